# SPDX-License-Identifier: Apache-2.0
"""Squares driven by mbot's own odometry, both ways, with the simulator's truth beside them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import math
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from diff_drive_sim.controller_file import NODE_NAME
from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.umbmark import SquareRun
from diff_drive_sim.umbmark import Wheels
import numpy as np
import rclpy
import rclpy.logging
from wasd_core.node import init_ros
import yaml

from wasd_bringup.errors import UsageError
from wasd_bringup.options import RunOptions
from wasd_bringup.scripts import TWIST_RATE
from wasd_bringup.session import Session

# Commands last whole periods of the stream they are sent in [s].
TICK = 1.0 / TWIST_RATE
# Each run has its own speeds [m/s], [rad/s], so that it slips in its own way.
SPEEDS = (0.15, 0.30)
TURN_RATES = (0.5, 1.0)
# Before the next leg the robot has stood still for so long [s]; it is given up after the second.
REST, PATIENCE = 0.3, 60.0

Velocity = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class SquareTest:
    """What is driven: which robot, how large the squares are, how many each way."""

    description: str = 'mbot'
    package_path: tuple[Path, ...] = ()
    side: float = 1.0  # [m]
    runs: int = 3
    seed: int = 0

    @property
    def count(self) -> int:
        """How many squares there are."""
        return 2 * self.runs


class DrivenSquares(NamedTuple):
    """The runs, and the geometry that odometry believed in."""

    runs: list[SquareRun]
    geometry: DiffDriveGeometry

    @property
    def believed(self) -> Wheels:
        """The wheels of that geometry."""
        geometry = self.geometry
        return Wheels(geometry.left_radius, geometry.right_radius, geometry.wheel_separation)


def drive_squares(
    test: SquareTest,
    parameters: dict[str, Any],
    signals: Any,
    note: Callable[[int], None] = lambda number: None,
) -> DrivenSquares:
    """
    Drive the squares at full speed with these parameters of the controller.

    `note` is told the number of the square that is next.

    Raises:
        UserError: the robot cannot be driven, or does not come to rest.
        KeyboardInterrupt: `signals` has been requested to stop.
    """
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'controller.yaml'
        file.write_text(yaml.safe_dump(parameters), encoding='utf-8')
        options = RunOptions(
            robot='mbot',
            description=test.description,
            package_path=test.package_path,
            preset='mbot',
            mode='sim',
            controller=file if parameters else None,
            speed=0.0,
        )
        init_ros([])
        # What contradicts the description is what is to be found out: no need to warn each time.
        rclpy.logging.set_logger_level(NODE_NAME, rclpy.logging.LoggingSeverity.ERROR)
        try:
            for number in range(test.count):
                note(number)
                session = Session(options)
                try:
                    square = _Square(session, test, number)
                    session.run(_Either(signals, square))
                    if signals.requested:
                        raise KeyboardInterrupt
                    runs.append(square.run())
                finally:
                    session.close()
        finally:
            rclpy.logging.set_logger_level(NODE_NAME, rclpy.logging.LoggingSeverity.UNSET)
            rclpy.try_shutdown()
    return DrivenSquares(runs, square.geometry)


class _Either:
    """A stop that is requested from outside or when the square is done."""

    def __init__(self, signals: Any, square: '_Square') -> None:
        self._signals = signals
        self._square = square

    @property
    def requested(self) -> bool:
        return self._signals.requested or self._square.is_done


class _Square:
    """Drives one square in a session and writes down angles and truth at every control step."""

    def __init__(self, session: Session, test: SquareTest, number: int) -> None:
        self._session = session
        stack: Any = session.stack  # of a robot with wheels
        self._stack = stack
        self.geometry = stack.geometry
        self.is_done = False
        self._turn = 1 if number % 2 == 0 else -1
        self._rows: list[tuple[float, ...]] = []
        random = np.random.default_rng([test.seed, number // 2])
        speed, rate = random.uniform(*SPEEDS), random.uniform(*TURN_RATES)
        self._velocities = self._plan(test.side, speed, rate)
        schedule = session.simulation.schedule
        schedule.every(session.stack.period, self._record)
        schedule.every(TICK, self._drive)

    def run(self) -> SquareRun:
        """Return what was recorded."""
        rows = np.array(self._rows)
        x, y, yaw = self._stack.sample().odometry
        end = np.array([x, y]) + self._to_axle(yaw) - self._to_axle(0.0)
        return SquareRun(self._turn, rows[:, 0], rows[:, 1], rows[:, 2:], (end[0], end[1]))

    def _plan(self, side: float, speed: float, rate: float) -> Iterator[Velocity]:
        """Yield a velocity for every tick; legs are as fast as fits whole ticks."""
        corner = 0.5 * math.pi
        straight = max(1, round(side / speed / TICK))
        turning = max(1, round(corner / rate / TICK))
        for _ in range(4):
            yield from [(side / (straight * TICK), 0.0, 0.0)] * straight
            yield from self._stand()
            yield from [(0.0, 0.0, self._turn * corner / (turning * TICK))] * turning
            yield from self._stand()

    def _stand(self) -> Iterator[Velocity]:
        """Yield zero until the robot has stood still for a while."""
        rested = 0
        for _ in range(round(PATIENCE / TICK)):
            yield (0.0, 0.0, 0.0)
            rested = rested + 1 if self._stack.state == 'stopped' else 0
            if rested * TICK >= REST:
                return
        raise UsageError(f'the robot does not come to rest within {PATIENCE:.0f} s')

    def _drive(self) -> None:
        velocity = next(self._velocities, None)
        if velocity is None:
            self.is_done = True
        else:
            self._stack.drive(velocity)

    def _record(self) -> None:
        world, geometry = self._session.world, self.geometry
        angles = dict(zip(world.joint_names, world.joints().position.tolist(), strict=True))
        base = world.base()
        yaw = float(base.rpy[2])
        x, y = (base.position[:2] + self._to_axle(yaw)).tolist()
        left = geometry.left_direction * angles[geometry.left_joint]
        right = geometry.right_direction * angles[geometry.right_joint]
        self._rows.append((left, right, x, y, yaw))

    def _to_axle(self, yaw: float) -> np.ndarray:
        """Return where the axle's middle is from the base, in the world's axes [m], (2,)."""
        x, y = self.geometry.axle_x, self.geometry.axle_y
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([cos * x - sin * y, sin * x + cos * y])
