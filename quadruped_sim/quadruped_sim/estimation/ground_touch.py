# SPDX-License-Identifier: Apache-2.0
"""What the legs feel in a tick, in one compiled call: forces, where feet touch, and a load."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import put
from quadruped_sim.algebra import rotate_back
from quadruped_sim.dynamics import find_dynamics
from quadruped_sim.estimation.contacts import feel_touch
from quadruped_sim.estimation.contacts import find_touch
from quadruped_sim.estimation.contacts import TouchRule
from quadruped_sim.estimation.load import feel_load
from quadruped_sim.estimation.load import LoadRule
from quadruped_sim.leg_kinematics import find_contact_points
from quadruped_sim.robot_state import place_base


class TouchRules(NamedTuple):
    """The rules of all that is felt; feet are balls of `radius` [m]."""

    touch: TouchRule
    load: LoadRule
    radius: float


@jit
def feel_ground(
    robot: np.ndarray,
    rigid: tuple[np.ndarray, np.ndarray],
    stages: tuple[np.ndarray, np.ndarray],
    seen: tuple[np.ndarray, np.ndarray],
    rules: np.ndarray,
    tick: tuple[float, bool],
) -> None:
    """
    Write into a flat `RobotState` that knows its base and joints all that follows of these.

    That are its place, its dynamics, forces, contacts and contact points, and its load. `rigid`
    are flat `Bodies` and `Links`, `stages` a flat `Felt` and `LoadState`, `rules` flat
    `TouchRules`. `seen` are the joints' torques (12,) [N m] and the ground's normal (3,), world
    axes. `tick` is dt [s] and whether the robot is on its feet, so that its load is felt.
    """
    state, felt, rule, (torque, normal), (dt, is_up) = robot[0], stages[0][0], rules[0], seen, tick
    place_base(robot)
    find_dynamics(rigid[0], rigid[1], robot)
    feel_touch(stages[0], robot, torque, rule.touch, dt)
    up = rotate_back(state.base.R, normal)
    find_touch(stages[0], up, rule.touch)
    for i in range(4):
        put(state.forces[i], felt.forces[i])
        state.normal_forces[i], state.is_contact[i] = felt.normal_forces[i], felt.is_contact[i]
    find_contact_points(state.motion, up, rule.radius, state.contact)
    if is_up:
        feel_load(stages[1], robot, rule.load, dt)
