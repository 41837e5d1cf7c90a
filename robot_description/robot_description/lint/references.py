# SPDX-License-Identifier: Apache-2.0
"""Checks of names that point elsewhere: plugins, transmissions, mimics, controllers, materials."""

from collections.abc import Iterator

from wasd_core.safe_files import Place

from robot_description.joint_names import meant
from robot_description.joint_names import sides
from robot_description.joint_names import words
from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.lint.model import Element
from robot_description.lint.model import Model

# Tags of Gazebo's drive plugins that hold the name of a joint.
JOINT_TAGS = {'leftJoint', 'rightJoint', 'left_joint', 'right_joint', 'jointName', 'joint_name'}


def check_joint_references(model: Model) -> Iterator[Finding]:
    """Joints that are referred to exist."""
    seen: set[tuple[str, str]] = set()
    for name, place, who in _referred_joints(model):
        if name in model.joints or (name, who) in seen or not name:
            continue
        seen.add((name, who))
        probably = meant(name, model.joints)
        text = f'{who} names joint {name!r}, which is not there'
        if probably:
            cure = f'describe fix --rename {probably}:={name}'
            yield finding('unknown-joint', place, f'{text}; {probably!r} is', cure)
        else:
            yield finding('unknown-joint', place, text)


def _referred_joints(model: Model) -> Iterator[tuple[str, Place, str]]:
    for name in model.expected_joints:
        yield name, model.robot.place, 'a controller'
    for joint in model.robot.all('joint'):
        mimic = joint.find('mimic')
        if mimic is not None:
            who = f'the mimic of {joint.name!r}'
            yield mimic.attributes.get('joint', ''), mimic.place, who
    for transmission in model.robot.all('transmission'):
        for joint in transmission.all('joint'):
            yield joint.name, joint.place, f'transmission {transmission.name!r}'
    for control in model.robot.all('ros2_control'):
        for joint in control.all('joint'):
            yield joint.name, joint.place, f'ros2_control {control.name!r}'
    for gazebo in model.robot.all('gazebo'):
        for plugin in gazebo.all('plugin'):
            for tag in plugin.walk():
                if tag.tag in JOINT_TAGS:
                    yield tag.text, tag.place, f'plugin {plugin.name!r}'


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
            probably = meant(name, {**model.links, **model.joints})
            hint = f'; {probably!r} is' if probably else ''
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
