# SPDX-License-Identifier: Apache-2.0
"""Data between the simulation and the page: snapshots with their history, and orders."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
import shlex
import time
from typing import ClassVar, NamedTuple

import numpy as np

# Seconds that the plots show, and samples a second.
SPAN, RATE = 10.0, 50.0
# A stick that is held counts for so long after the page last said so [s].
STICK_PROOF = 0.3
# What is looked at counts as such for so long after the page last said so [s].
ATTENTION = 1.0
# More orders than these at once are nobody's wish.
MOST_ORDERS = 100
# What a hand takes hold of: the number of a robot, and how often all was reset before.
Grip = tuple[int, int]


@dataclass(frozen=True)
class Columns:
    """
    The columns of the history.

    Column 0 is the time [s]; then three each of velocities (forward, left [m/s], turn [rad/s]),
    the controller's tick [ms], the real-time factor; then a force [N] and whether the plan has it
    stand for each foot, and the torque of each motor as a share of its limit.
    """

    feet: tuple[str, ...] = ()
    motors: tuple[str, ...] = ()

    COMMAND: ClassVar = 1
    ODOMETRY: ClassVar = 4
    TRUTH: ClassVar = 7
    TICK: ClassVar = 10
    PACE: ClassVar = 11
    FORCES: ClassVar = 12

    @property
    def stances(self) -> int:
        """The first column of the stances."""
        return self.FORCES + len(self.feet)

    @property
    def torques(self) -> int:
        """The first column of the torques."""
        return self.stances + len(self.feet)

    @property
    def width(self) -> int:
        """How many columns there are."""
        return self.torques + len(self.motors)


class History:
    """Keeps the last `length` rows of `width` numbers."""

    def __init__(self, length: int, width: int) -> None:
        self._length = length
        # Twice: so the last rows always lie one after the other.
        self._rows = np.zeros((2 * length, width))
        self._count = 0

    def add(self, row: np.ndarray) -> None:
        """Add a row, shape (width,); what is not finite counts as 0: it cannot be drawn."""
        at = self._count % self._length
        if not np.isfinite(row).all():
            row = np.nan_to_num(row, posinf=0.0, neginf=0.0)
        self._rows[at] = self._rows[at + self._length] = row
        self._count += 1

    def clear(self) -> None:
        """Forget all rows."""
        self._count = 0

    def last(self) -> np.ndarray:
        """Return a copy of the last rows, the oldest first, shape (n, width), n <= length."""
        known = min(self._count, self._length)
        end = self._count % self._length + self._length if known == self._length else known
        return self._rows[end - known : end].copy()


class Order(NamedTuple):
    """An order from the page: its kind, its target and its value."""

    what: str
    name: str = ''
    value: float = 0.0

    @classmethod
    def goal(cls, place: Sequence[float], toward: Sequence[float] | None) -> 'Order':
        """Return the wish to drive to a place of the map [m], and to look at another there."""
        (x, y), yaw = place, math.nan
        if toward is not None:
            yaw = math.atan2(toward[1] - y, toward[0] - x)
        return cls('goal', f'{x} {y} {yaw}')


class Choice(NamedTuple):
    """A state of a key, with a button: whether it is on, or why it is not available."""

    name: str
    key: str
    is_on: bool = False
    refusal: str = ''


class Setting(NamedTuple):
    """One of several that is chosen; `refusal` says why it cannot be changed."""

    name: str
    options: tuple[str, ...]
    chosen: str
    refusal: str = ''


class KeyCap(NamedTuple):
    """A key by its name as on `keys`, and what it does."""

    key: str
    does: str


class Stick(NamedTuple):
    """Deflections in [-1, 1]: forward, to the left, and counter-clockwise."""

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0


class Push(NamedTuple):
    """A hand's force in the world's axes [N], on what it took hold of and on nothing else."""

    force: tuple[float, float, float]
    grip: Grip


class StickUse(NamedTuple):
    """
    The use of the stick: `full` is the command of a full stick [m/s], [m/s], [rad/s].

    `words` say what it moves, or what is missing; `backward` is the full speed back [m/s], None
    where it is that ahead.
    """

    full: tuple[float, float, float]
    words: str
    sideways: bool = True
    backward: float | None = None

    def velocity(self, stick: Stick) -> tuple[float, float, float]:
        """Return the command of a stick [m/s], [m/s], [rad/s]."""
        ahead, left, turn = self.full
        if stick.forward < 0.0 and self.backward is not None:
            ahead = self.backward
        return ahead * stick.forward, left * stick.left, turn * stick.turn


class Start(NamedTuple):
    """
    The present robot and world, and the choices for a restart.

    `called` is what the user types before their names, `kept` are the options with which the same
    robot starts again; `refusal` says why it may not.
    """

    called: str
    robots: tuple[str, ...]
    robot: str
    worlds: tuple[str, ...]
    world: str
    kept: str = ''
    refusal: str = ''

    def offers(self, robot: str, world: str) -> bool:
        """Whether a run with a robot in a world may be started."""
        return not self.refusal and robot in self.robots and world in self.worlds

    def words(self, robot: str, world: str) -> str:
        """Return what the user would type for a run with a robot in a world."""
        kept = self.kept if robot == self.robot else ''
        # Before what is kept: that may end in words for ROS.
        words = (self.called, robot, '--world', shlex.quote(world), kept)
        return ' '.join(filter(None, words))


class PlanarPose(NamedTuple):
    """Where something is: x, y [m], yaw [rad]."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


def moved(points: np.ndarray, pose: PlanarPose, other: PlanarPose) -> np.ndarray:
    """Return points (n, 2) of one frame in another, by one thing's pose in both."""
    turn = other.yaw - pose.yaw
    cos, sin = math.cos(turn), math.sin(turn)
    rotation = np.array(((cos, -sin), (sin, cos)))
    return np.asarray((points - (pose.x, pose.y)) @ rotation.T + (other.x, other.y))


class Navigation(NamedTuple):
    """
    The robot's map, path and goal, in the map's axes [m].

    `cells` (rows, columns) are -1 where nothing is known, 0 free, to 100 occupied, 101 in a
    keepout area, each of a `resolution`; the corner of the first, lowest in x and y, is at
    `origin`. `number` is another one for another map. `pose` is where the robot believes to be,
    `path` (n, 2) the way to the `goal`; `state` says in a word what it does, `reason` why.
    `no_exploring` says why it cannot explore now, '' where it can; `is_following` whether it
    drives to several goals, also while it waits between two.
    """

    number: int
    cells: np.ndarray
    resolution: float
    origin: tuple[float, float]
    pose: PlanarPose
    path: np.ndarray
    goal: PlanarPose | None
    state: str
    reason: str
    no_exploring: str = ''
    is_following: bool = False


class Elevation(NamedTuple):
    """
    The heights around the robot that it has mapped, in the frame of its odometry [m].

    `heights` (rows along y, columns along x) are NaN where unknown, of cells of a `resolution`;
    `corner` is the least x and y. `number` is another one for other heights. `pose` is where the
    robot believes to be, `feet` (n, 2) where its feet are, `footholds` (n, 2) where those that
    swing are to land.
    """

    number: int
    heights: np.ndarray
    resolution: float
    corner: tuple[float, float]
    pose: PlanarPose = PlanarPose()
    feet: np.ndarray = np.empty((0, 2))
    footholds: np.ndarray = np.empty((0, 2))


@dataclass(frozen=True, kw_only=True)
class Marks:
    """
    Marks in the scene beside the robot, in the world's axes [m], [N].

    `place` and `rotation` are the base's as it is, `estimate` and `estimated_rotation` as the
    controller believes them to be, None where it does not say. `footholds` are where swinging feet
    are to land, `feet` and `forces` where feet press and how much; `path` is the way ahead.
    """

    place: np.ndarray
    rotation: np.ndarray
    command: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
    measured: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
    estimate: np.ndarray | None = None
    estimated_rotation: np.ndarray | None = None
    footholds: np.ndarray | None = None
    feet: np.ndarray | None = None
    forces: np.ndarray | None = None
    path: np.ndarray | None = None
    size: float = 0.4  # of the robot [m]
    height: float = 0.0  # of the ground under it [m]


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """
    One instant of a run: all data of the page.

    `robot` is which of `robots` is driven, `grip` what a push takes hold of now. `speed` is the
    factor of real time that is wanted, 0 as fast as it goes, `pace` the one that is reached.
    `history` has a row for each sample of the last SPAN seconds (see `Columns`), `trail` (n, 2)
    where the robot was [m]. `body`, `qpos` and `mocap` (positions and quaternions of moving boxes,
    shape (n, 7)) are MuJoCo's, `mass` is the robot's [kg]. `navigation` is None without a map.
    `elevation` is None while the page does not look at it, `no_elevation` says why there is never
    one.
    """

    time: float
    is_paused: bool
    speed: float
    pace: float
    robots: tuple[str, ...]
    robot: int
    grip: Grip
    state: str
    facts: tuple[str, ...]
    message: str
    choices: tuple[Choice, ...]
    settings: tuple[Setting, ...]
    stick: StickUse
    keys: tuple[KeyCap, ...]
    lit: frozenset[str]
    columns: Columns
    history: np.ndarray
    trail: np.ndarray
    pose: PlanarPose
    body: int
    mass: float
    marks: Marks
    qpos: np.ndarray
    start: Start
    mocap: np.ndarray
    navigation: Navigation | None = None
    elevation: Elevation | None = None
    no_elevation: str = ''
    stopped_by: str = ''  # the source of an e-stop that holds


def words_of(snapshot: Snapshot) -> list[str]:
    """Return a snapshot in lines of text."""
    pose, marks = snapshot.pose, snapshot.marks
    pace = 'paused' if snapshot.is_paused else f'x{snapshot.pace:.2f}'
    rows = (('command', marks.command), ('measured', marks.measured))
    chosen = (f'{setting.name:10} {setting.chosen}' for setting in snapshot.settings)
    return [
        f'{snapshot.robots[snapshot.robot]}   {snapshot.state}',
        f'{snapshot.time:.1f} s   {pace}',
        f'{"at":10} {pose.x:+.2f} {pose.y:+.2f} m   {pose.yaw:+.2f} rad',
        *(f'{name:10} {x:+.2f} {y:+.2f} m/s {turn:+.2f} rad/s' for name, (x, y, turn) in rows),
        *chosen,
        *snapshot.facts,
        *filter(None, [navigation_words(snapshot.navigation), snapshot.message]),
    ]


def navigation_words(navigation: Navigation | None) -> str:
    """Return what a navigator does, '' where there is none."""
    if navigation is None:
        return ''
    return ': '.join(filter(None, (f'goal {navigation.state}', navigation.reason)))


class _Held(NamedTuple):
    stick: Stick | None
    push: Push | None
    at: float


class Link:
    """
    Where the page and the simulation meet, without a lock: each side swaps whole values.

    The simulation sets `snapshot`, and takes `orders`, the `stick` and the `push` of a hand; the
    page the other way round. What is held must be renewed: what nobody renews is let go.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Take a clock of wall time [s]."""
        self._clock = clock
        self._orders: deque[Order] = deque(maxlen=MOST_ORDERS)
        self._held = _Held(None, None, 0.0)
        self._watched_until = -math.inf
        self.snapshot: Snapshot | None = None

    def order(self, order: Order) -> None:
        """Ask for something; by the page."""
        self._orders.append(order)

    def hold(self, stick: Stick | None, push: Push | None = None) -> None:
        """Say what is held, None what is not; by the page, in each frame."""
        self._held = _Held(stick, push, self._clock())

    def look(self) -> None:
        """Say that somebody looks at the elevation; by the page, in each frame."""
        self._watched_until = self._clock() + ATTENTION

    @property
    def is_looked_at(self) -> bool:
        """Whether somebody looks at the elevation."""
        return self._clock() <= self._watched_until

    def take_orders(self) -> list[Order]:
        """Return what was asked for since the last call."""
        taken = []
        while self._orders:
            taken.append(self._orders.popleft())
        return taken

    @property
    def stick(self) -> Stick | None:
        """The stick as it is held now; None where nobody holds it, or says so any more."""
        return self._proved.stick

    @property
    def has_stick(self) -> bool:
        """Whether the page held the stick in its last message, however old."""
        return self._held.stick is not None

    @property
    def push(self) -> Push | None:
        """How a hand pushes a robot now."""
        return self._proved.push

    @property
    def _proved(self) -> _Held:
        held = self._held
        is_old = self._clock() - held.at > STICK_PROOF
        return _Held(None, None, held.at) if is_old else held
