# SPDX-License-Identifier: Apache-2.0
"""
A robot as MuJoCo's specification: a floating tree, with motors where it has effort limits.

MuJoCo's own reader of URDF does much silently; here each step is explicit: angles are radians,
joints have their range, damping and dry friction, some mimic others, and links that are welded on
become one body. Impossible inertias become the nearest possible, instead of being balanced by the
compiler. What is drawn can be left out, and meshes come as triangles, so that MuJoCo interprets
neither path nor scale.
"""

from collections.abc import Iterator, Mapping
import contextlib

import mujoco
import numpy as np
from wasd_core.errors import DescriptionError, one_line
from wasd_core.robot_io import TIME_STEP
from wasd_core.rotations import NO_ORIGIN, Origin

from robot_description.morphology.quadruped import find_imu, imu_position, REFLECTED_INERTIA
from robot_description.morphology.wheels import find_drive
from robot_description.mujoco.geoms import (
    add_geoms,
    exclude_all,
    exclude_pairs,
    Meshes,
    quaternion,
)
from robot_description.robot import Joint, possible_inertia, Robot, WORLD_LINK

# How far in the floor a hanging robot may be, and how far above it is hung up otherwise [m].
CLEARANCE = 0.05
# A link without mass between two joints, as a hip of three axes has, gets so much [kg], [kg m^2].
NEXT_TO_NOTHING = 1e-9
# Dry friction that holds a light wheel, which would creep by MuJoCo's own: as quick as a step of
# physics allows, and as hard as MuJoCo can.
DRY_SOLREF, DRY_SOLIMP = (2.0 * TIME_STEP, 1.0), (0.9999, 0.9999)
# How far a joint whose limits are equal may move to either side [rad], [m].
LOCKED = 1e-6


def to_mujoco(robot: Robot, visuals: bool = False) -> mujoco.MjSpec:
    """
    Return the robot as a MuJoCo model specification, nothing around it.

    It is free to move unless it hangs on a link called `world`; then it hangs high enough to
    touch no floor at z = 0. Joints with an effort limit get a motor of the joint's name, unless
    they mimic another; the others swing freely. Colliding geoms are called `LINK/0`, `LINK/1`, ...
    and stay so when their link is welded into its parent. Without `visuals` nothing is there to
    be drawn.

    Raises:
        DescriptionError: what MuJoCo cannot have of it, in one line.
    """
    with _one_line():
        spec = mujoco.MjSpec()
        if robot.name:
            spec.modelname = robot.name
        spec.compiler.degree = False  # URDF's angles are in radians
        # What is welded on is one body with what carries it, which is faster. Not on the world,
        # into which the base would be welded, too, and lose its mass.
        spec.compiler.fusestatic = not robot.is_fixed
        bodies = _add_bodies(spec, robot)
        add_masses(bodies, robot)
        meshes = Meshes(spec, robot.mesh_files)
        for link in robot.links.values():
            add_geoms(bodies[link.name], link, robot, meshes, visuals)
        for joint in robot.joints.values():
            _add_joint(bodies[joint.child], joint)
        exclude_pairs(spec, robot)
        _drive(spec, robot)
        if find_imu(robot) is not None:
            add_imu(spec, robot)
    if robot.is_fixed:
        _hang(spec, robot)
    return spec


def add_sky(spec: mujoco.MjSpec, rgb1: list[float], rgb2: list[float]) -> None:
    """Add a sky between two colours."""
    spec.add_texture(
        name='sky',
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=rgb1,
        rgb2=rgb2,
        width=64,  # of 256 it would look the same, and a world take a third longer to build
        height=6 * 64,
    )


def compile_model(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """
    Return the compiled model.

    Raises:
        DescriptionError: what MuJoCo says, in one line.
    """
    with _one_line():
        model: mujoco.MjModel = spec.compile()
    return model


@contextlib.contextmanager
def _one_line() -> Iterator[None]:
    """Turn what MuJoCo refuses, a name used twice, say, into a DescriptionError."""
    try:
        yield
    except DescriptionError:  # our own words
        raise
    except ValueError as error:
        raise DescriptionError(f'MuJoCo: {one_line(error)}') from None


def add_imu(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Measure specific force and angular velocity where the IMU is, in the base's axes."""
    site = 'imu_site'
    spec.body(robot.base).add_site(name=site, pos=imu_position(robot))
    for name, kind in (
        ('accelerometer', mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ('gyro', mujoco.mjtSensor.mjSENS_GYRO),
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


def _add_bodies(spec: mujoco.MjSpec, robot: Robot) -> dict[str, mujoco.MjsBody]:
    """Add a body for each link where its joint is at 0; MuJoCo has a body `world` already."""
    bodies: dict[str, mujoco.MjsBody] = {}
    for link in robot.links_from_root:
        joint = robot.parent_joints.get(link)
        if joint is not None:
            bodies[link] = bodies[joint.parent].add_body(
                name=link, pos=joint.pose.position, quat=quaternion(joint.pose)
            )
        elif link == WORLD_LINK:
            bodies[link] = spec.worldbody
        else:
            bodies[link] = spec.worldbody.add_body(name=link)
            bodies[link].add_freejoint(name=robot.root_joint)
    return bodies


def _add_joint(body: mujoco.MjsBody, joint: Joint) -> None:
    """Let a body move as its joint does: not at all, in one way, or in several."""
    hinge, slide = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
    added = []
    if joint.kind == 'floating':
        raise DescriptionError(
            f'joint {joint.name!r} floats within the robot: only one that alone hangs the robot '
            'on a root without mass and shapes may'
        )
    if joint.kind == 'planar':
        # Along two axes of its plane and about the normal on it, the joint's axis.
        turn = _turn_from_x(joint.axis)
        for end, kind, axis in (
            ('TX', slide, (0.0, 0.0, -1.0)), ('TY', slide, (0.0, 1.0, 0.0)),
            ('RZ', hinge, (1.0, 0.0, 0.0)),
        ):  # fmt: skip
            axis = turn @ np.array(axis)
            added.append(body.add_joint(name=f'{joint.name}_{end}', type=kind, axis=axis))
    elif joint.is_movable:
        kind = slide if joint.kind == 'prismatic' else hinge
        added.append(body.add_joint(name=joint.name, type=kind, axis=joint.axis))
    for each in added:
        each.damping[0] = joint.damping
        each.frictionloss = joint.friction
        if joint.kind == 'continuous':
            each.solref_friction[:], each.solimp_friction[:2] = DRY_SOLREF, DRY_SOLIMP
    if joint.kind == 'revolute':
        added[0].armature = REFLECTED_INERTIA
    if np.isfinite(joint.upper):
        # A range without any width is none to MuJoCo: a joint that is locked has a hair.
        hair = LOCKED if joint.lower == joint.upper else 0.0
        added[0].range = joint.lower - hair, joint.upper + hair
    if added and joint.effort:
        # Whatever acts on the joint, in sum; its motor stops there by itself.
        added[0].actfrcrange = -abs(joint.effort), abs(joint.effort)


def _turn_from_x(axis: np.ndarray) -> np.ndarray:
    """Return the shortest rotation (3, 3) that turns x to a unit axis (3,)."""
    x, y, z = axis
    if x < -1.0 + 1e-9:  # about z
        return np.diag((-1.0, -1.0, 1.0))
    cross = np.array(((0.0, -y, -z), (y, 0.0, 0.0), (z, 0.0, 0.0)))
    turn: np.ndarray = np.eye(3) + cross + cross @ cross / (1.0 + x)
    return turn


def _drive(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give joints their motor, or what they mimic."""
    for joint in robot.movable_joints:
        if joint.effort > 0.0 and not joint.mimics:
            _add_motor(spec, joint)
        other = robot.joints.get(joint.mimics)
        if other is not None and other.is_movable:  # position = multiplier * other + offset
            equality = spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT, name1=joint.name, name2=joint.mimics
            )
            equality.data[:2] = joint.offset, joint.multiplier


def _add_motor(spec: mujoco.MjSpec, joint: Joint) -> None:
    """
    Add an actuator whose force is `ctrl - kp q - kd v`, clipped to the effort limit [N m].

    Gains are written at run time, so that the law acts at every physics step.
    """
    actuator = spec.add_actuator(
        name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
    )
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.gainprm[0] = 1.0
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.forcelimited = True
    actuator.forcerange = np.array([-joint.effort, joint.effort])


def hold_joints(spec: mujoco.MjSpec, robot: Robot, held: Mapping[str, float]) -> None:
    """
    Keep joints where they are `held` [rad] or [m], whatever hangs on them.

    It is a constraint, called as `holding` says, which MuJoCo weighs against the inertia that it
    moves: one stiffness serves an antenna and an arm. What is held may overlap what carries it, as
    it often does with all joints at 0.
    """
    for name, position in held.items():
        if not robot.joints[name].mimics:
            equality = spec.add_equality(
                name=holding(name), type=mujoco.mjtEq.mjEQ_JOINT, name1=name
            )
            equality.data[0] = position
    rigid = {robot.carriers[robot.base], *(robot.joints[name].child for name in held)}
    exclude_all(spec, robot, rigid)


def holding(joint: str) -> str:
    """Return what the constraint that holds a joint is called."""
    return f'{joint} is held'


def _hang(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Lift a robot whose feet would be in the floor; what stands on it stays."""
    model = compile_model(spec)
    lowest = lowest_geom_point(model, mujoco.MjData(model))
    if lowest < -CLEARANCE and robot.base != robot.root:
        spec.body(robot.base).pos[2] += CLEARANCE - lowest


def lowest_geom_point(
    model: mujoco.MjModel, data: mujoco.MjData, root: int | None = None
) -> float:
    """
    Return the height of the lowest point that collides [m]; inf if none does.

    `root` is the first body of the robot that counts; without it all do. `data` holds the pose.
    Boxes stand for all shapes but spheres, so that the result may be a little too low.
    """
    mujoco.mj_kinematics(model, data)
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    if root is not None:
        collides &= model.body_rootid[model.geom_bodyid] == root
    geoms = np.flatnonzero(collides)
    up = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
    centre, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
    reach = (np.abs(up) * half).sum(axis=1) - (up * centre).sum(axis=1)
    is_round = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE
    reach = np.where(is_round, model.geom_rbound[geoms], reach)
    return float((data.geom_xpos[geoms, 2] - reach).min(initial=np.inf))


def overlaps(robot: Robot) -> dict[tuple[str, str], float]:
    """
    Return how deep links are in each other where the joints rest [m], by their names.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
    """
    model = compile_model(to_mujoco(robot))
    data = mujoco.MjData(model)
    for name, position in robot.rest_positions.items():
        data.joint(name).qpos[0] = position
    mujoco.mj_forward(model, data)
    deepest: dict[tuple[str, str], float] = {}
    for geoms, distance in zip(data.contact.geom.tolist(), data.contact.dist, strict=True):
        one, other = (model.geom(geom).name.rpartition('/')[0] for geom in geoms)
        deepest[one, other] = max(deepest.get((one, other), 0.0), -float(distance))
    return deepest


def add_masses(bodies: Mapping[str, mujoco.MjsBody], robot: Robot) -> None:
    """
    Give the links' bodies their masses and inertias, the nearest possible for an impossible one.

    Raises:
        DescriptionError: a joint moves nothing that has a mass.
    """
    virtual = _virtual_links(robot)
    for link in robot.links.values():
        if link.mass > 0.0:
            mended = possible_inertia(link.inertia, link.mass)
            inertia = link.inertia if mended is None else mended
            _set_mass(bodies[link.name], link.mass, inertia, link.inertial)
        elif link.name in virtual:
            inertia = NEXT_TO_NOTHING * np.eye(3)
            _set_mass(bodies[link.name], NEXT_TO_NOTHING, inertia, NO_ORIGIN)


def _set_mass(body: mujoco.MjsBody, mass: float, inertia: np.ndarray, frame: Origin) -> None:
    """Set a body's mass; MuJoCo finds the principal axes of the inertia in the frame by itself."""
    body.explicitinertial = True
    body.mass = mass
    body.ipos, body.iquat = frame.position, quaternion(frame)
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]


def _virtual_links(robot: Robot) -> set[str]:
    """
    Return the links that move without a mass of their own, with one further out.

    Raises:
        DescriptionError: there is a link that moves without any.
    """
    for link, beyond in robot.massless.items():
        own = robot.links[link].mass
        if own < 0.0:
            raise DescriptionError(f'link {link!r} has a mass of {own:g} kg: weigh it')
        if beyond <= 0.0:
            joint = robot.parent_joints.get(link)
            by = f' (joint {joint.name!r})' if joint is not None else ''
            has = f'a mass of {beyond:g} kg' if beyond else 'no mass'
            can_fake = bool(find_drive(robot).wheels)
            or_else = ', or drive it without physics: wasd mbot --mode fake' * can_fake
            raise DescriptionError(
                f'link {link!r} moves{by} but has {has}: '
                f'give it an <inertial> with <mass> and <inertia>{or_else}'
            )
    return set(robot.massless)
