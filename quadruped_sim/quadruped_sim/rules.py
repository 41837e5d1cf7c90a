# SPDX-License-Identifier: Apache-2.0
"""The numbers that the compiled stages of a tick read."""

from dataclasses import fields
import math

import numpy as np
from wasd_core.robot_io import GRAVITY

from quadruped_sim.algebra import flatten
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.presets import GAITS
from quadruped_sim.robot_model import RobotModel


def flat_rules(params: LegControllerParameters, model: RobotModel) -> np.ndarray:
    """
    Return in one block all groups of parameters, and the robot's own numbers.

    Those are its geometry, `nominal`, where its feet stand below its hips (4, 3) [m], yaw frame,
    its inertia (3, 3) [kg m^2] about its centre of mass, lengths and speeds over the Go2's, how
    far its gait minds `rough` ground, and `fall_time`, sqrt(h / g), by which a body of its height
    h topples [s].
    """
    legs, names = model.geometry, [group.name for group in fields(LegControllerParameters)]
    return flatten(
        {
            **{name: vars(getattr(params, name)) for name in names},
            'geometry': legs,
            'nominal': np.stack((legs.hip[:, 0], legs.hip[:, 1] + legs.offset, np.zeros(4)), 1),
            'inertia': model.inertia_about_com(model.walking_pose)[0],
            'length': model.scale.of('m'),
            'speed': model.scale.of('m/s'),
            'rough': GAITS[params.gait.name].rough,
            'fall_time': math.sqrt(params.reference.height / GRAVITY),
        }
    )
