# SPDX-License-Identifier: Apache-2.0
"""
Chooses the best motion of the next seconds: model predictive path integral control.

Many motions around the last best one are tried, and weighted by the exponential of what they cost
(Williams, Wagener, Goldfain and others, Information Theoretic MPC for Model-Based Reinforcement
Learning, 2017, Alg. 2). Some of them are not random but what simple drivers would do: follow the
way, turn, back up, stand. So one that is good is there from the first step on.
"""

import math
from typing import NamedTuple

import numpy as np

from wasd_navigation.planning.distances import fast, Field, look_up
from wasd_navigation.planning.motion import Base, clearance, move
from wasd_navigation.se2 import wrap

STEP = 0.1  # of a motion [s]
# A bank of noise is drawn once; each step takes the next part of it.
_BANK = 8
# Noise is drawn at every so many steps, and runs straight between.
_KNOT = 6
# Standard deviation of the noise as a share of the largest velocities.
_SPREAD = 0.4
# Costs differ by this much [m of way] where weights differ by e.
_TEMPERATURE = 0.04
# What costs how much [m of way]: a step nearer than the margin, one that touches; a second at
# no comfort; a radian turned; a metre of any way, and one backward.
_TOO_NEAR, _TOUCHES, _DISCOMFORT = 3.0, 30.0, 0.1
_TURNING, _LENGTH, _BACKWARD = 0.01, 0.6, 0.5
# Somebody near a robot that stands costs this share of what he costs one that moves: if he walks
# into it, he is to blame. It stands below a speed [m/s]; a turn counts as that of its rim, which
# is so far out [m].
_NOT_TO_BLAME, _STANDING, _RIM = 0.2, 0.05, 0.3
# It stands while somebody walks by so near [m]: he may turn on his heel.
_BESIDE = 0.1
# Who walks this near may turn on his heel [m]; who stands, but moved a short while ago, may step
# towards the robot so fast [m/s], unless it leaves him: by the cosine between its way and his.
_NEAR, _STEPS, _LEFT = 0.4, 0.6, 0.5
# What is foreseen counts less by this share each second; so fast somebody may leave the line that
# he walks on [m/s].
_DOUBT, _TURNS = 0.2, 0.3
# Simple drivers: looks ahead [m] and shares of full speed of those that follow the way; and four
# that turn left, turn right, back up and stand.
_FOLLOWERS = 6
DRIVERS = _FOLLOWERS + 4


class Scene(NamedTuple):
    """The input of a motion's cost; the path (x, y, yaw), shape (n, 3), leads to the goal."""

    distances: Field
    values: Field
    circles: np.ndarray
    way: np.ndarray
    keep: tuple[float, float]  # what all motions keep, and comfort [m]
    movers: np.ndarray  # (n, 5): x, y, vx, vy and radius of those who move [m], [m/s]


class Sampler:
    """
    Chooses the velocity of the next step; keeps the motion around it.

    `plan`, shape (horizon, 3), are the velocities to come, one per STEP.
    """

    def __init__(self, base: Base, samples: int, horizon: int) -> None:
        self._base = base
        random = np.random.default_rng(16)
        knots = -(-horizon // _KNOT) + 1
        drawn = random.normal(size=(_BANK, samples, knots, 3)) * _SPREAD * base.most
        at = np.arange(horizon) / _KNOT
        left, share = at.astype(int), (at % 1.0)[:, None]
        noise = (1.0 - share) * drawn[:, :, left] + share * drawn[:, :, left + 1]
        self._noise = noise.astype(np.float32)
        self._costs = np.empty(samples)
        self._motions = np.empty((samples, horizon, 3))
        self.plan = np.zeros((horizon, 3))
        self.reset()

    def reset(self) -> None:
        """Know of no motion."""
        self.plan[:] = 0.0
        self._turn = 0

    def step(self, state: np.ndarray, scene: Scene, dt: float) -> np.ndarray:
        """Return the velocity (3,) to ask for in a state (6,), `dt` [s] after the last step."""
        later = np.arange(len(self.plan)) + dt / STEP
        for axis in range(3):
            self.plan[:, axis] = np.interp(later, np.arange(len(self.plan)), self.plan[:, axis])
        np.add(self.plan, self._noise[self._turn % _BANK], out=self._motions)
        self._turn += 1
        self._motions[-1] = self.plan
        _try_all(self._motions, state, scene, self._base, self._costs)
        weights = np.exp((self._costs.min() - self._costs) / _TEMPERATURE)
        np.einsum('k,kta->ta', weights / weights.sum(), self._motions, out=self.plan)
        first: np.ndarray = self.plan[0].copy()
        return first

    def foresee(self, state: np.ndarray) -> np.ndarray:
        """Return where the plan leads, shape (horizon + 1, 2) [m]."""
        places: np.ndarray = _foresee(self.plan, state, self._base)
        return places


@fast
def _foresee(plan: np.ndarray, state: np.ndarray, base: Base) -> np.ndarray:
    state = state.copy()
    places = np.empty((plan.shape[0] + 1, 2))
    places[0, 0], places[0, 1] = state[0], state[1]
    for step in range(plan.shape[0]):
        move(state, plan[step], base, STEP)
        places[step + 1, 0], places[step + 1, 1] = state[0], state[1]
    return places


@fast
def _try_all(
    motions: np.ndarray, start: np.ndarray, scene: Scene, base: Base, costs: np.ndarray
) -> None:
    """Write what each motion, shape (k, steps, 3), costs; the first ones are drivers', in full."""
    state = np.empty(6)
    for sample in range(motions.shape[0]):
        for axis in range(6):
            state[axis] = start[axis]
        motion = motions[sample]
        cost = 0.0
        near = int(np.int64(0))  # of a mere 0 numba makes a type, and compiles the drivers twice
        for step in range(motion.shape[0]):
            if sample < DRIVERS:
                near = _drive(sample, state, scene, base, near, motion[step])
            for axis in range(3):
                motion[step, axis] = min(
                    max(motion[step, axis], base.least[axis]), base.most[axis]
                )
            move(state, motion[step], base, STEP)
            cost += _price(state, scene) + value_at(scene.values, state) / motion.shape[0]
            if scene.movers.shape[0] > 0:
                cost += _price_of_movers(state, scene, (step + 1) * STEP)
        costs[sample] = cost + value_at(scene.values, state)


@fast
def value_at(values: Field, state: np.ndarray) -> float:
    """Return what is left from (x, y, yaw, ...), between headings by their share."""
    value: float
    layers = values.values.shape[0]
    if layers == 1:
        value = look_up(values, layers - 1, state[0], state[1])
        return value
    around = state[2] / (2.0 * math.pi) * layers
    low = math.floor(around)
    share = around - low
    first, second = int(low) % layers, (int(low) + 1) % layers
    value = (1.0 - share) * look_up(values, first, state[0], state[1])
    value += share * look_up(values, second, state[0], state[1])
    return value


@fast
def _price(state: np.ndarray, scene: Scene) -> float:
    """Return what a step costs that ends in a state."""
    least, comfort = scene.keep
    room = clearance(scene.distances, scene.circles, state, comfort)
    cost: float = _TURNING * abs(state[5]) * STEP
    cost += _LENGTH * math.hypot(state[3], state[4]) * STEP
    if room < 0.0:
        cost += _TOUCHES * (1.0 - 10.0 * room)
    if room < least:
        cost += _TOO_NEAR * (1.0 + (least - room) / max(least, 0.01))
    if room < comfort:
        cost += _DISCOMFORT * (1.0 - room / comfort) ** 2 * STEP
    if state[3] < 0.0:
        cost -= _BACKWARD * state[3] * STEP
    return cost


@fast
def _price_of_movers(state: np.ndarray, scene: Scene, time: float) -> float:
    """Return the cost of a state near movers, a time [s] from now."""
    least, comfort = scene.keep
    room = room_to_movers(scene.movers, scene.circles, state, time)
    if room >= comfort:
        return 0.0
    cost = _DISCOMFORT * (1.0 - room / comfort) ** 2 * STEP
    if room < least:
        cost += _TOO_NEAR * (1.0 + (least - room) / max(least, 0.01))
    if room < 0.0:
        cost += _TOUCHES * (1.0 - 3.0 * room)
    if abs(state[3]) + abs(state[4]) + _RIM * abs(state[5]) < _STANDING:
        cost *= _NOT_TO_BLAME
    weighed: float = cost * max(1.0 - _DOUBT * time, 0.1)
    return weighed


@fast
def room_to_movers(
    movers: np.ndarray, circles: np.ndarray, state: np.ndarray, time: float
) -> float:
    """
    Return the distance [m] from a footprint to where those who move may be, a time [s] from now.

    Who walks may turn: the farther ahead, the more room he may need, up to a second ahead.
    """
    least: float = math.inf
    cos, sin = math.cos(state[2]), math.sin(state[2])
    for one in range(movers.shape[0]):
        x = movers[one, 0] + time * movers[one, 2] - state[0]
        y = movers[one, 1] + time * movers[one, 3] - state[1]
        speed = math.hypot(movers[one, 2], movers[one, 3])
        needed = movers[one, 4] + min(speed, _TURNS) * min(time, 1.0)
        for index in range(circles.shape[0]):
            dx = x - cos * circles[index, 0] + sin * circles[index, 1]
            dy = y - sin * circles[index, 0] - cos * circles[index, 1]
            least = min(least, math.hypot(dx, dy) - circles[index, 2] - needed)
    return least


@fast
def _drive(
    driver: int, state: np.ndarray, scene: Scene, base: Base, near: int, asked: np.ndarray
) -> int:
    """Write what a simple driver asks for, (3,); return the nearest point of the way."""
    asked[0] = asked[1] = asked[2] = 0.0
    if driver >= _FOLLOWERS:
        kind = driver - _FOLLOWERS
        if kind < 2:
            asked[2] = base.most[2] if kind == 0 else base.least[2]
        elif kind == 2:
            asked[0] = base.least[0]
        return near
    way = scene.way
    while near + 1 < way.shape[0] and _away(way[near + 1], state) <= _away(way[near], state):
        near += 1
    look = 0.2 + 0.15 * (driver % 3)
    target = near
    while target + 1 < way.shape[0] and _away(way[target], state) < look:
        target += 1
    x, y = way[target, 0] - state[0], way[target, 1] - state[1]
    turn = wrap(math.atan2(y, x) - state[2])
    full = 1.0 if driver < 3 else 0.5
    distance = math.hypot(x, y)
    speed = min(full * base.most[0], math.sqrt(base.change[0] * distance))
    if base.is_omni:
        turn = wrap(way[target, 2] - state[2])
    asked[2] = 2.0 * turn
    if base.is_omni:
        bearing = math.atan2(y, x) - state[2]
        asked[0], asked[1] = speed * math.cos(bearing), speed * math.sin(bearing)
    elif abs(turn) < 0.8:
        asked[0] = speed * math.cos(turn) ** 2
    return near


@fast
def _away(point: np.ndarray, state: np.ndarray) -> float:
    distance: float = math.hypot(point[0] - state[0], point[1] - state[1])
    return distance


@fast
def is_safe(
    state: np.ndarray,
    asked: np.ndarray,
    scene: Scene,
    base: Base,
    time: float,
    is_slow: bool = False,
) -> bool:
    """
    Whether the robot can ask for a velocity for a time [s] and then stop, and touch nothing.

    Where it is nearer to something than all motions keep, it may go away from it. Who moves is
    taken to walk on, or to turn towards where the robot is now; who stands, to step there, but
    past him a robot that `is_slow` may drive. Once the robot stands, it is up to him.
    """
    for one in range(scene.movers.shape[0] if asked.any() else 0):
        walks = math.hypot(scene.movers[one, 2], scene.movers[one, 3]) > _TURNS
        him = scene.movers[one : one + 1]
        if walks and room_to_movers(him, scene.circles, state, 0.0) < _BESIDE:
            return False
    turned = _turn_to(state, asked, scene, is_slow)
    state = state.copy()
    least = scene.keep[0]
    apart = min(room_to_movers(scene.movers, scene.circles, state, 0.0), least)
    room = min(clearance(scene.distances, scene.circles, state, least), least)
    stop = np.zeros(3)
    passed = 0.0
    while passed < time or max(abs(state[3]), abs(state[4]), 0.3 * abs(state[5])) > 0.02:
        move(state, asked if passed < time else stop, base, 0.5 * STEP)
        passed += 0.5 * STEP
        if clearance(scene.distances, scene.circles, state, least) < room - 1e-3:
            return False
        near = room_to_movers(scene.movers, scene.circles, state, passed)
        if near < apart - 1e-3:
            return False
        if room_to_movers(turned, scene.circles, state, passed) < 0.0:
            return False
        if passed > 5.0:
            break
    return True


@fast
def _turn_to(state: np.ndarray, asked: np.ndarray, scene: Scene, is_slow: bool) -> np.ndarray:
    """Return those who may turn or step towards the robot, as if they did; see `Scene`."""
    cos, sin = math.cos(state[2]), math.sin(state[2])
    along_x, along_y = cos * asked[0] - sin * asked[1], sin * asked[0] + cos * asked[1]
    turned = scene.movers.copy()
    found = 0
    for one in range(scene.movers.shape[0]):
        him = scene.movers[one]
        x, y = state[0] - him[0], state[1] - him[1]
        away = max(math.hypot(x, y), 1e-9)
        speed = math.hypot(him[2], him[3])
        if speed > _TURNS:
            near = room_to_movers(scene.movers[one : one + 1], scene.circles, state, 0.0) < _NEAR
            may_turn = near or x * him[2] + y * him[3] > 0.0
        else:
            # Who stands behind it would have to run after it.
            is_left = x * along_x + y * along_y > _LEFT * away * math.hypot(along_x, along_y)
            speed, may_turn = _STEPS, not (is_slow or is_left)
        if may_turn:
            turned[found] = him
            turned[found, 2], turned[found, 3] = speed * x / away, speed * y / away
            found += 1
    return turned[:found]
