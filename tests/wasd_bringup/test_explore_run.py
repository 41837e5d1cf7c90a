# SPDX-License-Identifier: Apache-2.0
"""`--explore` in a run: it maps by itself, comes back, and gives way to all who drive."""

import math

import pytest
from wasd_bringup.page.bridge import CockpitBridge
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_cockpit.link import Order

pytestmark = [pytest.mark.slow, pytest.mark.takes_up_to(240.0)]

# A room of 3.6 x 3 m with a wall that reaches half across.
ROOM = """<mujoco><worldbody>
<geom name="floor" type="plane" size="0 0 0.05" friction="1 0.02 0.001"/>
<geom type="box" pos="0.8 1.55 0.4" size="1.9 0.05 0.4"/>
<geom type="box" pos="0.8 -1.55 0.4" size="1.9 0.05 0.4"/>
<geom type="box" pos="-1.05 0 0.4" size="0.05 1.6 0.4"/>
<geom type="box" pos="2.65 0 0.4" size="0.05 1.6 0.4"/>
<geom type="box" pos="1.4 0.75 0.4" size="0.05 0.8 0.4"/>
</worldbody></mujoco>"""


@pytest.fixture
def make(tmp_path):
    """Return a function that makes a run in the room."""
    world = tmp_path / 'room.xml'
    world.write_text(ROOM)
    runs = []

    def make(**more) -> Run:
        options = RunOptions(
            robot='mbot',
            description='mbot',
            preset='mbot',
            world=str(world),
            speed=0.0,
            map='',
            **more,
        )
        runs.append(Run(options))
        return runs[-1]

    yield make
    for run in runs:
        run.close()


@pytest.fixture
def run(make):
    return make(explore=True)


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
    for place in ((2.3, 1.0), (2.3, -1.0), (0.0, 1.0), (-0.5, -1.0)):
        row, column = grid.to_cells(run.world.base().position[None, :2] * 0.0 + place)[0]
        assert grid.cells[row, column] == 0, place


def test_a_key_ends_it(run):
    unit = run.navigations[0].unit
    go_on(run, 1.0)
    run.press('i')
    go_on(run, 2.0)
    assert not unit.is_exploring
    assert unit.navigator.goal is None


def test_the_page_begins_it_and_its_loss_ends_it(make):
    run = make()
    navigation = run.navigations[0]
    go_on(run, 1.0)
    assert navigation.view().no_exploring == ''
    bridge = CockpitBridge(run)
    bridge._link.order(Order('explore'))
    bridge.step(0.0, 0.0)
    bridge.close()
    assert navigation.unit.is_exploring
    assert navigation.view().no_exploring == 'it explores'
    go_on(run, 2.0)
    assert navigation.navigator.goal is not None
    navigation.lose_page()
    assert not navigation.unit.is_exploring
    assert navigation.navigator.goal is None


def test_a_patrol_goes_round_until_somebody_drives(make):
    run = make(goals=((0.3, 0.2, math.nan), (0.0, 0.0, math.nan)), patrol=True)
    navigation = run.navigations[0]
    while len(navigation.report()['goals']) < 3 and run.world.time < 90.0:
        go_on(run, 1.0)
    goals = navigation.report()['goals']
    assert [goal['state'] for goal in goals] == ['arrived'] * len(goals)
    assert [goal['goal'][0] for goal in goals[:3]] == [0.3, 0.0, 0.3]
    run.press('i')
    go_on(run, 2.0)
    assert navigation.navigator.goal is None


def test_a_patrol_ends_where_no_goal_can_be_reached(make):
    run = make(goals=((99.0, 0.0, 0.0), (0.0, 99.0, 0.0)), patrol=True)
    go_on(run, 3.0)
    navigation = run.navigations[0]
    assert {goal['state'] for goal in navigation.report()['goals']} == {'refused'}
    assert len(navigation.report()['goals']) == 2
