# SPDX-License-Identifier: Apache-2.0
"""Checks of tags, attributes and numbers against what URDF knows."""

from collections.abc import Iterator
import math

from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.model import Element
from robot_description.lint.model import Model

# Tag: what it may hold, and its attributes. After the URDF specification of urdfdom 4.
SHAPES = ('box', 'cylinder', 'sphere', 'mesh', 'capsule')
CHILDREN: dict[str, tuple[str, ...]] = {
    'robot': ('link', 'joint', 'material', 'transmission', 'gazebo', 'ros2_control', 'sensor'),
    'link': ('inertial', 'visual', 'collision'),
    'joint': (
        *('origin', 'parent', 'child', 'axis', 'limit', 'dynamics', 'mimic', 'calibration'),
        'safety_controller',
    ),
    'inertial': ('origin', 'mass', 'inertia'),
    'visual': ('origin', 'geometry', 'material'),
    'collision': ('origin', 'geometry', 'material'),  # many have one; it is shown by some tools
    'geometry': SHAPES,
    'material': ('color', 'texture'),
}
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    'robot': ('name', 'version'),
    'link': ('name', 'type'),
    'joint': ('name', 'type'),
    'inertial': (),
    'visual': ('name',),
    'collision': ('name',),
    'geometry': (),
    'material': ('name',),
    'origin': ('xyz', 'rpy', 'quat_xyzw'),
    'parent': ('link',),
    'child': ('link',),
    'axis': ('xyz',),
    'limit': ('lower', 'upper', 'effort', 'velocity', 'acceleration', 'deceleration', 'jerk'),
    'dynamics': ('damping', 'friction'),
    'mimic': ('joint', 'multiplier', 'offset'),
    'calibration': ('rising', 'falling', 'reference_position'),
    'safety_controller': ('soft_lower_limit', 'soft_upper_limit', 'k_position', 'k_velocity'),
    'mass': ('value',),
    'inertia': ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'),
    'box': ('size',),
    'cylinder': ('radius', 'length'),
    'capsule': ('radius', 'length'),
    'sphere': ('radius',),
    'mesh': ('filename', 'scale'),
    'color': ('rgba',),
    'texture': ('filename',),
}
# Extensions that a tool reads: MuJoCo, Bullet, Drake's loop joints, MoveIt, Isaac.
EXTENSIONS = {
    *('mujoco', 'contact', 'verbose', 'self_collision_checking', 'collision_checking', 'group'),
    *(
        'hardwareInterface',
        'loop',
        'loop_joint',
        'plugin',
        'property',
        'audio_source',
        'compliance',
    ),
    *('isaac_sim_config', 'sdf', 'frame', 'disable_collisions', 'version', 'camera', 'user_data'),
}
# Tag and attribute: how many numbers; `+` for sizes, which are above zero.
NUMBERS: dict[tuple[str, str], str] = {
    ('origin', 'xyz'): '3',
    ('origin', 'rpy'): '3',
    ('axis', 'xyz'): '3',
    ('mass', 'value'): '1',
    ('limit', 'lower'): '1',
    ('limit', 'upper'): '1',
    ('limit', 'effort'): '1',
    ('limit', 'velocity'): '1',
    ('dynamics', 'damping'): '1',
    ('dynamics', 'friction'): '1',
    ('mimic', 'multiplier'): '1',
    ('mimic', 'offset'): '1',
    ('box', 'size'): '3+',
    ('cylinder', 'radius'): '1+',
    ('cylinder', 'length'): '1+',
    ('capsule', 'radius'): '1+',
    ('capsule', 'length'): '1+',
    ('sphere', 'radius'): '1+',
    ('color', 'rgba'): '4',
    **{('inertia', name): '1' for name in ATTRIBUTES['inertia']},
}
# Attributes without which the tag says nothing.
REQUIRED = {'mass', 'inertia', 'box', 'cylinder', 'sphere', 'capsule', 'color'}


def check_tags(model: Model) -> Iterator[Finding]:
    """Tags stand where URDF reads them; extensions are left alone."""
    for element in _urdf_elements(model.robot):
        wanted = CHILDREN.get(element.tag, ())
        for child in element.children:
            if child.tag in wanted or ':' in child.tag or child.tag in EXTENSIONS:
                continue
            where = f'<{child.tag}> under <{element.tag}>' + _named(element)
            if child.tag in ATTRIBUTES:
                homes = ', '.join(
                    f'<{tag}>' for tag, tags in CHILDREN.items() if child.tag in tags
                )
                yield finding('illegal-child', child.place, f'{where}; it belongs under {homes}')
            elif child.tag != 'gazebo':
                yield finding('unknown-tag', child.place, f'{where} is no tag of URDF')


def _named(element: Element) -> str:
    return f' {element.name!r}' if element.name else ''


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
        for (tag, attribute), wanted in NUMBERS.items():
            if tag != element.tag:
                continue
            text = element.attributes.get(attribute)
            if text is None:
                if tag in REQUIRED:
                    yield finding('bad-number', element.place, f'<{tag}> has no {attribute}')
            elif (reason := _wrong(text, wanted)) is not None:
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
    return None


def _urdf_elements(element: Element) -> Iterator[Element]:
    """Yield the robot's elements that URDF itself describes."""
    yield element
    for child in element.children:
        if child.tag in CHILDREN.get(element.tag, ()) and child.tag in ATTRIBUTES:
            yield from _urdf_elements(child)
