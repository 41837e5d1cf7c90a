# SPDX-License-Identifier: Apache-2.0
"""Benchmark of driving to points: random goals in flats that nobody tuned on, and trouble."""

from collections.abc import Callable, Sequence
import dataclasses
import math
import time
from typing import Any

from buildings import measure_step
from gaps import leave_gaps
from goals_physics import PhysicalRobot
from goals_trials import Course, Drive, Trouble
from kinematic import RATE, ROBOTS
import numpy as np
from table import format_count, Row
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.parts import warm_up
from wasd_navigation.planning.driver import Driver

FIRST_SEED = 1000
EACH = 5  # goals in a flat
LONGEST = 1.15  # way, as a share of the shortest
LONGEST_STEP = 25.0  # [ms]
SOON = 1.0  # a way is another one so long after something was put into it [s]
AT_ONCE = 0.2  # a goal is refused within this time [s]
FAR = 4.0  # goals in trouble are no nearer [m]
# How near and how well turned each must be [cm], [degrees]; what ships asks itself for as much.
NEAR = {'mbot': (5.0, 3.0), 'go2': (10.0, 5.0)}
# States of a drive that has ended elsewhere; in any other it is stuck on its way.
GIVEN_UP = ('refused', 'failed')


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure both robots."""
    flats, physical, tries = (2, 1, 6) if quick else (20, 4, 50)
    rows = []
    for name in ROBOTS:
        note(f'goals: {name} without physics')
        # Compiled before anything is timed, as the navigator does before it takes a goal.
        course = Course(ROBOTS[name], 0)
        warm_up(Mapper(), course.driver)
        _drives(course, 1)
        drives = [
            (seed, drive)
            for seed in range(FIRST_SEED, FIRST_SEED + flats)
            for drive in _drives(Course(ROBOTS[name], seed), EACH)
        ]
        rows += [
            _arrivals(f'{name} without physics', drives),
            _ways(name, drives),
            _cost(name, drives),
        ]
        note(f'goals: {name} with physics')
        with_physics = [
            (seed, drive)
            for seed in range(FIRST_SEED, FIRST_SEED + physical)
            for drive in _drives(_physical_course(name, seed), 2 if quick else EACH)
        ]
        rows.append(_arrivals(f'{name} with physics, its own lidar', with_physics))
        note(f'goals: {name}, refused and in trouble')
        rows += [_refusals(name, tries), _troubles(name, tries), leave_gaps(name, tries)]
        note(f'goals: {name} in large buildings')
        rows.append(measure_step(name, 1 if quick else 3))
    return rows


def _drives(course: Course, count: int) -> list[Drive]:
    return [course.drive(course.choose_goal()) for _ in range(count)]


def _physical_course(name: str, seed: int) -> Course:
    course = Course(ROBOTS[name], seed)
    course.moving = PhysicalRobot(name, ROBOTS[name], f'flat:{seed}', seed)
    return course


def _arrivals(name: str, drives: Sequence[tuple[int, Drive]]) -> Row:
    near, turned = NEAR[name.split()[0]]
    there = [
        drive.state == 'arrived'
        and 100.0 * drive.off <= near
        and math.degrees(drive.turned_off) <= turned
        and drive.gap > 0.0
        for _, drive in drives
    ]
    off = 100.0 * max(drive.off for _, drive in drives)
    angle = math.degrees(max(drive.turned_off for _, drive in drives))
    gap = 100.0 * min(drive.gap for _, drive in drives)
    return Row(
        what=f'goals, {name}: arrived without a touch',
        measured=f'{format_count(sum(there), len(there))}; {off:.1f} cm, {angle:.1f} deg off, '
        f'{gap:.1f} cm from obstacles at worst',
        must=f'all, <= {near:g} cm, {turned:g} deg',
        passed=all(there),
        trials=[drive.record(seed=seed) for seed, drive in drives],
    )


def _ways(name: str, drives: Sequence[tuple[int, Drive]]) -> Row:
    longer = [drive.way / drive.shortest for _, drive in drives]
    return Row(
        what=f'goals, {name}: way over the shortest for its width',
        measured=f'{np.median(longer):.3f}, at worst {max(longer):.3f}',
        must=f'<= {LONGEST}',
        passed=max(longer) <= LONGEST,
        trials=[{'seed': seed, 'longer': drive.way / drive.shortest} for seed, drive in drives],
    )


def _cost(name: str, drives: Sequence[tuple[int, Drive]]) -> Row:
    steps = 1e3 * np.concatenate([drive.steps for _, drive in drives])
    share = 0.1 * float(steps.mean()) * 20.0
    return Row(
        what=f'goals, {name}: CPU time of a step, 20 a second',
        measured=f'{np.median(steps):.2f} ms, p99 {np.percentile(steps, 99):.1f} ms, longest '
        f'{steps.max():.1f} ms; {share:.0f} % of a core',
        must=f'<= 20 % of a core, <= {LONGEST_STEP:g} ms: so long a key may wait',
        passed=share <= 20.0 and float(steps.max()) <= LONGEST_STEP,
    )


def _refusals(name: str, tries: int) -> Row:
    """Send a robot to where it cannot come, and see how soon it says so."""
    trials: list[dict[str, Any]] = []
    for index in range(tries):
        course = Course(ROBOTS[name], FIRST_SEED + index)
        goal, grid, kind = course.choose_shut_off()
        robot = course.robot
        # Nor is a place that is near enough what is looked for here.
        parameters = dataclasses.replace(robot.parameters, tolerance=0.0)
        driver = Driver(robot.limits, robot.footprint, parameters)
        driver.set_goal(goal)
        begin, steps = time.thread_time(), 0
        while driver.is_under_way and steps < 100:
            steps += 1
            scan = course.moving.scan(course.flat.boxes)
            driver.step(grid, 0, np.zeros(3), np.zeros(3), scan, 1.0 / RATE)
        took = max(time.thread_time() - begin, (steps - 1) / RATE)
        is_refused = driver.state == 'refused' and bool(driver.reason)
        trials.append({'kind': kind, 'took': took, 'reason': driver.reason, 'ok': is_refused})
    slowest = max(float(trial['took']) for trial in trials)
    refused = sum(bool(trial['ok']) for trial in trials)
    return Row(
        what=f'goals, {name}: refused where no way leads',
        measured=f'{format_count(refused, tries)}, slowest {slowest:.2f} s',
        must=f'all, <= {AT_ONCE} s, with the reason',
        passed=refused == tries and slowest <= AT_ONCE,
        trials=trials,
    )


def _troubles(name: str, tries: int) -> Row:
    """Put boxes into the way and close doors; see that nothing is touched."""
    trials: list[tuple[Drive, dict[str, Any]]] = []
    seed = FIRST_SEED + 500
    while len(trials) < tries:
        course = Course(ROBOTS[name], seed)
        for index in range(4):
            goal = course.choose_goal(FAR)
            trouble = Trouble(float(course.random.uniform(0.2, 2.0)), is_door=index % 2 == 1)
            drive = course.drive(goal, trouble)
            if trouble.put is not None and len(trials) < tries:
                kind = 'door' if index % 2 else 'box'
                trials.append((drive, drive.record(seed=seed, kind=kind)))
        seed += 1
    touched = sum(drive.gap <= 0.0 for drive, _ in trials)
    says = sum(drive.state in GIVEN_UP and bool(drive.reason) for drive, _ in trials)
    arrived = sum(drive.state == 'arrived' for drive, _ in trials)
    # Where there is no other way the one beside what is seen of a box may lead through its rest.
    slowest, latest = (
        max(
            (drive.replanned for drive, _ in trials if (drive.state == 'arrived') is is_new),
            default=0.0,
        )
        for is_new in (True, False)
    )
    return Row(
        what=f'goals, {name}: boxes in the way, doors closed',
        measured=f'{touched} of {tries} touched, slowest new way {slowest:.2f} s, '
        f'{arrived} arrived; {says} said why not, and knew it after {latest:.2f} s',
        must=f'0 touched, a new way <= {SOON} s; the others say why',
        passed=touched == 0 and slowest <= SOON and arrived + says == tries,
        trials=[record for _, record in trials],
    )
