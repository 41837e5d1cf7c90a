# SPDX-License-Identifier: Apache-2.0
"""
What is put into a robot with two driven wheels: motors, tyres, casters; and what is held.

See "The motor" in docs/diff_drive.md; why a motor's torque falls linearly with speed: Franklin,
Powell, Emami-Naeini, Feedback Control of Dynamic Systems, section 2.3.
"""

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import NamedTuple

import numpy as np
from wasd_core.robot_io import GRAVITY, TIME_STEP
from wasd_core.rotations import Origin, Pose, rpy_from_matrix

from robot_description.meshes.load import mesh_points
from robot_description.morphology.rollers import rolling_joints
from robot_description.morphology.tyre import carried, Tyre
from robot_description.morphology.wheels import Drive
from robot_description.robot import Joint, Link, Robot, Shape

# A gear motor's stall torque over the torque that its driver lets through.
STALL_SHARE = 3.75
# A loaded wheel nears its speed no sooner and no later than with these time constants [s]; mbot,
# for which the loop was tuned, has 0.011.
QUICKEST, SLOWEST = 0.010, 0.025
# A joint that damps is driven by a line so much steeper: else it would decide the speed.
OVER_DRAG = 4.0


class MotorSize(NamedTuple):
    """
    The motor of each of two driven wheels.

    `damping` [N m s/rad] is the slope of its line, `rotor` [kg m^2] what it adds to its wheel;
    `straight` and `turning` [kg m^2] are what the wheel moves, seen at its axis.
    """

    damping: float
    rotor: float
    straight: float
    turning: float


class Strength(NamedTuple):
    """What motors allow along one axis [m/s^2] or [rad/s^2]; infinite where nobody knows."""

    speed_up: float = math.inf
    slow_down: float = math.inf

    def scaled(self, factor: float) -> 'Strength':
        """Return so many times this."""
        return Strength(factor * self.speed_up, factor * self.slow_down)


def size_motor(robot: Robot, drive: Drive) -> MotorSize:
    """Return the motor of each of two wheels; without a torque limit or masses it has none."""
    left, right = drive.wheels
    joint, radius = drive.weakest.joint, drive.weakest.radius
    middle = 0.5 * (left.position + right.position)
    straight = 0.5 * robot.mass * radius**2
    turning = 2.0 * yaw_inertia(robot, float(middle[0]), float(middle[1]))
    turning *= (radius / drive.track) ** 2
    load = max(straight, turning)
    described = STALL_SHARE * joint.effort / joint.velocity if joint.velocity > 0.0 else 0.0
    steepest = load / QUICKEST + OVER_DRAG * joint.damping
    damping = min(max(described, load / SLOWEST), steepest) if described > 0.0 else 0.0
    rotor = max(0.0, TIME_STEP * damping - axle_inertia(robot, joint))
    return MotorSize(damping, rotor, straight, turning)


def strength(robot: Robot, drive: Drive) -> tuple[Strength, Strength]:
    """
    Return what the motors allow ahead [m/s^2] and of a turn [rad/s^2]: the weaker one decides.

    Dry friction takes of the torque that speeds a wheel up, and helps to brake it.
    """
    size = size_motor(robot, drive)
    if size.damping == 0.0:
        return Strength(), Strength()
    weakest = drive.weakest
    torque = Strength(
        max(0.0, weakest.joint.effort - weakest.joint.friction),
        min(wheel.joint.effort + wheel.joint.friction for wheel in drive.wheels),
    )
    own = axle_inertia(robot, weakest.joint) + size.rotor
    ahead = weakest.radius / (size.straight + own)
    turning = 2.0 * weakest.radius / drive.track / (size.turning + own)
    return torque.scaled(ahead), torque.scaled(turning)


def rotors(robot: Robot, drive: Drive) -> dict[str, float]:
    """Return what rotors add to the driven wheels [kg m^2] by joint, where these need one."""
    rotor = size_motor(robot, drive).rotor if drive.wheels else 0.0
    return {wheel.joint.name: rotor for wheel in drive.wheels} if rotor > 0.0 else {}


def yaw_inertia(robot: Robot, x: float, y: float) -> float:
    """Return the robot's moment of inertia about a vertical line [kg m^2], joints at 0."""
    total = 0.0
    for link in robot.links.values():
        pose = robot.zero_poses[link.name] @ link.inertial
        up = pose.rotation[2]
        arm = (pose.position[0] - x) ** 2 + (pose.position[1] - y) ** 2
        total += float(up @ link.inertia @ up) + link.mass * float(arm)
    return total


def axle_inertia(robot: Robot, joint: Joint) -> float:
    """Return a wheel's own moment of inertia about its axis [kg m^2]."""
    link = robot.links[joint.child]
    axis = link.inertial.rotation.T @ joint.axis
    return float(axis @ link.inertia @ axis)


# What hangs at most so much higher than the wheels' lowest point [m] is there to touch the floor.
FLOOR_GAP = 0.003
# Wheels hang where what is before and behind them reaches lower by more than this [m].
HANGING = 0.001
# A motor that a description does not speak of: rim speed [m/s], and torque as a multiple of what
# makes a wheel slip on a floor with friction 1, beyond what the joint itself takes.
RIM_SPEED = 1.5
TORQUE_SHARE = 2.0
TYRE_FRICTION = 1.0


def equip_drive(robot: Robot, drive: Drive) -> Robot:
    """
    Return the robot with what its two driven wheels need and its description leaves out.

    It adds motors, tyres with grip, and casters without friction that give way, which are the
    links that touch the floor beside the wheels. Wheels that are no clean cylinder or ball to
    collide with get one, and what carries them is held. What the description says is kept.
    """
    if not drive.wheels:
        return robot
    joints, links = dict(robot.joints), dict(robot.links)
    friction, touching = dict(robot.friction), dict(robot.self_collide)
    for wheel in drive.wheels:
        joint = wheel.joint
        velocity = joint.velocity if joint.velocity > 0.0 else RIM_SPEED / wheel.radius
        torque = 0.5 * TORQUE_SHARE * robot.mass * GRAVITY * wheel.radius
        torque += joint.friction + joint.damping * velocity  # the joint's own, at any speed
        joints[joint.name] = replace(
            joint,
            kind='continuous',
            lower=-math.inf,
            upper=math.inf,
            effort=joint.effort if joint.effort > 0.0 else torque,
            velocity=velocity,
        )
        joints |= {mount.name: _held(mount) for mount in wheel.mounts}
        parts = [link.name for link, _ in carried(robot, joint.child)]
        # An arm that is held may lie in a wheel with its joints at 0, and would brake it.
        touching = dict.fromkeys(parts, False) | touching
        said = [friction[name] for name in parts if name in friction]
        friction = dict.fromkeys(parts, said[0] if said else TYRE_FRICTION) | friction
        if not wheel.tyre.is_exact:
            # The tyre alone rolls, and not what is welded on, which would touch in two points.
            links |= {name: replace(links[name], shapes=links[name].visuals) for name in parts}
            links[joint.child] = _with_tyre(links[joint.child], joint.axis, wheel.tyre)
    idle = {link.name for joint in drive.idle for link, _ in carried(robot, joint.child)}
    friction = {name: mu for name, mu in friction.items() if name not in idle}
    robot = replace(robot, joints=joints, links=links, friction=friction, self_collide=touching)
    floor = min(float(wheel.position[2]) - wheel.radius for wheel in drive.wheels)
    low = {link for link in links if lowest_point(robot, link) <= floor + FLOOR_GAP}
    casters = frozenset(link for link in low | idle if link not in friction)
    friction |= dict.fromkeys(casters, 0.0)
    return replace(robot, casters=casters)


def hanging(robot: Robot, drive: Drive) -> tuple[str, ...]:
    """Return a line where others carry the robot before and behind its wheels, which hang."""
    if not drive.wheels:
        return ()
    own = {wheel.joint.child for wheel in drive.wheels}
    floor = min(float(wheel.position[2]) - wheel.radius for wheel in drive.wheels)
    lowest = {link: lowest_point(robot, link) for link in robot.links if link not in own}
    low = [link for link, height in lowest.items() if height < floor - HANGING]
    ahead = {
        float(robot.zero_poses[link].position[0] - drive.wheels[0].position[0]) > 0.0
        for link in low
    }
    if len(ahead) < 2:
        return ()
    depth = 1e3 * (floor - max(lowest[link] for link in low))
    return (
        f'{", ".join(low)} reach {depth:.2g} mm below the driven wheels, which hang in the air: '
        'raise them or lower the wheels',
    )


def held_joints(robot: Robot, drive: Drive) -> dict[str, float]:
    """Return where the motors of what a wheeled robot carries, an arm say, hold [rad] or [m]."""
    if not drive.wheels:
        return {}
    wheels = {wheel.joint.name for wheel in drive.wheels} | {joint.name for joint in drive.idle}
    rolling = rolling_joints(robot) | wheels
    return {
        joint.name: joint.rest
        for joint in robot.movable_joints
        if (joint.kind != 'continuous' or joint.name not in rolling)
        and joint.effort > 0.0
        and not joint.mimics
    }


def _held(joint: Joint) -> Joint:
    """Return a joint that does not move from where it rests."""
    pose, rpy = joint.transform(joint.rest), joint.pose.rpy
    if joint.kind != 'prismatic' and joint.rest != 0.0:
        roll, pitch, yaw = rpy_from_matrix(pose.rotation).tolist()
        rpy = roll, pitch, yaw
    origin = Origin(pose.position, pose.rotation, rpy)
    return replace(joint, kind='fixed', pose=origin, lower=-math.inf, upper=math.inf, effort=0.0)


def _with_tyre(link: Link, axis: np.ndarray, tyre: Tyre) -> Link:
    """Return a wheel's link that collides as a cylinder about its axis, and looks as before."""
    # Its x level in the link, so that roll and yaw have but one meaning.
    level = np.array([-axis[1], axis[0], 0.0])
    length = float(np.linalg.norm(level))
    x = level / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    rotation = np.column_stack((x, np.cross(axis, x), axis))
    roll, pitch, yaw = rpy_from_matrix(rotation).tolist()
    pose = Origin(tyre.centre, rotation, (roll, pitch, yaw))
    rolls = Shape('cylinder', (tyre.radius, tyre.width), pose, collides=True)
    return replace(link, shapes=(*link.visuals, rolls))


def lowest_point(
    robot: Robot, link: str | None = None, poses: Mapping[str, Pose] | None = None
) -> float:
    """
    Return the least z that collides in the root's frame [m], of a link or of all.

    Links are at their `poses`, or where they are with every joint at 0. Where nothing collides
    what is drawn does, without meshes.
    """
    poses = robot.zero_poses if poses is None else poses
    collides = any(each.collisions for each in robot.links.values())
    links = [robot.links[link]] if link is not None else robot.links.values()
    heights = (
        float(pose.position[2]) - _reach_down(robot, shape, pose.rotation[2])
        for each in links
        for shape in (each.collisions if collides else each.visuals)
        for pose in [poses[each.name] @ shape.pose]
    )
    return min(heights, default=math.inf)


def _reach_down(robot: Robot, shape: Shape, up: np.ndarray) -> float:
    """Return how far a shape reaches below its centre [m]; `up` is z in its axes."""
    if shape.kind == 'mesh' and shape.collides:
        points = mesh_points(robot, shape)
        return -math.inf if points is None else -float((points @ up).min())
    if shape.kind == 'sphere':
        return shape.size[0]
    if shape.kind == 'box':
        return 0.5 * float(np.abs(up) @ np.array(shape.size))
    if shape.kind == 'capsule':
        radius, length = shape.size
        return radius + 0.5 * length * abs(float(up[2]))
    if shape.kind == 'cylinder':
        radius, length = shape.size
        return radius * math.hypot(up[0], up[1]) + 0.5 * length * abs(float(up[2]))
    return -math.inf
