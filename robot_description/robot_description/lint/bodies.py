# SPDX-License-Identifier: Apache-2.0
"""Checks of masses and inertias against what a body of that shape can have."""

from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np
from wasd_core.rotations import Pose

from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.model import Element
from robot_description.lint.model import Model

# Osmium has 22 590 kg/m^3; shapes are drawn a little small.
DENSEST = 30_000.0
# Lighter links are frames with a number for show, as an IMU's; their inertia moves nothing.
LEAST_MASS = 0.02
# Small parts are drawn as points, and their mass rounded up [kg].
LEAST_HEAVY = 0.1
# MuJoCo takes what is smaller for zero [kg m^2].
SMALLEST = 1e-15
# Rounded numbers of CAD programs miss the triangle inequality by less than this.
ROUNDING = 0.01
# How far an inertia may be off that of its shape, and how near it is then taken for equal.
SCALE, EQUAL = 10.0, 0.05


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
    """Links that move have a mass."""
    links = model.robot.all('link')
    moving = [link for link in links if link.name in model.moving_links]
    if moving and not any(link.find('inertial') for link in links):
        yield finding('no-inertials', model.robot.place, f'none of {len(links)} links has a mass')
        return
    carried = _links_with_something_rigid_below(model)
    for link in moving:
        if link.find('inertial') is None and link.name not in carried:
            text = f'link {link.name!r} moves and has no inertial'
            yield finding('no-inertial', link.place, text)


def _links_with_something_rigid_below(model: Model) -> set[str]:
    """Links that get their mass from what is fixed to them."""
    carried: set[str] = set()
    for name, link in model.links.items():
        here = name
        while link.find('inertial') and here in model.joint_above and here not in carried:
            if here in model.moving_links:
                break
            parent = model.joint_above[here].find('parent')
            here = parent.attributes.get('link', '') if parent else ''
            carried.add(here)
    return carried


def check_masses(model: Model) -> Iterator[Finding]:
    """Masses are positive, and fit into the shape."""
    for body in _bodies(model):
        name, place = body.link.name, body.element('mass').place
        if body.mass < 0.0 or (body.mass == 0.0 and name in model.moving_links):
            yield finding('bad-mass', place, f'link {name!r} has a mass of {body.mass:g} kg')
        # Under a mesh, feet collide as points and heads as marbles.
        is_mesh = any(visual.find('geometry/mesh') for visual in body.link.all('visual'))
        volume = _volume(body.link)
        if body.mass > max(DENSEST * volume, LEAST_HEAVY) and volume > 0.0 and not is_mesh:
            text = f'link {name!r} weighs {body.mass:g} kg in {volume * 1e6:.3g} cm3'
            yield finding('absurd-mass', place, text)


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
        xx, xy, xz, yy, yz, zz = (
            inertial.number('inertia', name) for name in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
        )
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
