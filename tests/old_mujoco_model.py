# SPDX-License-Identifier: Apache-2.0
"""A robot as MuJoCo's own reader of URDF made it: the reference of its successor."""

from collections.abc import Callable
import itertools
import logging
from pathlib import Path

import mujoco
import numpy as np
from old_mujoco_urdf import for_mujoco
from old_mujoco_urdf import MeshUse
from robot_description.errors import DescriptionError
from robot_description.imu import find_imu
from robot_description.imu import imu_position
from robot_description.meshes import load_mesh
from robot_description.urdf import Robot
from robot_description.urdf_shapes import Shape

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)
VISUAL_GROUP = 2
COLLISION_GROUP = 3

# Returns the file that a mesh URL means, or None.
FindMesh = Callable[[str], Path | None]


def find_nothing(_: str) -> Path | None:
    """Find no mesh: primitives only."""
    return None


def sort_geoms(spec: mujoco.MjSpec) -> None:
    """Put what is drawn and what collides into groups of their own; neither weighs anything."""
    for geom in spec.geoms:
        geom.mass = 0.0  # else MuJoCo weighs the shapes of links without an inertial
        collides = bool(geom.contype or geom.conaffinity)
        geom.group = COLLISION_GROUP if collides else VISUAL_GROUP


def strip_visuals(spec: mujoco.MjSpec) -> None:
    """Leave only what collides: a run that nobody watches is faster without the rest."""
    for geom in list(spec.geoms):
        if geom.group == VISUAL_GROUP:
            spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)


def fill_meshes(spec: mujoco.MjSpec, meshes: dict[str, MeshUse], find: FindMesh) -> None:
    """
    Load the meshes that the specification has under the names of `meshes`.

    Links whose visual mesh is missing show what they collide with instead.

    Raises:
        DescriptionError: a mesh that something collides with is missing or cannot be read.
    """
    for target in list(spec.meshes):
        url, scale = meshes[target.name]
        path = find(url)
        if path is None:
            _do_without(spec, target, f'mesh {url} not found')
            continue
        try:
            mesh = load_mesh(path)
        except (OSError, ValueError) as error:
            _do_without(spec, target, str(error))
            LOGGER.warning('description: visual mesh left out: %s', error)
            continue
        target.file = ''
        target.uservert = (mesh.vertices * np.array(scale, np.float32)).flatten()
        # A mirror image is inside out unless its triangles turn the other way.
        faces = mesh.faces[:, ::-1] if np.prod(scale) < 0.0 else mesh.faces
        target.userface = faces.flatten()
        # Masses are the URDF's; computed from its volume, an open surface is an error.
        target.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def _do_without(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh, why: str) -> None:
    """Show what the links of a missing visual mesh collide with."""
    for geom in [geom for geom in spec.geoms if geom.meshname == mesh.name]:
        if geom.group == COLLISION_GROUP:
            raise DescriptionError(f'link {geom.parent.name!r} collides with what is not: {why}')
        for other in geom.parent.geoms:
            if other.group == COLLISION_GROUP:
                other.group = VISUAL_GROUP
        spec.delete(geom)
    spec.delete(mesh)


# Contact that holds a wheel where its odometry says it is: stiffer contacts slip less. Measured
# on mbot, 360 degrees on the spot: 0.18 degrees off at 0.01 s, 0.03 at 0.004 s.
SOLREF = (0.004, 1.0)


def name_collisions(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Call what a link collides with `LINK/0`, `LINK/1`, ..."""
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


def set_contacts(spec: mujoco.MjSpec, robot: Robot) -> None:
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


def exclude_pairs(spec: mujoco.MjSpec, robot: Robot) -> None:
    """
    Let links overlap that always do, and those whose gazebo tag says that they may.

    Links two joints apart do, as a trunk's box and a thigh next to it. A `self_collide` of false
    keeps a link, with what is welded to it, from touching any other of the robot.
    """
    bodies = _colliding_bodies(robot)
    parents = {j.child: robot.carriers[j.parent] for j in robot.movable_joints}
    apart = [(parents[above], link) for link, above in parents.items() if above in parents]
    # MuJoCo lets neighbours overlap by itself, but not those of a body that cannot move.
    beside = list(parents.items()) if robot.is_fixed else []
    pairs = {frozenset(pair) for pair in apart + beside}
    for loner in _loners(robot):
        pairs |= {frozenset((loner, other)) for other in bodies if other != loner}
    order = list(robot.links)
    for pair in sorted(sorted(pair, key=order.index) for pair in pairs):
        one, other = (bodies.get(carrier, []) for carrier in pair)
        for first, second in itertools.product(one, other):
            spec.add_exclude(bodyname1=first, bodyname2=second)


def _colliding_bodies(robot: Robot) -> dict[str, list[str]]:
    """Return the bodies in which what each carrier carries collides: one, where MuJoCo welds."""
    bodies: dict[str, list[str]] = {}
    for link, carrier in robot.carriers.items():
        if robot.links[link].collisions:
            bodies.setdefault(carrier, []).append(link)
    if robot.is_fixed:
        return bodies
    return {carrier: [carrier] for carrier in bodies}


def _loners(robot: Robot) -> list[str]:
    """Return the carriers none of whose links may touch the robot, as the gazebo tags have it."""
    said: dict[str, list[bool]] = {}
    for link, collides in robot.self_collide.items():
        if link in robot.carriers:
            said.setdefault(robot.carriers[link], []).append(collides)
    return [carrier for carrier, words in said.items() if not any(words)]


def _colliding(spec: mujoco.MjSpec, robot: Robot, link: str) -> list[tuple[Shape, mujoco.MjsGeom]]:
    body = spec.body(link)
    if body is None or link not in robot.links:  # welded on, or a tag's reference to nothing
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
