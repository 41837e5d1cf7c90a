# SPDX-License-Identifier: Apache-2.0
"""A robot as data: links, joints, shapes and where they are; geometry and masses live here."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
import xml.etree.ElementTree as ElementTree

import numpy as np
from wasd_core.rotations import axis_angle, IDENTITY, NO_ORIGIN, Origin, Pose

Colour = tuple[float, ...]
# The colour of what has none, or none that is valid.
GREY = (0.7, 0.7, 0.7, 1.0)
MOVABLE = ('revolute', 'continuous', 'prismatic')
# What has stops at both ends.
LIMITED = ('revolute', 'prismatic')
# Joints on which a robot moves freely in its world.
LOOSE = ('floating', 'planar')
JOINT_KINDS = (*MOVABLE, 'fixed', *LOOSE)
# A root link of this name is no part of the robot: what hangs on it does not float.
WORLD_LINK = 'world'
# Of links without an inertial where nothing is simulated, as in the first lessons on URDF.
STAND_IN_MASS, STAND_IN_INERTIA = 1.0, 0.01  # [kg], [kg m^2]
# A second moment below this share of their sum counts as impossible: MuJoCo refuses it.
SMALLEST_SHARE = 1e-9
# What it is raised to, and the radius of gyration [m] of a mass without any extent.
RAISED_SHARE = 1e-6
SMALLEST_RADIUS = 1e-4
# A negative moment of this share of their sum is more than rounding.
WORTH_SAYING = 1e-3
# A link whose radius of gyration is so many times as long as its robot is no link of it.
ABSURD = 10.0
# A robot reaches no less and no further from its root than this [m].
SHORTEST, LONGEST = 0.01, 30.0
# Nothing to MuJoCo, whose limit is lower by two digits [kg m^2].
SMALLEST_MOMENT = 1e-12


@dataclass(frozen=True)
class Shape:
    """
    What is drawn or what collides: kind, size in URDF's order [m], pose in its link.

    A mesh has no size but a URL and a scale along x, y and z. What is drawn has a colour: red,
    green, blue, opacity, each from 0 to 1.
    """

    kind: str
    size: tuple[float, ...]
    pose: Origin
    collides: bool
    rgba: Colour = GREY
    url: str = ''
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Link:
    """
    A link: its mass [kg], what collides and what is drawn.

    `inertia` (3, 3) [kg m^2] is about its centre of mass, in the axes of its inertial frame, whose
    pose in the link is `inertial`. Mass and inertia are 0 without an inertial. `shapes` are in the
    order of the file.
    """

    name: str
    mass: float
    inertia: np.ndarray
    inertial: Origin
    shapes: tuple[Shape, ...]

    @cached_property
    def collisions(self) -> tuple[Shape, ...]:
        """What collides."""
        return tuple(shape for shape in self.shapes if shape.collides)

    @cached_property
    def visuals(self) -> tuple[Shape, ...]:
        """What is drawn."""
        return tuple(shape for shape in self.shapes if not shape.collides)


@dataclass(frozen=True)
class Joint:
    """
    A joint: `pose` is the joint frame in the parent link at position 0.

    Positions are in [rad] or [m], effort in [N m] or [N], velocity in [rad/s] or [m/s]; without
    limits `lower` and `upper` are infinite. Viscous `damping` is in [N m s/rad] or [N s/m], dry
    `friction` in [N m] or [N]. `mimics` names the joint that it follows, if any, at
    `multiplier * position + offset`. `has_effort` and `has_velocity` are whether the description
    names these limits.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Origin
    axis: np.ndarray
    effort: float
    velocity: float
    lower: float
    upper: float
    damping: float
    friction: float
    mimics: str
    multiplier: float
    offset: float
    has_effort: bool = True
    has_velocity: bool = True

    @property
    def is_movable(self) -> bool:
        """Whether it has one degree of freedom."""
        return self.kind in MOVABLE

    @property
    def rest(self) -> float:
        """Where it rests: at 0, or as near as its limits let it [rad] or [m]."""
        return min(max(0.0, self.lower), self.upper)

    def transform(self, position: float) -> Pose:
        """Return the child's pose in the parent at a joint position [rad] or [m]."""
        if self.kind in ('revolute', 'continuous'):
            return self.pose @ Pose(np.zeros(3), axis_angle(self.axis, position))
        if self.kind == 'prismatic':
            return self.pose @ Pose(self.axis * position, np.eye(3))
        return self.pose


@dataclass(frozen=True)
class Robot:
    """
    A kinematic tree.

    `friction` and `self_collide` map a link to what its gazebo tag says, where it does; `gazebo`
    are these tags, for what a simulator looks for in them. `mesh_files` maps the URL of a mesh to
    its file, as far as these were looked for and found. `casters` are links that carry the robot
    beside its driven wheels, of which the description says no more. `notes` are lines about what
    the description leaves out or says as no other reads it.
    """

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    friction: dict[str, float]
    self_collide: dict[str, bool]
    gazebo: tuple[ElementTree.Element, ...]
    mesh_files: Mapping[str, Path] = field(default_factory=dict)
    casters: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()

    @property
    def mass(self) -> float:
        """Sum of the link masses [kg]."""
        return sum(link.mass for link in self.links.values())

    @cached_property
    def reach(self) -> float:
        """About how far links and primitives reach from the root [m], joints at 0."""
        return max(
            float(np.linalg.norm((pose @ shape.pose).position)) + float(np.linalg.norm(shape.size))
            for name, pose in self.zero_poses.items()
            for shape in (Shape('', (), NO_ORIGIN, False), *self.links[name].shapes)
        )

    @property
    def is_fixed(self) -> bool:
        """Whether the robot hangs on a link called `world`."""
        return self.root == WORLD_LINK

    @property
    def base(self) -> str:
        """The link that carries the others: the root, or what hangs on the world first."""
        if not self.is_fixed:
            return self.root
        return next((j.child for j in self.joints.values() if j.parent == self.root), self.root)

    @property
    def root_joint(self) -> str:
        """A name for the joint by which it floats that no joint of its own has."""
        name = 'root'
        while name in self.joints:
            name += '_'
        return name

    @property
    def movable_joints(self) -> tuple[Joint, ...]:
        """Joints with a degree of freedom, in the order of the file."""
        return tuple(joint for joint in self.joints.values() if joint.is_movable)

    @cached_property
    def rest_positions(self) -> dict[str, float]:
        """Where movable joints rest [rad] or [m]; what mimics one, where that has it."""
        return self.all_positions({})

    def all_positions(self, given: Mapping[str, float]) -> dict[str, float]:
        """Return where movable joints are [rad] or [m]: as given, at rest, or as mimics follow."""
        positions = {}
        for joint in self.movable_joints:
            chain = [joint]
            while (other := self.joints.get(chain[-1].mimics)) is not None and other.is_movable:
                chain.append(other)
            leader = chain.pop()
            position = given.get(leader.name, leader.rest)
            for follower in reversed(chain):
                position = follower.multiplier * position + follower.offset
            positions[joint.name] = position
        return positions

    @cached_property
    def parent_joints(self) -> dict[str, Joint]:
        """The joint that holds each link but the root."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def links_from_root(self) -> tuple[str, ...]:
        """The links, each after its parent, brothers in the order of the file."""
        children: dict[str, list[str]] = {link: [] for link in self.links}
        for joint in self.joints.values():
            children[joint.parent].append(joint.child)
        order = []
        waiting = [self.root]
        while waiting:
            order.append(link := waiting.pop())
            waiting += reversed(children[link])
        return tuple(order)

    @cached_property
    def carriers(self) -> dict[str, str]:
        """For each link the one that moves with it and has a joint of its own, or is the root."""
        carriers: dict[str, str] = {}
        for link in self.links_from_root:
            joint = self.parent_joints.get(link)
            welded = joint is not None and joint.kind == 'fixed'
            carriers[link] = carriers[joint.parent] if joint is not None and welded else link
        return carriers

    @cached_property
    def massless(self) -> dict[str, float]:
        """Links that move with no mass of their own or welded on, and the mass beyond [kg]."""
        welded = dict.fromkeys(self.links, 0.0)
        beyond = dict(welded)
        for link in reversed(self.links_from_root):
            mass = self.links[link].mass
            welded[self.carriers[link]] += mass
            beyond[link] += mass
            if link != self.root:
                beyond[self.parent_joints[link].parent] += beyond[link]
        moving = (link for link in self.links_from_root if self.carriers[link] == link)
        return {
            link: beyond[link]
            for link in moving
            if welded[link] <= 0.0 and not (self.is_fixed and link == self.root)
        }

    def link_poses(self, positions: Mapping[str, float]) -> dict[str, Pose]:
        """Return the pose of every link in the root, with joints at positions [rad] or [m]."""
        poses = {self.root: IDENTITY}
        for link in self.links_from_root[1:]:
            joint = self.parent_joints[link]
            poses[link] = poses[joint.parent] @ joint.transform(positions.get(joint.name, 0.0))
        return poses

    def with_stand_in_masses(self) -> 'Robot':
        """Return the robot with a mass for each link, for a world without physics."""
        inertia = STAND_IN_INERTIA * np.eye(3)
        links = {
            name: link if link.mass else replace(link, mass=STAND_IN_MASS, inertia=inertia)
            for name, link in self.links.items()
        }
        return replace(self, links=links)

    @cached_property
    def zero_poses(self) -> dict[str, Pose]:
        """The pose of every link in the root with every joint at 0."""
        return self.link_poses({})


def _second_moments(inertia: np.ndarray) -> np.ndarray:
    moments: np.ndarray = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return moments


def _smallest_share(inertia: np.ndarray) -> float:
    """Return the smallest second moment as a share of their sum; 0 for none."""
    values = np.linalg.eigvalsh(_second_moments(inertia))
    total = float(np.abs(values).sum())
    return float(values[0]) / total if total > SMALLEST_MOMENT else 0.0


def possible_inertia(inertia: np.ndarray, mass: float) -> np.ndarray | None:
    """
    Return the inertia (3, 3) [kg m^2] nearest to an impossible one; None when it is possible.

    A body's second moments of mass S = tr(I)/2 1 - I cannot be negative along any direction,
    which says at once that principal inertias are positive and obey the triangle inequality.
    Negative ones are raised to next to nothing [Wensing2018, eq. 9].
    """
    values, directions = np.linalg.eigh(_second_moments(inertia))
    total = float(np.abs(values).sum())
    if values[0] > max(SMALLEST_SHARE * total, 0.1 * SMALLEST_MOMENT):
        return None
    floor = max(RAISED_SHARE * total, mass * SMALLEST_RADIUS**2, SMALLEST_MOMENT)
    raised = directions @ np.diag(np.maximum(values, floor)) @ directions.T
    mended: np.ndarray = np.trace(raised) * np.eye(3) - raised
    return mended


def impossible_inertias(robot: Robot) -> tuple[str, ...]:
    """
    Return a line for each link whose inertia no body can have.

    Points, rods and plates, which have none in some direction, and rounding are not worth a line.
    """
    return tuple(
        f'inertia of link {link.name!r}: impossible: using the nearest that a body can have '
        f'(principal {", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(link.inertia))})'
        for link in robot.links.values()
        if link.mass > 0.0 and _smallest_share(link.inertia) < -WORTH_SAYING
    )


def absurd_size(robot: Robot) -> tuple[str, ...]:
    """Return a line about the robot's size, if its lengths can hardly be in metres."""
    if robot.reach == 0.0 or SHORTEST <= robot.reach <= LONGEST:
        return ()
    return (f'the robot reaches {robot.reach:.3g} m from its root: check units, URDF has metres',)


def credible_inertias(robot: Robot) -> tuple[Robot, tuple[str, ...]]:
    """
    Return the robot without inertias of another world, and a line about them, if there were any.

    A radius of gyration of many times the robot's reach is a number that was put there to have
    one: with 1000 kg m^2 on a shin of 100 g nothing ever moves. Such a link gets the inertia of a
    ball as large as its shapes.
    """
    reach = max(
        float(np.linalg.norm(robot.zero_poses[link.name].position)) + _radius(link)
        for link in robot.links.values()
    )
    most = ABSURD * reach
    absurd = {
        link.name: link
        for link in robot.links.values()
        if link.mass > 0.0 and most > 0.0 and _gyration(link) > most
    }
    if not absurd:
        return robot, ()
    worst = max(absurd.values(), key=_gyration)
    line = (
        f'inertia of {len(absurd)} links ({worst.name!r} has {worst.inertia.max():.3g} kg m^2 '
        f'at {worst.mass:g} kg, a body of {_gyration(worst):.2g} m; the robot has {reach:.2g} m): '
        'using balls as large as their shapes'
    )
    sizes = {name: _radius(link) or 0.1 * reach for name, link in absurd.items()}
    mended = {
        name: replace(link, inertia=0.4 * link.mass * sizes[name] ** 2 * np.eye(3))
        for name, link in absurd.items()
    }
    return replace(robot, links=robot.links | mended), (line,)


def _gyration(link: Link) -> float:
    """Return the largest radius of gyration [m] of a link that has a mass."""
    return float(np.sqrt(max(float(np.linalg.eigvalsh(link.inertia)[-1]), 0.0) / link.mass))


def _radius(link: Link) -> float:
    """Return half of the longest extent of a link's solids [m]; 0 of one with none but meshes."""
    return max((0.5 * max(shape.size) for shape in link.shapes if shape.size), default=0.0)
