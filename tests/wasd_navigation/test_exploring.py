# SPDX-License-Identifier: Apache-2.0
"""Exploring: which frontier is next, and when there is none."""

from itertools import permutations
import math

from navigation_stand_ins import odometry
import numpy as np
import pytest
from wasd_navigation.exploring import begin_tour, Explorer, frontiers
from wasd_navigation.parameters import Footprint, PlanningParameters
from wasd_navigation.planning.distances import measure_distances
from wasd_navigation.records import Grid, read_scan
from wasd_navigation.robot_navigator import RobotNavigator

HERE = np.array((1.0, 2.0, 0.0))


@pytest.mark.slow
def test_it_waits_for_a_lidar_that_sees_nothing_yet() -> None:
    unit, angles = RobotNavigator(), np.linspace(-math.pi, math.pi, 360)
    unit.navigator.move(odometry())
    unit.explore()
    ranges = np.full(360, 2.0)
    ranges[150:210] = math.inf
    for tick in range(80):
        unit.navigator.move(odometry(x=1e-6 * tick))
        if tick >= 40:
            unit.navigator.see(read_scan(ranges, angles, (0.1, 6.0)), odometry())
        unit.step(0.05 * tick)
        if tick < 40:
            assert unit.is_exploring
            assert unit.navigator.goal is None
    assert unit.navigator.goal is not None


def room(*unknown: tuple[float, float, float, float], walls=()) -> Grid:
    """Return a free room of 8 x 4 m with walls around, and unknown and occupied parts in it."""
    cells = np.zeros((80, 160), np.int8)
    for value, parts in ((-1, unknown), (100, walls)):
        for x, y, to_x, to_y in parts:
            rows, columns = (
                slice(round(a / 0.05), round(b / 0.05)) for a, b in ((y, to_y), (x, to_x))
            )
            cells[rows, columns] = value
    cells[:1] = cells[-1:] = cells[:, :1] = cells[:, -1:] = 100
    return Grid(cells, 0.05, (0.0, 0.0))


def explorer() -> Explorer:
    return Explorer(Footprint(radius=0.2), PlanningParameters())


def test_a_room_that_is_known_has_no_frontier() -> None:
    assert explorer().choose(room(), HERE) is None


def test_it_drives_to_where_the_unknown_begins() -> None:
    goal = explorer().choose(room((5.0, 0.0, 8.0, 4.0)), HERE)
    assert goal[0] == pytest.approx(5.0, abs=0.15)
    assert math.isnan(goal[2])


def test_of_two_it_takes_the_nearer() -> None:
    grid = room((6.0, 0.0, 8.0, 4.0), (0.0, 0.0, 0.6, 4.0))
    # Nearer, but behind it: half a turn costs less than four metres.
    assert explorer().choose(grid, HERE)[0] < 1.0


def test_cracks_and_what_is_too_narrow_to_drive_into_are_no_frontiers() -> None:
    crack = room((4.0, 1.0, 4.05, 1.05))
    assert explorer().choose(crack, HERE) is None
    niche = room((4.0, 0.05, 4.3, 0.5), walls=((3.9, 0.0, 4.0, 0.5), (4.3, 0.0, 4.4, 0.5)))
    assert explorer().choose(niche, HERE) is None


def test_what_is_behind_a_wall_without_a_door_is_left_alone() -> None:
    wall = ((4.0, 0.0, 4.1, 4.0),)
    assert explorer().choose(room((6.0, 0.0, 8.0, 4.0), walls=wall), HERE) is None


def test_a_frontier_that_was_driven_to_in_vain_is_not_chosen_again() -> None:
    grid, chosen = room((5.0, 0.0, 8.0, 4.0)), explorer()
    assert chosen.choose(grid, HERE) is not None
    assert not chosen.is_seen(grid, HERE)
    chosen.give_up()
    assert chosen.choose(grid, HERE) is None


def test_a_frontier_is_seen_when_what_was_behind_it_is_known() -> None:
    chosen = explorer()
    chosen.choose(room((5.0, 0.0, 8.0, 4.0)), HERE)
    assert not chosen.is_seen(room((5.1, 0.0, 8.0, 4.0)), HERE)
    assert chosen.is_seen(room((7.0, 0.0, 8.0, 4.0)), HERE)


def test_a_frontier_is_left_alone_once_no_way_leads_to_it() -> None:
    unknown, chosen = (5.0, 0.0, 8.0, 4.0), explorer()
    chosen.choose(room(unknown), HERE)
    assert not chosen.is_seen(room(unknown, walls=((4.0, 0.0, 4.1, 3.0),)), HERE)
    shut = room(unknown, walls=((4.0, 0.0, 4.1, 4.0),))
    assert chosen.is_seen(shut, HERE)
    assert chosen.choose(shut, HERE) is None


def test_frontiers_are_apart_where_a_wall_parts_them() -> None:
    grid = room((5.0, 0.0, 8.0, 4.0), walls=((4.0, 1.9, 8.0, 2.1),))
    distances = measure_distances(grid.cells == 100, 0.05)
    found = frontiers(grid.cells, distances, 0.23, 3)
    assert len(found) == 2
    assert all((part[:, 1] == 99).all() for part, _ in found)


def test_each_frontier_tells_how_much_is_unknown_behind_it() -> None:
    grid = room((5.0, 1.0, 6.0, 3.0))
    ((_, behind),) = frontiers(grid.cells, np.full(grid.cells.shape, 9.0), 0.23, 3)
    assert behind == 20 * 40


def test_little_that_is_unknown_is_worth_a_short_way_but_no_long_one() -> None:
    def small(x: float) -> Grid:
        return room((x, 1.9, x + 0.4, 2.3))

    assert explorer().choose(small(2.5), HERE) is not None
    assert explorer().choose(small(7.0), HERE) is None


def test_what_is_left_beside_the_way_home_is_looked_at_first() -> None:
    # The last is nearer to home, and a little nearer to the robot too.
    grid = room((0.0, 0.0, 1.0, 4.0), (6.7, 0.0, 8.0, 4.0))
    here, home = np.array((3.8, 2.0, 0.5 * math.pi)), np.array((1.2, 2.0, 0.0))
    assert explorer().choose(grid, here)[0] < 1.5
    assert explorer().choose(grid, here, home=home)[0] > 6.0


def test_who_stands_in_a_pocket_of_the_map_drives_out_of_it() -> None:
    # The way out is too narrow by the map, which drew a table too near after it had driven in.
    walls = ((1.5, 0.0, 1.6, 1.8), (1.5, 2.22, 1.6, 4.0))
    grid = room((5.0, 0.0, 8.0, 4.0), walls=walls)
    goal = explorer().choose(grid, HERE)
    assert goal is not None
    assert goal[0] == pytest.approx(5.0, abs=0.15)
    # A gap as narrow that is elsewhere is none.
    assert explorer().choose(grid, np.array((0.3, 0.5, 0.0))) is None


def test_a_tour_begins_where_the_shortest_of_all_orders_does() -> None:
    random = np.random.default_rng(3)
    for count in (1, 2, 5, 6):
        for has_end in (False, True):
            begins, legs = random.uniform(1.0, 9.0, count), random.uniform(1.0, 9.0, (7, 7))
            legs = legs[: count + has_end, : count + has_end]

            def length(order, begins=begins, legs=legs, has_end=has_end) -> float:
                stops = [*order, len(order)] if has_end else order
                pairs = zip(stops, stops[1:], strict=False)
                return begins[order[0]] + sum(legs[a, b] for a, b in pairs)

            best = min(permutations(range(count)), key=length)
            assert begin_tour(begins, legs) == best[0]
