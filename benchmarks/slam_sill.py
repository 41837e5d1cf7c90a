# SPDX-License-Identifier: Apache-2.0
"""
A sill in the way of mbot: physics, its own wheels that spin, its own lidar that does not see it.

A plain room, which the robot maps; what it believes comes from its odometry and its lidar alone.
"""

from collections.abc import Callable
import math
from pathlib import Path
import tempfile
from typing import Any

from cores import all_on_cores
from kinematic import ROBOTS
from mujoco_sim.sensors.lidar import Lidar
from mujoco_sim.sensors.mount import Site
import numpy as np
from robot_description.description import load_robot
from slam_logs import A1, as_matrix
from slam_physics import where
from table import format_count, Row
import wasd
from wasd_core.rotations import Pose
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.odometry import Odometry
from wasd_navigation.parts import make_pilot
from wasd_navigation.records import Grid, Ranges
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.se2 import compose, inverse

FIRST_SEED = 9400  # tuned on 9300 to 9319
TICK, SLICES, RATE = 0.02, 5, 20.0  # odometry [s], parts of it, commands [Hz]
SILL, DEPTH = 0.08, 0.06  # height and length of the sill [m]
NEAR, SOON = 0.05, 3.0  # of the truth [m], of the first touch [s]
LOOKS, HELD, BACK = 6.0, 10.0, 3.0  # it drives about first, then at the sill, then back [s]


def write_room(seed: int, folder: Path) -> tuple[Path, float]:
    """Write a room with a sill across it as MJCF; return its file and where the sill is, x [m]."""
    random = np.random.default_rng((seed, 17))
    length, width = random.uniform(4.0, 7.0), random.uniform(3.0, 5.0)
    sill = float(random.uniform(1.0, 0.5 * length - 0.9))  # there is room behind it
    walls = [
        (0.5 * length + 0.05, 0.0, 0.05, 0.5 * width + 0.1),
        (-0.5 * length - 0.05, 0.0, 0.05, 0.5 * width + 0.1),
        (0.0, 0.5 * width + 0.05, 0.5 * length, 0.05),
        (0.0, -0.5 * width - 0.05, 0.5 * length, 0.05),
    ]
    boxes = [(x, y, 0.4, a, b, 0.4) for x, y, a, b in walls]
    boxes.append((sill + 0.5 * DEPTH, 0.0, 0.5 * SILL, 0.5 * DEPTH, 0.5 * width, 0.5 * SILL))
    geoms = ''.join(
        f'<geom type="box" pos="{x} {y} {z}" size="{a} {b} {c}"/>' for x, y, z, a, b, c in boxes
    )
    floor = '<geom type="plane" size="10 10 0.1"/>'
    path = folder / f'sill{seed}.xml'
    path.write_text(f'<mujoco><worldbody>{floor}{geoms}</worldbody></mujoco>')
    return path, sill


class Ride:
    """
    mbot in a world, with a navigator that knows what the robot senses.

    It maps, or localises in a `grid`.
    """

    def __init__(self, world: Path, seed: int, grid: Grid | None = None) -> None:
        self.robot, settings = wasd.Mbot(world=str(world), seed=seed), ROBOTS['mbot'].settings
        self._lidar = Lidar(A1, Site(self.robot._world, load_robot('mbot').robot))
        self._random = np.random.default_rng((seed, 3))
        locator = Mapper() if grid is None else Localizer(grid)
        if isinstance(locator, Localizer):
            locator.start(np.zeros(3), 0.01 * np.eye(3))
        self.unit = RobotNavigator(settings, (locator, make_pilot(settings)))
        self.unit.send = lambda velocity: self.robot.drive(float(velocity[0]), float(velocity[2]))
        self.unit.senses.base_frame = 'base'
        self.unit.senses.place_frame('lidar', 'base', Pose(np.array((0.0, 0.0, 0.3)), np.eye(3)))
        self._begin, self._next_step = -math.inf, 0.0
        self.said: list[tuple[float, str]] = []  # times and words of what is said
        self.unit.say = lambda words: self.said.append((self.robot.time, words))
        self.errors: list[tuple[float, float]] = []  # times, and by how much the pose is off [m]
        self._truth: dict[float, np.ndarray] = {}
        self.unit.on_scan.append(self._judge)

    def step(self) -> None:
        """Go on for a tick."""
        robot, unit, state = self.robot, self.unit, self.robot.odometry
        now = round(robot.time, 6)
        self._truth[now] = where(robot)
        said = np.array((state.x, state.y, state.yaw))
        known = as_matrix(robot._robot.drive_unit.controller.covariance)
        level = Pose(np.zeros(3), np.eye(3))
        odometry = Odometry(said, np.array((state.linear, 0.0, state.angular)), known, level)
        unit.navigator.move(odometry)
        unit.senses.add_odometry(now, odometry)
        if now - self._begin >= 1.0 / A1.rate - 1e-9:
            self._begin = now
            self._lidar.begin(0, 0.0)
        if now >= self._next_step:
            self._next_step = now + 1.0 / RATE - 1e-9
            unit.step(now)
        for _ in range(SLICES):
            robot.run(TICK / SLICES)
            ranges = self._lidar.step(TICK / SLICES)
            if ranges is not None:
                self._tell(A1.err(ranges, self._random))

    def _tell(self, ranges: np.ndarray) -> None:
        angles = A1.angles
        limits = (A1.min_range, A1.max_range)
        said = Ranges(
            ranges.tolist(), float(angles[0]), A1.angle_increment, *limits, A1.time_increment
        )
        self.unit.senses.take_scan(self._begin, said, 'lidar')

    def _judge(self, now: float, _: Odometry) -> None:
        times = np.array(list(self._truth))
        truth = self._truth[float(times[np.argmin(np.abs(times - now))])]
        off = compose(inverse(truth), self.unit.navigator.locator.pose)
        self.errors.append((now, math.hypot(off[0], off[1])))

    def drive(self, forward: float, turn: float, seconds: float) -> None:
        """Drive by hand."""
        end = self.robot.time + seconds
        while self.robot.time < end - 1e-9:
            self.robot.drive(forward, turn)
            self.step()

    def go(self, x: float, y: float, patience: float) -> str:
        """Drive to a goal; return how it has ended."""
        self.unit.go(np.array((x, y, math.nan)))
        end = self.robot.time + patience
        while self.unit.navigator.goal is not None and self.robot.time < end:
            self.step()
        outcome = self.unit.navigator.outcome
        return 'none' if outcome is None else f'{outcome.state}: {outcome.reason}'


def map_room(seed: int, world: Path) -> Grid:
    """Return the map that the robot makes of a room on a small circle."""
    ride = Ride(world, seed)
    ride.drive(0.15, 0.5, 4.0 * math.pi)
    return ride.unit.navigator.grid


def meet_sill(seed: int, world: Path, sill: float, grid: Grid | None = None) -> dict[str, Any]:
    """Drive by hand at a sill for 10 s, then back."""
    random, ride = np.random.default_rng((seed, 18)), Ride(world, seed, grid)
    ride.drive(0.0, 2.0 * math.pi / LOOKS, LOOKS)
    speed, turn = random.uniform(0.15, 0.5), random.uniform(-0.1, 0.1)
    met = math.inf
    begin = ride.robot.time
    while ride.robot.time < begin + 4.0 / 0.15 and ride.robot.time < met + HELD:
        # A little curve: it meets the sill at an angle.
        ride.drive(speed, turn if met == math.inf else 0.0, TICK)
        if met == math.inf and where(ride.robot)[0] > sill - 0.22:
            met = ride.robot.time
    spun = ride.robot.odometry.position[0] - where(ride.robot)[0]
    worst = max(error for time, error in ride.errors)
    said = min((t for t, words in ride.said if 'stuck' in words), default=math.inf) - met
    ride.drive(-0.3, 0.0, BACK)
    after = ride.errors[-1][1]
    return {
        'seed': seed,
        'passed': bool(met < math.inf and (worst <= NEAR or said <= SOON)),
        'speed': speed,
        'spun': float(spun),
        'error': worst,
        'said': said,
        'error_after': after,
        'notice_after': ride.unit.navigator.notice,
    }


def go_over_sill(seed: int, world: Path, sill: float, grid: Grid | None = None) -> dict[str, Any]:
    """Send it to a goal behind a sill, then back to where it began."""
    ride = Ride(world, seed, grid)
    ride.drive(0.0, 2.0 * math.pi / LOOKS, LOOKS)
    ended = ride.go(sill + 0.5, 0.0, 120.0)
    back = ride.go(0.0, 0.0, 60.0)
    x, y, _ = where(ride.robot)
    return {
        'seed': seed,
        'passed': 'stuck' in ended and back.startswith('arrived') and math.hypot(x, y) < 0.1,
        'ended': ended,
        'back': back,
        'off': math.hypot(x, y),
        'error': max(error for _, error in ride.errors),
    }


def measure_sill(count: int, note: Callable[[str], None]) -> list[Row]:
    """Return the rows of so many rooms with a sill."""
    note('slam: sill')
    rooms = all_on_cores(try_room, range(FIRST_SEED, FIRST_SEED + count))
    return [_row(what, name, [room[what, name] for room in rooms]) for what, name in rooms[0]]


def try_room(seed: int) -> dict[tuple[str, str], dict[str, Any]]:
    """Try a room with a sill in each way; return the trials by what is tried and in what map."""
    with tempfile.TemporaryDirectory() as folder:
        world, sill = write_room(seed, Path(folder))
        maps = {'mapping': None, 'in its map': map_room(seed, world)}
        tries = {'keys': meet_sill, 'goal': go_over_sill}
        return {
            (what, name): try_it(seed, world, sill, grid)
            for name, grid in maps.items()
            for what, try_it in tries.items()
        }


def _row(what: str, name: str, done: list[dict[str, Any]]) -> Row:
    passed = sum(trial['passed'] for trial in done)
    error = 1e3 * max(trial['error'] for trial in done)
    measured = f'{format_count(passed, len(done))}, error {error:.0f} mm'
    if what == 'keys':
        said = max(trial['said'] for trial in done)
        spun = max(trial['spun'] for trial in done)
        measured += f', said after {said:.1f} s, wheels spun {spun:.1f} m, all at worst'
        sentence = f'driven at it by keys for {HELD:g} s'
        must = f'error <= {1e3 * NEAR:g} mm or stuck said within {SOON:g} s'
    else:
        sentence = 'a goal behind it, then one where it began'
        must = 'the first fails as stuck, the second is reached'
    return Row(
        what=f'slam: sill of {100 * SILL:g} cm, mbot in physics, A1, {name}; {sentence}',
        measured=measured,
        must=must,
        passed=passed == len(done),
        trials=done,
    )
