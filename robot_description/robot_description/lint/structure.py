# SPDX-License-Identifier: Apache-2.0
"""Checks of the tree: names, parents and children, roots, circles."""

from collections import Counter
from collections.abc import Iterator

from robot_description.joint_names import meant
from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.model import Element
from robot_description.lint.model import end
from robot_description.lint.model import Model
from robot_description.lint.model import MOVABLE

ENDS = ('parent', 'child')
JOINT_TYPES = (*MOVABLE, 'fixed')
# More than this many names make no message clearer.
MOST_NAMES = 5


def check_names(model: Model) -> Iterator[Finding]:
    """Every robot, link and joint has a name, and a name of its own."""
    elements = [*model.robot.all('link'), *model.robot.all('joint')]
    if elements:  # else it is a file of macros
        elements.append(model.robot)
    for element in elements:
        if not element.name:
            yield finding('missing-name', element.place, f'<{element.tag}> has no name')
    for tag in ('link', 'joint'):
        seen: dict[str, Element] = {}
        for element in model.robot.all(tag):
            first = seen.setdefault(element.name, element)
            if first is not element and element.name:
                text = f'{tag} {element.name!r} is defined again, first at {first.place}'
                yield finding('duplicate-name', element.place, text)


def check_links_exist(model: Model) -> Iterator[Finding]:
    """There are links, and joints name links that exist, each child once."""
    if not model.links:
        left = sorted({f'<{child.tag}>' for child in model.robot.children})
        text = f'no links; what is there: {", ".join(left) or "nothing"}'
        yield finding('no-links', model.robot.place, text)
        return
    children: dict[str, Element] = {}
    for joint in model.robot.all('joint'):
        for which in ENDS:
            name = end(joint, which)
            if name and name not in model.links:
                text = f'{which} link {name!r} of joint {joint.name!r} is not defined'
                yield finding('unknown-link', joint.place, text + _hint(name, model.links))
        child = end(joint, 'child')
        if child and (first := children.setdefault(child, joint)) is not joint:
            text = f'link {child!r} is the child of {first.name!r} and of {joint.name!r}'
            yield finding('two-parents', joint.place, text)


def _hint(name: str, known: dict[str, Element]) -> str:
    probably = meant(name, known)
    return f'; {probably!r} is' if probably else ''


def check_one_tree(model: Model) -> Iterator[Finding]:
    """The links are one tree: one root, no circle, nobody left over."""
    mentioned = {end(joint, which) for joint in model.robot.all('joint') for which in ENDS}
    for name, link in model.links.items():
        if name not in mentioned and len(model.links) > 1:
            yield finding('orphan-link', link.place, f'no joint mentions link {name!r}')
    roots = [name for name in model.links if name not in model.joint_above and name in mentioned]
    if len(roots) > 1:
        sizes = Counter(model.roots.values())
        main = max(roots, key=lambda name: sizes[name])
        for name in roots:
            if name != main:
                text = f'link {name!r} is a second root beside {main!r}'
                yield finding('several-roots', model.links[name].place, text)
    circle = sorted(_in_circles(model))
    if circle:
        shown = ', '.join(circle[:MOST_NAMES]) + (' ...' if len(circle) > MOST_NAMES else '')
        text = f'joints run in a circle through {shown}'
        yield finding('cycle', model.joint_above[circle[0]].place, text)


def _in_circles(model: Model) -> set[str]:
    """Return the links from which the way up comes back to them."""
    seen: set[str] = set()
    circles: set[str] = set()
    for link in model.links:
        way: dict[str, int] = {}
        while link in model.joint_above and link not in seen:
            seen.add(link)
            way[link] = len(way)
            link = end(model.joint_above[link], 'parent')
        if link in way:
            circles.update(list(way)[way[link] :])
    return circles


def check_joints(model: Model) -> Iterator[Finding]:
    """Joints have a type, both ends, an axis, and limits where they need them."""
    for joint in model.robot.all('joint'):
        kind = joint.attributes.get('type', '')
        if kind not in JOINT_TYPES:
            text = f'joint {joint.name!r} has type {kind!r}; wanted {", ".join(JOINT_TYPES)}'
            yield finding('bad-joint', joint.place, text)
        for which in ENDS:
            if not end(joint, which):
                text = f'joint {joint.name!r} has no <{which} link="...">'
                yield finding('bad-joint', joint.place, text)
        if kind in MOVABLE and not joint.numbers('axis', 'xyz', '1 0 0').any():
            axis = joint.find('axis')
            place = axis.place if axis else joint.place
            yield finding('bad-joint', place, f'the axis of joint {joint.name!r} is zero')
        yield from _check_limit(joint, kind)


def _check_limit(joint: Element, kind: str) -> Iterator[Finding]:
    limit = joint.find('limit')
    if limit is None:
        if kind in ('revolute', 'prismatic'):
            text = f'{kind} joint {joint.name!r} has no <limit>'
            yield finding('missing-limit', joint.place, text)
        return
    if kind in ('revolute', 'prismatic', 'continuous'):
        missing = [name for name in ('effort', 'velocity') if name not in limit.attributes]
        if missing:
            text = f'the limit of joint {joint.name!r} has no {" and no ".join(missing)}'
            yield finding('missing-limit', limit.place, text)
    lower, upper = limit.number('', 'lower'), limit.number('', 'upper')
    if lower > upper and kind != 'continuous':
        text = f'joint {joint.name!r} goes from {lower:g} down to {upper:g}'
        yield finding('reversed-limit', limit.place, text)
