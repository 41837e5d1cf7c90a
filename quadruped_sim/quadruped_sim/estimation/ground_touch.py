# SPDX-License-Identifier: Apache-2.0
"""What the legs feel in a tick, in one compiled call: forces, where feet touch, and a load."""

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import put
from quadruped_sim.estimation.contacts import feel_touch
from quadruped_sim.estimation.contacts import TouchRule
from quadruped_sim.estimation.load import feel_load
from quadruped_sim.estimation.load import Loaded
from quadruped_sim.estimation.load import LoadRule
from quadruped_sim.estimation.load import LoadState
from quadruped_sim.leg_kinematics import find_contact_points


@jit
def feel_ground(
    robot: np.ndarray,
    touch: np.ndarray,
    load: LoadState,
    seen: tuple[np.ndarray, np.ndarray, np.ndarray],
    rules: tuple[TouchRule, LoadRule, float],
    tick: tuple[float, bool],
) -> None:
    """
    Write forces, contacts and contact points of a flat `RobotState`, and its load if it carries.

    `touch` is a flat `Felt`. `seen` are the joints' torques (12,) [N m], and in base axes up and
    the base's velocity; the last rule is the feet's radius [m]. `tick` is dt [s] and whether the
    robot is on its feet, so that it is felt what it carries.
    """
    state, felt = robot[0], touch[0]
    torque, up, velocity = seen
    dynamics, motion = state.dynamics, state.motion
    moving = torque, dynamics.momentum_drift, dynamics.momentum, motion.jacobian
    feel_touch(touch, moving, up, rules[0], tick[0])
    for i in range(4):
        put(state.forces[i], felt.forces[i])
        state.normal_forces[i], state.is_contact[i] = felt.normal_forces[i], felt.is_contact[i]
    find_contact_points(motion, up, rules[2], state.contact)
    if tick[1]:
        points, base = state.contact.position, state.base
        down = Loaded(dynamics, state.forces, points, base.R[2], velocity, base.omega)
        feel_load(load, down, rules[1], tick[0])
