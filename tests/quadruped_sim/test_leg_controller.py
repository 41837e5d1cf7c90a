# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import numpy as np
import pytest
from quadruped_sim.command_filter import velocity_limits
from quadruped_sim.keys import KeyWords, StickValues
from quadruped_sim.leg_controller import LegController
from quadruped_sim.leg_kinematics import foot_positions
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.presets import GAITS
from quadruped_sim.tuning import GaitParameters
from wasd_core.errors import UserError
from wasd_core.robot_io import JointTargets
from wasd_core.rotations import rpy_matrix, to_quaternion

DT = 0.002
# unitree_guide's stand.
STAND_ANGLES = np.tile((0.0, 0.67, -1.3), 4)


@pytest.fixture
def controller(model):
    return LegController(model, estimator='truth')


@pytest.fixture
def run(standing, truth):
    """Step a controller some ticks on one reading; returns the last command."""

    def run(controller, ticks, reading=standing, truth=truth):
        for _ in range(ticks):
            command = controller.step(reading, DT, truth)
        return command

    return run


def test_it_starts_passive_and_only_damps(controller, run):
    command = run(controller, 3)
    assert controller.state == 'passive'
    np.testing.assert_array_equal(command.effort, 0.0)
    np.testing.assert_array_equal(command.kp, 0.0)
    assert (command.kd > 0.0).all()


def test_passive_takes_energy_out_whatever_the_motion(controller, rng, standing, truth):
    for _ in range(20):
        rates = rng.normal(size=12)
        reading = standing._replace(joints=standing.joints._replace(velocity=rates))
        command = controller.step(reading, DT, truth)
        torque = command.effort + command.kd * (command.velocity - rates)
        assert torque @ rates <= 0.0


@pytest.mark.slow
def test_stand_up_is_a_straight_line_of_two_seconds(controller, run, standing):
    run(controller, 2)
    controller.press('2')
    start = standing.joints.position
    run(controller, 1)
    halfway = run(controller, 500)
    np.testing.assert_allclose(halfway.position, 0.5 * (start + STAND_ANGLES), atol=1e-9)
    end = run(controller, 500)
    np.testing.assert_allclose(end.position, STAND_ANGLES, atol=1e-12)


@pytest.mark.slow
def test_sticks_are_zero_after_every_entry(controller, run):
    run(controller, 2)
    for key in '2', '4', '2', '3':
        controller.press('w')
        controller.press(key)
        run(controller, 3)
        assert controller.sticks.values.ly == 0.0


def test_keys_that_come_with_a_states_key_move_the_sticks_of_that_state(controller, run):
    run(controller, 2)
    controller.press('2')
    run(controller, 3)
    for key in '4w':
        assert controller.press(key) is None
    run(controller, 3)
    assert controller.state == 'trotting'
    assert controller.sticks.values.ly == 0.05
    for key in '24':
        assert controller.press(key) is None
    assert controller.press('d') is None
    assert controller.sticks.values.ly == 0.05  # its trot has not ended yet
    run(controller, 3)
    assert controller.state == 'trotting'
    assert controller.sticks.values == StickValues(lx=0.05)


def test_the_key_of_the_present_state_changes_nothing(controller, run):
    run(controller, 2)
    for key in '24w':
        assert controller.press(key) is None
        run(controller, 3)
    assert controller.press('4') == 'trotting already'
    assert controller.press('w') is None
    assert controller.sticks.values.ly == 0.1
    run(controller, 3)
    assert controller.sticks.values.ly == 0.1


def test_a_velocity_ends_with_a_states_key_also_where_the_next_leads_back(controller, run):
    run(controller, 2)
    for key in '25':
        controller.press(key)
        run(controller, 3)
    controller.set_velocity(0.5, 0.0, 0.0)
    for key in '25':
        controller.press(key)
    run(controller, 3)
    assert controller.state == 'move base'
    assert controller.command_filter.is_silent


def test_velocity_commands_need_move_base(controller, run):
    run(controller, 2)
    assert 'move base' in controller.set_velocity(0.5, 0.0, 0.0)
    for key in '25':
        controller.press(key)
        run(controller, 3)
    assert controller.state == 'move base'
    assert controller.set_velocity(0.5, 0.0, 0.0) is None


def test_a_velocity_taken_while_it_rises_is_driven_once_it_stands(
    controller, run, standing, truth
):
    crouched = standing._replace(
        joints=standing.joints._replace(position=np.tile((0.0, 1.1, -2.2), 4))
    )
    run(controller, 2, crouched, truth)
    for key in '25':
        controller.press(key)
        run(controller, 3, crouched, truth)
    while not controller.locomotion.is_up:
        assert controller.set_velocity(0.5, 0.0, 0.0) is None
        run(controller, 1, crouched, truth)
        assert not controller.command_filter.command.any()
    run(controller, 20, crouched, truth)
    assert controller.command_filter.command[0] > 0.05


def test_tipping_over_goes_passive_in_the_same_tick_and_key_2_gets_up(
    controller, run, standing, truth
):
    run(controller, 2)
    controller.press('2')
    run(controller, 5)
    orientation = np.array(to_quaternion(rpy_matrix(1.2, 0.0, 0.0)))
    tipped = standing._replace(imu=standing.imu._replace(orientation=orientation))
    command = run(controller, 1, tipped, truth._replace(orientation=orientation))
    assert controller.state == 'passive'
    assert controller.is_fallen
    assert 'tilt' in controller.event
    np.testing.assert_array_equal(command.kp, 0.0)
    assert 'fallen' in controller.press('4')
    assert controller.press('2') is None
    run(controller, 3, tipped, truth._replace(orientation=orientation))
    assert controller.state == 'get up'
    assert controller.event is None


def test_emergency_stop_acts_at_once(controller, run):
    run(controller, 2)
    controller.press('2')
    run(controller, 5)
    controller.e_stop()
    np.testing.assert_array_equal(run(controller, 1).kp, 0.0)
    assert controller.state == 'passive'


@pytest.mark.slow
@pytest.mark.parametrize('state_keys', ['2', '23', '24', '25', '20', '29', '28'])
def test_every_state_gives_finite_commands_inside_the_limits(controller, state_keys, run):
    run(controller, 2)
    for key in state_keys:
        controller.press(key)
        run(controller, 10)
    for key in 'wdji':
        controller.press(key)
    command = run(controller, 50)
    for part in (command.position, command.velocity, command.effort, command.kp, command.kd):
        assert np.isfinite(part).all()
    assert (np.abs(command.effort) <= controller.model.limits.effort).all()
    walk = controller.locomotion
    assert walk.mpc.solver.failures == walk.whole_body.solver.failures == 0


@pytest.mark.slow
def test_reset_gives_the_same_commands_again(controller, run):
    def script():
        run(controller, 2)
        for key in '24':
            controller.press(key)
            run(controller, 5)
        controller.press('w')
        return [run(controller, 1).effort for _ in range(40)]

    first = script()
    controller.reset()
    np.testing.assert_array_equal(first, script())


def test_reset_forgets_the_friction_that_was_felt(controller, run):
    legs = controller.locomotion
    guess = legs.grip.friction
    run(controller, 2)
    for key in '24':
        controller.press(key)
        run(controller, 3)
    for reset in (controller.reset, lambda: legs.reset(controller.robot)):
        run(controller, 1)
        legs.grip.friction = 0.2
        legs.step(controller.robot, np.zeros(3), DT)
        assert legs.mpc.pyramids.friction == legs.whole_body.pyramids.friction == 0.2
        reset()
        assert legs.mpc.pyramids.friction == legs.whole_body.pyramids.friction == guess


def test_standing_still_the_odometry_stays(model, run):
    controller = LegController(model)
    run(controller, 50)
    odometry = controller.odometry
    assert np.linalg.norm(odometry.position[:2]) < 1e-6
    assert np.abs(odometry.linear_velocity).max() < 1e-6
    assert np.linalg.eigvalsh(odometry.pose_covariance).min() > 0.0


def test_unknown_estimators_are_refused(model):
    with pytest.raises(ValueError, match='kalman'):
        LegController(model, estimator='magic')


def test_keys_it_does_not_know_are_named(controller):
    assert "'x'" in controller.press('x')


@pytest.mark.slow
def test_key_2_ends_a_trot_before_the_legs_stiffen(model, run):
    params = LegControllerParameters(gait=GaitParameters(step_in_place=True))
    controller = LegController(model, params, estimator='truth')
    run(controller, 2)
    for key in '24':
        controller.press(key)
        run(controller, 60)  # the first pair of feet is in the air by then
    controller.press('2')
    soft = run(controller, 5)
    assert controller.state == 'fixed stand'
    assert soft.kp.max() < 50.0
    stiff = run(controller, 2000)
    np.testing.assert_allclose(stiff.position, STAND_ANGLES, atol=1e-12)


@pytest.mark.slow
def test_free_stand_rises_to_the_stand_leans_and_returns(controller, run):
    run(controller, 2)
    for key in '23':
        controller.press(key)
        low = run(controller, 3).position
    geometry = controller.model.geometry
    upright = run(controller, 500).position
    heights = [-foot_positions(geometry, each)[:, 2] for each in (low, upright, STAND_ANGLES)]
    np.testing.assert_allclose(heights[1], heights[2], atol=1e-6)
    assert (heights[0] < heights[1] - 0.03).all()
    for _ in range(20):
        controller.press('i')
    lifted = run(controller, 500).position
    rise = foot_positions(geometry, upright)[:, 2] - foot_positions(geometry, lifted)[:, 2]
    np.testing.assert_allclose(rise, 0.04, atol=1e-6)
    controller.press(' ')
    np.testing.assert_allclose(run(controller, 1000).position, upright, atol=1e-4)


@pytest.mark.slow
def test_free_stand_leans_with_all_feet_on_the_ground_however_high(controller, run):
    run(controller, 2)
    for key in '23':
        controller.press(key)
        run(controller, 3)
    for _ in range(20):
        controller.press('i')
        controller.press('w')
    feet = foot_positions(controller.model.geometry, run(controller, 1000).position)
    heights = (feet @ rpy_matrix(0.0, np.radians(15.0), 0.0).T)[:, 2]
    np.testing.assert_allclose(heights, heights[0], atol=1e-3)
    assert heights[0] < -0.3


def test_a_failing_solver_is_survived_then_counted_against_it(controller, run, monkeypatch):
    run(controller, 2)
    for key in '20':
        controller.press(key)
        run(controller, 3)
    solver = controller.locomotion.whole_body.solver
    failed = None, None, -1, None
    monkeypatch.setattr('quadruped_sim.locomotion.convex_mpc.daqp.solve', lambda *_: failed)
    command = run(controller, 10)
    assert controller.state == 'balance test'
    assert np.isfinite(command.effort).all()
    assert solver.failures == 10
    run(controller, 30)
    assert controller.state == 'passive'
    assert 'QPs' in controller.event
    monkeypatch.undo()
    controller.press('2')
    run(controller, 5)
    assert controller.state == 'fixed stand'


@pytest.mark.parametrize(('keys', 'ticks', 'spares'), [('20', 1, True), ('2v', 250, False)])
def test_a_stand_spares_its_motors_and_a_jump_does_not(
    controller, run, monkeypatch, keys, ticks, spares
):
    """Asked for too much, all legs of one that jumps are to lack the same."""
    run(controller, 2)
    for key in keys:
        controller.press(key)
        run(controller, 3)
    body, asked = controller.locomotion.whole_body, []
    solve = body.solve

    def listen(*of, spares_motors=True):
        asked.append(spares_motors)
        return solve(*of, spares_motors=spares_motors)

    monkeypatch.setattr(body, 'solve', listen)
    run(controller, ticks)
    assert set(asked) == {spares}


def test_keys_choose_gaits_in_turn_and_say_how_fast_they_are(controller):
    names = list(GAITS)
    for name in (*names[1:], *names[:1]):
        said = controller.press('n')
        assert controller.gait == name
        limits = controller.command_filter.limits
        assert said.startswith(f'{name}: at most {limits.forward:.2g}, ')
    controller.press('N')
    assert controller.gait == names[-1]
    assert controller.locomotion.gait.params.name == names[-1]
    controller.reset()
    assert controller.gait == names[0]


def test_a_key_of_the_keymap_chooses_no_gait(controller):
    controller.words = KeyWords(elsewhere=frozenset('n'))
    controller.press('n')
    assert controller.gait == 'trot'


def test_asked_for_more_than_its_gait_can_it_says_so(controller, run):
    run(controller, 2)
    for key in '25n':
        controller.press(key)
        run(controller, 3)
    assert controller.set_velocity(0.5, 0.0, 0.0) is None
    assert controller.set_velocity(2.0, 0.0, 0.0).startswith('walk: at most 1, ')


def test_a_gait_chosen_at_speed_comes_once_the_command_is_slow_enough(controller, run):
    run(controller, 2)
    for key in '25':
        controller.press(key)
        run(controller, 3)
    command_filter, legs = controller.command_filter, controller.locomotion.gait
    legs.is_stepping = True
    command_filter.command = np.array((2.0, 0.0, 0.0))
    controller.choose_gait('walk')
    assert (controller.gait, legs.params.name) == ('walk', 'trot')
    assert command_filter.limits.forward == GAITS['walk'].limits.forward
    command_filter.command = np.array((0.5, 0.0, 0.0))
    run(controller, 1)
    assert legs.params.name == 'walk'
    controller.reset()
    assert (controller.gait, legs.params.name) == ('trot', 'trot')


@pytest.fixture
def folded(standing):
    """A reading of a level robot whose trunk lies between its legs."""
    angles = np.tile((0.0, 1.3, -2.7), 4)
    return standing._replace(joints=standing.joints._replace(position=angles))


@pytest.mark.parametrize('keys', ['2', '23', '24', '25', '20', '29', '28'])
@pytest.mark.slow
def test_a_level_robot_whose_trunk_stays_on_the_ground_has_fallen(controller, run, folded, keys):
    run(controller, 2)
    for key in keys:
        controller.press(key)
        run(controller, 10)
    run(controller, 90, folded)
    assert controller.state != 'passive'
    command = run(controller, 30, folded)
    assert (controller.state, controller.is_fallen) == ('passive', True)
    assert 'gone down' in controller.event
    np.testing.assert_array_equal(command.kp, 0.0)
    assert controller.press('2') is None
    run(controller, 3, folded)
    assert controller.state == 'get up'


@pytest.mark.parametrize('keys', ['', '27', '6'])
def test_who_lies_by_key_has_not_fallen(controller, run, folded, keys):
    run(controller, 2, folded)
    for key in keys:
        controller.press(key)
        run(controller, 3, folded)
    run(controller, 150, folded)
    assert not controller.is_fallen
    assert controller.event is None


@pytest.mark.slow
@pytest.mark.parametrize('keys', ['', '2', '24', '20', '29'])
@pytest.mark.parametrize('broken', [np.nan, np.inf, 1e200])
def test_an_estimate_that_is_not_finite_ends_in_damping_and_a_word(model, run, keys, broken):
    controller = LegController(model)
    run(controller, 2)
    for key in keys:
        controller.press(key)
        run(controller, 5)
    controller._kalman._estimate.x[:] = broken
    controller._detector._felt.forces[:] = broken
    command = run(controller, 1)
    assert (controller.state, command.kp.any()) == ('passive', False)
    for part in command:
        assert np.isfinite(part).all()
    assert np.isfinite(controller.odometry.position).all()
    assert not keys or 'not finite' in controller.event
    run(controller, 5)
    controller.press('2')
    run(controller, 5)
    assert controller.state == 'fixed stand'


@pytest.mark.broken_legs
def test_a_controller_that_breaks_damps_and_says_so(model, run, monkeypatch):
    controller = LegController(model)
    run(controller, 2)
    controller.press('2')
    run(controller, 5)
    monkeypatch.setattr(controller._kalman, 'step', lambda *_: 1 / 0)
    command = run(controller, 3)
    assert controller.state == 'passive'
    assert 'division by zero' in controller.event
    np.testing.assert_array_equal(command.kp, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize('speed', [0.0, 1.0])
def test_key_1_is_limp_after_a_squat_at_rest_and_in_motion(controller, run, truth, speed):
    run(controller, 2)
    controller.press('2')
    moving = truth._replace(linear_velocity=np.array((0.0, speed, 0.0)))
    run(controller, 5, truth=moving)
    controller.press('1')
    command = run(controller, 3, truth=moving)
    assert (controller.state, bool(command.kp.any())) == ('passive', True)
    assert not run(controller, 350, truth=moving).kp.any()


@pytest.mark.slow
@pytest.mark.parametrize('keys', ['2', '21'])
def test_an_emergency_stop_is_limp_at_once_in_motion_and_in_a_squat(controller, run, truth, keys):
    moving = truth._replace(linear_velocity=np.array((0.0, 1.0, 0.0)))
    run(controller, 2)
    for key in keys:
        controller.press(key)
        run(controller, 5, truth=moving)
    controller.e_stop()
    for _ in range(20):
        assert not run(controller, 1, truth=moving).kp.any()
    assert controller.state == 'passive'


@pytest.mark.slow
@pytest.mark.parametrize('key', ['2', '7'])
def test_a_policy_is_left_with_all_feet_in_the_air(model, walker, run, key):
    controller = LegController(model, estimator='truth', walker=walker)
    run(controller, 2)
    for pressed, ticks in (('2', 3), ('p', 600), (key, 5)):
        assert controller.press(pressed) is None
        run(controller, ticks)
    assert not controller.robot.is_contact.any()
    assert controller.event is None
    assert controller.state == {'2': 'fixed stand', '7': 'lie down'}[key]


@pytest.mark.broken_legs
def test_a_policy_with_targets_of_a_wrong_shape_ends_passive_with_a_line(
    model, walker, run, monkeypatch
):
    monkeypatch.setattr('quadruped_sim.states.policy.SETTLE_TIME', 0.0)
    pose, gains = walker.default, np.full(12, 40.0)
    controller = LegController(model, estimator='truth', walker=walker)
    right = JointTargets(pose.tolist(), gains.astype(np.float32), gains)
    wrong = [
        None,
        JointTargets(pose[:5], gains, gains),
        JointTargets(np.zeros(13), gains, gains),
        JointTargets(pose, 40.0, gains),
        JointTargets(None, gains, gains),
        (pose, gains),
    ]
    for targets, state in ((right, 'policy'), *((each, 'passive') for each in wrong)):
        monkeypatch.setattr(walker, 'step', lambda *_, targets=targets: targets, raising=False)
        run(controller, 2)
        controller.press('2')
        run(controller, 3)
        controller.press('p')
        command = run(controller, 3)
        assert controller.state == state
        assert ('got targets of' in (controller.event or '')) == (state == 'passive')
    assert not command.kp.any()
    said = 'policy: got targets of shapes [(12,), (12,)], wanted 3 of (12,)'
    assert controller.event == f'the controller broke: {said}'


def test_a_network_is_told_what_a_trot_may_whatever_gait_is_chosen(model, walker, run):
    pronk = LegControllerParameters(gait=GaitParameters(name='pronk'))
    controller = LegController(model, pronk, 'truth', walker)
    slow = controller.command_filter.limits
    run(controller, 2)
    for key in '2p':
        controller.press(key)
        run(controller, 3)
    full = velocity_limits(pronk.command.limits, model.scale, model.agility, model.turning)
    assert controller.command_filter.limits == full != slow
    assert controller.set_velocity(full.forward, 0.0, 0.0) is None
    controller.tune(pronk)
    assert controller.command_filter.limits == full
    controller.press('2')
    run(controller, 3)
    assert controller.command_filter.limits == slow
    controller.press('p')
    run(controller, 3)
    controller.reset()
    run(controller, 1)
    assert controller.command_filter.limits == slow


def test_gaits_and_eyes_are_none_of_a_network_s(model, walker, run):
    controller = LegController(model, estimator='truth', walker=walker)
    run(controller, 2)
    for key in '2p':
        controller.press(key)
        run(controller, 3)
    for key in 'nNe':
        said = controller.press(key)
        assert said == f'press 2 to stand, then 4 to trot ({key} does nothing here)'
    assert (controller.gait, controller.eyes) == ('trot', False)


def test_a_policy_begins_in_the_pose_that_its_reset_chooses(model, walker, run, monkeypatch):
    monkeypatch.setattr('quadruped_sim.states.policy.SETTLE_TIME', 1.0)
    controller = LegController(model, estimator='truth', walker=walker)
    chosen = walker.default + 0.3
    monkeypatch.setattr(walker, 'reset', lambda: walker.default.__setitem__(slice(None), chosen))
    run(controller, 2)
    controller.press('2')
    run(controller, 3)
    controller.press('p')
    run(controller, 3)
    ours = [walker.joints.index(name) for name in model.quadruped.joint_names]
    state = controller._states['policy']
    assert state._default == pytest.approx(
        model.quadruped.sign * chosen[ours] + model.quadruped.zero
    )


@pytest.mark.broken_legs
def test_a_policy_whose_reset_chooses_a_pose_of_no_robot_ends_passive(
    model, walker, run, monkeypatch
):
    monkeypatch.setattr(walker, 'default', walker.default)
    monkeypatch.setattr(walker, 'reset', lambda: setattr(walker, 'default', np.zeros(13)))
    controller = LegController(model, estimator='truth', walker=walker)
    run(controller, 2)
    for key in '2p':
        controller.press(key)
        run(controller, 3)
    assert controller.state == 'passive'
    assert 'policy: default: got shape (13,)' in controller.event


@for_all('default', [np.zeros(3), np.zeros(13), np.full(12, np.nan), ['x'] * 12, None])
def test_a_policy_whose_pose_is_none_of_this_robot_is_refused(model, walker, monkeypatch, default):
    monkeypatch.setattr(walker, 'default', default)
    with pytest.raises(UserError, match='^policy: default: got .*, wanted 12 finite numbers$'):
        LegController(model, walker=walker)


def test_after_a_fault_the_heading_that_was_found_is_kept(model, run):
    controller = LegController(model)
    run(controller, 2)
    controller.press('2')
    run(controller, 3)
    controller._heading.flat['offset'] = 0.5
    run(controller, 3)
    before = controller.robot.base.R.copy()
    controller._kalman._estimate.x[:] = np.nan
    run(controller, 3)
    assert 'not finite' in controller.event
    np.testing.assert_allclose(controller.robot.base.R, before, atol=1e-3)


def test_reset_forgets_the_ground(controller, run):
    legs = controller.locomotion
    run(controller, 2)
    legs.ground.flat['gradient'], legs.ground.flat['height'], legs.step_height.flat[0] = 0.1, 1, 1
    controller.reset()
    assert (legs.ground.slope, legs.ground.height, legs.step_height.roughness) == (0, 0, 0)


@pytest.mark.parametrize(
    ('name', 'value', 'said'),
    [
        ('joints', ('FL_hip_joint',) * 12, 'joints: FL_calf_joint is missing, another is there'),
        ('ranges', ((-1.0, 1.0),), 'ranges: got '),
        ('ranges', ((-1.0, float('nan')),) * 3, 'ranges: got '),
        ('ranges', 'wide', "ranges: got 'wide', wanted "),
    ],
)
def test_joints_and_ranges_of_a_walker_are_those_of_a_robot(
    model, walker, monkeypatch, name, value, said
):
    monkeypatch.setattr(walker, name, value, raising=False)
    with pytest.raises(UserError, match=f'^policy: {said}'):
        LegController(model, estimator='truth', walker=walker)
