# SPDX-License-Identifier: Apache-2.0
"""Checks of where things are: left and right, front and back, wheels alike, a footprint."""

from collections.abc import Iterator
from typing import NamedTuple

from robot_description.joint_names import OPPOSITE
from robot_description.joint_names import part
from robot_description.joint_names import sides
from robot_description.joint_names import words
from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.model import Element
from robot_description.lint.model import end
from robot_description.lint.model import Model

# Nearer to the middle than this [m], a thing has no side.
MIDDLE = 1e-3
# Wheels that differ by less than this [m] are meant to be equal.
EQUAL = 1e-6
FOOTPRINT = 'base_footprint'


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
    for joint, other in mirrored(model, side):
        here, there = (_position(model, j)[axis] for j in (joint, other))
        if here < -MIDDLE and there > MIDDLE:
            pairs.append((joint, other))
    return pairs


def mirrored(model: Model, side: str) -> list[tuple[Element, Element]]:
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
    for left, right in mirrored(model, 'left'):
        wheel, mate = wheels.get(left.name), wheels.get(right.name)
        if wheel is None or mate is None:
            continue
        name = left.name
        if abs(wheel.radius - mate.radius) > EQUAL:
            text = f'{name!r} turns a radius of {wheel.radius:g} m, {mate.joint.name!r} one of '
            yield finding('different-wheels', wheel.joint.place, f'{text}{mate.radius:g} m')
        if abs(abs(wheel.y) - abs(mate.y)) > EQUAL:
            text = f'{name!r} is {abs(wheel.y):g} m from the middle, {mate.joint.name!r} '
            yield finding('different-wheels', wheel.joint.place, f'{text}{abs(mate.y):g} m')


def check_footprint(model: Model) -> Iterator[Finding]:
    """A robot on wheels has a base_footprint."""
    if len(find_wheels(model)) < 2 or FOOTPRINT in model.links:
        return
    text = f'{model.robot.name!r} has wheels and no link {FOOTPRINT!r}'
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
