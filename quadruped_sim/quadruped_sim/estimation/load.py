# SPDX-License-Identifier: Apache-2.0
"""What the legs feel in a tick, in one compiled call: forces, where feet touch, and a load."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY

from quadruped_sim.algebra import cross3, flatten, put, rotate_back
from quadruped_sim.dynamics import Dynamics, find_dynamics
from quadruped_sim.estimation.touch import feel_touch, find_touch
from quadruped_sim.leg_kinematics import find_contact_points
from quadruped_sim.robot_state import place_base, sound_height

# Of the model's mass: the least and the largest that is believed; of the shift of the centre of
# mass along x and y, the largest [m], on the Go2.
_MASS_LEAST, _MASS_MOST = 0.9, 1.8
_SHIFT_MOST = 0.06


class LoadState(NamedTuple):
    """State of the observer, both (3,): see `LoadObserver`; whether it has seen anything yet."""

    integral: np.ndarray
    residual: np.ndarray
    is_started: np.ndarray


class LoadObserver:
    """
    Sees what the robot carries: the force along gravity and the moments that its model lacks.

    The base's momentum p along gravity, and the angular ones about its x and y, obey dp/dt = what
    the feet's forces f and the model's weight do + w. A residual driven by the part of p that they
    do not explain is w low-passed with a time constant, as in [DeLuca2006]. Pushes pass, a load
    stays. State: the observer, `flat`.
    """

    def __init__(self) -> None:
        self.flat = flatten(LoadState(np.zeros(3), np.zeros(3), np.zeros(1, dtype=bool)))

    def reset(self) -> None:
        """Believe the model again."""
        self.flat['residual'], self.flat['is_started'] = 0.0, False


@jit
def feel_load(load: np.ndarray, robot: np.ndarray, rules: np.ndarray, dt: float) -> None:
    """Observe with a flat `LoadState`, and correct the dynamics of a flat `RobotState`."""
    own, state, inertia = load[0], robot[0], rules[0].inertia
    rate = 1.0 / rules[0].contact.load_time
    base, dynamics, up = state.base, state.dynamics, state.base.R[2]
    mass, momentum = dynamics.mass[0, 0], np.zeros(3)
    velocity = rotate_back(base.R, base.velocity)
    known, arm = np.zeros(3), np.empty(3)
    known[0] = -GRAVITY * mass
    for k in range(3):
        momentum[0] += mass * up[k] * velocity[k]
        momentum[1] += inertia[0, k] * base.omega[k]
        momentum[2] += inertia[1, k] * base.omega[k]
    for i in range(4):
        force = state.forces[i]
        for k in range(3):
            arm[k] = state.contact.position[i, k] - dynamics.com[k]
            known[0] += up[k] * force[k]
        moment = cross3(arm, force)
        known[1] += moment[0]
        known[2] += moment[1]
    for k in range(3):
        if not own.is_started[0]:
            own.integral[k] = momentum[k]
        own.integral[k] += dt * (known[k] + own.residual[k])
        own.residual[k] = rate * (momentum[k] - own.integral[k])
    own.is_started[0] = True
    _carry(dynamics, up, own.residual, _SHIFT_MOST * rules[0].length)


@jit
def _carry(dynamics: Dynamics, up: np.ndarray, load: np.ndarray, most: float) -> None:
    """Give the dynamics the mass and centre of mass that `load` (3,) tells of."""
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
    turn = cross3(first, up)
    for k in range(3):
        mass[k, k] += after - before
        bias[k] += GRAVITY * (after - before) * up[k]
        bias[3 + k] += GRAVITY * turn[k]
    # The coupling of a velocity with the angular one is -[first moment]x.
    for row, column, value in ((0, 1, first[2]), (1, 2, first[0]), (2, 0, first[1])):
        mass[row, 3 + column] += value
        mass[3 + column, row] += value
        mass[column, 3 + row] -= value
        mass[3 + row, column] -= value
    for k in range(3):
        com[k] = moved[k]


@jit
def feel_ground(
    robot: np.ndarray,
    rigid: tuple[np.ndarray, np.ndarray],
    stages: tuple[np.ndarray, np.ndarray],
    seen: tuple[np.ndarray, np.ndarray],
    rules: np.ndarray,
    tick: tuple[float, bool],
) -> float:
    """
    Write into a flat `RobotState` that knows its base and joints all that follows of these.

    That are its place, its dynamics, forces, contacts and contact points, and its load. `rigid`
    are flat `Bodies` and `Links`, `stages` a flat `Felt` and `LoadState`, `rules` see
    `flat_rules`. `seen` are the joints' torques (12,) [N m] and the ground's normal (3,), world
    axes. `tick` is dt [s] and whether the robot is on its feet, so that its load is felt.
    Return the base's `sound_height` [m].
    """
    state, felt, (torque, normal), (dt, is_up) = robot[0], stages[0][0], seen, tick
    place_base(robot)
    find_dynamics(rigid[0], rigid[1], robot)
    feel_touch(stages[0], robot, torque, rules, dt)
    up = rotate_back(state.base.R, normal)
    find_touch(stages[0], up, rules)
    for i in range(4):
        put(state.forces[i], felt.forces[i])
        state.normal_forces[i], state.is_contact[i] = felt.normal_forces[i], felt.is_contact[i]
    find_contact_points(state.motion, up, rules[0].geometry.foot_radius, state.contact)
    if is_up:
        feel_load(stages[1], robot, rules, dt)
    return sound_height(robot)
