# SPDX-License-Identifier: Apache-2.0
"""Modes and parameter files of `wasd mbot`, in whole scripted runs."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.slow

Report = dict[str, Any]
RunMbot = Callable[..., Report]
CURVE = '0 0.3 0 0.6\n3 0 0 0'


def odometry_error(report: Report) -> float:
    """Return the largest distance between odometry and truth [m]."""
    samples = report['samples']
    places = zip(samples['position'], samples['odom'], strict=True)
    return max(math.dist(truth[:2], odometry[:2]) for truth, odometry in places)


def test_fake_drives_the_same_way_as_the_simulation(report_of: RunMbot) -> None:
    fake = report_of('--mode', 'fake', twist=CURVE)
    simulated = report_of('--mode', 'sim', twist=CURVE)
    assert odometry_error(fake) < 1e-12
    ends = [np.array(report['samples']['position'][-1]) for report in (fake, simulated)]
    np.testing.assert_allclose(ends[0], ends[1], atol=0.01)
    yaws = [report['samples']['rpy'][-1][2] for report in (fake, simulated)]
    assert yaws[0] == pytest.approx(yaws[1], abs=0.01)
    assert fake['samples']['velocity'][100][0] == pytest.approx(0.3)


def test_fake_stops_when_commands_cease(report_of: RunMbot) -> None:
    samples = report_of('--mode', 'fake', '--duration', '4', twist='0 0.5 0 0\n1 stop')['samples']
    # As in the simulation: last published at 0.95 s, time-out 0.5 s, 0.5 m/s at 1 m/s^2.
    assert samples['velocity'][samples['t'].index(1.4)][0] == pytest.approx(0.5)
    assert samples['velocity'][samples['t'].index(2.0)][0] == pytest.approx(0.0, abs=1e-9)
    assert samples['position'][-1] == samples['position'][samples['t'].index(2.0)]


def test_the_boards_integer_law_is_slower_than_asked_for(report_of: RunMbot) -> None:
    speeds = {}
    for mode in ('float', 'arbotix'):
        samples = report_of('--mode', mode, '--duration', '4', twist='0 0.05 0 0')['samples']
        speeds[mode] = np.mean([velocity[0] for velocity in samples['velocity'][100:]])
    assert speeds['float'] == pytest.approx(0.05, rel=0.005)
    assert speeds['arbotix'] < 0.8 * 0.05


@pytest.mark.parametrize('speed', [0.05, 0.5])
def test_the_default_keeps_its_speed_against_a_load(report_of: RunMbot, speed: float) -> None:
    # 2 N from in front take 0.012 m/s of a motor that nobody controls.
    push = ('--push', '0 -2 0 0 9', '--duration', '6')
    samples = report_of(*push, twist=f'0 {speed} 0 0')['samples']
    position = np.array(samples['position'])[:, 0]
    assert position[-1] - position[-101] == pytest.approx(2.0 * speed, rel=0.005)


def test_the_width_of_the_tutorial_turns_0_684_of_what_is_asked_for(
    report_of: RunMbot, tmp_path: Path
) -> None:
    path = tmp_path / 'fake_mbot_arbotix.yaml'
    path.write_text(
        'controllers: {\n   base_controller: {\n       type: diff_controller, \n'
        '       base_frame_id: base_footprint, \n       base_width: 0.26, \n'
        '       ticks_meter: 4100, \n       Kp: 12, \n       Kd: 12, \n       Ki: 0, \n'
        '       Ko: 50, \n       accel_limit: 1.0 \n    }\n}\n'
    )
    turn = f'0 0 0 1\n{2 * math.pi} 0 0 0'
    samples = report_of('--controller', str(path), twist=turn)['samples']
    turned = np.unwrap([rpy[2] for rpy in samples['rpy']])[-1]
    believed = np.unwrap([odometry[2] for odometry in samples['odom']])[-1]
    assert believed == pytest.approx(2 * math.pi, abs=0.02)
    assert turned / believed == pytest.approx(0.26 / 0.38, abs=0.001)


@pytest.mark.parametrize('feedback', ['joint_states', 'ticks'])
def test_the_odometry_of_a_curve_is_within_a_millimetre(
    report_of: RunMbot, tmp_path: Path, feedback: str
) -> None:
    path = tmp_path / 'c.yaml'
    path.write_text(f'odometry_feedback: {feedback}')
    report = report_of('--controller', str(path), twist=CURVE)
    assert odometry_error(report) < 0.001


def test_with_stamped_commands_only_it_drives_the_same(report_of: RunMbot, tmp_path: Path) -> None:
    file = tmp_path / 'stamped.yaml'
    file.write_text('use_stamped_vel: true\n')  # ros2_controllers' default
    ends = [
        report_of(*arguments, twist=CURVE)['samples']['position'][-1]
        for arguments in ((), ('--controller', str(file)))
    ]
    np.testing.assert_allclose(*ends, atol=1e-3)


def test_beyond_the_wheels_speed_the_curve_is_kept(report_of: RunMbot, tmp_path: Path) -> None:
    path = tmp_path / 'c.yaml'
    path.write_text(
        'linear.x.max_velocity: 9.0\nangular.z.max_velocity: 20.0\n'
        'linear.x.max_acceleration: 2.0\nangular.z.max_acceleration: 4.0\n'
    )
    report = report_of('--controller', str(path), '--duration', '3', twist='0 2.0 0 4.0')
    late = np.array(report['samples']['velocity'])[-50:]
    # Wheels 1.24 and 2.76 m/s, where 1.5 m/s is all they have.
    assert (late[:, 0] / late[:, 2]).mean() == pytest.approx(0.5, rel=0.01)
    assert late[:, 0].mean() == pytest.approx(2.0 * 1.5 / 2.76, rel=0.02)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (('--controller', 'none.yaml'), '--controller none.yaml: no such file'),
        (('--mode', 'real'), "argument --mode: invalid choice: 'real'"),
        (('--controller', 'bad.yaml'), 'bad.yaml:1: Ko must be >= 1 and <= 1000, got 0.0'),
    ],
)
def test_a_mistake_is_said_in_one_line(
    wasd: Any, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / 'bad.yaml').write_text('Ko: 0')
    done = wasd('mbot', *arguments, '--duration', '1')
    assert done.returncode == 2
    assert done.stderr.startswith(f'error: {message}')
    assert done.stderr.count('\n') == 1
