# SPDX-License-Identifier: Apache-2.0
"""What the Go2 does in whole scripted runs, by its own report: stand, sticks, cmd_vel, terrain."""

from collections.abc import Callable
import math
from typing import Any

import numpy as np
import pytest
from quadruped_sim.tuning import SafetyParameters

pytestmark = pytest.mark.slow

Report = dict[str, Any]

# The hips' and thighs' torque limit [N m].
HIP_TORQUE = 23.7
# It stands after a second, and then begins what was asked for meanwhile.
STAND_AND_MOVE_BASE = '0.02 2\n0.04 5'
# Stand, trot, then the sticks: forward, left, turn left.
TOUR = '0.1 2\n2.5 4\n2.6 w*6\n4.5 SPACE a*10\n6.1 SPACE j*5'
# cmd_vel: three axes at once, one that is not finite, silence, far too fast.
VELOCITIES = '1.2 0.5 0.2 0.3\n4 nan 0 0\n4.3 0.5 0.2 0.3\n5 stop\n7.4 10 0 0'


class Series:
    """The samples of a report as arrays, asked for by time."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self._samples = report['samples']
        self.time = np.array(self._samples['t'])

    def during(self, name: str, start: float, end: float) -> np.ndarray:
        """Return the samples with start <= t < end [s]."""
        chosen = (self.time >= start - 1e-6) & (self.time < end - 1e-6)
        return np.array(self._samples[name])[chosen]

    def at(self, name: str, time: float) -> Any:
        """Return the sample at a time [s]."""
        return self._samples[name][int(np.argmin(abs(self.time - time)))]

    def first(self, state: str) -> float:
        """Return when a state was first seen [s]."""
        return float(self.time[self._samples['state'].index(state)])

    @property
    def speed(self) -> np.ndarray:
        """Horizontal speed [m/s], shape (n,)."""
        return np.linalg.norm(np.array(self._samples['velocity'])[:, :2], axis=1)


@pytest.fixture(scope='module')
def run(new_runner: Callable[[], Any]) -> Callable[..., Series]:
    """Return a function that runs `wasd go2` on scripts."""
    return lambda *arguments, **scripts: Series(new_runner().report('go2', *arguments, **scripts))


@pytest.fixture(scope='module')
def tour(run: Callable[..., Series]) -> Series:
    """A tour from lying to turning, driven by the sticks."""
    return run('--duration', '7.7', play=TOUR)


@pytest.fixture(scope='module')
def driven(run: Callable[..., Series]) -> Series:
    """A run in move base, driven by cmd_vel."""
    return run('--duration', '9.4', play=STAND_AND_MOVE_BASE, twist=VELOCITIES)


def test_the_report_says_what_the_contract_says(tour: Series) -> None:
    report = tour.report
    assert report['schema'] == 1
    assert (report['robot'], report['estimator'], report['seed']) == ('go2', 'kalman', 0)
    assert report['sim_time'] == 7.7
    assert (report['falls'], report['fell_at']) == (0, None)
    samples = report['samples']
    assert {len(column) for column in samples.values()} == {385}
    assert np.array(samples['contacts']).shape == (385, 4)


def test_key_2_stands_it_up_in_two_seconds(tour: Series) -> None:
    pressed = tour.first('fixed stand')
    assert tour.at('position', 0.06)[2] < 0.15  # it begins lying
    heights = tour.during('position', pressed + 2.0, 2.5)[:, 2]
    assert heights.min() >= 0.31
    assert heights.max() <= 0.36
    assert tour.during('torque_max', 0.0, 2.5).max() <= HIP_TORQUE


def test_each_key_leads_to_its_state_at_once(tour: Series) -> None:
    assert tour.at('state', 0.0) == 'passive'
    assert tour.first('fixed stand') == pytest.approx(0.1, abs=0.03)
    assert tour.first('trotting') == pytest.approx(2.5, abs=0.03)


def test_w_moves_it_forward_by_a_twentieth_of_full_speed_a_press(tour: Series) -> None:
    velocity = tour.during('velocity', 3.3, 4.5).mean(axis=0)
    assert velocity[0] == pytest.approx(6 * 0.05 * 2.0, rel=0.1)
    np.testing.assert_allclose(velocity[1:], 0.0, atol=0.03)


def test_sticks_stay_where_they_are(tour: Series) -> None:
    commands = tour.during('command', 3.2, 4.5)
    np.testing.assert_allclose(commands, np.tile((0.6, 0.0, 0.0), (len(commands), 1)), atol=1e-12)


def test_sticks_at_once_are_obeyed_when_it_has_stood_up(run: Callable[..., Series]) -> None:
    """It used to fall: it stepped at the speed of its sticks while it still lay half."""
    hasty = run('--duration', '3.2', play='0.1 2\n0.2 4\n0.3 w*9')
    assert hasty.report['falls'] == 0
    assert hasty.speed[-1] > 0.5


def test_left_is_left(tour: Series) -> None:
    sideways = tour.during('velocity', 5.1, 6.1).mean(axis=0)
    assert sideways[1] == pytest.approx(10 * 0.05 * 0.8, rel=0.15)
    turning = tour.during('velocity', 6.7, 7.7).mean(axis=0)
    assert turning[2] == pytest.approx(5 * 0.05 * 2.0, rel=0.15)
    np.testing.assert_allclose(turning[:2], 0.0, atol=0.05)


def test_diagonal_legs_swing_together(tour: Series) -> None:
    contacts = tour.during('contacts', 3.2, 4.5)
    assert 0.3 < contacts.mean() < 0.95
    for one, other in ((0, 3), (1, 2)):  # FL with RR, FR with RL
        assert (contacts[:, one] == contacts[:, other]).mean() > 0.75


def test_odometry_follows_the_truth(tour: Series) -> None:
    positions = tour.during('position', 0.0, 7.7)[:, :2]
    path = np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()
    error = math.dist(tour.at('odom', 7.68)[:2], positions[-1])
    assert path > 1.5
    assert error <= 0.03 * path


def test_move_base_follows_cmd_vel(driven: Series) -> None:
    velocity = driven.during('velocity', 2.8, 4.0).mean(axis=0)
    np.testing.assert_allclose(velocity, [0.5, 0.2, 0.3], rtol=0.1, atol=0.005)


def test_a_command_ramps(driven: Series) -> None:
    forward = driven.during('command', 1.1, 1.7)[:, 0]
    assert np.diff(forward).max() <= 2.0 * 0.02 + 1e-9  # 2 m/s^2
    assert forward[-1] == 0.5


def test_a_command_that_is_not_finite_changes_nothing(driven: Series) -> None:
    commands = driven.during('command', 3.9, 4.3)
    np.testing.assert_array_equal(commands, np.tile((0.5, 0.2, 0.3), (len(commands), 1)))


def test_silence_brings_it_to_a_stand(driven: Series) -> None:
    # The last command came at 4.95 s; time-out 0.5 s, ramp 0.25 s, a second to stand.
    assert driven.at('command', 5.4) == [0.5, 0.2, 0.3]
    assert driven.at('command', 5.8) == [0.0, 0.0, 0.0]
    late = (driven.time >= 6.7) & (driven.time < 7.4)
    assert driven.speed[late].max() < 0.05
    assert driven.during('contacts', 6.9, 7.4).all()


def test_a_command_far_too_fast_is_clamped(driven: Series) -> None:
    commands = driven.during('command', 7.4, 9.4)
    assert commands[:, 0].max() == 2.0
    assert driven.at('velocity', 9.3)[0] > 1.5
    assert driven.report['falls'] == 0


def test_the_same_script_gives_the_same_samples_at_any_speed(wasd: Any) -> None:
    play = '0.02 2\n0.04 4\n1.1 w*8'
    pushed = ('--duration', '2.1', '--push', '1.6 0 60 0 0.1', '--seed', '7')
    fast = wasd.anew().report('go2', *pushed, play=play, speed='0')
    slow = wasd.report('go2', *pushed, play=play, speed='1')
    assert fast['samples'] == slow['samples']


def test_another_seed_gives_other_noise(run: Callable[..., Series]) -> None:
    def odometry(seed: str) -> Any:
        return run('--duration', '0.5', '--seed', seed, play='0 2').report['samples']['odom']

    assert odometry('1') != odometry('2')


def test_an_illegal_key_changes_nothing_and_says_why(new_runner: Callable[[], Any]) -> None:
    runner = new_runner()
    report = runner.report('go2', '--duration', '1.2', play='0.1 4\n0.3 5\n0.6 2\n0.8 0\n1.0 4')
    states = Series(report)
    assert states.at('state', 0.5) == 'passive'
    assert 'press 2 to stand, then 4 to trot (trotting cannot follow passive)' in runner.said
    assert states.at('state', 1.1) == 'balance test'
    cure = 'press 2 to stand, then 4 to trot'
    assert f'{cure} (trotting cannot follow balance test)' in runner.said


def test_it_goes_through_all_states_and_lies_down_without_a_fall(
    run: Callable[..., Series],
) -> None:
    play = '0.1 2\n2.4 3\n2.6 i*5\n3.4 2\n3.8 0\n4 j*10\n4.8 2\n5.2 9\n5.4 w*5\n6.2 2\n'
    play += '6.6 8\n8 2\n8.4 5\n9 2\n9.4 4\n10 2\n10.4 1'
    toured = run('--duration', '12.5', play=play)
    states = toured.report['samples']['state']
    order = [state for index, state in enumerate(states) if states[index - 1 : index] != [state]]
    stand = 'fixed stand'
    assert order == [
        'passive', stand, 'free stand', stand, 'balance test', stand, 'swing test', stand,
        'step test', stand, 'move base', stand, 'trotting', stand, 'passive',
    ]  # fmt: skip
    assert toured.report['falls'] == 0
    assert toured.at('position', 12.4)[2] < 0.20  # it sinks on damped legs
    assert math.hypot(*toured.at('position', 12.4)[:2]) < 0.3


def test_a_robot_that_is_tipped_over_goes_passive_and_reports_it(
    run: Callable[..., Series],
) -> None:
    script = '0.02 2\n0.04 4\n2.9 4'
    tipped = run('--duration', '3.2', '--push', '1.4 0 1000 0 0.2', play=script)
    assert tipped.report['falls'] == 1
    assert 1.4 < tipped.report['fell_at'] < 2.4
    # The trunk touches the ground before it lies on its side, or as it does.
    tilt = np.abs(tipped.during('rpy', 1.4, 3.2)[:, :2]).max(axis=1)
    is_tipped = tilt > SafetyParameters().tilt_max
    is_passive = tipped.during('state', 1.4, 3.2) == 'passive'
    # Rows are 20 ms apart.
    assert abs(int(is_passive.argmax()) - int(is_tipped.argmax())) <= 2
    # It stays passive, whatever is pressed but what gets it up.
    assert is_passive[is_passive.argmax() :].all()
    assert tipped.report['sim_time'] == 3.2


def test_a_sideways_push_does_not_tip_a_trotting_robot(run: Callable[..., Series]) -> None:
    pushed = run('--duration', '3.6', '--push', '2.1 0 150 0 0.1', play='0.02 2\n0.04 4\n1.1 w*5')
    assert pushed.report['falls'] == 0
    assert pushed.at('state', 3.5) == 'trotting'
    assert abs(pushed.during('velocity', 2.2, 2.4)[:, 1]).max() > 0.4  # it was felt


def test_it_climbs_a_slope_of_15_degrees(run: Callable[..., Series]) -> None:
    climbed = run(
        '--world', 'slope:15', '--duration', '6.4', play=STAND_AND_MOVE_BASE, twist='1.1 0.5 0 0'
    )
    assert climbed.report['falls'] == 0
    x, _, z = climbed.at('position', 6.3)
    assert x > 2.0
    # The slope begins 0.8 m ahead.
    assert z == pytest.approx(0.3 + (x - 0.8) * math.tan(math.radians(15)), abs=0.05)
    assert climbed.during('rpy', 4.9, 6.4)[:, 1].mean() == pytest.approx(-0.26, abs=0.06)


def test_its_chin_clears_the_second_stair_of_12_cm(run: Callable[..., Series]) -> None:
    """The fore feet look for the top of the first one meanwhile."""
    stairs = ('--world', 'stairs:0.12', '--duration', '4.1')
    climbed = run(*stairs, play=STAND_AND_MOVE_BASE, twist='1.3 0.5 0 0')
    assert climbed.report['falls'] == 0
    assert climbed.at('position', 4.0)[0] > 1.0


def test_full_stick_with_guides_limits_and_the_truth_is_0_4_metres_a_second(
    run: Callable[..., Series],
) -> None:
    options = ('--limits', 'guide', '--estimator', 'truth', '--duration', '4')
    guided = run(*options, play='0.02 2\n0.04 4\n1.1 w*25')
    assert guided.report['estimator'] == 'truth'
    assert guided.at('command', 3.9) == [0.4, 0.0, 0.0]
    velocity = guided.during('velocity', 2.8, 4.0).mean(axis=0)
    np.testing.assert_allclose(velocity, [0.4, 0.0, 0.0], atol=0.02)
    # Without a filter, odometry is the truth.
    np.testing.assert_allclose(
        guided.during('odom', 1.5, 4.0)[:, :2],
        guided.during('position', 1.5, 4.0)[:, :2],
        atol=0.01,
    )


def test_the_tutorials_keymap_drives_while_w_is_down(run: Callable[..., Series]) -> None:
    held = run('--preset', 'go2', '--duration', '4.8', play='0.02 2\n0.04 5\n1.1 w*60')
    released = 1.1 + 59 / 30
    assert held.at('state', 1.0) == 'move base'
    assert held.during('command', 0.0, 4.8)[:, 0].max() == pytest.approx(0.8)
    velocity = held.during('velocity', 2.2, released).mean(axis=0)
    np.testing.assert_allclose(velocity, [0.8, 0.0, 0.0], atol=0.05)
    assert held.speed[-25:].max() < 0.05  # it stands again
