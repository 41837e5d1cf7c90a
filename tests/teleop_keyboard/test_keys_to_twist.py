# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
import pytest
from teleop_keyboard.hold import HELD_TIMEOUT
from teleop_keyboard.key_script import parse_key_script
from teleop_keyboard.keymap import IDLE_POLICIES, STOP_KEY
from teleop_keyboard.keymap_file import load_preset, preset_names
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL
from teleop_keyboard.parameters import TeleopParameters
from wasd_core.parameters import InvalidParameter
from wasd_core.timing import HELD, RELEASE, with_event

STEP = 0.002


def teleop(preset='mbot', **parameters):
    return KeysToTwist(load_preset(preset), TeleopParameters(preset=preset, **parameters))


def run(logic, script, end, dt=STEP):
    """Play a script; return (time [s], velocity, published or None) after each step."""
    presses = parse_key_script(script)
    trace = []
    for index in range(round(end / dt)):
        while presses and presses[0].time <= index * dt + 1e-9:
            logic.press(presses.pop(0).key)
        published = logic.step(dt)
        trace.append(((index + 1) * dt, logic.velocity, published))
    return trace


def published(trace):
    return [message for _, _, message in trace if message is not None]


@pytest.mark.slow
@for_all('dt', [0.001, 0.002, 0.01, 0.02])
@for_all('script', ['0 i*90', '0 i\n0.5 i*76'])
def test_holding_i_for_three_seconds_drives_speed_times_time(dt, script):
    trace = run(teleop(), script, 6.0, dt)
    distance = sum(velocity.vx * dt for _, velocity, _ in trace)
    assert 0.60 <= distance <= 0.64
    last_press = parse_key_script(script)[-1].time
    moving = [time for time, velocity, _ in trace if velocity != STANDSTILL]
    assert moving[-1] - last_press <= 0.5
    assert max(velocity.vx for _, velocity, _ in trace) == 0.2


@for_all('cadence', [10, 30, 100])
@for_all(
    ('preset', 'key', 'axis', 'slope'),
    [
        ('mbot', 'i', 0, 0.6),
        ('mbot', ',', 0, -0.6),
        ('go2', 'a', 1, 1.6),
        ('twist_keyboard', 'b', 2, -1.0),
        ('mbot', 'j', 3, 3.0),
    ],
)
def test_the_slope_does_not_depend_on_the_cadence_of_keys(cadence, preset, key, axis, slope):
    script = '\n'.join(f'{index / cadence} {key}' for index in range(cadence))
    trace = run(teleop(preset), script, 0.3)
    (t0, v0), (t1, v1) = [(trace[i][0], trace[i][1][axis]) for i in (10, 140)]
    # 1 %: what the issue allows; the ramp itself is exact.
    assert (v1 - v0) / (t1 - t0) == pytest.approx(slope, rel=0.01)


def test_braking_is_as_steep_as_speeding_up():
    trace = run(teleop(), '0 i*30', 3.0)
    falling = [(t, v.vx) for t, v, _ in trace if t > 1.0 and 0.02 < v.vx < 0.18]
    (t0, v0), (t1, v1) = falling[0], falling[-1]
    assert (v1 - v0) / (t1 - t0) == pytest.approx(-0.6, rel=0.01)


def test_there_is_no_stutter_between_the_first_press_and_the_repeat():
    trace = run(teleop(), '0 i\n0.5 i*60', 2.0)
    speeds = [velocity.vx for _, velocity, _ in trace]
    assert speeds == sorted(speeds)


@for_all(
    ('key', 'signs'),
    [
        ('u', (1, 1)),
        ('i', (1, 0)),
        ('o', (1, -1)),
        ('j', (0, 1)),
        ('l', (0, -1)),
        ('m', (-1, -1)),
        (',', (-1, 0)),
        ('.', (-1, 1)),
    ],
)
def test_each_motion_key_of_mbot_drives_its_way(key, signs):
    logic = teleop()
    velocity = run(logic, f'0 {key}*30', 1.0)[-1][1]
    assert velocity == (signs[0] * 0.2, 0.0, 0.0, signs[1] * 1.0)


@for_all('key', ['k', ' '])
def test_a_stop_key_stops_without_a_ramp_and_says_so_at_once(key):
    logic = teleop()
    run(logic, '0 i*30', 1.0)
    logic.press(key)
    assert logic.velocity == STANDSTILL
    assert logic.step(0.0) == STANDSTILL
    assert logic.step(STEP) is None


def test_a_stop_key_speaks_even_while_silent():
    logic = teleop()
    logic.press('k')
    assert published(run(logic, '', 1.0)) == [STANDSTILL]


def test_any_other_key_stops_mbot_on_the_ramp():
    logic = teleop()
    run(logic, '0 i*30', 1.0)
    logic.press('UP')
    assert logic.target == STANDSTILL
    logic.step(0.1)
    assert logic.velocity.vx == pytest.approx(0.14)


def test_a_new_motion_key_joins_the_old_one_until_that_would_have_repeated():
    logic = teleop()
    run(logic, '0 i*15', 0.5)
    logic.press('j')
    assert logic.target == (0.2, 0.0, 0.0, 1.0)
    logic.step(0.12)
    assert logic.target == (0.0, 0.0, 0.0, 1.0)


def test_speed_keys_never_start_a_motion():
    logic = teleop()
    assert published(run(logic, '0 q*20 z*20 w*20 x*20 e*20 c*20', 2.0)) == []
    assert logic.velocity == STANDSTILL


@for_all('idle', IDLE_POLICIES)
@for_all('preset', preset_names())
def test_a_speed_key_while_stopped_publishes_nothing_but_zeros(preset, idle):
    logic = teleop(preset, idle=idle)
    script = '0 ' + ' '.join(f'{key}*10' for key in logic.keymap.speed_keys or ('F1',))
    messages = published(run(logic, script, 1.0))
    assert set(messages) <= {STANDSTILL}
    assert bool(messages) == (idle != 'silent')


def test_speed_keys_change_by_a_tenth_and_what_is_shown_is_used():
    logic = teleop()
    for key in 'qwe':
        logic.press(key)
    assert logic.speed == pytest.approx(0.2 * 1.21)
    assert logic.turn == pytest.approx(1.21)
    run(logic, '0 u*30', 1.0)
    assert logic.velocity == (logic.speed, 0.0, 0.0, logic.turn)


def test_speed_keys_stay_within_the_limits():
    logic = teleop()
    for _ in range(200):
        logic.press('q')
    assert (logic.speed, logic.turn) == (1.0, 5.0)
    for _ in range(200):
        logic.press('z')
    assert (logic.speed, logic.turn) == (0.02, 0.1)


def test_silent_publishes_while_moving_then_one_zero_then_nothing():
    messages = [(t, m) for t, _, m in run(teleop(), '1 i*30', 5.0) if m is not None]
    assert messages[0][0] == pytest.approx(1.0, abs=2 * STEP)
    assert [m for _, m in messages].count(STANDSTILL) == 1
    assert messages[-1][1] == STANDSTILL
    gaps = [b[0] - a[0] for a, b in zip(messages, messages[1:], strict=False)]
    assert max(gaps) <= 1 / 50 + 2 * STEP


def test_keys_that_cancel_each_other_are_no_silence_but_end_as_all_do():
    logic = teleop('wasd')
    logic.press('w')
    logic.press('s')
    assert published(run(logic, '', 0.5)) == []
    assert not logic.is_silent
    run(logic, '', 1.0)
    assert logic.motion.hold.held == ()
    assert logic.is_silent


def test_repeat_publishes_always_at_its_rate():
    messages = published(run(teleop(idle='repeat', rate=20.0), '', 2.0))
    assert messages == [STANDSTILL] * len(messages)
    assert len(messages) == pytest.approx(40, abs=1)


@pytest.mark.slow
@pytest.mark.parametrize('dt', [0.001, 0.0031, 0.02, 0.049, 0.05])
def test_the_rate_is_kept_whatever_the_step(dt):
    messages = published(run(teleop('ramps'), '', 10.0, dt))
    assert len(messages) == pytest.approx(200, rel=0.03)


def test_no_time_moves_nothing_and_a_pause_brings_no_burst():
    logic = teleop()
    logic.press('i')
    for dt in (0.0, -1.0, math.nan, math.inf):
        assert logic.step(dt) is None
    assert logic.velocity == STANDSTILL
    repeating = teleop(idle='repeat')
    repeating.step(5.0)
    assert [repeating.step(0.0) for _ in range(10)] == [None] * 10


@for_all('name', ['speed', 'scale_linear', 'linear_scale'])
def test_every_name_of_the_full_speed_is_honoured(name):
    logic = teleop(**{name: 0.1})
    assert run(logic, '0 i*30', 1.0)[-1][1].vx == 0.1


@for_all('name', ['turn', 'scale_angular', 'angular_scale'])
def test_every_name_of_the_full_turn_rate_is_honoured(name):
    logic = teleop('ramps', **{name: 0.4})
    assert run(logic, '0 a', 1.0)[-1][1].wz == 0.4


def test_names_that_disagree_are_rejected_and_those_that_agree_are_not():
    with pytest.raises(InvalidParameter, match='speed=0.1 and scale_linear=0.3'):
        teleop(speed=0.1, scale_linear=0.3)
    assert teleop(speed=0.3, scale_linear=0.3).speed == 0.3


def test_a_speed_beyond_the_limits_is_rejected_and_changes_nothing():
    logic = teleop()
    with pytest.raises(InvalidParameter, match=r'speed must be within 0.02 .. 1 \(preset mbot\)'):
        logic.set_parameters(TeleopParameters(speed=2.0, turn=2.0))
    assert (logic.speed, logic.turn) == (0.2, 1.0)


def test_parameters_take_effect_while_running():
    logic = teleop(scale_linear=0.1)
    run(logic, '0 i*15', 0.5)
    logic.set_parameters(TeleopParameters(scale_linear=0.1, speed=0.3))
    assert logic.target.vx == 0.3
    # Back to the name that is still set, and then to the preset.
    logic.set_parameters(TeleopParameters(scale_linear=0.1))
    assert logic.speed == 0.1
    logic.set_parameters(TeleopParameters())
    assert logic.speed == 0.2


def test_another_parameter_leaves_what_the_speed_keys_did():
    logic = teleop()
    logic.press('q')
    logic.set_parameters(TeleopParameters(rate=30.0))
    assert logic.speed == pytest.approx(0.22)
    assert logic.rate == 30.0


def test_a_reset_returns_to_the_start():
    logic = teleop(speed=0.3)
    run(logic, '0 q i*30', 1.0)
    logic.reset()
    assert (logic.speed, logic.velocity, logic.target) == (0.3, STANDSTILL, STANDSTILL)
    assert logic.step(STEP) is None


@pytest.mark.slow
def test_the_same_keys_give_the_same_twists():
    script = '0 u*20\n1 q j*9\n2 k ,*40 x'
    assert run(teleop(), script, 4.0) == run(teleop(), script, 4.0)


def hold_told(logic, key, seconds):
    """Hold a key whose release will be told; return the velocities meanwhile."""
    logic.press(key)
    velocities = []
    for index in range(round(seconds / STEP)):
        if index % 50 == 0:
            logic.press(with_event(HELD, key))
        if index % 15 == 0:
            logic.press(key)  # it repeats, too
        logic.step(STEP)
        velocities.append(logic.velocity)
    return velocities


@for_all('stop', [STOP_KEY, 'k'])
@for_all('mode', ['hold', 'latch', 'step'])
def test_after_a_stop_a_key_that_stays_down_drives_no_more_until_it_is_pressed_anew(stop, mode):
    logic = teleop(mode=mode)
    assert hold_told(logic, 'i', 0.5)[-1].vx > 0.1
    logic.press(stop)
    logic.step(STEP)
    assert set(hold_told(logic, 'i', 3.0)) == {STANDSTILL}
    assert not logic.is_silent  # its release is still to come
    assert hold_told(logic, ',', 0.5)[-1].vx < -0.01  # another key is a wish
    logic.press(with_event(RELEASE, ','))
    logic.press(stop)
    logic.press(with_event(RELEASE, 'i'))
    assert hold_told(logic, 'i', 0.5)[-1].vx > 0.1


def test_a_key_down_since_a_stop_counts_again_when_its_release_was_lost():
    logic = teleop()
    hold_told(logic, 'i', 0.5)
    logic.press(STOP_KEY)
    for _ in range(round(HELD_TIMEOUT / STEP) + 2):
        logic.step(STEP)
    assert hold_told(logic, 'i', 0.5)[-1].vx > 0.1


def test_without_told_releases_a_press_after_a_stop_drives_at_once():
    logic = teleop()
    run(logic, '0 i*10', 0.3)
    logic.press(STOP_KEY)
    logic.press('i')
    logic.step(STEP)
    assert logic.target.vx > 0.0
