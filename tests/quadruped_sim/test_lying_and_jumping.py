# SPDX-License-Identifier: Apache-2.0
"""Up from any pose, gently down again, and off the ground."""

from collections.abc import Callable
from pathlib import Path
import re

from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.world import build_world, pose_base, pose_joints, update_bodies, World
import numpy as np
import pytest
from quadruped_sim.leg_controller import LegController, NO_JUMP
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import JointMap, RobotModel
from quadruped_sim.states.jump import EXTENDED, highest
from quadruped_sim.states.lying import rolling_poses, ROLLS, stretched, swung_out, TRIES_MAX
from quadruped_sim.tuning import JumpParameters
from robot_description.description import load_robot, parse_description
from robot_description.morphology.quadruped import FOLDED, similar_pose
from robot_description.packages import share_directory
from wasd_core.parameters import InvalidParameter, numeric_ends
from wasd_core.rotations import rpy_matrix, to_quaternion, yaw_matrix

pytestmark = pytest.mark.long

DT = 0.002
# How high the base of a Go2 is when its legs, as they extend, stop pushing [m].
TAKE_OFF = EXTENDED + 0.022
ROBOTS = share_directory('example-robot-data') / 'robots'
ANYMAL_B = str(ROBOTS / 'anymal_b_simple_description/robots/anymal.urdf')
LIES = 1.0  # by then a robot that was dropped lies still [s]


class Dropped:
    """A Go2 let go of just above the floor, its legs anywhere; its controller feels noise."""

    def __init__(
        self, world: World, model, rpy: tuple[float, float, float] | None, seed: int, params=None
    ) -> None:
        """Without angles it lies with folded legs, as a robot that is switched on does."""
        self.world, self.model = world, model
        world.reset()
        names = model.quadruped.joint_names
        rng = np.random.default_rng(seed)
        if rpy is not None:
            pose_joints(world, names, rng.uniform(model.limits.lower, model.limits.upper))
            pose_base(world, (0.0, 0.0, 0.35), to_quaternion(rpy_matrix(*rpy)))
            update_bodies(world)
        self.controller = LegController(model, params)
        self._joints = JointMap(model.quadruped, world.joint_names, world.motor_names)
        self.torque = self.top = 0.0

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False, vx=None) -> float:
        """Step so long, or until something holds, driving at `vx`; return how long it took [s]."""
        for tick in range(round(seconds / DT)):
            if until():
                return tick * DT
            if vx is not None:
                self.controller.set_velocity(vx, 0.0, 0.0)
            reading = self._joints.reading(self.world.read())
            self.world.apply(self._joints.command(self.controller.step(reading, DT)))
            self.world.step(round(DT / self.world.time_step))
            self.torque = max(self.torque, float(np.abs(self.world.joints().effort).max()))
        return seconds


@pytest.fixture(scope='module')
def floor() -> World:
    loaded = load_robot('go2')
    return build_world(loaded, 'flat', 3, usual_setup(loaded))


@pytest.mark.slow
@pytest.mark.parametrize(
    ('rpy', 'seed'),
    [((3.0, 0.2, 0.4), 1), ((1.6, 0.0, 0.0), 2), ((-1.6, 0.3, 2.0), 3), ((0.3, 0.0, 0.0), 4)],
)
def test_it_stands_within_six_seconds_from_any_pose_knows_where_and_drives(
    floor, model, rpy, seed
):
    dog = Dropped(floor, model, rpy, seed)
    dog.run(LIES)
    assert dog.controller.press('6') is None
    before = dog.controller.odometry.position
    stands = dog.run(6.0, until=lambda: dog.controller.state == 'fixed stand')
    assert stands < 6.0
    assert np.abs(dog.controller.odometry.position - before)[:2].max() < 0.05
    dog.run(0.3)
    assert dog.controller.robot.is_contact.all()
    start = dog.world.base().position
    assert dog.controller.odometry.position[2] == pytest.approx(start[2], abs=0.03)
    dog.controller.press('5')
    dog.run(1.5, vx=0.5)
    assert dog.controller.state == 'move base'
    assert np.linalg.norm((dog.world.base().position - start)[:2]) > 0.4
    assert dog.torque <= model.limits.effort.max() + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize('seed', [11, 13])
def test_key_2_folds_legs_first_that_a_level_robot_lies_upon(floor, model, seed):
    """Led straight into the stand, a leg above the trunk tips it over on its way down."""
    dog = Dropped(floor, model, (0.0, 0.0, 0.0), seed)
    dog.run(LIES)
    robot = dog.controller.robot
    assert not dog.controller.is_fallen
    assert (robot.motion.position @ robot.base.R[2]).max() > 0.05
    assert dog.controller.press('2') is None
    assert dog.run(4.0, until=lambda: dog.controller.state == 'fixed stand') < 4.0
    dog.run(1.0)
    assert dog.controller.event is None
    assert dog.controller.robot.is_contact.all()


@pytest.mark.parametrize(
    'thigh, calf, state',
    [
        (1.36, -2.65, 'fixed stand'),
        (0.67, -1.3, 'fixed stand'),
        (2.78, -2.0, 'get up'),
        (0.2, -2.0, 'get up'),
    ],
)
def test_key_2_folds_first_a_thigh_that_lies_far_from_its_fold(
    model, standing, truth, thigh, calf, state
):
    """A foot need not be above the trunk to tip it over: one that lay far ahead has."""
    controller = LegController(model, estimator='truth')
    angles = model.folded_pose.copy()
    angles[1:3] = thigh, calf
    lies = standing._replace(joints=standing.joints._replace(position=angles))
    controller.step(lies, 0.02, truth)
    assert controller.press('2') is None
    for _ in range(3):
        controller.step(lies, 0.02, truth)
    assert (controller.state, controller.is_fallen) == (state, False)


@pytest.fixture(scope='module')
def anymal() -> tuple[World, RobotModel]:
    loaded = load_robot(ANYMAL_B)
    return build_world(loaded, 'flat', 3, usual_setup(loaded)), RobotModel(loaded)


@pytest.mark.slow
@pytest.mark.parametrize('hooked', [(1, -2.6, 2.9, -0.6), (1, -3.82, 9.04, 2.78)])
def test_a_leg_that_is_hooked_to_the_trunk_frees_itself(anymal, hooked):
    """ANYmal's hips turn all round: its knee hangs behind the trunk's edge, on the wrong side."""
    leg, *angles = hooked
    world, model = anymal
    dog = Dropped(world, model, (0.0, 0.0, 0.0), 1)
    pose = model.folded_pose.copy()
    pose[3 * leg : 3 * leg + 3] = angles
    pose_joints(dog.world, model.quadruped.joint_names, pose)
    update_bodies(dog.world)
    dog.run(LIES)
    assert abs(dog.controller.robot.joint_position[3 * leg]) > 2.0
    dog.controller.press('2')
    assert dog.run(20.0, until=lambda: dog.controller.state == 'fixed stand') < 20.0


def test_a_hooked_leg_stretches_off_the_trunk_upside_down():
    folded, position = np.full(12, 0.1), np.full(12, 2.6)
    pose = stretched(folded, position, np.array([True, False, False, True])).reshape(4, 3)
    np.testing.assert_array_equal(pose[1:3], np.full((2, 3), 0.1))
    np.testing.assert_allclose(pose[0], [np.pi, -np.pi / 2, 0.0])
    np.testing.assert_allclose(pose[3], [np.pi, np.pi / 2, 0.0])


@pytest.mark.parametrize('turns', [0, 1])
def test_a_leg_that_stays_hooked_swings_out_on_the_side_away_from_the_trunk(turns):
    back, on = (2.6, 0.3, 0.4), (2.6, 2.8, 0.4)
    right = np.array([-1.0, 1.0, 1.0])
    position = np.concatenate([back, back * right, on, on * right])
    position[::3] += 2.0 * np.pi * turns
    chosen = np.array([True, False, True, False])
    pose = swung_out(np.full(12, 0.1), position, chosen).reshape(4, 3)
    np.testing.assert_allclose(pose[0], [2.0 * np.pi * turns, 0.3, 0.4], atol=1e-12)
    np.testing.assert_allclose(pose[2], [2.0 * np.pi * (turns + 1), 2.8, 0.4])
    np.testing.assert_array_equal(pose[[1, 3]], np.full((2, 3), 0.1))
    pose = swung_out(np.full(12, 0.1), position, ~chosen).reshape(4, 3)
    np.testing.assert_allclose(pose[1], [2.0 * np.pi * turns, 0.3, 0.4], atol=1e-12)
    np.testing.assert_allclose(pose[3], [2.0 * np.pi * (turns - 1), 2.8, 0.4])


@pytest.mark.slow
def test_key_1_and_an_emergency_stop_end_getting_up_at_once(floor, model):
    dog = Dropped(floor, model, (3.1, 0.0, 0.0), 5)
    dog.run(LIES)
    for stop in (lambda: dog.controller.press('1'), dog.controller.e_stop):
        dog.controller.press('2')
        dog.run(0.6)
        assert dog.controller.state == 'get up'
        stop()
        dog.run(0.01)
        assert dog.controller.state == 'passive'
    assert dog.controller.press('2') is None


@pytest.mark.slow
def test_a_robot_that_stays_on_its_back_gives_up_and_says_so(model, standing, truth):
    controller = LegController(model, estimator='truth')
    on_back = np.array(to_quaternion(rpy_matrix(np.pi, 0.0, 0.0)))
    reading = standing._replace(imu=standing.imu._replace(orientation=on_back))
    where = truth._replace(orientation=on_back)
    for _ in range(2):
        controller.step(reading, 0.02, where)
    controller.press('6')
    for _ in range(round(30.0 / 0.02)):
        command = controller.step(reading, 0.02, where)
        torque = command.kp * (command.position - reading.joints.position)
        assert (np.abs(torque) <= model.limits.effort + 1e-9).all()
        if controller.event:
            break
    assert controller.event == f'{TRIES_MAX} rolls have not turned it over'
    assert controller.state == 'passive'


def test_one_that_tips_over_whenever_it_stands_up_gives_up_as_well(model, standing, truth):
    controller = LegController(model, estimator='truth')
    folded = similar_pose(model.quadruped, *FOLDED)
    reading = standing._replace(joints=standing.joints._replace(position=folded))
    tipped = truth._replace(orientation=np.array(to_quaternion(rpy_matrix(0.96, 0.0, 0.0))))
    controller.step(reading, 0.02, truth)
    controller.press('6')
    for _ in range(TRIES_MAX):
        for _ in range(10):
            controller.step(reading, 0.02, truth)
        assert controller.state == 'get up'
        controller.step(reading, 0.02, tipped)
    controller.step(reading, 0.02, truth)
    assert controller.event == f'{TRIES_MAX} tries have not got it on its feet'
    assert controller.state == 'passive'


@pytest.mark.slow
@pytest.mark.parametrize(('key', 'state'), [('6', 'get up'), ('1', 'passive')])
def test_a_robot_carried_around_while_it_lies_has_not_drifted(model, standing, key, state):
    """So slowly that a gyro might: but the feet in the air do not hold its heading."""
    controller = LegController(model)
    for tick in range(1000):
        R = yaw_matrix(5e-5 * tick) @ rpy_matrix(np.pi, 0.0, 0.0)
        imu = standing.imu._replace(orientation=np.array(to_quaternion(R)))
        controller.step(standing._replace(imu=imu), DT)
        if tick == 1:
            controller.press(key)
    assert controller.state == state
    np.testing.assert_allclose(controller.robot.base.R, R, atol=1e-3)


@pytest.mark.parametrize('roll', ROLLS)
def test_the_poses_of_one_side_are_the_mirror_image_of_the_other_sides(model, roll):
    sides = rolling_poses(model, roll, 1), rolling_poses(model, roll, -1)
    for left, right in zip(*sides, strict=True):
        assert (left >= model.limits.lower).all()
        assert (left <= model.limits.upper).all()
        mirrored = left.reshape(4, 3)[[1, 0, 3, 2]] * (-1.0, 1.0, 1.0)
        np.testing.assert_allclose(right.reshape(4, 3), mirrored, atol=1e-12)


@pytest.mark.slow
def test_it_is_let_go_of_near_the_ground_at_less_than_a_tenth_of_a_metre_per_second(floor, model):
    dog = Dropped(floor, model, (0.0, 0.0, 0.0), 4)
    dog.run(LIES)
    dog.controller.press('6')
    dog.run(6.0, until=lambda: dog.controller.state == 'fixed stand')
    dog.run(0.2)
    dog.controller.press('7')
    assert dog.run(3.0, until=lambda: dog.controller.state == 'passive') < 3.0
    assert dog.world.base().position[2] < 0.13
    assert float(dog.world.base().linear_velocity[2]) > -0.1
    dog.run(0.5)
    assert dog.world.base().position[2] < 0.11
    assert dog.controller.event is None


@pytest.fixture
def jumper(floor, model):
    """Return a function that has a Go2 stand, and jump so high and far; it and its feet's rise."""

    def jump(**params):
        tuning = LegControllerParameters(jump=JumpParameters(**params))
        dog = Dropped(floor, model, None, 4, tuning)
        dog.run(0.02)
        dog.controller.press('2')
        dog.run(1.3)
        dog.controller.press('v')
        dog.run(0.01)
        start, rise = dog.world.base().position, 0.0
        while dog.controller.state == 'jump':
            dog.run(0.01)
            dog.top = max(dog.top, float(dog.world.base().position[2]))
            lowest = dog.world.base().position + dog.controller.robot.feet.min(axis=0)
            lowest -= dog.controller.robot.base.position
            rise = max(rise, float(lowest[2]) - model.geometry.foot_radius)
        dog.run(1.0)
        return dog, start, rise

    return jump


@pytest.mark.slow
def test_it_jumps_25_cm_clear_of_the_ground_and_stands_where_it_was(jumper):
    dog, start, rise = jumper()
    assert rise > 0.25
    assert dog.controller.state == 'fixed stand'
    end = dog.world.base()
    assert np.linalg.norm((end.position - start)[:2]) < 0.1
    assert end.position[2] > 0.3
    assert end.tilt < 0.05


@pytest.mark.slow
def test_it_jumps_40_cm_ahead_and_knows_about_where_it_is(jumper):
    dog, start, _ = jumper(distance=0.4)
    end = dog.world.base()
    assert np.linalg.norm((end.position - start)[:2]) > 0.4
    assert end.tilt < 0.05
    assert dog.controller.odometry.position == pytest.approx(end.position, abs=0.12)
    dog.controller.press('5')
    dog.run(1.5, vx=0.5)
    assert dog.controller.state == 'move base'
    assert np.linalg.norm((dog.world.base().position - end.position)[:2]) > 0.4


@pytest.mark.slow
@pytest.mark.parametrize(
    ('height', 'distance'),
    [(0.05, 0.15), (0.05, -0.075), (0.2, 0.5), (0.2, -0.25)],  # the ends of both
)
def test_it_jumps_as_high_and_far_as_it_is_asked_within_2_and_3_cm(jumper, height, distance):
    dog, start, _ = jumper(height=height, distance=distance)
    assert dog.controller.state == 'fixed stand'
    assert dog.top - TAKE_OFF == pytest.approx(height, abs=0.02)
    end = dog.world.base()
    way = yaw_matrix(float(dog.controller.robot.base.rpy[2])).T @ (end.position - start)
    assert way[0] == pytest.approx(distance, abs=0.03)
    assert abs(way[1]) < 0.05
    assert end.tilt < 0.05


def test_how_high_it_may_be_asked_to_jump_is_what_its_motors_can(model):
    _, most = numeric_ends(JumpParameters.__dataclass_fields__['height'])
    assert most <= highest(model) < 1.02 * most


def test_more_than_it_can_jump_or_no_jump_is_refused_with_the_range():
    tuning = LegControllerParameters()
    for name, value, said in (
        ('height', 0.3, r'>= 0.05 and <= 0.2 m, got 0.3'),
        ('height', 0.0, r'>= 0.05 and <= 0.2 m, got 0.0'),
        ('distance', 0.8, r'>= -0.25 and <= 0.5 m, got 0.8'),
    ):
        with pytest.raises(InvalidParameter, match=said):
            tuning.changed({f'jump.{name}': value})
    with pytest.raises(
        InvalidParameter, match=r'jump.distance must be -0.15 to 0.3 m with .*0.1 m'
    ):
        tuning.changed({'jump.height': 0.1, 'jump.distance': 0.4})


def test_a_robot_of_slow_motors_says_how_high_it_jumps_and_jumps_no_higher():
    path = ROBOTS / 'anymal_c_simple_description/urdf/anymal.urdf'
    slow = RobotModel(load_robot(str(path)))
    notes = LegController(slow).notes
    assert f'motors allow jumps of {highest(slow):.2g} m, not 0.26 m; lowered' in notes


def test_a_robot_that_jumps_less_high_than_asked_jumps_less_far_as_well():
    path = ROBOTS / 'anymal_c_simple_description/urdf/anymal.urdf'
    far = LegControllerParameters(jump=JumpParameters(distance=0.5))
    controller = LegController(RobotModel(load_robot(str(path))), far)
    ahead, _, flight = controller._states['jump']._take_off()
    assert 0.0 < ahead * flight < 3.0 * highest(controller.model)


@pytest.mark.parametrize('kind', ['weak', 'slow'])
def test_a_robot_that_can_hardly_lift_itself_says_so_and_refuses_to_jump(kind, standing, truth):
    path = Path(__file__).parents[1] / f'catalogue/legs/{kind}_motors.xacro'
    controller = LegController(RobotModel(load_robot(str(path))), estimator='truth')
    controller.step(standing, DT, truth)
    controller.press('2')
    for _ in range(3):
        controller.step(standing, DT, truth)
    assert controller.state == 'fixed stand'
    assert controller.press('v') == NO_JUMP
    assert NO_JUMP in controller.notes
    assert not any('jumps of' in note for note in controller.notes)


@pytest.mark.slow
def test_a_robot_whose_motors_know_no_fastest_speed_jumps(urdf, standing, truth):
    text = re.sub(r' velocity="[^"]*"', '', urdf)
    controller = LegController(
        RobotModel(parse_description(text, Path('robot.urdf'))), estimator='truth'
    )
    assert np.isinf(controller.model.limits.velocity).all()
    for key in ' 2v':
        controller.press(key)
        for _ in range(3):
            controller.step(standing, DT, truth)
    while controller.state == 'jump':
        controller.step(standing, DT, truth)
    assert (controller.state, controller.event) == ('fixed stand', None)


@pytest.fixture(scope='module')
def hyq() -> RobotModel:
    return RobotModel(load_robot(str(ROBOTS / 'hyq_description/robots/hyq_no_sensors.urdf')))


@pytest.mark.slow
def test_a_jump_takes_a_larger_robot_longer_by_the_root_of_its_size(model, hyq, standing, truth):
    """As its feet feel nothing, each stage takes the longest that it may."""

    def ticks(robot: RobotModel) -> int:
        controller, dt = LegController(robot, estimator='truth'), DT * robot.scale.of('s')
        stands = standing._replace(joints=standing.joints._replace(position=robot.standing_pose))
        for key in ' 2v':
            controller.press(key)
            for _ in range(3):
                controller.step(stands, dt, truth)
        count = 0
        while controller.state == 'jump':
            controller.step(stands, dt, truth)
            count += 1
        assert (controller.state, controller.event) == ('fixed stand', None)
        return count

    assert hyq.scale.of('s') > 1.2
    assert ticks(hyq) == pytest.approx(ticks(model), abs=3)


@pytest.mark.slow
def test_a_robot_whose_joints_cannot_roll_it_over_says_which_when_it_has_fallen(
    hyq, standing, truth
):
    controller = LegController(hyq, estimator='truth')
    on_back = np.array(to_quaternion(rpy_matrix(np.pi, 0.0, 0.0)))
    controller.step(standing, DT, truth._replace(orientation=on_back))
    for key in '26':
        said = controller.press(key)
        assert (
            said == 'put it on its feet (fallen; lf_hfe_joint ends 2.1 rad short of rolling over)'
        )
        assert controller.state == 'passive'
