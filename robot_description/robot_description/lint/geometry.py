# SPDX-License-Identifier: Apache-2.0
"""Checks of what it means: masses, inertias, left and right, wheels, a footprint."""

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from wasd_core.errors import DescriptionError
from wasd_core.rotations import Pose

from robot_description.lint.model import Element, end, Model
from robot_description.lint.rules import Finding, finding
from robot_description.morphology.names import OPPOSITE, part, sides, words
from robot_description.morphology.rollers import find_rollers, is_on_leg
from robot_description.morphology.tyre import imbalance, is_unbalanced
from robot_description.morphology.wheels import find_drive
from robot_description.robot import absurd_size, Robot
from robot_description.urdf import INERTIA_COMPONENTS

# Osmium has 22 590 kg/m^3; shapes are drawn a little small.
DENSEST = 30_000.0
# Lighter links are frames with a number for show, as an IMU's; their inertia moves nothing.
LEAST_MASS = 0.02
# Small parts are drawn as points, and their mass rounded up [kg].
LEAST_HEAVY = 0.1
# No robot weighs more than a ship, of any size [kg].
HEAVIEST = 1e6
# MuJoCo takes what is smaller for zero [kg m^2].
SMALLEST = 1e-15
# Rounded numbers of CAD programs miss the triangle inequality by less than this.
ROUNDING = 0.01
# How far an inertia may be off that of its shape, and how near it is then taken for equal.
SCALE, EQUAL = 10.0, 0.05
# Nearer to the middle than this [m], a thing has no side.
MIDDLE = 1e-3
# Wheels that differ by less than this [m] are meant to be equal.
SAME = 1e-6
FOOTPRINT = 'base_footprint'
# A root so near to the ground [m] is the point that stands for the robot itself.
ON_GROUND = 0.01


class Body(NamedTuple):
    """A link's inertial: mass [kg], tensor (3, 3) [kg m^2] in the link's axes."""

    link: Element
    inertial: Element
    mass: float
    tensor: np.ndarray

    @property
    def moments(self) -> np.ndarray:
        """Principal moments, the smallest first, shape (3,)."""
        moments: np.ndarray = np.linalg.eigvalsh(self.tensor)
        return moments

    def element(self, tag: str) -> Element:
        """Return a tag of the inertial, or the inertial itself."""
        return self.inertial.find(tag) or self.inertial


class Solid(NamedTuple):
    """A primitive: kind, pose in the link, edges of the box around it, volume [m^3]."""

    kind: str
    pose: Pose
    edges: np.ndarray
    volume: float


def check_inertials(model: Model) -> Iterator[Finding]:
    """Some link has a mass, if any moves."""
    links = model.robot.all('link')
    if model.moving_links & model.links.keys() and not any(
        link.find('inertial') for link in links
    ):
        yield finding('no-inertials', model.robot.place, f'none of {len(links)} links has a mass')


def check_massless(model: Model, robot: Robot) -> Iterator[Finding]:
    """Links that move have a mass, which is told here if no mass is at all."""
    for name, beyond in robot.massless.items() if robot.mass else ():
        link = model.links[name]
        if name not in model.moving_links or link.find('inertial/mass'):
            continue
        if beyond > 0.0:
            text = f'link {name!r} moves and has no mass, what hangs on it has {beyond:g} kg'
            yield finding('no-inertial', link.place, text)
        else:
            text = f'link {name!r} moves by {model.joint_above[name].name!r} and has no mass'
            yield finding('no-mass', link.place, text)


def check_floating(model: Model, robot: Robot) -> Iterator[Finding]:
    """Nothing floats within the robot."""
    for joint in robot.joints.values():
        if joint.kind == 'floating':
            text = f'joint {joint.name!r} lets {joint.child!r} float within the robot'
            yield finding('floating-joint', model.joints[joint.name].place, text)


def check_size(model: Model, robot: Robot) -> Iterator[Finding]:
    """Its lengths are those of a robot."""
    for line in absurd_size(robot):
        yield finding('absurd-size', model.robot.place, line.partition(':')[0])


def check_balance(model: Model, robot: Robot) -> Iterator[Finding]:
    """The centre of mass of a wheel is on its axle."""
    driving = {robot.carriers[j.parent] for j in robot.movable_joints if j.effort > 0.0}
    for roller in find_rollers(robot):
        # What carries a motor, a thigh a knee's, say, is no wheel.
        is_limb = is_on_leg(roller, robot) or roller.joint.child in driving
        if (
            roller.is_measured
            and not is_limb
            and is_unbalanced(robot, roller.joint, roller.radius)
        ):
            link = model.links[roller.joint.child]
            off = imbalance(robot, roller.joint)
            text = f'the centre of mass of {link.name!r} is {off:.3g} m off its axle'
            yield finding('unbalanced-wheel', (link.find('inertial') or link).place, text)


def check_wheel_room(model: Model, robot: Robot) -> Iterator[Finding]:
    """No link that moves by itself lies in a driven wheel where the joints rest."""
    wheels = {wheel.joint.child for wheel in find_drive(robot).wheels}
    if not wheels:
        return
    # Here, because MuJoCo takes longer to load than most files to check.
    from robot_description.mujoco.builder import overlaps

    try:
        deepest = overlaps(robot)
    except DescriptionError:  # which other findings tell
        return
    for (one, other), depth in deepest.items():
        turns, also_turns = (robot.carriers[name] in wheels for name in (one, other))
        if turns != also_turns:
            wheel, link = (one, other) if turns else (other, one)
            text = f'{link!r} lies {1e3 * depth:.3g} mm deep in the wheel {wheel!r}'
            yield finding('blocked-wheel', model.links[link].place, text)


def check_masses(model: Model) -> Iterator[Finding]:
    """Masses are positive, and fit into the shape."""
    for body in _bodies(model):
        name, place = body.link.name, body.element('mass').place
        if body.mass < 0.0 or (body.mass == 0.0 and name in model.moving_links):
            yield finding('bad-mass', place, f'link {name!r} has a mass of {body.mass:g} kg')
        # A link that is drawn as a mesh may collide as something much smaller.
        is_mesh = any(visual.find('geometry/mesh') for visual in body.link.all('visual'))
        volume = _volume(body.link)
        is_dense = body.mass > max(DENSEST * volume, LEAST_HEAVY) and volume > 0.0 and not is_mesh
        if is_dense or body.mass > HEAVIEST:
            size = f' in {volume * 1e6:.3g} cm3' * is_dense
            yield finding('absurd-mass', place, f'link {name!r} weighs {body.mass:g} kg{size}')


def check_inertias(model: Model) -> Iterator[Finding]:
    """Inertias are those of a body, of about the shape's size, about the shape's axis."""
    for body in _bodies(model):
        if body.mass <= 0.0:
            continue
        place, name = body.element('inertia').place, body.link.name
        low, middle, high = body.moments.tolist()
        shown = f'{low:.3g}, {middle:.3g}, {high:.3g} kg m2'
        if low < SMALLEST:
            # What is fixed to another link adds to its inertia; alone it need not have one.
            if name in model.moving_links or low < -SMALLEST:
                text = f'link {name!r} has principal moments {shown}: not all are above zero'
                yield finding('bad-inertia', place, text)
        elif high > (low + middle) * (1.0 + ROUNDING):
            text = f'link {name!r} has principal moments {shown}: {high:.3g} > {low + middle:.3g}'
            yield finding('inertia-triangle', place, text)
        else:
            yield from _check_shape(body)


def _check_shape(body: Body) -> Iterator[Finding]:
    solids = _solids(body.link)
    if not solids or not LEAST_MASS <= body.mass <= DENSEST * _volume(body.link):
        return
    name, place = body.link.name, body.element('inertia').place
    expected = _box_around(solids)
    ratio = float(np.trace(body.tensor)) / (body.mass * expected)
    if ratio > SCALE or ratio < 1.0 / SCALE:
        what = f'{ratio:.0f} times' if ratio > 1.0 else f'1/{1.0 / ratio:.0f} of'
        text = f"the inertia of link {name!r} is {what} its shape's with {body.mass:g} kg"
        yield finding('inertia-scale', place, text)
    elif len(solids) == 1 and solids[0].kind == 'cylinder' and _lies_across(body, solids[0]):
        text = f'the inertia of link {name!r} is that of its cylinder about another axis'
        rpy = body.link.find('collision/origin') or body.link.find('visual/origin') or body.link
        cure = f'<inertial> needs <origin rpy="{rpy.attributes.get("rpy", "")}"/>'
        yield finding('inertia-axis', place, text, cure)


def _lies_across(body: Body, cylinder: Solid) -> bool:
    """Whether the tensor has the cylinder's moments, but its own moment about another axis."""
    width, _, length = cylinder.edges.tolist()
    own = body.mass * width**2 / 8.0
    other = body.mass * (3.0 * width**2 / 4.0 + length**2) / 12.0
    has_them = np.allclose(body.moments, sorted((own, other, other)), rtol=EQUAL)
    axis = cylinder.pose.rotation[:, 2]
    return has_them and not math.isclose(float(axis @ body.tensor @ axis), own, rel_tol=EQUAL)


def _box_around(solids: list[Solid]) -> float:
    """Return the trace of inertia per mass [m^2] of the box around the shapes of a link."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for solid in solids:
        half = np.abs(solid.pose.rotation) @ solid.edges / 2.0
        low = np.minimum(low, solid.pose.position - half)
        high = np.maximum(high, solid.pose.position + half)
    return float(((high - low) ** 2).sum()) / 6.0


def _bodies(model: Model) -> Iterator[Body]:
    for link in model.robot.all('link'):
        inertial = link.find('inertial')
        if inertial is None:
            continue
        xx, xy, xz, yy, yz, zz = (inertial.number('inertia', c) for c in INERTIA_COMPONENTS)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        rotation = inertial.origin().rotation
        yield Body(
            link, inertial, inertial.number('mass', 'value'), rotation @ tensor @ rotation.T
        )


def _volume(link: Element) -> float:
    return sum(solid.volume for solid in _solids(link))


def _solids(link: Element) -> list[Solid]:
    """Return the primitives that collide, or are drawn if nothing does; none among meshes."""
    shapes = link.all('collision') or link.all('visual')
    solids = [_solid(shape) for shape in shapes]
    known = [solid for solid in solids if solid is not None]
    return known if len(known) == len(solids) else []


def _solid(shape: Element) -> Solid | None:
    geometry = shape.find('geometry')
    if geometry is None:
        return None
    radius = geometry.number('cylinder', 'radius') or geometry.number('sphere', 'radius')
    if geometry.find('box'):
        edges = geometry.numbers('box', 'size', '0 0 0')
        return Solid('box', shape.origin(), edges, float(np.prod(edges)))
    if geometry.find('cylinder'):
        length = geometry.number('cylinder', 'length')
        edges = np.array([2.0 * radius, 2.0 * radius, length])
        return Solid('cylinder', shape.origin(), edges, math.pi * radius**2 * length)
    if geometry.find('sphere'):
        edges = np.full(3, 2.0 * radius)
        return Solid('sphere', shape.origin(), edges, 4.0 / 3.0 * math.pi * radius**3)
    return None


class Wheel(NamedTuple):
    """A wheel on a joint: radius, and y and z of its axle in its root [m]."""

    joint: Element
    radius: float
    y: float
    z: float


def check_sides(model: Model) -> Iterator[Finding]:
    """What is called left is at larger y than its counterpart on the right; front at larger x."""
    for code, side, axis in (('swapped-sides', 'left', 1), ('swapped-ends', 'front', 0)):
        for one, other in swapped_pairs(model, side):
            here, there = (_position(model, joint)[axis] for joint in (one, other))
            text = (
                f'{one.name!r} is at {"xyz"[axis]} = {here:.4g} m, {other.name!r} at {there:.4g} m'
            )
            yield finding(code, one.place, text)


def swapped_pairs(model: Model, side: str) -> list[tuple[Element, Element]]:
    """
    Return the pairs of joints of which the one on `side` is where the other should be.

    `side` is `left` or `front`. Both hang on the same link: what is further out follows it.
    """
    axis = 1 if side == 'left' else 0
    pairs = []
    for joint, other in pair_sides(model, side):
        here, there = (_position(model, j)[axis] for j in (joint, other))
        if here < -MIDDLE and there > MIDDLE:
            pairs.append((joint, other))
    return pairs


def pair_sides(model: Model, side: str) -> list[tuple[Element, Element]]:
    """Return the joints on `side`, each with its counterpart on the same link."""
    by_part = {_role(joint, sides(joint.name)): joint for joint in model.joints.values()}
    pairs = []
    for joint in model.joints.values():
        told = sides(joint.name)
        other = by_part.get(_role(joint, told - {side} | {OPPOSITE[side]}))
        if side in told and other is not None:
            pairs.append((joint, other))
    return pairs


def _role(joint: Element, where: frozenset[str]) -> tuple[object, ...]:
    return where, part(joint.name), end(joint, 'parent')


def _position(model: Model, joint: Element) -> list[float]:
    """Return where a joint is in its root [m]; zero where that cannot be said."""
    parent = model.poses.get(end(joint, 'parent'))
    if parent is None:
        return [0.0, 0.0, 0.0]
    return list((parent @ joint.origin()).position)


def check_wheels(model: Model) -> Iterator[Finding]:
    """The wheels of a pair have one radius, and are equally far from the middle."""
    wheels = {wheel.joint.name: wheel for wheel in find_wheels(model)}
    for left, right in pair_sides(model, 'left'):
        wheel, mate = wheels.get(left.name), wheels.get(right.name)
        if wheel is None or mate is None:
            continue
        name = left.name
        if abs(wheel.radius - mate.radius) > SAME:
            text = f'{name!r} turns a radius of {wheel.radius:g} m, {mate.joint.name!r} one of '
            yield finding('different-wheels', wheel.joint.place, f'{text}{mate.radius:g} m')
        if abs(abs(wheel.y) - abs(mate.y)) > SAME:
            text = f'{name!r} is {abs(wheel.y):g} m from the middle, {mate.joint.name!r} '
            yield finding('different-wheels', wheel.joint.place, f'{text}{abs(mate.y):g} m')


def check_footprint(model: Model, robot: Robot) -> Iterator[Finding]:
    """A robot that floats on two wheels has its root on the ground, or a `base_footprint`."""
    if robot.is_fixed or robot.root in model.joint_above:
        return
    wheels = find_wheels(model)
    bottom = min((wheel.z - wheel.radius for wheel in wheels), default=0.0)
    if len(wheels) == 2 and abs(bottom) > ON_GROUND and FOOTPRINT not in model.links:
        text = (
            f"the root of {model.robot.name!r} is {-bottom:.3g} m above its wheels' lowest points"
        )
        yield finding('missing-footprint', model.robot.place, text)


def find_wheels(model: Model) -> list[Wheel]:
    """Return the wheels: round things on continuous joints that are called wheels."""
    wheels = []
    for joint in model.joints.values():
        link = model.links.get(end(joint, 'child'))
        called = {*words(joint.name), *words(end(joint, 'child'))}
        if joint.attributes.get('type') != 'continuous' or link is None:
            continue
        if 'wheel' in called and 'caster' not in called and (radius := _radius(link)) > 0.0:
            wheels.append(Wheel(joint, radius, *_position(model, joint)[1:]))
    return wheels


def _radius(link: Element) -> float:
    for shape in (*link.all('collision'), *link.all('visual')):
        for kind in ('cylinder', 'sphere'):
            radius = shape.number(f'geometry/{kind}', 'radius')
            if radius > 0.0:
                return radius
    return 0.0
