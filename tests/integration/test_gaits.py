# SPDX-License-Identifier: Apache-2.0
"""A gait that can be chosen follows its full stick, in each direction, and back to rest."""

from pathlib import Path

import numpy as np
import pytest
from quadruped_sim.presets import GAITS
from quadruped_sim.tuning import GaitParameters
from robot_description.packages import share_directory
import wasd

STEP, COUNT = 0.1, 8
# Ramp and settling before the speed counts, at most, of each axis [s]; some gaits gain speed
# slowly. Ahead comes last: from there the gait changes.
SETTLE = {2: 1.4, 1: 2.0, 0: 3.0}


def speed(dog: wasd.Go2, axis: int, full: float) -> float:
    """Return the mean speed along an axis [m/s], or about the vertical [rad/s], at last."""
    seen: list[float] = []
    for _ in range(round(SETTLE[axis] / STEP) + COUNT):
        dog.run(STEP)
        seen.append(dog.truth.planar_velocity[axis])
        halves = np.mean(np.reshape(seen[-COUNT:], (2, -1)), axis=1) if len(seen) >= COUNT else 0.0
        if np.abs(halves - full).max() < 0.05 * full:
            break  # in both halves: it does not only come by on its way to another speed
    return float(np.mean(seen[-COUNT:]))


def follow_each_stick(dog: wasd.Go2) -> None:
    """Give full stick along each axis that the gait has."""
    for axis in SETTLE:
        command = np.zeros(3)
        command[axis] = full = dog.full_stick[axis]
        if full == 0.0:
            continue
        dog.drive(*command)
        assert speed(dog, axis, full) == pytest.approx(full, rel=0.1)
        assert dog.state == 'move base'


def is_at_rest(dog: wasd.Go2) -> bool:
    return bool(np.abs(dog.truth.planar_velocity).max() < 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(('limits', 'count'), [('sport', 1), ('race', len(GAITS))])
def test_a_gait_follows_its_full_stick_and_changes_at_full_speed(limits: str, count: int) -> None:
    """A small sample of benchmarks/gait_limits.py: with `race`, one robot goes through all."""
    dog = wasd.Go2(seed=905, limits=limits)
    dog.press('2')
    dog.press('5')
    dog.run(1.2)  # as soon as it stands
    seen = []
    for number in range(count):
        if number:
            dog.press('n')
        dog.drive(9.0, 9.0, 9.0)
        dog.run(1.0)
        assert dog.state == 'move base'
        follow_each_stick(dog)
        seen.append(dog.full_stick)
    assert len(set(seen)) == count
    dog.drive(0.0)
    end = dog.time + 4.0  # it slows down by 1 m/s^2, from up to 2.5 m/s ahead
    while dog.time < end and not is_at_rest(dog):
        dog.run(STEP)
    dog.run(0.3)
    assert is_at_rest(dog)


@pytest.mark.slow
def test_a_wide_robot_walks_fast() -> None:
    path = share_directory('example-robot-data') / 'robots/solo_description/robots/solo12.urdf'
    dog = wasd.Go2(seed=907, gait='walk', description=str(path))
    dog.press('2')
    dog.press('5')
    dog.run(1.2)  # as soon as it stands
    fast = 0.9 * dog.full_stick[0]  # at full stick its fall is a matter of chance
    dog.drive(fast)
    dog.run(1.5)
    assert dog.state == 'move base'
    assert dog.truth.planar_velocity[0] == pytest.approx(fast, rel=0.1)


def test_the_page_says_what_the_rows_say() -> None:
    page = (Path(__file__).parents[2] / 'docs/gaits.md').read_text().split('\nFull stick is')[0]
    rows = {
        cells[1].strip(' `'): cells[3:8]
        for cells in (line.split('|') for line in page.split('\n') if line.startswith('| `'))
    }
    assert list(rows) == list(GAITS)
    gait = GaitParameters()
    for name, (offsets, period, stands, footprint, limits) in rows.items():
        row = GAITS[name]
        assert _numbers(offsets) == list(row.offsets)
        assert _numbers(footprint) == list(row.footprint)
        assert _numbers(limits) == list(row.limits)
        periods = row.period * gait.slow_period, row.period * gait.fast_period
        assert _numbers(period.replace('-', ',')) == pytest.approx(periods, abs=0.006)
        duties = row.longer + gait.slow_duty, row.longer + gait.fast_duty
        assert _numbers(stands.replace('-', ',')) == pytest.approx(duties, abs=1e-9)


def test_the_page_says_what_a_gait_does_at_once() -> None:
    page = (Path(__file__).parents[2] / 'docs/gaits.md').read_text()
    table = page.split('half axes ahead')[1].split('\n\n')[0]
    cells = [line.split('|')[1:3] for line in table.split('\n') if line.startswith('| `')]
    rows = {name.strip(' `'): tuple(_numbers(axes)) for name, axes in cells}
    assert rows == {name: row.able for name, row in GAITS.items()}


def _numbers(cell: str) -> list[float]:
    return [float(number) for number in cell.split(',')]
