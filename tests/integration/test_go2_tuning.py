# SPDX-License-Identifier: Apache-2.0
"""`wasd go2` with other parameters of its leg controller: from a file, from ROS, in a replay."""

from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.slow

# Stand, then trot on the spot.
STEPS = '0.1 2\n0.2 4'
REFUSED = 'gait.slow_period must be >= 0.3 and <= 0.6 s, got -1.0'
DUTY = '/**/leg_controller:\n  ros__parameters:\n    gait: {slow_duty: 0.7}\n'


def period_and_duty(wasd: Any, *words: str) -> tuple[float, float]:
    """Step; return the mean time between touchdowns of a foot [s], and its duty."""
    (wasd.folder / 'steps.txt').write_text(STEPS)
    report = wasd.report('go2', '--duration', '3.8', '--play', 'steps.txt', *words)
    times, contacts = (np.array(report['samples'][name]) for name in ('t', 'contacts'))
    trots = times >= 1.7
    times, touches = times[trots], contacts[trots, 0].astype(bool)
    downs = np.flatnonzero(~touches[:-1] & touches[1:])
    first, last = downs[0], downs[-1]
    period = (times[last] - times[first]) / (len(downs) - 1)
    return float(period), float(touches[first + 1 : last + 1].mean())


def test_a_gait_that_is_given_shows_in_the_steps(wasd):
    """One value by each way in: without any of them the steps are others, or there are none."""
    (wasd.folder / 'period.yaml').write_text('gait: {slow_period: 0.6}\n')
    (wasd.folder / 'duty.yaml').write_text(DUTY)
    words = ('--controller', 'period.yaml', '--ros-args', '--params-file', 'duty.yaml')
    period, duty = period_and_duty(wasd, *words, '-p', 'leg_controller:step_in_place:=true')
    assert period == pytest.approx(0.6, abs=0.03)
    assert duty == pytest.approx(0.7, abs=0.06)


def test_without_them_the_steps_are_those_of_always(wasd):
    period, duty = period_and_duty(wasd, '--ros-args', '-p', 'step_in_place:=true')
    assert period == pytest.approx(0.45, abs=0.03)
    assert duty == pytest.approx(0.55, abs=0.06)


def test_a_replay_walks_by_the_same_file(wasd):
    (wasd.folder / 'slow.yaml').write_text('gait: {slow_period: 0.6}\nstep_in_place: true\n')
    words = ('--duration', '2.2', '--controller', 'slow.yaml', '--record', 'run.mcap')
    wasd.report('go2', *words, play=STEPS)
    done = wasd('replay', 'run.mcap', '--drive')
    assert (done.returncode, done.stdout) == (0, '110 of 110 recorded poses are identical\n')


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (('--controller', 'none.yaml'), '--controller none.yaml: no such file'),
        (('--controller', 'bad.yaml'), f'bad.yaml:1: {REFUSED}'),
        (
            ('--ros-args', '-p', 'gait.slow_period:=-1.0'),
            f'leg_controller: {REFUSED}',
        ),
        (
            ('--ros-args', '-p', 'gait.slow_periode:=1.0'),
            "leg_controller: unknown parameter 'gait.slow_periode', "
            'did you mean gait.slow_period?',
        ),
    ],
)
def test_a_bad_value_ends_it_with_one_line(wasd, words, message):
    (wasd.folder / 'bad.yaml').write_text('gait: {slow_period: -1}\n')
    done = wasd('go2', '--viewer', 'none', '--duration', '1', *words)
    assert (done.returncode, done.stderr) == (2, f'error: {message}\n')
