# SPDX-License-Identifier: Apache-2.0
"""URDF to MuJoCo: a floating robot with motors where the URDF gives an effort limit."""

import mujoco
import numpy as np

from robot_description.errors import DescriptionError
from robot_description.imu import find_imu
from robot_description.imu import imu_position
from robot_description.mujoco_contacts import exclude_pairs
from robot_description.mujoco_contacts import name_collisions
from robot_description.mujoco_contacts import set_contacts
from robot_description.mujoco_urdf import for_mujoco
from robot_description.mujoco_visuals import COLLISION_GROUP
from robot_description.mujoco_visuals import fill_meshes
from robot_description.mujoco_visuals import find_nothing
from robot_description.mujoco_visuals import FindMesh
from robot_description.mujoco_visuals import sort_geoms
from robot_description.mujoco_visuals import strip_visuals
from robot_description.urdf import Robot

ROOT_JOINT = 'root'
# Rotor inertia as a geared joint feels it [kg m^2]; unitree_mujoco's value for the Go2.
REFLECTED_INERTIA = 0.01
# How far in the floor a hanging robot may be, and how far above it is hung up otherwise [m].
CLEARANCE = 0.05


def to_mujoco(
    urdf: str, robot: Robot, find_mesh: FindMesh = find_nothing, visuals: bool = False
) -> mujoco.MjSpec:
    """
    Return the robot as a MuJoCo model specification, nothing around it.

    It is free to move unless it hangs on a link called `world`; then it hangs high enough to
    touch no floor at z = 0. `robot` is the parsed `urdf`. Joints with an effort limit get a motor
    of the joint's name, unless they mimic another; the others swing freely. Colliding geoms are
    called `LINK/0`, `LINK/1`, ... and stay so when their link is welded into its parent. Without
    `visuals` nothing is there to be drawn.

    Raises:
        DescriptionError: what MuJoCo says about the URDF, in one line.
    """
    _check_floating(robot)
    prepared = for_mujoco(urdf, robot)
    spec = _parse(prepared.text)
    if robot.is_fixed:
        # Welded to the world, the base would lose its mass.
        spec.compiler.fusestatic = False
    else:
        # Before compilation, for the same reason.
        spec.body(robot.root).add_freejoint(name=ROOT_JOINT)
    sort_geoms(spec)
    name_collisions(spec, robot)
    set_contacts(spec, robot)
    exclude_pairs(spec, robot)
    for joint in robot.movable_joints:
        if joint.effort > 0.0 and not joint.mimics:
            _add_motor(spec, joint.name, joint.effort)
        if joint.kind == 'revolute':
            spec.joint(joint.name).armature = REFLECTED_INERTIA
    if find_imu(robot) is not None:
        add_imu(spec, robot)
    if not visuals:
        strip_visuals(spec)
    fill_meshes(spec, prepared.meshes, find_mesh)
    if robot.is_fixed:
        _hang(spec, robot)
    return spec


def _check_floating(robot: Robot) -> None:
    for joint in robot.joints.values():
        if joint.kind == 'floating' and not (robot.is_fixed and joint.parent == robot.root):
            raise DescriptionError(
                f'joint {joint.name!r} floats within the robot: only what hangs on a root link '
                "'world' may"
            )


def _hang(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Lift a robot whose feet would be in the floor; what stands on it stays."""
    try:
        model = spec.compile()
    except ValueError as error:
        raise DescriptionError(f'MuJoCo: {" ".join(str(error).split())}') from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    lowest = 0.0
    for geom in np.flatnonzero(model.geom_group == COLLISION_GROUP):
        rotation = data.geom_xmat[geom].reshape(3, 3)
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        bottom = data.geom_xpos[geom] + rotation @ centre - np.abs(rotation) @ half
        lowest = min(lowest, float(bottom[2]))
    if lowest < -CLEARANCE and robot.base != robot.root:
        spec.body(robot.base).pos[2] += CLEARANCE - lowest


def _parse(urdf: str) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_string(urdf)
    except ValueError as error:
        raise DescriptionError(f'MuJoCo: {" ".join(str(error).split())}') from None


def add_imu(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Measure specific force and angular velocity where the IMU is, in the base's axes."""
    site = 'imu_site'
    spec.body(robot.base).add_site(name=site, pos=imu_position(robot))
    for name, kind in (
        ('accelerometer', mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ('gyro', mujoco.mjtSensor.mjSENS_GYRO),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


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
