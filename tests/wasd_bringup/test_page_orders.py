# SPDX-License-Identifier: Apache-2.0
"""What the page asks of a run: sticks by keys that all hear of, the keys' names, a hand's push."""

import mujoco
import numpy as np
from policy_player.joint_controller import State
import pytest
from quadruped_sim.keys import STATE_KEYS, StateName, StickValues, ZERO_KEYS
from wasd_bringup.page.bridge import CockpitBridge, SNAPSHOT_EVERY
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.drivers import SILENCE
from wasd_bringup.run.inputs import ScriptedTwist, SWITCH_KEY
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.robot import REFUSED
from wasd_bringup.run.run import Run as Session
from wasd_cockpit.link import Order, Push, Stick, STICK_PROOF, words_of
from wasd_core.output_file import OutputFile

pytestmark = pytest.mark.slow

PERIOD = 1.0 / 60.0  # of the scene [s]


class Run:
    """A run with a page's bridge; simulated time passes when it is told to."""

    def __init__(self, session):
        self.session = session
        self.bridge = CockpitBridge(session)
        self.heard = [[] for _ in session.robots]  # what `keys` would tell, for each robot
        for robot, heard in zip(session.robots, self.heard, strict=True):
            robot.on_key.append(heard.append)
        self._now = 0.0
        self._grip = None  # of the hand

    def look(self, stick=None, force=None):
        """Let the page hold a stick and a force, and the session look at them."""
        self._grip = None if force is None else self._grip or self.bridge._grip
        self.bridge._link.hold(stick, None if force is None else Push(force, self._grip))
        self.bridge.step(self._now, PERIOD)
        self._now += SNAPSHOT_EVERY * PERIOD

    def order(self, what, name='', **held):
        self.bridge._link.order(Order(what, name))
        self.look(**held)

    def close(self):
        self.bridge.close()
        self.session.close()


@pytest.fixture
def run_of(tmp_path, monkeypatch):
    """A function that makes a run of a robot with options, as with --no-ros."""
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    runs = []

    def make(robot, preset, make_run=Session, **more):
        options = RunOptions(robot=robot, description=robot, preset=preset, speed=0.0, **more)
        runs.append(Run(make_run(options)))
        return runs[-1]

    yield make
    for run in runs:
        run.close()


def test_a_stick_held_over_a_fallen_go2_presses_no_keys(run_of):
    run = run_of('go2', 'unitree')
    world, legs = run.session.world, run.session.robot.legs.controller
    world.data.qpos[3:7] = 0.0, 1.0, 0.0, 0.0  # on its back
    run.session.simulation.advance(20)
    assert legs.is_fallen
    for _ in range(30):
        run.look(Stick(0.5, -0.3, 0.2))
        run.session.simulation.advance(33)
    assert legs.is_fallen
    assert run.heard == [[]]


def test_a_stick_over_a_go2_on_its_feet_presses_each_key_once(run_of):
    run = run_of('go2', 'unitree')
    for _ in range(5):
        run.look(Stick(0.5, -0.3, 0.2))
    assert sorted(run.heard[0]) == sorted(10 * ['w'] + 6 * ['d'] + 4 * ['j'])


def test_a_stick_let_go_before_its_state_is_entered_moves_nothing(run_of):
    run = run_of('go2', 'unitree')
    simulation, sticks = run.session.simulation, run.session.robot.legs.controller.sticks
    run.session.press('2')
    simulation.advance(20)
    run.session.press('4')  # it trots after two steps more, as while time stands still
    for _ in range(3):
        run.look(Stick(0.5, 0.0, 0.0))
    assert run.heard[0].count('w') == 10
    run.look()
    simulation.advance(20)
    assert sticks.values == StickValues()


def test_each_key_of_a_state_is_named_as_on_the_keyboard_and_does_so_when_clicked(run_of):
    run = run_of('go2', 'unitree', layout='dvorak')
    legs = run.session.robot.legs.controller
    run.look()
    caps = {cap.does: cap.key for cap in run.bridge._link.snapshot.keys}
    assert caps['jump'] == 'k'  # the place of qwerty's v
    assert 'policy' not in caps  # nobody has given one
    states = [state.value for state in STATE_KEYS.values() if state is not StateName.POLICY]
    assert {caps[state] for state in states} == {*'1234509867k'}
    for state in (StateName.FIXED_STAND, StateName.JUMP):
        run.order('key', caps[state.value])
        assert legs.coming_state == state


def test_a_key_of_a_state_is_no_strange_key_on_any_keyboard(run_of):
    run = run_of('go2', 'wasd', layout='dvorak')
    stack = run.session.robot
    stack.legs.controller._machine.force(StateName.MOVE_BASE)
    run.session.press('k')  # the place of qwerty's v
    assert 'jump cannot follow' in stack.notice.text
    run.session.press('v')  # the place of qwerty's full stop
    assert stack.notice.text.startswith('v stops')


def test_what_a_hand_lets_go_of_ends_before_the_next_snapshot(run_of):
    run = run_of('mbot', 'mbot')
    world = run.session.world
    run.look(Stick(0.5, 0.0, 0.0), force=(3.0, 0.0, 0.0))
    assert run.bridge._driven == 0
    assert world.actuation._kept_push.any()
    shown = run.bridge._link.snapshot
    run.bridge._link.hold(None, None)
    run.bridge.step(0.01 * PERIOD, PERIOD)
    assert run.bridge._link.snapshot is shown
    assert run.bridge._driven is None
    assert not world.actuation._kept_push.any()


@pytest.mark.parametrize('pace', [0.2, 1.0, 20.0])
def test_a_hand_that_pushes_for_a_second_gives_its_force_times_a_second(run_of, pace):
    run = run_of('mbot', 'mbot')
    world, simulation = run.session.world, run.session.simulation
    model, data = world.model, world.data
    model.opt.gravity[:] = 0.0
    data.qpos[2] = 1.0  # it floats
    force = np.array([0.4, -0.3, 0.5])
    looks = round(30 / pace)
    steps = round(1.0 / world.time_step / looks)
    for _ in range(looks):
        run.look(force=tuple(force))
        simulation.advance(steps)
    run.look()
    assert not data.xfrc_applied.any()
    simulation.advance(100)
    mujoco.mj_subtreeVel(model, data)
    time = looks * steps * world.time_step
    expected = force * time / model.body_subtreemass[world.root]
    np.testing.assert_allclose(data.subtree_linvel[world.root], expected, rtol=1e-3)


def test_a_hand_pushes_what_it_took_hold_of_while_that_is_in_turn_and_nothing_else(run_of):
    run = run_of('both', 'unitree')
    go2, mbot = (robot.world.root for robot in run.session.robots)

    def pushed(force=(1.0, 0.0, 0.0)):
        run.look(force=force)
        return run.session.world.data.xfrc_applied[[go2, mbot], 0].tolist()

    assert pushed() == [1.0, 0.0]
    run.session.press(SWITCH_KEY)
    assert pushed() == pushed() == [0.0, 0.0]
    assert pushed(None) == [0.0, 0.0]
    assert pushed() == [0.0, 1.0]


def test_a_hand_that_pushes_over_a_reset_pushes_again_after_its_release(run_of):
    run = run_of('mbot', 'mbot')
    applied, force = run.session.world.data.xfrc_applied, (1.0, 0.0, 0.0)
    run.look(force=force)
    assert applied.any()
    run.order('reset', force=force)
    for _ in range(2):
        assert not applied.any()
        run.look(force=force)
    run.look()
    run.look(force=force)
    assert applied.any()


@pytest.mark.parametrize(('robot', 'preset'), [('go2', 'unitree'), ('mbot', 'ramps')])
def test_what_a_viewer_drove_stops_without_it_and_the_driver_reads_why(
    run_of, robot, preset, capfd
):
    run = run_of(robot, preset)
    run.session.press('w', 'page')
    run.session._stop_what_the_view_moved()
    stack = run.session.robot
    assert run.heard == [['w', stack.stop_key]]
    # Not what that key does, which nobody has pressed.
    assert stack.notice.text == 'it was stopped (the viewer that drove it is gone)'
    assert 'SPACE' not in capfd.readouterr().err
    run.session._stop_what_the_view_moved()  # it drives no more
    assert len(run.heard[0]) == 2


@pytest.mark.parametrize('preset', ['unitree', 'wasd'])
@pytest.mark.parametrize('state', [StateName.PASSIVE, StateName.FIXED_STAND])
def test_the_emergency_stop_is_answered_in_one_line(ros, run_of, state, preset, capfd):
    run = run_of('go2', preset, make_ros_run)
    stack = run.session.robot
    stack.legs.controller._machine.force(state)
    run.session.simulation.advance(20)
    capfd.readouterr()
    run.order('e-stop')
    run.session.simulation.advance(300)
    assert run.heard == [['1', stack.stop_key]]
    assert stack.notice.text == 'press 2 to stand (passive: E-STOP by the page)'
    said = capfd.readouterr().err.splitlines()
    assert len(said) == 1, said
    run.session.press('1')  # somebody's key is answered
    assert stack.notice.text == 'passive already'


def test_the_status_of_legs_tells_their_command_once(run_of):
    run = run_of('go2', 'unitree')
    run.session.robot.legs.controller._machine.force(StateName.MOVE_BASE)
    run.session.simulation.advance(20)
    run.look()
    lines = words_of(run.bridge._link.snapshot)
    assert [line.split()[0] for line in lines].count('command') == 1


def test_the_emergency_stop_ends_a_script(run_of):
    run = run_of('mbot', 'mbot', twists=(ScriptedTwist(0.0, (0.2, 0.0, 0.0)),))
    simulation, stack = run.session.simulation, run.session.robot
    controller = stack.drive_unit.controller
    simulation.advance(1000)
    assert controller.target.linear == 0.2
    run.order('e-stop')
    simulation.advance(100)
    assert controller.target.linear == 0.0
    simulation.advance(2000)  # the script would have gone on
    assert controller.target.linear == 0.0
    run.session.press('i')
    simulation.advance(100)  # its driver drives
    assert controller.target.linear > 0.0


def test_after_an_emergency_stop_others_are_refused_until_they_were_silent_or_send_a_zero(
    ros, run_of
):
    run = run_of('mbot', 'mbot', make_ros_run)
    robot, simulation = run.session.robot, run.session.simulation
    follow = run.session.face.faces[0].controller.node.cmd_vel.on_velocity
    admit, words = (
        lambda velocity: follow(velocity, 0.0),
        f'{REFUSED.format("/cmd_vel")} (refused since E-STOP by the page)',
    )
    silent = round((SILENCE + 0.1) / run.session.world.time_step)
    for lets_go in (lambda: admit((0.0, 0.0, 0.0)), lambda: simulation.advance(silent)):
        assert admit((0.2, 0.0, 0.0))
        run.order('e-stop')
        for _ in range(40):
            assert not admit((0.2, 0.0, 0.0))
            assert robot.notice.text == words
            simulation.advance(50)
        lets_go()
        assert admit((0.2, 0.0, 0.0))


@pytest.mark.parametrize('speed', [20.0, 0.0])
def test_an_emergency_stop_holds_against_who_sends_on_while_time_hurries(run_of, speed):
    run = run_of('mbot', 'mbot')
    robot, simulation = run.session.robot, run.session.simulation
    run.bridge._link.order(Order('speed', value=speed))
    run.look()
    simulation.pacer.allowed(0.0, 0.0)
    simulation.pacer.measure(1.0, 20.0)
    assert robot.drive((0.2, 0.0, 0.0), 'sine')
    run.order('e-stop')
    for _ in range(4):
        simulation.advance(round(20.0 * 0.1 / run.session.world.time_step))
        assert not robot.drive((0.2, 0.0, 0.0), 'sine')


def test_time_goes_as_fast_as_is_asked_for_but_never_stands_still(run_of):
    run = run_of('mbot', 'mbot')
    for asked, speed in (
        (np.float32(0.3), 0.3),
        (-1.0, 0.3),  # no speed
        (-1e-9, 0.3),
        (1.5e-8, 0.01),
        (0.004, 0.01),
        (0.0, 0.0),
        (1e9, 100.0),
    ):
        run.bridge._link.order(Order('speed', value=float(asked)))
        run.look()
        assert run.session.simulation.pacer.speed == speed, asked


def test_a_stick_let_go_at_a_change_of_robot_is_told_and_saved_as_its_keys(run_of, tmp_path):
    run = run_of('both', 'unitree', save_keys=OutputFile(tmp_path / 'saved', '--save-keys'))
    run.look(Stick(0.1))
    assert run.heard == [['w', 'w'], []]
    run.session.press(SWITCH_KEY)
    run.look()
    assert run.heard == [['w', 'w', ZERO_KEYS[0]], []]
    assert run.session.active == 1
    sticks = run.session.robots[0].legs.controller.sticks
    assert sticks.values.ly == 0.0
    run.session._writer.close()
    keys = [line.split()[1] for line in (tmp_path / 'saved').read_text().splitlines()]
    assert keys == ['w', 'w', SWITCH_KEY, SWITCH_KEY, 'SPACE', SWITCH_KEY]


def test_the_stick_and_the_e_stop_reach_their_robot_though_its_keys_are_held_for_another(run_of):
    run = run_of('both', 'unitree')
    run.session.press(SWITCH_KEY)
    held = ('w', 'SPACE', SWITCH_KEY)
    for key in held:
        run.session.press(f'HELD+{key}', 'page')
    run.session.press(SWITCH_KEY)
    run.session.robots[0].legs.controller._machine.force(StateName.TROTTING)
    run.heard[1].clear()
    run.look(Stick(0.1))
    assert run.heard == [['w', 'w'], []]
    run.session.e_stop('page')
    assert run.heard[0][-2:] == [*run.session.robots[0].stop_keys]
    assert {*run.heard[1]} == {*run.session.robots[1].stop_keys}
    assert run.session.active == 0


@pytest.mark.parametrize(
    ('given', 'text', 'shown'),
    [
        (None, '', 'sim'),
        ('sim', '', 'sim'),
        ('float', '', 'float'),
        ('fake', '', 'fake'),
        (None, 'mode: arbotix', 'arbotix'),
        ('sim', 'mode: arbotix', 'arbotix'),
        (None, 'mode: fake', 'fake'),
        ('sim', 'mode: fake', 'sim'),
        ('float', 'mode: arbotix', 'float'),
    ],
)
def test_the_page_shows_the_mode_that_drives(run_of, tmp_path, given, text, shown):
    file = tmp_path / 'drive.yaml'
    file.write_text(text)
    run = run_of('mbot', 'mbot', mode=given, controller=file if text else None)
    run.look()
    (setting,) = run.bridge._link.snapshot.settings
    assert setting.chosen == shown


def test_an_elevation_is_shown_only_while_the_page_looks(run_of):
    run = run_of('go2', 'unitree', world='step:0.1')
    robot, link = run.session.robot, run.bridge._link
    link._clock = lambda: 0.0  # a look lasts, however slow the machine is
    run.look()
    run.session.simulation.advance(300)
    run.look()
    assert link.snapshot.elevation is None
    assert link.snapshot.no_elevation == ''
    assert np.isnan(robot.elevation.mapper.elevation.heights()).all()  # nothing was measured
    link.look()
    run.session.simulation.advance(300)
    run.look()
    shown = link.snapshot.elevation
    mapped = robot.elevation.mapper.elevation
    assert shown.heights.shape == (mapped.count, mapped.count)
    assert np.isfinite(shown.heights).sum() > 100
    # The robot and its feet are over the middle of what is shown.
    middle = np.array(shown.corner) + 0.5 * mapped.count * shown.resolution
    assert np.hypot(shown.pose.x - middle[0], shown.pose.y - middle[1]) < 0.1
    assert np.abs(shown.feet - middle).max() < 0.5
    run.session.simulation.reset()
    run.look()
    assert link.snapshot.elevation is None


def test_an_elevation_is_mapped_only_of_the_robot_in_turn(run_of):
    run = run_of('both', 'unitree')
    mapper, link = run.session.robots[0].elevation.mapper, run.bridge._link
    link._clock = lambda: 0.0
    link.look()
    run.session.press(SWITCH_KEY)  # to mbot
    run.session.simulation.advance(300)
    assert np.isnan(mapper.elevation.heights()).all()
    run.session.press(SWITCH_KEY)
    run.session.simulation.advance(300)
    assert np.isfinite(mapper.elevation.heights()).any()


def test_while_a_stop_holds_the_page_starts_no_other_run(run_of):
    run = run_of('mbot', 'mbot', latched=True, words=('mbot',))
    run.session.e_stop('page')
    run.order('start', 'mbot room')
    assert run.session.next_words == ()
    assert run.session.robot.notice.text == 'ENTER releases E-STOP (by the page)'
    run.session.end_e_stop()
    run.order('start', 'mbot room')
    assert run.session.next_words[:3] == ('mbot', '--world', 'room')


@pytest.mark.parametrize('events', [('e-stop',), ('e-stop', 'silence'), ('silence', 'e-stop')])
def test_a_stick_held_over_an_e_stop_of_another_source_drives_only_after_its_release(
    run_of, events
):
    run, now = run_of('mbot', 'mbot'), [0.0]
    run.bridge._link._clock = lambda: now[0]
    run.bridge.attach('')
    controller, stick = run.session.robot.drive_unit.controller, Stick(0.5, 0.0, 0.0)
    run.look(stick)
    assert controller.target.linear > 0.05
    for event in events:
        if event == 'silence':  # the page is late
            now[0] += 1.3 * STICK_PROOF
            run.bridge.step(run._now, PERIOD)
        else:
            run.session.press('ESC')
    for _ in range(100):  # longer than any silence
        run.look(stick)
        run.session.simulation.advance(33)
        assert controller.target.linear == 0.0
    run.look(None)
    run.look(stick)
    assert controller.target.linear > 0.05


@pytest.mark.parametrize('speed', [20.0, 0.0])
def test_a_stick_drives_on_however_far_time_goes_between_two_looks(run_of, speed):
    run = run_of('mbot', 'mbot')
    run.bridge._link._clock = lambda: 0.0  # a stick that is held stays proved
    run.bridge.attach('')
    controller, simulation = run.session.robot.drive_unit.controller, run.session.simulation
    run.look(Stick(0.5))
    for _ in range(20):
        simulation.advance(round(0.1 / run.session.world.time_step))
        assert controller.target.linear > 0.05
    run.look(None)
    simulation.advance(round(0.1 / run.session.world.time_step))
    assert controller.target.linear == 0.0


def test_a_stick_that_is_held_over_a_change_of_robot_drives_the_other_after_its_release(run_of):
    run = run_of('both', 'unitree')
    run.bridge.attach('')
    controller = run.session.robots[1].drive_unit.controller
    run.look(Stick(0.5))
    run.session.press(SWITCH_KEY)
    for _ in range(5):
        run.look(Stick(0.5))
        run.session.simulation.advance(33)
        assert controller.target.linear == 0.0
    run.look(None)
    run.look(Stick(0.5))
    assert controller.target.linear > 0.05


def test_a_stick_of_a_page_that_is_closed_stops_the_robot_for_good(run_of):
    run = run_of('mbot', 'mbot')
    run.bridge.attach('')
    controller = run.session.robot.drive_unit.controller
    run.look(Stick(0.5))
    assert controller.target.linear > 0.05
    run.session._stop_what_the_view_moved()
    for _ in range(5):  # what the page said last is still fresh
        run.look(Stick(0.5))
        assert controller.target.linear == 0.0
    run.look(None)  # another page
    run.look(Stick(0.5))
    assert controller.target.linear > 0.05


def run_with_key(run_of, folder, key):
    """Return a run of a Go2 whose keymap drives ahead by a key."""
    preset = folder / 'mine.yaml'
    limits = 'speed: 0.5\nturn: 1.0\nlinear_accel: 1.0\nangular_accel: 4.0\n'
    preset.write_text(f'{limits}motion: {{{key}: [1, 0, 0]}}\n')
    return run_of('go2', str(preset))


def test_a_gait_is_chosen_by_the_key_that_the_keymap_left(run_of, tmp_path):
    run = run_with_key(run_of, tmp_path, 'n')
    run.session.press('2')
    run.session.simulation.advance(1500)
    view = run.bridge._watched[0].view
    keys = view.keys_to_choose('gait', 'walk')
    assert set(keys) == {'N'}
    run.session.press_for(0, keys, 'page')
    assert run.session.robot.legs.controller.gait == 'walk'


def test_a_state_whose_key_the_keymap_took_cannot_be_chosen(run_of, tmp_path):
    run = run_with_key(run_of, tmp_path, 'v')
    legs = run.session.robot.legs.controller
    legs._machine.force(StateName.FIXED_STAND)
    run.look()
    refusals = {choice.name: choice.refusal for choice in run.bridge._link.snapshot.choices}
    assert refusals['jump'] == "the key v is the preset's"
    assert not refusals['trotting']


@pytest.mark.parametrize('state', [StateName.TROTTING, StateName.MOVE_BASE])
def test_a_full_stick_backwards_is_as_fast_as_the_page_says(run_of, state):
    run = run_of('go2', 'unitree')
    stack = run.session.robot
    for key, steps in (('2', 1200), ('4' if state is StateName.TROTTING else '5', 200)):
        run.session.press(key)
        run.session.simulation.advance(steps)
    assert stack.state == state
    # From full speed backwards to full speed ahead the ramp takes 1.75 s.
    for stick, looks in ((Stick(-1.0), 27), (Stick(1.0), 57)):
        for _ in range(looks):
            run.look(stick)
            run.session.simulation.advance(33)
        shown = run.bridge._link.snapshot
        assert shown.stick.velocity(stick)[0] == pytest.approx(shown.marks.command[0])


def test_a_full_stick_backwards_of_a_network_is_as_fast_as_it_was_trained(run_of):
    run = run_of('g1', 'wasd')
    controller = run.session.robot.controller
    controller.state = State.POLICY
    run.look(Stick(-1.0))
    shown = run.bridge._link.snapshot.stick.velocity(Stick(-1.0))
    assert shown == tuple(controller._asked) == (-0.5, 0.0, 0.0)


def test_what_the_page_orders_by_its_buttons_is_saved_as_keys(run_of, tmp_path):
    saved = tmp_path / 'saved'
    run = run_of('mbot', 'mbot', save_keys=OutputFile(saved, '--save-keys'), latched=True)
    simulation, world = run.session.simulation, run.session.world
    run.session.press('i', 'page')
    simulation.advance(1000)
    for order in ('reset', 'e-stop', 'end e-stop'):
        run.order(order)
        simulation.advance(100)
    assert abs(world.base().position[0]) < 0.01
    run.session._writer.close()
    keys = [line.split()[1] for line in saved.read_text().splitlines()]
    assert keys == ['i', 'BACKSPACE', 'ESC', run.session.robot.stop_key, 'ENTER']


def test_the_page_s_buttons_do_as_they_say_though_a_keymap_has_their_keys(run_of, tmp_path):
    preset, saved = tmp_path / 'mine.yaml', tmp_path / 'saved'
    motion = '{i: [1, 0, 0], ENTER: [1, 0, 0], BACKSPACE: [1, 0, 0]}'
    preset.write_text(
        f'speed: 0.5\nturn: 1.0\nlinear_accel: 1.0\nangular_accel: 4.0\nmotion: {motion}\n'
    )
    options = {'latched': True, 'save_keys': OutputFile(saved, '--save-keys')}
    run = run_of('mbot', str(preset), **options)
    run.session.press('i')
    run.session.simulation.advance(1000)
    run.order('reset')
    assert run.session.world.base().position[0] == 0.0
    run.order('e-stop')
    run.order('end e-stop')
    assert not run.session.robot.drivers.stopped_by
    run.session._writer.close()
    keys = [line.split()[1] for line in saved.read_text().splitlines()]
    assert keys == ['i', 'ESC', run.session.robot.stop_key, 'ENTER']


def test_a_step_that_the_page_orders_is_published(run_of):
    run = run_of('mbot', 'mbot')
    simulation, told = run.session.simulation, []
    simulation.on_step.append(lambda: told.append(run.session.world.tick))
    run.order('step')
    assert told == []
    simulation.paused = True
    run.order('step')
    assert told == [run.session.world.tick] == [simulation.schedule.stride]
