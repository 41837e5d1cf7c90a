# SPDX-License-Identifier: Apache-2.0
import gc
import math
import weakref

from cases import for_all
import mujoco
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.world import build_shared_world, build_world, World
import numpy as np
from physics_steps import steps_taken
import pytest
from wasd_core.errors import SimulationError
from wasd_core.robot_io import BaseState, JointCommand
from wasd_core.rotations import rpy_matrix

GRAVITY = 9.81
WHEELS = ('left_wheel_joint', 'right_wheel_joint')


def state_of(world):
    """Return every bit of the physical state."""
    size = mujoco.mj_stateSize(world.model, mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.empty(size)
    mujoco.mj_getState(world.model, world.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    return state


def drive(left, right):
    zeros = np.zeros(2)
    return JointCommand(zeros, np.array([left, right]), zeros, zeros, np.full(2, 0.3))


def test_time_is_steps_times_the_time_step(world):
    assert (world.time, world.tick) == (0.0, 0)
    world.step()
    world.step(249)
    assert world.tick == 250
    assert world.time == pytest.approx(0.25, abs=1e-15)
    assert world.data.time == pytest.approx(world.time, abs=1e-12)


def test_many_steps_at_once_are_the_steps_one_by_one(loaded):
    worlds = [build_world(loaded) for _ in range(2)]
    for world in worlds:
        world.apply(drive(3.0, 2.0))
        world.push((0.0, 2.0, 0.0), 0.033)
    worlds[0].step(100)
    for _ in range(100):
        worlds[1].step()
    np.testing.assert_array_equal(*map(state_of, worlds))


def lengths_of_steps(world, count):
    """Return how long each step that MuJoCo takes is [ms], while the world advances."""
    with steps_taken() as taken:
        world.step(count)
    return taken


def test_long_steps_are_taken_where_allowed_and_time_is_the_same(loaded):
    world = build_world(loaded)
    assert lengths_of_steps(world, 4) == [1, 1, 1, 1]
    world.actuation.allows_long_steps = True
    assert lengths_of_steps(world, 4) == [2, 2]
    # They begin at even ticks, so that who looks more often does not shift them.
    assert lengths_of_steps(world, 5) == [2, 2, 1]
    assert lengths_of_steps(world, 6) == [1, 2, 2, 1]
    world.step(981)
    assert world.time == 1.0
    assert world.data.time == pytest.approx(1.0, abs=1e-12)
    assert world.model.opt.timestep == world.time_step
    world.reset()
    assert lengths_of_steps(world, 2) == [1, 1]


def test_commands_and_pushes_begin_and_end_as_told_among_long_steps(loaded):
    world = build_world(loaded, setup=RobotSetup(command_delay=0.003))
    world.actuation.allows_long_steps = True
    world.apply(JointCommand(*np.zeros((2, 2)), np.full(2, 0.01), *np.zeros((2, 2))))
    assert lengths_of_steps(world, 8) == [2, 1, 1, 2, 2]
    world.push((0.0, 2.0, 0.0), 0.005)
    assert lengths_of_steps(world, 8) == [2, 2, 1, 1, 2]
    assert not world.data.xfrc_applied.any()


def test_a_push_that_lasts_does_not_hold_up_a_command(loaded):
    world = build_world(loaded, setup=RobotSetup(command_delay=0.003))
    world.actuation.allows_long_steps = True
    world.push((0.0, 0.0, 0.001), 0.1)
    world.apply(JointCommand(*np.zeros((2, 2)), np.full(2, 0.01), *np.zeros((2, 2))))
    assert lengths_of_steps(world, 8) == [2, 1, 1, 2, 2]
    np.testing.assert_array_equal(world.data.ctrl, [0.01, 0.01])


def test_a_motor_that_damps_more_than_a_long_step_bears_gets_short_ones(loaded):
    world = build_world(loaded)
    world.actuation.allows_long_steps = True
    index = [world.model.joint(name).dofadr[0] for name in WHEELS]
    # What stops a wheel in the air within one short step diverges from twice of it on.
    stopping = 1.0 / (world.model.dof_invweight0[index] * world.time_step)
    zeros = np.zeros(2)
    for share, taken in ((0.24, [2, 2]), (0.26, [1, 1, 1, 1])):
        world.apply(JointCommand(zeros, zeros, zeros, zeros, share * stopping))
        assert lengths_of_steps(world, 4) == taken
    world.brake()
    assert lengths_of_steps(world, 4) == [1, 1, 1, 1]


def test_robots_that_share_a_world_take_long_steps_where_all_allow_them(loaded):
    setups = [RobotSetup(place=(0.0, y)) for y in (0.0, 2.0)]
    members = [(f'{name}/', loaded, setup) for name, setup in zip('ab', setups, strict=True)]
    one, other = build_shared_world(members)
    one.actuation.allows_long_steps = True
    assert lengths_of_steps(one, 2) == [1, 1]
    other.actuation.allows_long_steps = True
    assert lengths_of_steps(one, 2) == [2]


def test_a_fall_by_long_steps_is_that_of_their_closed_form(ball):
    ball.model.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
    ball.actuation.allows_long_steps = True
    start = ball.base().position[2]
    ball.step(100)
    # Semi-implicit Euler: n steps of h fall by g h^2 n (n + 1) / 2.
    fallen = GRAVITY * 0.002**2 * 50 * 51 / 2
    assert start - ball.base().position[2] == pytest.approx(fallen, rel=1e-9)


@pytest.mark.slow
def test_the_same_calls_give_the_same_bits(loaded):
    def run():
        world = build_world(loaded, seed=3)
        random = np.random.default_rng(3)
        for count in (10, 100, 1, 300):
            world.apply(drive(*random.uniform(-5.0, 5.0, 2)))
            world.step(count)
        world.push((3.0, 1.0, 0.0), 0.1)
        world.step(200)
        return state_of(world)

    np.testing.assert_array_equal(run(), run())


def test_after_a_reset_everything_happens_again_bit_by_bit(world):
    def run():
        world.apply(drive(4.0, -2.5))
        world.step(300)
        world.push((0.0, 0.0, 5.0), 1.0)
        world.step(50)
        return world.data.qpos.copy(), world.data.qvel.copy()

    first = run()
    world.reset()
    for before, after in zip(first, run(), strict=True):
        np.testing.assert_array_equal(before, after)


def test_a_reset_takes_back_the_robot_but_not_the_time(world):
    world.apply(drive(4.0, 4.0))
    world.step(500)
    world.reset()
    assert world.time == 0.5
    np.testing.assert_array_equal(world.base().position, [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(world.data.qvel, np.zeros(10))
    np.testing.assert_array_equal(world.joints().effort, np.zeros(4))


def test_joints_are_named_and_motors_are_among_them(world):
    assert world.joint_names == (*WHEELS, 'front_caster_joint', 'back_caster_joint')
    assert world.motor_names == WHEELS


def test_each_wheel_stands_on_one_point_and_casters_slide(world):
    world.step(100)
    dimensions = {
        world.model.body(world.model.geom_bodyid[pair[1]]).name: dimension
        for pair, dimension in zip(world.data.contact.geom, world.data.contact.dim, strict=True)
    }
    assert len(world.data.contact.geom) == 4
    assert dimensions == {
        'left_wheel_link': 3,
        'right_wheel_link': 3,
        'front_caster_link': 1,
        'back_caster_link': 1,
    }


def test_at_rest_the_ground_carries_the_weight(world):
    world.step(1000)
    touching = ['left_wheel_link', 'right_wheel_link', 'front_caster_link', 'back_caster_link']
    assert world.contact_forces(touching).sum() == pytest.approx(1.8 * GRAVITY, rel=1e-6)
    # Alike left and right, front and back.
    left, right, front, back = world.contact_forces(touching)
    assert left == pytest.approx(right, rel=1e-6)
    assert front == pytest.approx(back, rel=1e-6)


@pytest.mark.slow
def test_the_force_on_a_body_is_that_of_all_its_contacts():
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05])
    crate = spec.worldbody.add_body(name='crate', pos=[0.0, 0.0, 0.1])
    crate.add_freejoint()
    crate.add_geom(name='crate/0', type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1], mass=3.0)
    world = World(spec, 'crate')
    world.step(1000)
    assert world.data.ncon == 4
    assert world.contact_forces(['crate'])[0] == pytest.approx(3.0 * GRAVITY, rel=1e-6)


def test_turning_on_the_spot_keeps_it_on_the_ground(world):
    # An upright cylinder above the floor was once given a contact as deep as it is wide.
    for speed in np.linspace(0.0, 4.0, 100):
        world.apply(drive(-speed, speed))
        world.step(5)
        assert world.data.ncon == 4
        assert abs(world.base().position[2]) < 1e-4


def test_at_rest_the_robot_stays_where_it_is(world):
    world.step(2000)
    np.testing.assert_allclose(world.base().position, np.zeros(3), atol=5e-5)
    assert world.base().tilt < 1e-9


def test_what_does_not_touch_feels_no_force(world):
    world.data.qpos[2] = 1.0
    world.step()
    np.testing.assert_array_equal(world.contact_forces(['base_link', 'left_wheel_link']), 0.0)


def test_in_the_air_the_robot_falls_by_g_times_t(world):
    world.data.qpos[2] = 1.0
    world.step(100)
    assert world.base().linear_velocity[2] == pytest.approx(-GRAVITY * 0.1, rel=1e-9)


def test_turning_wheels_drive_the_robot_forward(world):
    world.apply(drive(5.0, 5.0))
    world.step(1000)
    # 5 rad/s on 0.06 m, once up to speed.
    assert world.base().planar_velocity[0] == pytest.approx(0.3, rel=0.02)
    assert world.base().position[0] > 0.25


@for_all('rpy', [(0.0, 0.0, 0.0), (0.3, -0.2, 2.5), (-1.0, 0.7, -3.0), (0.0, 0.0, 3.1)])
def test_roll_pitch_yaw_read_back(rpy):
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rpy_matrix(*rpy).flatten())
    base = BaseState(np.zeros(3), quaternion, np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(base.rpy, rpy, atol=1e-12)
    # The angle of the z axes: cos is the last entry of Ry(pitch) Rx(roll).
    assert base.tilt == pytest.approx(math.acos(math.cos(rpy[0]) * math.cos(rpy[1])), abs=1e-7)


def test_planar_velocity_is_seen_from_the_robots_heading():
    half = 0.5 * math.radians(90.0)
    heading_north = np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
    base = BaseState(
        np.zeros(3), heading_north, np.array([0.0, 0.4, 9.0]), np.array([0.0, 0.0, 0.7])
    )
    np.testing.assert_allclose(base.planar_velocity, [0.4, 0.0, 0.7], atol=1e-15)


def test_the_turn_of_a_tumbling_ball_is_the_z_of_its_world_rate(ball):
    # A ball tumbles on about one axis of the world, however its own frame lies.
    ball.data.qpos[3:7] = np.array([0.8, 0.4, -0.2, 0.4])
    ball.data.qvel[3:6] = [0.4, -0.3, 0.8]
    R_world_base = np.empty(9)
    mujoco.mju_quat2Mat(R_world_base, ball.base().orientation)
    wanted = (R_world_base.reshape(3, 3) @ ball.base().angular_velocity)[2]
    assert ball.base().planar_velocity[2] == pytest.approx(wanted, abs=1e-12)
    ball.step(700)
    assert ball.base().planar_velocity[2] == pytest.approx(wanted, abs=1e-9)


def test_what_was_read_does_not_change_afterwards(world):
    world.apply(drive(3.0, 3.0))
    world.step(100)
    joints, base = world.joints(), world.base()
    kept = [array.copy() for array in (*joints, *base)]
    world.step(100)
    for array, copy in zip((*joints, *base), kept, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_a_model_that_does_not_compile_is_one_line():
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name='ball').add_freejoint()
    with pytest.raises(SimulationError, match='^MuJoCo: ') as caught:
        World(spec, 'ball')
    assert '\n' not in str(caught.value)


def test_a_model_is_freed_with_the_last_world_in_it_without_the_garbage_collector(loaded):
    worlds = build_shared_world([('a_', loaded, RobotSetup()), ('b_', loaded, RobotSetup())])
    data = weakref.ref(worlds[0].data)
    gc.disable()
    try:
        del worlds[0]
        assert data() is not None
        del worlds[0]
        assert data() is None
    finally:
        gc.enable()
