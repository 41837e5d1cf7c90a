# SPDX-License-Identifier: Apache-2.0
"""URDF to MuJoCo: a floating robot with motors where the URDF gives an effort limit."""

import mujoco
import numpy as np

from robot_description.errors import DescriptionError
from robot_description.mujoco_urdf import for_mujoco
from robot_description.mujoco_visuals import COLLISION_GROUP
from robot_description.mujoco_visuals import fill_meshes
from robot_description.mujoco_visuals import find_nothing
from robot_description.mujoco_visuals import FindMesh
from robot_description.mujoco_visuals import sort_geoms
from robot_description.mujoco_visuals import strip_visuals
from robot_description.urdf import Robot
from robot_description.urdf import Shape

# Contact that holds a wheel where its odometry says it is: stiffer contacts slip less. Measured
# on mbot, 360 degrees on the spot: 0.18 degrees off at 0.01 s, 0.03 at 0.004 s.
SOLREF = (0.004, 1.0)
ROOT_JOINT = 'root'
# Rotor inertia as a geared joint feels it [kg m^2]; unitree_mujoco's value for the Go2.
REFLECTED_INERTIA = 0.01
IMU_LINKS = ('imu', 'imu_link')


def to_mujoco(
    urdf: str, robot: Robot, find_mesh: FindMesh = find_nothing, visuals: bool = False
) -> mujoco.MjSpec:
    """
    Return the robot as a MuJoCo model specification, nothing around it.

    It is free to move unless it hangs on a link called `world`.
    `robot` is the parsed `urdf`. Joints with an effort limit get a motor of the joint's name;
    the others swing freely. Colliding geoms are called `LINK/0`, `LINK/1`, ... and stay so when
    their link is welded into its parent. Without `visuals` nothing is there to be drawn.

    Raises:
        DescriptionError: what MuJoCo says about the URDF, in one line.
    """
    prepared = for_mujoco(urdf, robot)
    spec = _parse(prepared.text)
    if robot.is_fixed:
        # Welded to the world, the base would lose its mass.
        spec.compiler.fusestatic = False
    else:
        # Before compilation, for the same reason.
        spec.body(robot.root).add_freejoint(name=ROOT_JOINT)
    sort_geoms(spec)
    _name_collisions(spec, robot)
    _set_contacts(spec, robot)
    _exclude_neighbours(spec, robot)
    for joint in robot.movable_joints:
        if joint.effort > 0.0:
            _add_motor(spec, joint.name, joint.effort)
        if joint.kind == 'revolute':
            spec.joint(joint.name).armature = REFLECTED_INERTIA
    for link in IMU_LINKS:
        if link in robot.links:
            _add_imu(spec, robot, link)
    if not visuals:
        strip_visuals(spec)
    fill_meshes(spec, prepared.meshes, find_mesh)
    return spec


def _parse(urdf: str) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_string(urdf)
    except ValueError as error:
        raise DescriptionError(f'MuJoCo: {" ".join(str(error).split())}') from None


def _name_collisions(spec: mujoco.MjSpec, robot: Robot) -> None:
    for link in robot.links:
        for index, (_, geom) in enumerate(_colliding(spec, robot, link)):
            geom.name = f'{link}/{index}'
            if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
                _tilt(geom)


def _tilt(geom: mujoco.MjsGeom) -> None:
    """
    Turn a cylinder by a hair, 1e-6 rad.

    MuJoCo 4.0.0 gives a cylinder that stands on a plane upright to 1e-15 a contact as deep as it
    is wide: the direction to its rim is then a quotient of rounding errors. mbot's drum, which
    does not even touch the floor, was thrown into the air by it.
    """
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, geom.quat, np.array([1.0, 0.5e-6, 0.0, 0.0]))
    geom.quat = turned


def _set_contacts(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give links that name a friction their contact; what rolls gets a stiff one in one point."""
    rolling = {joint.child for joint in robot.movable_joints if joint.kind == 'continuous'}
    for name, friction in robot.friction.items():
        for shape, geom in _colliding(spec, robot, name):
            geom.priority = 1  # this friction counts, whatever lies on the floor
            geom.friction[0] = friction
            geom.condim = 3 if friction > 0.0 else 1
            if name in rolling:
                geom.solref = SOLREF
            if shape.kind == 'cylinder' and _is_wheel(robot, name, shape):
                _round_off(geom, shape)


def _exclude_neighbours(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Let links two joints apart overlap: a trunk's box and a thigh next to it always do."""
    parents = {joint.child: joint.parent for joint in robot.movable_joints}
    for child, parent in parents.items():
        if parent in parents and parents[parent] != child:
            spec.add_exclude(bodyname1=parents[parent], bodyname2=child)


def _add_imu(spec: mujoco.MjSpec, robot: Robot, link: str) -> None:
    """Measure specific force and angular velocity where the IMU is, in the root's axes."""
    site = f'{link}_site'
    spec.body(robot.root).add_site(name=site, pos=robot.pose_of(link).position)
    for name, kind in (
        ('accelerometer', mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ('gyro', mujoco.mjtSensor.mjSENS_GYRO),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


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
