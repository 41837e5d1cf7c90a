# SPDX-License-Identifier: Apache-2.0
"""What mbot does in whole scripted runs, by its own report."""

from collections.abc import Callable
import math
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.slow

Report = dict[str, Any]
RunMbot = Callable[..., Report]

HOLD_I = '0.5 i*90'


def displacement(report: Report) -> float:
    """Return how far the robot is from its start at the end [m]."""
    positions = report['samples']['position']
    return math.dist(positions[-1][:2], positions[0][:2])


def odometry_errors(report: Report) -> tuple[float, float]:
    """Return the largest distance [m] and angle [rad] between odometry and truth at any time."""
    samples = report['samples']
    places = zip(samples['position'], samples['odom'], strict=True)
    distance = max(math.dist(truth[:2], odometry[:2]) for truth, odometry in places)
    yaws = zip(samples['rpy'], samples['odom'], strict=True)
    angle = max(abs(math.remainder(rpy[2] - odometry[2], 2 * math.pi)) for rpy, odometry in yaws)
    return distance, angle


@pytest.fixture(scope='module')
def held(new_runner: Callable[[], Any]) -> Report:
    """Return the report of 8 s in which i is held for three."""
    report: Report = new_runner().report('mbot', '--duration', '8', play=HOLD_I)
    return report


def test_a_run_ends_by_itself_and_reports_what_the_contract_says(held: Report) -> None:
    report = held
    assert report['schema'] == 1
    assert (report['robot'], report['world'], report['seed']) == ('mbot', 'flat', 0)
    assert report['sim_time'] == 8.0
    assert (report['falls'], report['fell_at']) == (0, None)
    assert set(report['tick']) == {'median_us', 'p99_us', 'max_us', 'overruns'}
    samples = report['samples']
    assert {len(column) for column in samples.values()} == {400}
    np.testing.assert_allclose(np.diff(samples['t']), 0.02, atol=1e-9)


def test_holding_i_for_three_seconds_moves_as_far_as_the_ramp_law_says(held: Report) -> None:
    # Equal ramps up and down: distance = speed x (hold + release delay). 90 presses at 30 Hz
    # span 89/30 s, and a repeating key counts as released 0.12 s after the last one.
    law = 0.2 * (89 / 30 + 0.12)
    assert displacement(held) == pytest.approx(law, rel=0.03)
    assert 0.60 <= displacement(held) <= 0.64


def test_it_stands_still_1_3_s_after_the_key_is_let_go(held: Report) -> None:
    samples = held['samples']
    released = 0.5 + 89 / 30
    late = [
        abs(velocity[0])
        for time, velocity in zip(samples['t'], samples['velocity'], strict=True)
        if time >= released + 1.3
    ]
    assert max(late) < 1e-6


def test_odometry_is_within_half_a_millimetre_on_2_m_straight(report_of: RunMbot) -> None:
    report = report_of(twist='0 0.5 0 0\n4 0 0 0')
    distance, _ = odometry_errors(report)
    assert displacement(report) == pytest.approx(2.0, abs=0.002)
    assert distance <= 0.0005


def test_odometry_is_within_a_twentieth_of_a_degree_on_a_full_turn(report_of: RunMbot) -> None:
    report = report_of(twist=f'0 0 0 1\n{2 * math.pi} 0 0 0')
    turned = np.unwrap([odometry[2] for odometry in report['samples']['odom']])
    _, angle = odometry_errors(report)
    assert math.degrees(turned[-1]) == pytest.approx(360.0, abs=1.0)
    assert math.degrees(angle) <= 0.05


def test_a_run_in_real_time_gives_the_same_samples_as_one_at_full_speed(
    report_of: RunMbot,
) -> None:
    script = '0.2 i*20\n1.2 l*10'
    fast = report_of('--duration', '3', play=script, speed='0')
    slow = report_of('--duration', '3', play=script, speed='1')
    assert slow['samples'] == fast['samples']


def test_left_is_left(report_of: RunMbot) -> None:
    samples = report_of('--duration', '2', play='0 j*20')['samples']
    assert samples['rpy'][-1][2] > 0.3


def test_k_stops_at_once_without_the_ramp(report_of: RunMbot) -> None:
    samples = report_of('--duration', '3', play='0 i*60\n1.0 k')['samples']
    after = samples['command'][samples['t'].index(1.02)]
    assert after == [0.0, 0.0, 0.0]


def test_silence_on_cmd_vel_stops_it_within_the_time_out_and_the_ramp(
    report_of: RunMbot,
) -> None:
    # Published for the last time at 0.95 s; time-out 0.5 s, then 0.5 m/s at 1 m/s^2.
    samples = report_of('--duration', '4', twist='0 0.5 0 0\n1 stop')['samples']
    assert samples['command'][samples['t'].index(1.4)] == [0.5, 0.0, 0.0]
    assert samples['command'][samples['t'].index(1.5)] == [0.0, 0.0, 0.0]
    assert abs(samples['velocity'][samples['t'].index(2.1)][0]) < 1e-3


def test_a_command_that_is_not_a_number_changes_nothing(report_of: RunMbot) -> None:
    samples = report_of('--duration', '2', twist='0 0.2 0 0\n1 nan 0 0\n1.2 0.2 0 inf')['samples']
    assert samples['command'][samples['t'].index(1.3)] == [0.2, 0.0, 0.0]
    assert np.isfinite(samples['position']).all()


def test_a_box_in_the_way_stops_it_and_none_is_put_into_it(report_of: RunMbot) -> None:
    twist = '0 0.5 0 0'
    boxes = ('--box', '1 1.0 0', '--box', '0.5 0 0')
    free, blocked = (
        report_of('--duration', '3', *words, twist=twist)['samples']['position']
        for words in ((), boxes)
    )
    assert free[-1][0] > 1.1
    assert 0.4 < blocked[-1][0] < 0.8
    at = blocked.index(next(place for place in blocked if place[0] > 0.4))
    assert blocked[:at] == free[:at]


def test_a_push_moves_it_and_odometry_does_not_see_all_of_it(report_of: RunMbot) -> None:
    report = report_of('--duration', '2', '--push', '0.5 0 40 0 0.3')
    assert abs(report['samples']['position'][-1][1]) > 0.05
    assert abs(report['samples']['odom'][-1][1]) < 0.01


def test_a_wall_of_the_room_stops_it(report_of: RunMbot) -> None:
    samples = report_of('--world', 'room', '--duration', '6', twist='0 0.9 0 0')['samples']
    assert samples['position'][-1][0] == pytest.approx(3.0 - 0.2, abs=0.01)


def test_the_preset_ramps_latches_until_s(report_of: RunMbot) -> None:
    report = report_of('--preset', 'ramps', '--duration', '5', play='0.5 w\n2.5 s')
    # Half a metre a second within half a second, held for two, and down again.
    assert displacement(report) == pytest.approx(0.5 * 2.0, rel=0.05)
