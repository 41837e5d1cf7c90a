# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of the guard: full speed held towards walls, boxes and people who stand, and freely.

With physics: wheels that a motor turns, legs that walk, their own lidars with their noise, which
turn. The guard is that of --guard: it knows the robot's scans and its own odometry. What is
touched is what MuJoCo says.
"""

from collections.abc import Callable, Sequence
import dataclasses
from functools import partial
import math
import tempfile
from typing import Any

from cores import all_on_cores
from goals_physics import PhysicalRobot
from goals_trials import Course
from kinematic import KinematicRobot, RATE, ROBOTS
import mujoco
import numpy as np
from table import format_count, Row
from wasd_bringup.run.sensing import DRIFT, NOISE, SWAY
from wasd_core.errors import UserError
from wasd_core.rotations import Pose
from wasd_navigation.guard import Guard
from wasd_navigation.guard_parameters import GuardParameters
from wasd_navigation.odometry import Odometry
from wasd_navigation.planning.motion import HARD
from wasd_navigation.records import Scan

FIRST_SEED = 4000
# Full speed (vx, vy, wz), what each robot brakes with, and how large rooms are for it.
FULL = {'mbot': (1.0, 0.0, 4.0), 'go2': (2.0, 0.8, 2.0)}
BRAKING = {'mbot': (1.0, 1.0, 5.0), 'go2': (1.6, 1.0, 3.0)}
# Who walks sways and drifts: --guard keeps more around it.
PARAMETERS = {
    'mbot': GuardParameters(),
    'go2': GuardParameters(footprint_padding=SWAY, drift=DRIFT),
}
SPACE = {'mbot': 1.0, 'go2': 1.7}
# A try takes so long, and each key is held so long [s].
LONGEST, HELD = 8.0, (0.5, 2.5)
SLOWED = 5.0  # [%]
EACH = 3  # goals in a flat
WORLD = """<mujoco><worldbody>
<geom name="floor" type="plane" size="0 0 0.05" friction="1 0.02 0.001"/>
{}
</worldbody></mujoco>"""


def arena(seed: int, space: float) -> tuple[str, np.ndarray]:
    """Return a room of walls, boxes and people around the origin, as MJCF and as boxes (n, 6)."""
    random = np.random.default_rng((seed, 41))
    half = space * random.uniform(1.4, 3.0, size=4)
    boxes = [
        (half[0] + 0.05, 0.0, 0.05, 6.0, 0.4, 0.0),
        (-half[1] - 0.05, 0.0, 0.05, 6.0, 0.4, 0.0),
        (0.0, half[2] + 0.05, 6.0, 0.05, 0.4, 0.0),
        (0.0, -half[3] - 0.05, 6.0, 0.05, 0.4, 0.0),
    ]
    for _ in range(int(random.integers(2, 6))):
        away, bearing = space * random.uniform(0.9, 2.6), random.uniform(-math.pi, math.pi)
        is_person = random.random() < 0.5
        sizes = (0.13, 0.2) if is_person else random.uniform(0.05, 0.4, size=2)
        place = away * math.cos(bearing), away * math.sin(bearing)
        if math.hypot(*sizes) + 0.55 < away:
            boxes.append((*place, *sizes, 0.85 if is_person else 0.4, random.uniform(0.0, 3.0)))
    text = ''.join(
        f'<geom type="box" pos="{x} {y} {height}" size="{length} {width} {height}" '
        f'euler="0 0 {math.degrees(yaw)}"/>'
        for x, y, length, width, height, yaw in boxes
    )
    return WORLD.format(text), np.array(boxes)


class Guarded(PhysicalRobot):
    """A robot with a guard, or without."""

    @property
    def touched(self) -> bool:
        """Whether a part of it touches something that is not the floor."""
        world = self._unit.world
        model, data = world.model, world.data
        for contact in data.contact[: data.ncon]:
            of_world = model.body_rootid[model.geom_bodyid[contact.geom]] == 0
            is_floor = model.geom_type[contact.geom] == mujoco.mjtGeom.mjGEOM_PLANE
            if of_world.any() and not of_world.all() and not is_floor.any():
                return True
        return False


def hold_keys(name: str, folder: str, guards: bool, seed: int) -> dict[str, Any]:
    """Hold keys at full speed towards what is around, one after the other; a fall is a touch."""
    text, boxes = arena(seed, SPACE[name])
    path = f'{folder}/arena_{seed}.xml'
    with open(path, 'w', encoding='utf-8') as file:
        file.write(text)
    moving = Guarded(name, ROBOTS[name], path, seed, guards)
    random = np.random.default_rng((seed, 42))
    full = np.array(FULL[name])
    touches = 0
    # A first look before anything moves.
    for _ in range(10):
        moving.step(np.zeros(3))
        touches += moving.touched
    begin, least, way = moving.time, math.inf, 0.0
    asked, until, has_fallen = np.zeros(3), 0.0, False
    while moving.time - begin < LONGEST:
        if moving.time - begin >= until:
            until += float(random.uniform(*HELD))
            signs = random.choice((-1.0, 0.0, 1.0), size=3, p=(0.3, 0.2, 0.5))
            if random.random() < 0.4:
                signs = np.array((1.0, 0.0, 0.0))
            asked = signs * full
        before = moving.pose
        try:
            moving.step(asked)
        except UserError:  # it has fallen, and follows nothing any more
            has_fallen = True
            break
        touches += moving.touched
        way += math.dist(before[:2], moving.pose[:2])
        least = min(least, moving.gap(boxes))
    return {
        'seed': seed,
        'touches': touches + has_fallen,
        'fell': has_fallen,
        'gap': least,
        'way': way,
    }


class GuardedCourse(Course):
    """A flat in which a robot without physics drives to goals, with a guard behind its driver."""

    def __init__(self, name: str, seed: int, guards: bool) -> None:
        robot = ROBOTS[name]
        if guards and robot.footprint.is_circle:
            # As --guard does: its own file gives the Go2 as much room as its guard keeps.
            margin = (PARAMETERS[name].footprint_padding + NOISE) / HARD
            parameters = dataclasses.replace(robot.parameters, margin=margin)
            robot = dataclasses.replace(robot, parameters=parameters)
        super().__init__(robot, seed)
        self.moving = _GuardedMotion(name, seed) if guards else self.moving


class _GuardedMotion(KinematicRobot):
    def __init__(self, name: str, seed: int) -> None:
        super().__init__(ROBOTS[name], np.zeros(3), seed)
        self._guard = Guard(self.robot.footprint, np.array(BRAKING[name]), PARAMETERS[name])

    def scan(self, boxes: np.ndarray) -> Scan | None:
        scan = super().scan(boxes)
        if scan is not None:
            self._guard.see(scan, self._odometry)
        return scan

    def step(self, asked: np.ndarray) -> None:
        self._guard.pass_time(1.0 / RATE)
        self._guard.move(self._odometry)
        super().step(self._guard.step(asked).velocity)

    @property
    def _odometry(self) -> Odometry:
        return Odometry(self.body, self.velocity, np.eye(3), Pose(np.zeros(3), np.eye(3)))


def drive_freely(name: str, seed: int) -> dict[str, Any]:
    """Return how long drives to the same goals take without and with a guard [s]."""
    took, goals = {}, []
    for guards in (False, True):
        course = GuardedCourse(name, seed, guards)
        total = 0.0
        for index in range(EACH):
            if not guards:
                goals.append(course.choose_goal())
            drive = course.drive(goals[index])
            total += drive.took if drive.state == 'arrived' else math.inf
            course.moving.pose, course.moving.velocity = goals[index].copy(), np.zeros(3)
        took['with' if guards else 'without'] = total
    return {'seed': seed, **took}


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Measure both robots."""
    tries = 6 if quick else 200
    rows = []
    for name in ROBOTS:
        note(f'guard: {name}, keys held at full speed')
        with tempfile.TemporaryDirectory() as folder:
            seeds = range(FIRST_SEED, FIRST_SEED + tries)
            held = all_on_cores(partial(hold_keys, name, folder, True), seeds)
            free = all_on_cores(partial(hold_keys, name, folder, False), seeds[: tries // 10])
        rows.append(_touches(name, held, free))
        note(f'guard: {name}, drives to goals')
        flats = range(FIRST_SEED, FIRST_SEED + (1 if quick else 10))
        rows.append(_slowing(name, all_on_cores(partial(drive_freely, name), flats)))
    return rows


def _touches(name: str, held: Sequence[dict[str, Any]], free: Sequence[dict[str, Any]]) -> Row:
    clear = sum(not trial['touches'] for trial in held)
    way = float(np.median([trial['way'] for trial in held]))
    gap = 100.0 * min(float(trial['gap']) for trial in held)
    touched = sum(bool(trial['touches']) for trial in free)
    vx, vy, wz = FULL[name]
    speeds = f'{vx:g} m/s, {wz:g} rad/s' if not vy else f'{vx:g} and {vy:g} m/s, {wz:g} rad/s'
    return Row(
        what=f'guard, {name} with physics: keys held at {speeds}, nothing touched',
        measured=f'{format_count(clear, len(held))}; footprint {gap:.1f} cm from obstacles at '
        f'worst, {way:.1f} m driven in {LONGEST:g} s; without a guard {touched} of {len(free)} '
        'touch',
        must='all',
        passed=clear == len(held),
        trials=[*held],
    )


def _slowing(name: str, drives: Sequence[dict[str, Any]]) -> Row:
    took = [sum(float(drive[key]) for drive in drives) for key in ('without', 'with')]
    slower = 100.0 * (took[1] / took[0] - 1.0)
    return Row(
        what=f'guard, {name}: drives to goals in flats take longer with it',
        measured=f'{slower:.1f} % of {took[0]:.0f} s, {len(drives) * EACH} goals',
        must=f'< {SLOWED:g} %',
        passed=slower < SLOWED,
        trials=[*drives],
    )
