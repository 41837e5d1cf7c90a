# SPDX-License-Identifier: Apache-2.0
"""Checks of what is written: tags, attributes, numbers, names, and the tree they make."""

from collections import Counter
from collections.abc import Iterator
import math
import re

from wasd_core.errors import did_you_mean
from wasd_core.safe_files import Place

from robot_description.lint.model import Element, end, Model, MOVING_KINDS
from robot_description.lint.rules import Finding, finding
from robot_description.morphology.names import guess_name, hint_at, sides, words
from robot_description.robot import JOINT_KINDS, LIMITED, MOVABLE

# Tag: what it may hold. After the URDF specification of urdfdom 4.
CHILDREN = {
    'robot': ('link', 'joint', 'material', 'transmission', 'gazebo', 'ros2_control', 'sensor'),
    'link': ('inertial', 'visual', 'collision'),
    'joint': (
        *('origin', 'parent', 'child', 'axis', 'limit', 'dynamics', 'mimic', 'calibration'),
        'safety_controller',
    ),
    'inertial': ('origin', 'mass', 'inertia'),
    'visual': ('origin', 'geometry', 'material'),
    'collision': ('origin', 'geometry', 'material'),  # many have one; it is shown by some tools
    'geometry': ('box', 'cylinder', 'sphere', 'mesh', 'capsule'),
    'material': ('color', 'texture'),
}
# Tag: its attributes, each with how many numbers it is; `+` for sizes, which are above
# zero, `+0` for what may be zero, too.
ATTRIBUTES = {
    tag: {name: count for name, _, count in (word.partition(':') for word in attributes.split())}
    for tag, attributes in {
        'robot': 'name version',
        'link': 'name type',
        'joint': 'name type',
        'inertial': '',
        'visual': 'name',
        'collision': 'name',
        'geometry': '',
        'material': 'name',
        'origin': 'xyz:3 rpy:3 quat_xyzw',
        'parent': 'link',
        'child': 'link',
        'axis': 'xyz:3',
        'limit': 'lower:1 upper:1 effort:1+0 velocity:1+0 acceleration deceleration jerk',
        'dynamics': 'damping:1+0 friction:1+0',
        'mimic': 'joint multiplier:1 offset:1',
        'calibration': 'rising falling reference_position',
        'safety_controller': 'soft_lower_limit soft_upper_limit k_position k_velocity',
        'mass': 'value:1',
        'inertia': 'ixx:1 ixy:1 ixz:1 iyy:1 iyz:1 izz:1',
        'box': 'size:3+',
        'cylinder': 'radius:1+ length:1+',
        'capsule': 'radius:1+ length:1+',
        'sphere': 'radius:1+',
        'mesh': 'filename scale',
        'color': 'rgba:4',
        'texture': 'filename',
    }.items()
}
# Extensions that a tool reads: MuJoCo, Bullet, Drake's loop joints, MoveIt, Isaac.
EXTENSIONS = {
    *('mujoco', 'contact', 'verbose', 'self_collision_checking', 'collision_checking', 'group'),
    *('hardwareInterface', 'loop', 'loop_joint', 'plugin', 'property', 'audio_source'),
    *('isaac_sim_config', 'sdf', 'frame', 'disable_collisions', 'version', 'camera', 'user_data'),
    'compliance',
}
# Attributes without which the tag says nothing.
REQUIRED = {'mass', 'inertia', 'box', 'cylinder', 'sphere', 'capsule', 'color'}
ENDS = ('parent', 'child')
MIMIC = 'the mimic of '
# More than this many names make no message clearer.
MOST_NAMES = 5
# Tags of Gazebo's drive plugins that hold the name of a joint.
JOINT_TAGS = {'leftJoint', 'rightJoint', 'left_joint', 'right_joint', 'jointName', 'joint_name'}


def check_tags(model: Model) -> Iterator[Finding]:
    """Tags stand where URDF reads them; extensions are left alone."""
    for element in _urdf_elements(model.robot):
        wanted = CHILDREN.get(element.tag, ())
        for child in element.children:
            if child.tag in wanted or ':' in child.tag or child.tag in EXTENSIONS:
                continue
            name = f' {element.name!r}' if element.name else ''
            where = f'<{child.tag}> under <{element.tag}>{name}'
            if child.tag in ATTRIBUTES:
                homes = ', '.join(
                    f'<{tag}>' for tag, tags in CHILDREN.items() if child.tag in tags
                )
                yield finding('illegal-child', child.place, f'{where}; it belongs under {homes}')
            elif child.tag != 'gazebo' and child not in _almost_joints(model):
                meant = did_you_mean(child.tag, wanted)
                yield finding('unknown-tag', child.place, f'{where} is no tag of URDF{meant}')


def check_attributes(model: Model) -> Iterator[Finding]:
    """Attributes are those that URDF knows; each unknown one is told once."""
    seen: set[tuple[str, str]] = set()
    for element in _urdf_elements(model.robot):
        for name in element.attributes:
            known = ATTRIBUTES[element.tag]
            if name in known or ':' in name or name == 'xmlns' or (element.tag, name) in seen:
                continue
            seen.add((element.tag, name))
            text = f'attribute {name!r} of <{element.tag}> is none of URDF'
            yield finding('unknown-attribute', element.place, text)


def check_numbers(model: Model) -> Iterator[Finding]:
    """Numbers are numbers, as many as wanted, and sizes are positive."""
    for element in _urdf_elements(model.robot):
        tag = element.tag
        for part in ('mass', 'inertia') if tag == 'inertial' else ():
            if element.find(part) is None:
                yield finding('bad-number', element.place, f'<inertial> has no <{part}>')
        for attribute, wanted in ATTRIBUTES[tag].items():
            text = element.attributes.get(attribute)
            if text is None:
                if wanted and tag in REQUIRED:
                    yield finding('bad-number', element.place, f'<{tag}> has no {attribute}')
            elif attribute == 'scale':
                count = len(text.split())
                reason = _wrong(text, '1' if count == 1 else '3')
                if reason is not None:
                    message = f'<mesh scale="{text[:60]}">: {reason}'
                    yield finding('bad-number', element.place, message)
            elif wanted and (reason := _wrong(text, wanted)) is not None:
                message = f'<{tag} {attribute}="{text[:60]}">: {reason}'
                yield finding('bad-number', element.place, message)


def _wrong(text: str, wanted: str) -> str | None:
    count = int(wanted[0])
    try:
        numbers = [float(number) for number in text.split()]
    except ValueError:
        return 'is not a number' if count == 1 else f'is not {count} numbers'
    if len(numbers) != count:
        return f'has {len(numbers)} numbers, wanted {count}'
    if not all(map(math.isfinite, numbers)):
        return 'is not finite'
    if wanted.endswith('+') and min(numbers) <= 0.0:
        return 'is not above zero'
    if wanted.endswith('+0') and min(numbers) < 0.0:
        return 'is below zero'
    return None


def _urdf_elements(element: Element) -> Iterator[Element]:
    """Yield the robot's elements that URDF itself describes."""
    yield element
    for child in element.children:
        if child.tag in CHILDREN.get(element.tag, ()) and child.tag in ATTRIBUTES:
            yield from _urdf_elements(child)


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
                yield finding('unknown-link', joint.place, text + hint_at(name, model.links))
        child = end(joint, 'child')
        if child and (first := children.setdefault(child, joint)) is not joint:
            text = f'link {child!r} is the child of {first.name!r} and of {joint.name!r}'
            yield finding('two-parents', joint.place, text)


def check_one_tree(model: Model) -> Iterator[Finding]:
    """The links are one tree: one root, no circle, nobody left over."""
    mentioned = {end(joint, which) for joint in model.robot.all('joint') for which in ENDS}
    # A name that is spelt wrong has been told; so the link that was meant is not left over.
    meant = {guess_name(name, model.links) for name in mentioned - {'', *model.links}}
    meant |= {end(tag, which) for tag in _almost_joints(model) for which in ENDS}
    for name, link in model.links.items():
        if name not in mentioned | meant and len(model.links) > 1:
            yield finding('orphan-link', link.place, f'no joint mentions link {name!r}')
    tops = [name for name in model.links if name not in model.joint_above and name in mentioned]
    roots = [name for name in tops if name not in meant]
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
    """A joint has the tag `joint`, a type, both ends, an axis and the limits that it needs."""
    for tag in _almost_joints(model):
        text = f'<{tag.tag}> {tag.name!r} joins links, but is no tag of URDF'
        yield finding('bad-joint', tag.place, text, 'write <joint>')
    for joint in model.robot.all('joint'):
        kind = joint.attributes.get('type', '')
        if kind not in JOINT_KINDS:
            text = f'joint {joint.name!r} has type {kind!r}; wanted {", ".join(JOINT_KINDS)}'
            yield finding('bad-joint', joint.place, text)
        for which in ENDS:
            if not end(joint, which):
                text = f'joint {joint.name!r} has no <{which} link="...">'
                yield finding('bad-joint', joint.place, text)
        axis = joint.find('axis')
        if kind in MOVABLE and (axis is None or 'xyz' not in axis.attributes):
            text = f'joint {joint.name!r} has no axis: it turns about x, or slides along it'
            yield finding('no-axis', joint.place, text)
        if kind in MOVING_KINDS and not joint.numbers('axis', 'xyz', '1 0 0').any():
            place = axis.place if axis else joint.place
            yield finding('bad-joint', place, f'the axis of joint {joint.name!r} is zero')
        yield from _check_limit(joint, kind)


def _almost_joints(model: Model) -> list[Element]:
    """Return what has both ends of a joint and another name, under the robot itself."""
    others = (child for child in model.robot.children if child.tag not in CHILDREN['robot'])
    return [tag for tag in others if tag.tag not in EXTENSIONS and all(end(tag, e) for e in ENDS)]


def _check_limit(joint: Element, kind: str) -> Iterator[Finding]:
    limit = joint.find('limit')
    if limit is None:
        if kind in LIMITED:
            text = f'{kind} joint {joint.name!r} has no <limit>'
            yield finding('missing-limit', joint.place, text)
        return
    if kind in MOVABLE:
        missing = [name for name in ('effort', 'velocity') if name not in limit.attributes]
        if missing:
            text = f'the limit of joint {joint.name!r} has no {" and no ".join(missing)}'
            yield finding('missing-limit', limit.place, text)
    lower, upper = limit.number('', 'lower'), limit.number('', 'upper')
    if lower > upper and kind != 'continuous':
        text = f'joint {joint.name!r} goes from {lower:g} down to {upper:g}'
        yield finding('reversed-limit', limit.place, text)


def check_mimics(model: Model) -> Iterator[Finding]:
    """No joint mimics itself, by way of others or not; each circle is told once."""
    told: set[str] = set()
    for name in reversed(model.joints):
        way: list[str] = []
        while name in model.joints and name not in told:
            told.add(name)
            way.append(name)
            mimic = model.joints[name].find('mimic')
            name = mimic.attributes.get('joint', '') if mimic is not None else ''
        if name in way:
            circle = ' -> '.join([*way[way.index(name) :], name])
            place = model.joints[name].place
            yield finding('mimic-circle', place, f'joints mimic each other in a circle: {circle}')


def check_joint_references(model: Model) -> Iterator[Finding]:
    """Joints that are referred to exist."""
    seen: set[tuple[str, str]] = set()
    for name, place, who in _referred_joints(model):
        if name in model.joints or (name, who) in seen or not name:
            continue
        seen.add((name, who))
        probably = guess_name(name, model.joints)
        is_rename = probably and not who.startswith(MIMIC)
        cure = f'describe fix --rename {probably}:={name}' if is_rename else None
        text = f'{who} names joint {name!r}, which is not there{hint_at(name, model.joints)}'
        yield finding('unknown-joint', place, text, cure)


def _referred_joints(model: Model) -> Iterator[tuple[str, Place, str]]:
    for name in model.expected_joints:
        yield name, model.robot.place, 'a controller'
    for joint in model.robot.all('joint'):
        mimic = joint.find('mimic')
        if mimic is not None:
            who = f'{MIMIC}{joint.name!r}'
            yield mimic.attributes.get('joint', ''), mimic.place, who
    for transmission in model.robot.all('transmission'):
        for joint in transmission.all('joint'):
            for name in re.split(r'[\s,]+', joint.name):
                yield name, joint.place, f'transmission {transmission.name!r}'
    for control in model.robot.all('ros2_control'):
        for joint in control.all('joint'):
            yield joint.name, joint.place, f'ros2_control {control.name!r}'
    for gazebo in model.robot.all('gazebo'):
        for plugin in gazebo.all('plugin'):
            for tag in plugin.walk():
                for name in re.split(r'[\s,]+', tag.text) if tag.tag in JOINT_TAGS else ():
                    yield name, tag.place, f'plugin {plugin.name!r}'


def check_arbotix_names(model: Model) -> Iterator[Finding]:
    """Wheel joints have the names that everybody but arbotix uses."""
    for name, joint in model.joints.items():
        if name in ('base_l_wheel_joint', 'base_r_wheel_joint'):
            (side,) = sides(name)
            new = f'{side}_wheel_joint'
            cure = f'describe fix --rename {name}:={new}'
            text = f'joint {name!r} is what arbotix calls {new!r}'
            yield finding('arbotix-joint-name', joint.place, text, cure)


def check_gazebo_references(model: Model) -> Iterator[Finding]:
    """What a gazebo tag refers to exists."""
    for gazebo in model.robot.all('gazebo'):
        name = gazebo.attributes.get('reference')
        if name and name not in model.links and name not in model.joints:
            hint = hint_at(name, {**model.links, **model.joints})
            text = f'<gazebo> refers to {name!r}, which is neither link nor joint{hint}'
            yield finding('unknown-reference', gazebo.place, text)


def check_materials(model: Model) -> Iterator[Finding]:
    """Each visual has one material, which somebody defines."""
    visuals = [visual for link in model.robot.all('link') for visual in link.all('visual')]
    defined = {material.name for material in model.robot.all('material')}
    defined |= {m.name for visual in visuals for m in visual.all('material') if m.children}
    unknown: dict[str, Element] = {}
    for visual in visuals:
        materials = visual.all('material')
        if len(materials) > 1:
            names = ', '.join(material.name for material in materials)
            text = f'{len(materials)} materials in one visual: {names}'
            yield finding('repeated-material', materials[1].place, text)
        for material in materials[:1]:
            if material.name not in defined and not material.children:
                unknown.setdefault(material.name, material)
    for name, material in unknown.items():
        yield finding('unknown-material', material.place, f'material {name!r} is not defined')


def check_robot_name(model: Model) -> Iterator[Finding]:
    """The robot is called as its file, its folder, or its package."""
    name = model.robot.name
    around = [model.path.name, *(folder.name for folder in model.path.absolute().parents)][:4]
    told = {word for text in around for word in words(text)}
    is_near = any(_plain(name) in _plain(text) for text in around)
    if name and not is_near and not set(words(name)) & told:
        text = f'the robot of {model.path.name} is called {name!r}'
        yield finding('robot-name', model.robot.place, text)


def _plain(name: str) -> str:
    return ''.join(character for character in name.lower() if character.isalnum())
