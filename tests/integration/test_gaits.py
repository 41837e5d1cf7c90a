# SPDX-License-Identifier: Apache-2.0
"""A gait that can be chosen follows its full stick, in each direction, and back to rest."""

from pathlib import Path

import numpy as np
import pytest
from quadruped_sim.presets import GAITS
from quadruped_sim.tuning import GaitParameters
import wasd

STEPS, COUNT = 0.1, 12
# Ramp and settling before the speed counts, of each axis [s]; some gaits gain speed slowly.
SETTLE = (3.0, 2.0, 2.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('gait', 'limits'), [*((gait, 'sport') for gait in GAITS), ('gallop', 'race')]
)
def test_it_follows_its_full_stick(gait: str, limits: str) -> None:
    dog = wasd.Go2(seed=905, gait=gait, limits=limits)
    dog.press('2')
    dog.run(2.2)
    dog.press('5')
    for axis, speed in enumerate(dog.full_stick):
        if speed == 0.0:
            continue
        command = np.zeros(3)
        command[axis] = speed
        dog.drive(*command)
        dog.run(SETTLE[axis])
        seen = []
        for _ in range(COUNT):
            dog.run(STEPS)
            seen.append(dog.truth.planar_velocity[axis])
        assert dog.state == 'move base'
        assert np.mean(seen) == pytest.approx(speed, rel=0.1)
    dog.drive(0.0)
    dog.run(2.0)
    assert np.abs(dog.truth.planar_velocity).max() < 0.02


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


@pytest.mark.slow
def test_with_all_sticks_full_nothing_falls_nor_does_it_change_at_full_speed() -> None:
    """A small sample of benchmarks/gait_limits.py: each gait, and the change to the next one."""
    dog = wasd.Go2(seed=906, limits='race')
    dog.press('2')
    dog.run(2.2)
    dog.press('5')
    for _ in GAITS:
        dog.drive(9.0, 9.0, 9.0)
        dog.run(2.0)
        assert dog.state == 'move base'
        dog.press('n')
        dog.drive(9.0)
        dog.run(4.5)
        assert dog.state == 'move base'
        before = dog.truth.position
        dog.run(1.0)
        way = float(np.linalg.norm(dog.truth.position - before))
        assert way == pytest.approx(dog.full_stick[0], rel=0.12)


def _numbers(cell: str) -> list[float]:
    return [float(number) for number in cell.split(',')]
