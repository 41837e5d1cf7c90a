# SPDX-License-Identifier: Apache-2.0
"""A robot before it is compiled: its description and what its setup adds to it."""

from collections.abc import Sequence

import mujoco
import numpy as np
from robot_description.description import Description
from robot_description.morphology.quadruped import find_imu
from robot_description.mujoco.builder import add_imu
from robot_description.mujoco.builder import hold_joints
from robot_description.mujoco.builder import to_mujoco
from wasd_core.errors import DescriptionError

from mujoco_sim.robot_setup import foot_links
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.untold import Payload

# Of a payload, a bag of sand [kg/m^3].
PAYLOAD_DENSITY = 1600.0


def robot_spec(loaded: Description, setup: RobotSetup, visuals: bool = False) -> mujoco.MjSpec:
    """
    Return a robot with what its setup adds to it, nothing around it.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
    """
    try:
        spec = to_mujoco(loaded.robot, loaded.meshes.files.get, visuals)
    except DescriptionError as error:
        raise DescriptionError(f'{loaded.path}: {error}') from None
    for joint, inertia in setup.reflected_inertia.items():
        spec.joint(joint).armature = inertia
    hold_joints(spec, loaded.robot, setup.held)
    friction = setup.drawn.friction if setup.untold.friction is None else setup.untold.friction
    if friction is not None:
        _set_friction(spec, foot_links(loaded), friction)
    if setup.untold.payload is not None:
        _add_payload(spec.body(loaded.robot.base), setup.untold.payload)
    if setup.imu and find_imu(loaded.robot) is None:
        add_imu(spec, loaded.robot)
    return spec


def _set_friction(spec: mujoco.MjSpec, feet: Sequence[str], friction: float) -> None:
    """Let this friction count on any ground, of the feet, or of what is not free of friction."""
    for geom in spec.geoms:
        if geom.name.partition('/')[0] in feet or (not feet and geom.condim > 1):
            geom.priority = 1
            geom.friction[0] = friction


def _add_payload(base: mujoco.MjsBody, payload: Payload) -> None:
    """Weld a cube of the payload's mass to the base; it is to be seen and touches nothing."""
    edge = (payload.mass / PAYLOAD_DENSITY) ** (1.0 / 3.0)
    load = base.add_body(pos=payload.place)  # a link may have any name, also `payload`
    load.explicitinertial = True
    load.mass, load.ipos = payload.mass, np.zeros(3)
    load.inertia = np.full(3, payload.mass * edge**2 / 6.0)
    load.add_geom(
        name=f'{base.name}/payload',
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=np.full(3, edge / 2.0),
        contype=0,
        conaffinity=0,
        mass=0.0,
        rgba=[0.85, 0.65, 0.25, 1.0],
    )
