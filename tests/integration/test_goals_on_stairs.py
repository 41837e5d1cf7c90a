# SPDX-License-Identifier: Apache-2.0
"""A Go2 with its eyes open drives to goals on stairs; without, stairs are an obstacle."""

import math

import numpy as np
import pytest
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_navigation.records import FREE, OCCUPIED

pytestmark = [pytest.mark.long, pytest.mark.slow]

# Stairs of 15 cm begin at 0.8 m; their landing is from 2.3 to 5.9 m, 0.9 m high.
WORLD, LANDING = 'stairs:0.15', 0.9
RISERS = 0.8 + 0.3 * np.arange(6)
STAND = tuple(parse_key_script('0.3 2\n1.6 5', 'stand'))
# It has stood up and looked about by then [s].
LOOKED = 5


def begin(eyes, goal=None):
    """Return a run whose robot has stood up and looked about, or begun to drive to a goal."""
    run = Run(
        RunOptions(
            robot='go2',
            description='go2',
            preset='unitree',
            world=WORLD,
            eyes=eyes,
            map='',
            goals=(goal,) if goal else (),
            keys=STAND,
            speed=0.0,
            samples=True,
            seed=120,
        )
    )
    go_on(run, LOOKED)
    return run


def go_on(run, seconds):
    """Simulate so many seconds, or until a goal is reached or given up."""
    for _ in range(seconds):
        run.simulation.advance(round(1.0 / run.world.time_step))
        if run.report()['navigation']['goals']:
            break


def kinds(run, x):
    """Return the kinds of cells, (n, m), around x [m] and 1 m to either side, as planned with."""
    grid = run.navigations[0].navigator.seen
    steps = np.arange(-0.05, 0.06, 0.5 * grid.resolution)
    x, y = np.meshgrid(x + steps, np.arange(-1.0, 1.0, grid.resolution), indexing='ij')
    cells = grid.to_cells(np.column_stack((x.ravel(), y.ravel())))
    return grid.cells[tuple(cells.T)].reshape(x.shape)


def test_by_sight_it_drives_up_stairs_to_a_goal_on_the_landing():
    run = begin(eyes=True, goal=(2.8, 0.9, math.nan))
    try:
        go_on(run, 32)
        report = run.report()
        (goal,) = report['navigation']['goals']
        assert (goal['state'], goal['reason']) == ('arrived', '')
        assert report['falls'] == 0
        x, y, z = report['samples']['position'][-1]
        assert math.hypot(x - 2.8, y - 0.9) < 0.15
        assert z > LANDING + 0.2
        # What it has climbed is free.
        for riser in RISERS:
            assert (kinds(run, riser) == FREE).mean() > 0.9
    finally:
        run.close()


def test_without_sight_stairs_are_an_obstacle():
    # The second riser is as high as the lidar of a robot that lies; heights are not known then.
    run = begin(eyes=False)
    try:
        assert (kinds(run, RISERS[1]) == OCCUPIED).any(axis=0).all()
    finally:
        run.close()
