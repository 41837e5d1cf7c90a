# SPDX-License-Identifier: Apache-2.0
"""How heavy the robot is and where its centre of mass, as its feet feel them."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY

from quadruped_sim.algebra import cross3
from quadruped_sim.algebra import plain
from quadruped_sim.algebra import put
from quadruped_sim.dynamics import Dynamics

# Of the model's mass: the least and the largest that is believed; of the shift of the centre of
# mass along x and y, the largest [m], on the Go2.
_MASS_LEAST, _MASS_MOST = 0.9, 1.8
_SHIFT_MOST = 0.06


class LoadState(NamedTuple):
    """State of the observer, both (3,): see `LoadObserver`."""

    integral: np.ndarray
    residual: np.ndarray


class LoadObserver:
    """
    Sees what the robot carries: the force along gravity and the moments that its model lacks.

    The base's momentum p along gravity, and the angular ones about its x and y, obey dp/dt = what
    the feet's forces f and the model's weight do + w. A residual driven by the part of p that they
    do not explain is w low-passed with a time constant, as in [DeLuca2006]. Pushes pass, a load
    stays. State: the observer.
    """

    def __init__(self, inertia: np.ndarray, length: float) -> None:
        """Take the inertia (3, 3) [kg m^2] about the CoM, and lengths over the Go2's."""
        self._inertia = inertia
        self._shift_most = _SHIFT_MOST * length
        self.reset()

    def reset(self) -> None:
        """Believe the model again."""
        self.felt: LoadState | None = None  # plain

    def step(self, state: 'Loaded', time: float, dt: float) -> None:
        """Update by `dt` [s] with a time constant [s], and correct `state.dynamics` in place."""
        felt = self.felt or self.start(state)
        state = state._replace(dynamics=plain(state.dynamics))
        _feel(felt, plain(state), self.rule(time), dt)

    def start(self, state: 'Loaded') -> LoadState:
        """Return the state as it begins at this moment, plain."""
        state = state._replace(dynamics=plain(state.dynamics))
        momentum = _momentum_of(plain(state), self._inertia)
        self.felt = plain(LoadState(momentum, np.zeros(3)))
        return self.felt

    def rule(self, time: float) -> 'LoadRule':
        """Return how a load is felt with a time constant [s], plain."""
        return plain(LoadRule(self._inertia, self._shift_most, 1.0 / time))


class LoadRule(NamedTuple):
    """Inertia (3, 3) [kg m^2] about the CoM, its largest shift [m], and a rate [1/s]."""

    inertia: np.ndarray
    most: float
    rate: float


class Loaded(NamedTuple):
    """
    A moment of the robot, base axes: its dynamics, contact forces and points (4, 3).

    `up` (3,) is against gravity, `velocity` and `omega` (3,) are those of the base.
    """

    dynamics: Dynamics
    forces: np.ndarray
    points: np.ndarray
    up: np.ndarray
    velocity: np.ndarray
    omega: np.ndarray


@jit
def _momentum_of(state: Loaded, inertia: np.ndarray) -> np.ndarray:
    return _momentum(_named(state), inertia)


@jit
def _named(state: Loaded) -> Loaded:
    dynamics, forces, points, up, velocity, omega = state
    return Loaded(Dynamics(*dynamics), forces, points, up, velocity, omega)


@jit
def _momentum(state: Loaded, inertia: np.ndarray) -> np.ndarray:
    """Momentum along `up` and angular about x and y (3,)."""
    mass = state.dynamics.mass[0, 0]
    result = np.zeros(3)
    for k in range(3):
        result[0] += mass * state.up[k] * state.velocity[k]
        result[1] += inertia[0, k] * state.omega[k]
        result[2] += inertia[1, k] * state.omega[k]
    return result


@jit
def _observe(felt: LoadState, state: Loaded, inertia: np.ndarray, rate: float, dt: float) -> None:
    momentum = _momentum(state, inertia)
    dynamics = state.dynamics
    known = np.zeros(3)
    known[0] = -GRAVITY * dynamics.mass[0, 0]
    arm = np.empty(3)
    for i in range(4):
        for k in range(3):
            arm[k] = state.points[i, k] - dynamics.com[k]
            known[0] += state.up[k] * state.forces[i, k]
        moment = cross3(arm, state.forces[i])
        known[1] += moment[0]
        known[2] += moment[1]
    for k in range(3):
        felt.integral[k] += dt * (known[k] + felt.residual[k])
        felt.residual[k] = rate * (momentum[k] - felt.integral[k])


@jit
def _feel(felt: LoadState, state: Loaded, rule: LoadRule, dt: float) -> None:
    feel_load(felt, _named(state), rule, dt)


@jit
def feel_load(felt: LoadState, state: Loaded, rule: LoadRule, dt: float) -> None:
    """Observe, and correct the dynamics by what is felt."""
    own, load = LoadState(*felt), LoadRule(*rule)
    _observe(own, state, load.inertia, load.rate, dt)
    _carry(state, own.residual, load.most)


@jit
def _carry(state: Loaded, load: np.ndarray, most: float) -> None:
    """Give the dynamics the mass and centre of mass that `load` (3,) tells of."""
    dynamics = state.dynamics
    mass, bias, com = dynamics.mass, dynamics.bias, dynamics.com
    before = mass[0, 0]
    after = before - load[0] / GRAVITY
    after = min(max(after, _MASS_LEAST * before), _MASS_MOST * before)
    moved = np.empty(3)
    put(moved, com)
    weight = after * GRAVITY
    moved[0] += min(max(load[2] / weight, -most), most)
    moved[1] += min(max(-load[1] / weight, -most), most)
    first = np.empty(3)
    for k in range(3):
        first[k] = after * moved[k] - before * com[k]
    turn = cross3(first, state.up)
    for k in range(3):
        mass[k, k] += after - before
        bias[k] += GRAVITY * (after - before) * state.up[k]
        bias[3 + k] += GRAVITY * turn[k]
    # The coupling of a velocity with the angular one is -[first moment]x.
    for row, column, value in ((0, 1, first[2]), (1, 2, first[0]), (2, 0, first[1])):
        mass[row, 3 + column] += value
        mass[3 + column, row] += value
        mass[column, 3 + row] -= value
        mass[3 + row, column] -= value
    for k in range(3):
        com[k] = moved[k]
