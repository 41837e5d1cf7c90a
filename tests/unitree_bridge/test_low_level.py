# SPDX-License-Identifier: Apache-2.0
"""LowCmd moves the motors by its law at every physics step, and nothing else of it does."""

import math

from cases import for_all
import numpy as np
import pytest
from unitree_bridge.cdr import decode, Layout
from unitree_bridge.low_level import (
    LowLevel,
    POSITION_STOP,
    read_low_command,
    SILENCE,
    tick_of,
    VELOCITY_STOP,
)
from unitree_bridge.motion import SILENCE as SILENCE_AFTER_A_STOP
from unitree_bridge.remote import Remote
from unitree_bridge.robot import MOTORS, to_motors
from unitree_bridge.shapes import LOW_STATE, SPORT_MODE_STATE
from unitree_rig import low_cmd, positions, request, Rig, STANDING
from wasd_core.errors import InvalidMessage
from wasd_core.robot_io import JointCommand

DT = 0.002


@pytest.fixture
def rig():
    return Rig()


def test_a_command_is_read_motor_by_motor():
    numbers = np.arange(12.0)
    read = read_low_command(low_cmd(0.1 * numbers, numbers, -numbers, 2 * numbers, 3 * numbers))
    wanted = (0.1 * numbers, numbers, -numbers, 2 * numbers, 3 * numbers)
    for part, expected in zip(read.command, wanted, strict=True):
        assert part == pytest.approx(expected, rel=1e-6)


def test_unitree_s_order_of_the_legs_is_its_own_inverse():
    names = [f'{leg}_{i}' for leg in ('FL', 'FR', 'RL', 'RR') for i in range(3)]
    wanted = [f'{leg}_{i}' for leg in ('FR', 'FL', 'RR', 'RL') for i in range(3)]
    assert [names[i] for i in MOTORS] == wanted
    command = JointCommand(*np.random.default_rng(1).normal(size=(5, 12)))
    twice = to_motors(to_motors(command))
    assert all(map(np.array_equal, twice, command))


@for_all(
    ('wrong', 'reason'),
    [
        (low_cmd(is_sealed=False), 'checksum: got 0x00000000, wanted 0x'),
        (low_cmd(q=math.nan, kp=0.0), 'finite'),
        (low_cmd(dq=math.nan), 'finite'),
        (low_cmd(tau=math.inf), 'finite'),
        (low_cmd(kp=math.nan), 'finite'),
        (low_cmd(kd=-1.0), 'a gain is below 0'),
        (low_cmd()[:-4], 'got 808 bytes, wanted 812'),
        (low_cmd() + b'\0' * 4, 'got 816 bytes, wanted 812'),
        (b'', 'got 0 bytes'),
        (b'\x00\x00' + low_cmd()[2:], 'encoding: got 0000'),
    ],
)
def test_what_is_no_command_is_refused_in_words(wrong, reason):
    with pytest.raises(InvalidMessage, match=reason):
        read_low_command(wrong)


@for_all('sign', [1.0, -1.0])
def test_a_stop_value_is_no_aim_whatever_its_gain(sign):
    read = read_low_command(low_cmd(sign * POSITION_STOP, sign * VELOCITY_STOP, 1.5, 60.0, 5.0))
    assert read.command.effort == pytest.approx(np.full(12, 1.5))
    for part in (read.command.position, read.command.velocity, read.command.kp, read.command.kd):
        assert not part.any()


def test_a_motor_that_is_not_enabled_gets_no_torque():
    read = read_low_command(low_cmd(1.0, 1.0, 1.0, 1.0, 1.0, mode=0))
    assert not np.array(read.command).any()


@pytest.fixture(scope='module')
def stood():
    """Return a robot that a program made stand by its motors, and holds."""
    rig = Rig()
    rig.stand_by_motors(1.5)
    return rig


@pytest.mark.slow
def test_a_program_makes_the_robot_stand_by_its_motors(stood):
    assert stood.position[2] > 0.3
    assert np.abs(positions(stood.low_state) - STANDING).max() < 0.1
    assert stood.state == 'passive'
    assert [line for line in stood.said if line.startswith('LowCmd')] == [
        'LowCmd: an SDK program has the motors; our controller is stopped'
    ]


@pytest.mark.slow
def test_a_low_state_says_what_the_robot_measures(stood):
    state, world = stood.low_state, stood.go2.world
    assert (state['head'], state['level_flag']) == (b'\xfe\xef', 0xFF)
    w, x, y, z = state['imu_state']['quaternion']
    assert math.hypot(w, x, y, z) == pytest.approx(1.0, abs=1e-6)
    assert w == pytest.approx(1.0, abs=0.02)
    assert state['imu_state']['accelerometer'][2] == pytest.approx(9.81, abs=1.5)
    assert len(positions(state)) == 12
    weight = 9.81 * float(world.model.body_subtreemass[world.root])
    assert sum(state['foot_force']) == pytest.approx(weight, rel=0.05)
    for motor in state['motor_state'][12:]:
        assert motor == motor | dict.fromkeys(('mode', 'q', 'dq', 'tau_est', 'lost'), 0)


@pytest.mark.slow
def test_each_physics_step_has_the_torque_of_its_own_state(stood):
    """The law of the motors, at a step between two commands: tau = ff + kp (q* - q) - kd v."""
    world = stood.go2.world
    stood.command(low_cmd(STANDING + 0.05, kp=40.0, kd=1.0, tau=0.5))
    stood.run(0.004)
    for _ in range(5):
        joints = world.joints()
        world.step(1)
        aim = (STANDING + 0.05)[MOTORS]
        wanted = 0.5 + 40.0 * (aim - joints.position) - joints.velocity
        assert world.joints().effort == pytest.approx(wanted, abs=1e-3)


@pytest.mark.slow
def test_silence_damps_and_is_said(stood):
    for _ in range(100):
        stood.command(low_cmd(STANDING, kp=60.0, kd=5.0))
        stood.run(DT)
    assert stood.position[2] > 0.3
    stood.run(SILENCE + 0.01)
    assert stood.said[-1] == 'no LowCmd for 0.1 s: the motors damp'
    world = stood.go2.world
    stood.run(0.1)
    joints = world.joints()
    world.step(1)
    assert world.joints().effort == pytest.approx(-8.0 * joints.velocity, abs=0.3)
    stood.run(2.5)
    assert stood.position[2] < 0.15


@pytest.mark.slow
def test_an_e_stop_ends_what_a_program_does_to_the_motors(stood):
    stood.stand_by_motors(1.2)
    assert stood.position[2] > 0.25
    stood.go2.bridge.disarm()
    stood.run(3.0)
    assert stood.position[2] < 0.15


def damp_by_call(rig):
    assert rig.call('sport', 1001)[0] == 0


def damp_by_remote(rig):
    rig.wire.come['rt/wirelesscontroller'].append(Remote(down=frozenset({'L2', 'B'})).message())


@pytest.mark.parametrize('pause', [0.0, 0.3])
@pytest.mark.parametrize('damp', [damp_by_call, damp_by_remote])
def test_damp_lets_go_of_motors_that_a_program_goes_on_commanding(rig, damp, pause):
    def command(seconds):
        for _ in range(round(seconds / DT)):
            rig.command(low_cmd(tau=1.0))
            rig.run(DT)
        return rig.go2.bridge.in_force

    assert command(0.02) is not None
    rig.run(pause)
    damp(rig)
    assert command(0.1) is None
    assert rig.said[-1] == 'LowCmd ignored: the robot was stopped (end the program)'
    rig.run(SILENCE_AFTER_A_STOP + 0.1)
    assert command(0.02) is not None


UNSEALED = low_cmd(q=1.0, kp=60.0, is_sealed=False)
NO_NUMBER = low_cmd(q=math.nan, kp=60.0)
PUSH = low_cmd(tau=20.0)
NEGATIVE_GAIN = low_cmd(kp=-60.0)


def hostile(tick):
    """Return a wrong checksum, no number, half a message, a negative gain, noise."""
    noise = np.random.default_rng(tick).bytes(812)
    return [UNSEALED, NO_NUMBER, PUSH[: 4 * (tick % 203)], NEGATIVE_GAIN, noise]


@pytest.fixture(scope='module')
def undisturbed():
    return Rig().stand_by_motors(1.2)


@pytest.mark.slow
@pytest.mark.parametrize('is_last', [False, True])
def test_what_is_wrong_changes_no_torque_and_is_said_once(is_last, undisturbed):
    rig = Rig()
    if is_last:
        # It comes after the right command of each instant, and takes its place in the queue.
        rig.run(DT)
        start, efforts = positions(rig.low_state), []
        for tick in range(600):
            share = min(tick / 500.0, 1.0)
            rig.command(low_cmd((1.0 - share) * start + share * STANDING, kp=60.0, kd=5.0))
            rig.run(DT)
            efforts.append(rig.efforts)
            for raw in hostile(tick):
                assert not rig.go2.bridge.low.take(raw, lambda: True)
    else:
        efforts = rig.stand_by_motors(1.2, each=hostile)
        # Only the last of an instant is looked at: what is wrong before it is not even read.
        assert rig.go2.bridge.low.refused == 0
    assert np.abs(np.array(efforts) - undisturbed).max() <= 0.1
    complaints = [line for line in rig.said if 'ignored' in line]
    assert len(complaints) == (len(set(complaints)) if is_last else 0)
    assert len(complaints) <= 6


@pytest.mark.slow
def test_ten_thousand_commands_a_second_are_as_good_as_five_hundred(undisturbed):
    rig = Rig()
    efforts = rig.stand_by_motors(1.2, each=lambda tick: 19 * [low_cmd(q=2.0, kp=60.0)])
    assert np.abs(efforts - undisturbed).max() <= 0.1


def test_of_two_programs_at_once_and_of_a_mode_without_torque_a_line_is_said():
    rig = Rig()
    for sender in (1, 1, 2, 2):  # one goes on by another publisher
        rig.wire.sent_by = sender
        rig.command(low_cmd(STANDING, kp=60.0))
        rig.run(DT)
    assert not any('LowCmd: no' in line or 'two programs' in line for line in rig.said)
    for sender in (1, 2, 1, 2):
        rig.wire.sent_by = sender
        rig.command(low_cmd(STANDING, kp=60.0, mode=np.arange(12) % 2))
        rig.run(DT)
    said = ' '.join(rig.said)
    assert said.count('two programs command the motors in turn') == 1
    assert said.count('the mode is not 1, in motors 0, 2, 4, 6, 8, 10') == 1
    rig.command(low_cmd(STANDING, mode=0))  # none is asked for
    rig.run(DT)
    assert said == ' '.join(rig.said)


@pytest.mark.slow
def test_stop_values_push_nothing(rig):
    rig.stand_by_motors(0.1, kp=0.0, kd=0.0)
    before = rig.efforts
    for _ in range(50):
        rig.command(low_cmd(POSITION_STOP, VELOCITY_STOP, kp=60.0, kd=5.0))
        rig.run(DT)
        assert np.abs(rig.efforts - before).max() <= 0.1


@pytest.mark.slow
def test_the_first_command_stops_our_controller_where_it_stands(rig):
    rig.call('sport', 1004)
    rig.run(2.2)
    assert (rig.state, rig.position[2] > 0.3) == ('fixed stand', True)
    rig.command(low_cmd(positions(rig.low_state), kp=60.0, kd=5.0))
    rig.run(2 * DT)
    assert rig.state == 'passive'
    assert rig.call('motion_switcher', 1001)[1] == '{"form": "0", "name": ""}'


@pytest.mark.slow
def test_released_motors_obey_no_key_until_our_controller_is_selected(rig):
    rig.call('motion_switcher', 1003)
    rig.go2.legs.press('2')
    rig.run(0.5)
    assert (rig.state, rig.position[2] < 0.15) == ('passive', True)
    assert rig.call('sport', 1004)[0] == 0
    rig.run(0.5)
    assert rig.state == 'passive'
    assert any('SelectMode first' in line for line in rig.said)
    assert rig.call('motion_switcher', 1002, name='mcf')[0] == 0
    rig.call('sport', 1004)
    rig.run(0.5)
    assert rig.state == 'fixed stand'


def test_a_command_that_does_not_count_is_said_once_and_moves_nothing():
    said = []
    low = LowLevel(said.append)
    assert not any(low.take(low_cmd(tau=5.0), lambda: False) for _ in range(100))
    assert low.step(DT) is None
    assert said == ['LowCmd ignored: the robot was stopped (end the program)']
    assert (low.refused, low.is_released) == (100, False)


def test_the_tick_counts_milliseconds_and_begins_anew_in_32_bits():
    assert [tick_of(0.002 * n) for n in range(4)] == [0, 2, 4, 6]
    assert tick_of(2**32 / 1e3 + 0.002) == 2


def test_states_are_told_at_20_hz_under_the_names_of_a_radio_link():
    rig = Rig()
    rig.run(1.0)
    told = {topic: rig.wire.told[topic] for topic in ('rt/lf/lowstate', 'rt/lf/sportmodestate')}
    assert [len(messages) for messages in told.values()] == [20, 20]
    assert set(told['rt/lf/lowstate']) < set(rig.wire.told['rt/lowstate'])
    ticks = [decode(LOW_STATE, raw)['tick'] for raw in told['rt/lf/lowstate']]
    assert set(np.diff(ticks)) == {50}
    stamps = [decode(SPORT_MODE_STATE, raw)['stamp'] for raw in told['rt/lf/sportmodestate']]
    assert [stamp['nanosec'] for stamp in stamps[:3]] == [0, 50_000_000, 100_000_000]


@pytest.mark.slow
def test_low_states_are_five_hundred_a_second_none_lost(rig):
    rig.run(1.0)
    told = rig.wire.told['rt/lowstate']
    assert len(told) == 500
    layout = Layout(LOW_STATE)
    ticks = [int(layout.field('tick').of(raw)[0]) for raw in told]
    assert set(np.diff(ticks)) == {2}


def synced(answers, ticks=200):
    """Return the torques under a program that answers ticks as `answers(tick)` says."""
    rig = Rig(is_synced=True)
    wire = rig.wire

    def answer(raw):
        tick = rig.low_state['tick']
        wire.come['rt/lowcmd'] += [
            low_cmd(STANDING * min(tick / 1000.0, 1.0), kp=40.0, kd=2.0, reserve=reserve)
            for reserve in answers(tick)
        ]

    wire.on_tell['rt/lowstate'] = answer
    efforts = []
    for _ in range(ticks):
        rig.run(DT)
        efforts.append(rig.efforts)
    return rig, np.array(efforts)


@pytest.mark.slow
def test_in_sync_each_tick_has_the_command_that_answers_it():
    rig, efforts = synced(lambda tick: [tick])
    assert rig.wire.waits == 200
    _, again = synced(lambda tick: [tick])
    assert np.array_equal(efforts, again)


@pytest.mark.slow
def test_in_sync_the_late_answer_to_another_tick_is_not_the_one_that_is_waited_for():
    efforts = {'late': [], 'in time': []}
    for kind, told in efforts.items():
        rig = Rig(is_synced=True)
        wire, ask = rig.wire, []

        def answer(raw, rig=rig, ask=ask, kind=kind):
            tick = rig.low_state['tick']
            ask[:] = [low_cmd(STANDING, kp=0.05 * tick, kd=2.0, reserve=tick)]
            late = low_cmd(STANDING, kp=0.05 * (tick - 2), kd=2.0, reserve=max(tick - 2, 0))
            rig.wire.come['rt/lowcmd'] += [late] if kind == 'late' and tick > 4 else ask

        def wait(topic, seconds, rig=rig, ask=ask):
            come = rig.wire.come['rt/lowcmd']
            come += [] if come else ask
            return True

        wire.on_tell['rt/lowstate'], wire.wait = answer, wait
        for _ in range(100):
            rig.run(DT)
            told.append(rig.efforts)
    assert np.array_equal(efforts['late'], efforts['in time'])


@pytest.mark.slow
def test_a_program_that_has_gone_is_waited_for_once():
    rig, _ = synced(lambda tick: [tick] if tick < 100 else [], ticks=200)
    assert rig.wire.waits == 50 + 100  # of a hundredth of a second
    assert 'no LowCmd for 1 s: time no longer waits for it' in rig.said


def test_in_sync_time_does_not_wait_for_a_program_that_damp_ignores():
    rig, _ = synced(lambda tick: [tick], ticks=10)
    waits = rig.wire.waits
    damp_by_call(rig)
    rig.run(0.1)
    assert rig.wire.waits == waits
    assert rig.said[-1] == 'LowCmd ignored: the robot was stopped (end the program)'


@pytest.mark.slow
def test_a_flood_of_wrong_commands_does_not_hold_physics():
    rig = Rig(is_synced=True)
    rig.command(low_cmd(kd=3.0))
    rig.run(DT)
    rig.wire.wait = lambda topic, seconds: rig.command(low_cmd(is_sealed=False)) or True
    rig.run(0.1)
    assert rig.go2.world.time > 0.1


@pytest.mark.slow
def test_in_sync_time_begins_with_a_command_or_a_call():
    rig = Rig(is_synced=True)
    looks = iter(range(50))
    rig.go2.run(lambda: next(looks, None) is None, 1.0)
    assert rig.go2.world.time == 0.0
    assert len(rig.wire.told['rt/lowstate']) > 10
    rig.wire.come['rt/api/sport/request'].append(request(1, 1004))
    rig.run(0.1)
    assert rig.go2.world.time == pytest.approx(0.1)


def test_in_sync_time_begins_with_a_key_that_makes_it_stand():
    rig = Rig(is_synced=True)
    for key, begins in (('1', False), ('2', True)):
        rig.go2.legs.press(key)
        looks = iter(range(50))
        rig.go2.run(lambda looks=looks: next(looks, None) is None, 0.1)
        assert (rig.go2.world.time > 0.0) == begins
