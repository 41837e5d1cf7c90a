# SPDX-License-Identifier: Apache-2.0
"""`--explore` in a run: it maps by itself, comes back, and gives way to all who drive."""

import math

import pytest
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

pytestmark = [pytest.mark.slow, pytest.mark.takes_up_to(240.0)]

# A room of 5 x 3 m with a wall that reaches half across.
ROOM = """<mujoco><worldbody>
<geom name="floor" type="plane" size="0 0 0.05" friction="1 0.02 0.001"/>
<geom type="box" pos="1.5 1.55 0.4" size="2.6 0.05 0.4"/>
<geom type="box" pos="1.5 -1.55 0.4" size="2.6 0.05 0.4"/>
<geom type="box" pos="-1.05 0 0.4" size="0.05 1.6 0.4"/>
<geom type="box" pos="4.05 0 0.4" size="0.05 1.6 0.4"/>
<geom type="box" pos="2 0.75 0.4" size="0.05 0.8 0.4"/>
</worldbody></mujoco>"""


@pytest.fixture
def run(tmp_path):
    world = tmp_path / 'room.xml'
    world.write_text(ROOM)
    options = RunOptions(
        robot='mbot',
        description='mbot',
        preset='mbot',
        world=str(world),
        speed=0.0,
        map='',
        explore=True,
    )
    run = Run(options)
    yield run
    run.close()


def go_on(run, seconds):
    run.simulation.advance(round(seconds / run.world.time_step))


def test_it_sees_the_whole_room_and_comes_back(run):
    unit = run.navigations[0].unit
    go_on(run, 1.0)
    assert unit.is_exploring
    while unit.is_exploring and run.world.time < 120.0:
        go_on(run, 1.0)
    assert not unit.is_exploring
    assert math.hypot(*run.world.base().position[:2]) < 0.15
    grid = unit.navigator.grid
    for place in ((3.5, 1.0), (3.5, -1.0), (0.0, 1.0), (-0.5, -1.0)):
        row, column = grid.to_cells(run.world.base().position[None, :2] * 0.0 + place)[0]
        assert grid.cells[row, column] == 0, place


def test_a_key_ends_it(run):
    unit = run.navigations[0].unit
    go_on(run, 1.0)
    run.press('i')
    go_on(run, 2.0)
    assert not unit.is_exploring
    assert unit.navigator.goal is None
