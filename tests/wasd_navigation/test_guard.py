# SPDX-License-Identifier: Apache-2.0
"""The guard: against closed forms, and that nothing is touched and nobody is locked in."""

import math

from cases import for_all
import numpy as np
import pytest
from wasd_core.rotations import Pose
from wasd_navigation.guard import body_of, Clearance, Guard, Guarded, time_to_collision
from wasd_navigation.guard_parameters import GuardParameters
from wasd_navigation.odometry import Odometry
from wasd_navigation.parameters import Footprint
from wasd_navigation.records import Scan
from wasd_navigation.se2 import inverse, transform

ROUND = Footprint(radius=0.2)
LONG = Footprint(half_length=0.35, half_width=0.15)
BRAKING = np.array((1.0, 1.0, 4.0))
PADDING, TIME = GuardParameters().footprint_padding, GuardParameters().time_before_collision
DT = 0.05

LEVEL = Pose(np.zeros(3), np.eye(3))


def after_a_period(guard: Guard, asked: np.ndarray, odometry: Odometry | None) -> Guarded:
    """Let a period pass; return how much of a command is followed then."""
    guard.pass_time(DT)
    if odometry is not None:
        guard.move(odometry)
    return guard.step(asked)


def at(pose=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)) -> Odometry:
    return Odometry(np.array(pose, float), np.array(velocity, float), np.eye(3), LEVEL)


def wall(x: float, low: float = -2.0, high: float = 2.0) -> np.ndarray:
    ys = np.arange(low, high, 0.02)
    return np.column_stack((np.full(len(ys), x), ys))


def scan_of(points: np.ndarray) -> Scan:
    return Scan(np.zeros(2), points, np.ones(len(points), bool))


def guard_of(points: np.ndarray, footprint: Footprint = ROUND, **values) -> Guard:
    guard = Guard(footprint, BRAKING, GuardParameters(**values))
    guard.see(scan_of(points), at())
    return guard


def time_of(points, footprint, twist, horizon=20.0) -> float:
    points = np.array(points, float)
    none = Clearance(np.zeros(len(points)), 0.0, 0.0)
    found, _ = time_to_collision(points, none, body_of(footprint), np.array(twist), horizon)
    return found


def test_a_wall_straight_ahead_is_met_after_the_way_to_it() -> None:
    assert time_of([(1.2, 0.0)], ROUND, (0.5, 0.0, 0.0)) == pytest.approx(2.0, abs=1e-3)
    assert time_of([(1.35, 0.1)], LONG, (0.5, 0.0, 0.0)) == pytest.approx(2.0, abs=1e-3)
    assert time_of([(0.0, -0.75)], LONG, (0.0, -0.3, 0.0)) == pytest.approx(2.0, abs=1e-3)


def test_a_corner_that_turns_meets_a_point_at_the_angle_between() -> None:
    # It comes over the side, not the end: 0.37 m away that is at this bearing.
    bearing = math.asin(0.15 / 0.37)
    point = 0.37 * np.array((math.cos(1.0 + bearing), math.sin(1.0 + bearing)))
    assert time_of([point], LONG, (0.0, 0.0, 0.5)) == pytest.approx(2.0, abs=0.01)


def test_a_curve_meets_what_lies_on_its_circle() -> None:
    # A circle of 1 m about (0, 1): a quarter of it leads to (1, 1).
    found = time_of([(1.0, 1.0)], Footprint(radius=0.05), (0.5, 0.0, 0.5))
    assert found == pytest.approx((0.5 * math.pi - 2.0 * math.asin(0.025)) / 0.5, abs=0.01)


def test_what_is_not_on_the_curve_is_not_met() -> None:
    assert time_of([(1.0, 0.25), (-1.0, 0.0)], ROUND, (0.5, 0.0, 0.0)) == 20.0


def test_towards_a_wall_speed_falls_with_the_time_to_it() -> None:
    guard = guard_of(wall(0.2 + PADDING + 0.3))
    guarded = after_a_period(guard, np.array((0.5, 0.0, 0.0)), at())
    assert guarded.velocity[0] == pytest.approx(0.3 / TIME, rel=0.02)
    assert guarded.action == 'approach'
    assert guarded.why == 'something is 0.33 m ahead'


def test_far_from_everything_a_command_is_as_it_was() -> None:
    asked = np.array((0.5, 0.1, -0.4))
    guarded = after_a_period(guard_of(wall(3.0)), asked, at())
    assert (guarded.velocity == asked).all()
    assert guarded.action == ''


@for_all(('action', 'share'), [('slowdown', 0.5), ('stop', 0.0)])
def test_a_guard_may_slow_down_or_stop_instead(action: str, share: float) -> None:
    guard = guard_of(wall(0.65), action_type=action)
    guarded = after_a_period(guard, np.array((0.5, 0.0, 0.0)), at())
    assert guarded.velocity[0] == pytest.approx(share * 0.5)
    assert guarded.action == action


def test_no_faster_than_it_can_stop() -> None:
    room, reaction = 0.5, GuardParameters().reaction_time
    guard = guard_of(wall(0.2 + PADDING + room), time_before_collision=0.1)
    speed = after_a_period(guard, np.array((3.0, 0.0, 0.0)), at()).velocity[0]
    assert speed * reaction + 0.5 * speed**2 / BRAKING[0] == pytest.approx(room, rel=0.15)
    assert speed * reaction + 0.5 * speed**2 / BRAKING[0] <= room + 1e-6


@for_all('room', [0.0, 0.005, 0.02])
def test_near_a_wall_it_may_go_away_and_turn_but_come_no_nearer(room: float) -> None:
    guard = guard_of(wall(0.2 + room))
    for asked in ((-0.3, 0.0, 0.0), (0.0, 0.0, 1.0), (-0.3, 0.0, 0.5)):
        guarded = after_a_period(guard, np.array(asked), at())
        assert (guarded.velocity == asked).all(), asked
    for asked in ((0.3, 0.0, 0.0), (0.3, 0.0, 1.0), (0.001, 0.0, 0.0)):
        assert after_a_period(guard, np.array(asked), at()).velocity[0] == 0.0


def test_also_one_that_still_sways_towards_it_may_go_away() -> None:
    guard = guard_of(wall(0.21))
    guarded = after_a_period(guard, np.array((-0.3, 0.0, 0.0)), at(velocity=(0.04, 0.0, 0.0)))
    assert guarded.velocity[0] == -0.3
    guarded = after_a_period(guard, np.array((0.03, 0.0, 0.0)), at(velocity=(0.04, 0.0, 0.0)))
    assert guarded.velocity[0] == 0.0


def test_a_long_robot_leaves_a_gap_straight_and_does_not_turn_in_it() -> None:
    room = 0.02
    sides = np.arange(-1.0, 1.0, 0.02)
    gap = np.concatenate(
        [np.column_stack((sides, np.full(len(sides), side * (0.15 + room)))) for side in (-1, 1)]
    )
    guard = guard_of(gap, LONG)
    for asked in ((0.3, 0.0, 0.0), (-0.3, 0.0, 0.0)):
        assert after_a_period(guard, np.array(asked), at()).velocity[0] == pytest.approx(asked[0])
    assert after_a_period(guard, np.array((0.0, 0.0, 1.0)), at()).velocity[2] < 0.2


def test_where_only_the_way_to_a_stop_is_too_short_it_says_what_is_in_it() -> None:
    # What is behind it and to the left comes last, and is harmless.
    guard = guard_of(np.concatenate((wall(0.8, -0.3, 0.3), [(-0.6, 0.5)])))
    guarded = after_a_period(guard, np.array((0.3, 0.0, 0.0)), at(velocity=(1.2, 0.0, 0.0)))
    assert guarded.velocity[0] < 0.3
    assert guarded.why == 'something is 0.60 m ahead'


def test_it_turns_while_the_way_ahead_is_shut() -> None:
    guard = guard_of(wall(0.2 + PADDING))
    guarded = after_a_period(guard, np.array((0.5, 0.0, 1.0)), at())
    assert guarded.velocity == pytest.approx((0.0, 0.0, 1.0))
    assert guarded.action == 'approach'


def test_what_it_does_now_counts_as_well_as_what_is_asked() -> None:
    # A turn is harmless, but not at full speed past a wall that is near.
    beside = wall(0.2 + PADDING + 0.02)[:, ::-1]
    guard = guard_of(beside)
    asked = np.array((0.0, 0.0, 2.0))
    assert after_a_period(guard, asked, at()).velocity[2] == 2.0
    assert after_a_period(guard, asked, at(velocity=(1.0, 0.0, 0.0))).velocity[2] < 0.5


def test_what_has_to_be_kept_grows_with_the_way() -> None:
    # 4 cm beside the way of 1 m to it; the first centimetre of drift is in the padding.
    beside = np.array(((1.2, 0.24),))
    twist = np.array((0.5, 0.0, 0.0))
    for drift, is_met in ((0.03, False), (0.04, False), (0.07, True)):
        clearance = Clearance(np.zeros(1), drift, 0.01)
        found, _ = time_to_collision(beside, clearance, body_of(ROUND), twist, 20.0)
        assert (found < 20.0) == is_met, drift
    # It is met where what is to be kept is 4 cm: after 0.8 m and what the round front is short of.
    clearance = Clearance(np.zeros(1), 0.05 / 0.8, 0.01)
    found, _ = time_to_collision(np.array(((0.8, 0.24),)), clearance, body_of(ROUND), twist, 20.0)
    assert found == pytest.approx(0.8 / 0.5, rel=0.05)


def test_fast_it_does_not_pass_what_its_drift_might_touch_and_slowly_it_does() -> None:
    # A box to the left, as far off as the padding and 1 cm.
    box = np.array([(0.9 + 0.02 * index, 0.15 + PADDING + 0.01) for index in range(10)])
    guard = guard_of(box, LONG, drift=0.05)
    assert after_a_period(guard, np.array((0.3, 0.0, 0.0)), at()).action == ''
    fast = np.array((2.0, 0.0, 0.0))
    assert after_a_period(guard, fast, at()).action == 'approach'
    assert after_a_period(guard, fast, at(velocity=(2.0, 0.0, 0.0))).velocity[0] == 0.0
    steady = guard_of(box, LONG, drift=0.0)
    assert after_a_period(steady, fast, at()).action == ''


def test_a_turn_that_ends_at_once_must_not_lead_into_anything() -> None:
    # On its circle about (0, 1) the way is free; straight ahead it is not.
    post = np.array(((0.62, -0.02), (0.62, 0.02)))
    now = at(velocity=(0.8, 0.0, 0.8))
    guard = guard_of(post, Footprint(radius=0.2), time_before_collision=0.1)
    assert after_a_period(guard, np.array((0.8, 0.0, 0.8)), now).velocity[0] < 0.8
    aside = guard_of(post - (0.0, 0.6), Footprint(radius=0.2), time_before_collision=0.1)
    assert after_a_period(aside, np.array((0.8, 0.0, 0.8)), now).velocity[0] == 0.8


def test_a_scan_that_is_too_old_stops_it() -> None:
    guard = guard_of(wall(3.0))
    asked = np.array((0.3, 0.0, 0.0))
    steps = 0
    while after_a_period(guard, asked, at()).velocity.any():
        steps += 1
        assert steps < 100
    assert steps * DT == pytest.approx(GuardParameters().source_timeout, abs=DT)
    assert guard.last.action == 'stop'
    assert guard.last.why == 'the lidar is silent or blind for 0.5 s'
    guard.see(scan_of(wall(3.0)), at())
    assert after_a_period(guard, asked, at()).action == ''


def test_without_a_scan_or_odometry_it_stops() -> None:
    asked = np.array((0.3, 0.0, 0.0))
    guard = Guard(ROUND, BRAKING)
    assert after_a_period(guard, asked, at()).why == 'the lidar is silent or blind'
    assert after_a_period(guard_of(wall(3.0)), asked, None).why == 'odometry is silent'


def test_odometry_that_falls_silent_is_called_by_its_name_as_scans_wait_for_it() -> None:
    guard, asked = guard_of(wall(3.0)), np.array((0.3, 0.0, 0.0))
    assert after_a_period(guard, asked, at()).action == ''
    guard.pass_time(GuardParameters().source_timeout)
    guarded = after_a_period(guard, asked, None)
    assert (guarded.action, guarded.why) == ('stop', 'odometry is silent for 0.6 s')
    guard.see(scan_of(wall(3.0)), at())
    assert after_a_period(guard, asked, at()).action == ''


@for_all('odd', [math.nan, math.inf, 1e300, -1e9, 101.0])
def test_what_no_robot_can_do_is_refused_without_looking_ahead(odd: float) -> None:
    guard = guard_of(wall(3.0))
    for axis in range(3):
        asked = np.zeros(3)
        asked[axis] = odd
        guarded = after_a_period(guard, asked, at())
        assert (guarded.velocity == 0.0).all()
        assert guarded.why == 'the command is not within 20 m/s and rad/s'


def test_off_it_does_nothing() -> None:
    guard = guard_of(wall(0.3), enabled=False)
    assert after_a_period(guard, np.array((1.0, 0.0, 0.0)), at()) == (
        pytest.approx((1.0, 0, 0)),
        '',
        '',
    )


def ring(start: float, end: float, away: float = 5.0) -> np.ndarray:
    bearings = np.arange(start, end, 0.01)
    return away * np.column_stack((np.cos(bearings), np.sin(bearings)))


def test_what_the_lidar_does_not_see_any_more_is_remembered() -> None:
    post = np.array(((-0.6, 0.0), (-0.6, 0.02)))
    guard = Guard(ROUND, BRAKING)
    guard.see(scan_of(np.concatenate((post, ring(-math.pi, math.pi)))), at())
    guard.see(scan_of(ring(-2.9, 2.9)), at())  # it does not look behind now
    asked = np.array((-0.8, 0.0, 0.0))
    assert after_a_period(guard, asked, at()).velocity[0] > -0.5
    guard.see(scan_of(ring(-math.pi, math.pi)), at())  # somebody has taken it away
    assert after_a_period(guard, asked, at()).velocity[0] == -0.8


def test_points_stay_where_they_were_while_the_robot_moves() -> None:
    guard = guard_of(wall(2.0))
    here = at((1.0, 0.0, 0.5 * math.pi))  # the wall is 1 m to its right now
    assert after_a_period(guard, np.array((0.5, 0.0, 0.0)), here).action == ''
    assert after_a_period(guard, np.array((0.0, -0.9, 0.0)), here).action == 'approach'


def clutter(seed: int) -> np.ndarray:
    """Return points around boxes and posts in a room, shape (n, 2)."""
    random = np.random.default_rng(seed)
    half = random.uniform(1.2, 2.0)
    edge = np.arange(-half, half, 0.03)
    sides = [np.column_stack((edge, np.full(len(edge), side * half))) for side in (-1, 1)]
    parts = [*sides, *(side[:, ::-1] for side in sides)]
    for _ in range(5):
        away, bearing = random.uniform(0.7, 1.2), random.uniform(-math.pi, math.pi)
        middle = away * np.array((math.cos(bearing), math.sin(bearing)))
        turns = np.arange(0.0, 2.0 * math.pi, 0.2)
        parts.append(middle + 0.1 * np.column_stack((np.cos(turns), np.sin(turns))))
    return np.concatenate(parts)


def nearest(points: np.ndarray, pose: np.ndarray, footprint: Footprint) -> float:
    x, y = np.abs(transform(inverse(pose), points)).T
    out, side = x - footprint.half_length, y - footprint.half_width
    outside = np.hypot(np.maximum(out, 0.0), np.maximum(side, 0.0))
    return float((outside + np.minimum(np.maximum(out, side), 0.0)).min()) - footprint.radius


def hold_keys(seed: int, footprint: Footprint, full, guards: bool) -> tuple[float, float]:
    """Return the least room and the way of a robot with ramps, lag and noise [m]."""
    points, random = clutter(seed), np.random.default_rng((seed, 1))
    guard = Guard(footprint, BRAKING)
    pose, velocity, asked = np.zeros(3), np.zeros(3), np.zeros(3)
    least, way = math.inf, 0.0
    for step in range(160):
        odometry = at(pose, velocity + 0.01 * random.normal(size=3))
        if step % 4 == 0:  # 5 Hz
            noisy = transform(inverse(pose), points) + 0.005 * random.normal(size=points.shape)
            guard.see(scan_of(noisy), odometry)
        if step % 20 == 0:
            asked = random.choice((-1.0, 0.0, 1.0), size=3, p=(0.3, 0.1, 0.6)) * full
        wanted = after_a_period(guard, asked, odometry).velocity if guards else asked
        velocity = velocity + np.clip(wanted - velocity, -BRAKING * DT, BRAKING * DT)
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        vx, vy, wz = velocity
        pose = pose + DT * np.array((cos * vx - sin * vy, sin * vx + cos * vy, wz))
        way += DT * math.hypot(vx, vy)
        least = min(least, nearest(points, pose, footprint))
    return least, way


def drift_past(box: np.ndarray, drift: float) -> float:
    """Return the least room [m] of a walk at 2 m/s that drifts to the left, past a box."""
    guard = Guard(LONG, np.array((1.6, 1.0, 3.0)), GuardParameters(drift=drift))
    pose, velocity, least = np.zeros(3), np.array((2.0, 0.0, 0.0)), math.inf
    for _ in range(60):
        odometry = at(pose, velocity)
        guard.see(scan_of(transform(inverse(pose), box)), odometry)
        wanted = after_a_period(guard, np.array((2.0, 0.0, 0.0)), odometry).velocity[0]
        velocity[0] += np.clip(wanted - velocity[0], -1.6 * DT, 1.6 * DT)
        way = DT * velocity[0]
        pose = pose + way * np.array((1.0, 0.04, 0.0))
        least = min(least, nearest(box, pose, LONG))
    return least


def test_a_walk_that_drifts_towards_a_box_does_not_touch_it() -> None:
    sides = np.arange(0.0, 0.4, 0.02)
    front = np.column_stack((np.full(len(sides), 2.6), 0.15 + PADDING + 0.05 + sides))
    assert drift_past(front, 0.0) < 0.0
    assert drift_past(front, 0.05) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ('footprint', 'full'), [(ROUND, (1.0, 0.0, 4.0)), (LONG, (0.8, 0.5, 2.0))]
)
def test_keys_held_at_full_speed_touch_nothing_and_still_drive(footprint, full) -> None:
    seeds = range(6)
    free = [hold_keys(seed, footprint, full, guards=False)[0] for seed in seeds]
    assert sum(room < 0.0 for room in free) >= 3
    held = [hold_keys(seed, footprint, full, guards=True) for seed in seeds]
    assert min(room for room, _ in held) > 0.0
    assert np.median([way for _, way in held]) > 0.8


@for_all('after', [(5.0, 3.0, 1.0), (0.0, 0.0, -2.0), (-4.0, 0.5, 3.0)])
def test_what_is_known_stays_in_its_place_when_odometry_is_set_again(after) -> None:
    before = 2.0, -1.0, 0.5
    guard = Guard(ROUND, BRAKING, GuardParameters())
    guard.see(scan_of(wall(0.35)), at(before))
    asked = np.array((0.4, 0.0, 0.1))
    assert not guard.move(at(before))
    slowed = guard.step(asked).velocity
    assert 0.0 < slowed[0] < 0.4
    assert guard.move(at(after))
    assert guard.step(asked).velocity == pytest.approx(slowed, abs=1e-6)


@for_all('odd', [math.nan, math.inf, 1e300, -1e9, 101.0])
def test_odometry_that_no_robot_can_have_stops_it_without_looking_ahead(odd: float) -> None:
    guard = guard_of(wall(3.0))
    guarded = after_a_period(guard, np.array((0.3, 0.0, 0.0)), at(velocity=(odd, 0.0, 0.0)))
    assert (guarded.velocity == 0.0).all()
    assert guarded.why == 'odometry is not within 20 m/s and rad/s'
