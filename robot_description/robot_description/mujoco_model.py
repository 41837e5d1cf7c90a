# SPDX-License-Identifier: Apache-2.0
"""URDF to MuJoCo: a floating robot with motors where the URDF gives an effort limit."""

import mujoco
import numpy as np

from robot_description.errors import DescriptionError
from robot_description.urdf import Robot
from robot_description.urdf import Shape

# Contact that holds a wheel where its odometry says it is: stiffer contacts slip less. Measured
# on mbot, 360 degrees on the spot: 0.18 degrees off at 0.01 s, 0.03 at 0.004 s.
SOLREF = (0.004, 1.0)
ROOT_JOINT = 'root'
VISUAL_GROUP = 2
COLLISION_GROUP = 3


def to_mujoco(urdf: str, robot: Robot) -> mujoco.MjSpec:
    """
    Return the robot as a MuJoCo model specification, free to move, nothing around it.

    `robot` is the parsed `urdf`. Joints with an effort limit get a motor of the joint's name;
    the others swing freely. Drawn shapes are in geom group 2, colliding ones in group 3.

    Raises:
        DescriptionError: what MuJoCo says about the URDF, in one line.
    """
    spec = _parse(urdf)
    root = spec.body(robot.root)
    if root is None:
        raise DescriptionError(f'MuJoCo found no body {robot.root!r} in the description')
    # Before compilation: without it the root is welded to the world and its mass lost.
    root.add_freejoint(name=ROOT_JOINT)
    _sort_geoms(spec)
    _set_contacts(spec, robot)
    for joint in robot.movable_joints:
        if joint.effort > 0.0:
            _add_motor(spec, joint.name, joint.effort)
    return spec


def _parse(urdf: str) -> mujoco.MjSpec:
    # Visual shapes are dropped while parsing unless the file itself asks for them.
    options = '<mujoco><compiler discardvisual="false"/></mujoco>'
    head, end, tail = urdf.rpartition('</robot>')
    try:
        return mujoco.MjSpec.from_string(head + options + end + tail)
    except ValueError as error:
        raise DescriptionError(f'MuJoCo: {" ".join(str(error).split())}') from None


def _sort_geoms(spec: mujoco.MjSpec) -> None:
    for geom in spec.geoms:
        collides = bool(geom.contype or geom.conaffinity)
        geom.group = COLLISION_GROUP if collides else VISUAL_GROUP


def _set_contacts(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give links that name a friction their contact: its own mu, stiff, one point for a wheel."""
    for name, friction in robot.friction.items():
        for shape, geom in _colliding(spec, robot, name):
            geom.priority = 1  # this friction counts, whatever lies on the floor
            geom.friction[0] = friction
            geom.condim = 3 if friction > 0.0 else 1
            geom.solref = SOLREF
            if shape.kind == 'cylinder' and _is_wheel(robot, name, shape):
                _round_off(geom, shape)


def _colliding(spec: mujoco.MjSpec, robot: Robot, link: str) -> list[tuple[Shape, mujoco.MjsGeom]]:
    body = spec.body(link)
    if body is None:  # welded into its parent
        return []
    geoms = [geom for geom in body.geoms if geom.group == COLLISION_GROUP]
    return list(zip(robot.links[link].collisions, geoms, strict=False))


def _is_wheel(robot: Robot, link: str, cylinder: Shape) -> bool:
    """Whether the cylinder turns about its own axis on a continuous joint."""
    for joint in robot.joints.values():
        if joint.child == link and joint.kind == 'continuous':
            return bool(abs(cylinder.pose.rotation[:, 2] @ joint.axis) > 1.0 - 1e-6)
    return False


def _round_off(geom: mujoco.MjsGeom, cylinder: Shape) -> None:
    """
    Replace a cylinder by the ellipsoid inside it.

    A flat tread touches in two points, which fight every turn.
    """
    radius, length = cylinder.size
    geom.type = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    geom.size = np.array([radius, radius, length / 2.0])


def _add_motor(spec: mujoco.MjSpec, joint: str, effort: float) -> None:
    """
    Add an actuator whose force is `ctrl - kp q - kd v`, clipped to the effort limit [N m].

    Gains are written at run time, so that the law acts at every physics step.
    """
    actuator = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.gainprm[0] = 1.0
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.forcelimited = True
    actuator.forcerange = np.array([-effort, effort])
