# SPDX-License-Identifier: Apache-2.0
"""What is built of a robot is what MuJoCo's own reader made of its URDF, number by number."""

from pathlib import Path
import xml.etree.ElementTree as ElementTree

import numpy as np
import old_mujoco_model as old
import pytest
from robot_description.description import parse_description
from robot_description.description import read_description
from robot_description.errors import DescriptionError
from robot_description.mujoco.builder import compile_model
from robot_description.mujoco.builder import to_mujoco
from robot_description.packages import share_directory
from robot_description.robots import description_path

ROBOTS = share_directory('example-robot-data') / 'robots'
FIXTURES = Path(__file__).parent / 'fixtures'
FILES = [
    *(description_path(name) for name in ('go2', 'mbot')),
    *sorted(ROBOTS.rglob('*.urdf')),
    *sorted(FIXTURES.rglob('*.urdf')),
    *sorted(FIXTURES.rglob('*.xacro')),
]
# All kinds of names that a model has but those of meshes, which are nobody's business.
NAMED = {'body': 'nbody', 'joint': 'njnt', 'geom': 'ngeom', 'site': 'nsite', 'actuator': 'nu'}


def arrays(model):
    """Return all numbers of a model but those that say where its names are."""
    values = {
        name: getattr(model, name) for name in dir(model) if not name.startswith(('_', 'na'))
    }
    texts = ('signature', 'nnames', 'nbuffer')
    return {
        name: np.asarray(value)
        for name, value in values.items()
        if isinstance(value, (int, float, np.ndarray)) and name not in texts
    }


def names(model):
    return {
        kind: [getattr(model, kind)(index).name for index in range(getattr(model, count))]
        for kind, count in NAMED.items()
    }


def outcome(build):
    """Return the compiled model, or what is said in its place."""
    try:
        return compile_model(build()), ''
    except DescriptionError as error:
        return None, str(error)


def assert_same(loaded, visuals):
    robot, find = loaded.robot, loaded.meshes.files.get
    one, refusal = outcome(lambda: old.to_mujoco(loaded.urdf, robot, find, visuals))
    other, said = outcome(lambda: to_mujoco(robot, find, visuals))
    assert said == refusal
    if one is None or other is None:
        return
    assert names(other) == names(one)
    before, after = arrays(one), arrays(other)
    for model in (before, after):  # the range of a joint that has none says nothing
        model['jnt_range'] = model['jnt_range'] * model['jnt_limited'][:, None]
    different = {
        name: np.abs(before[name] - after[name]).max()
        if before[name].shape == after[name].shape
        else (before[name].shape, after[name].shape)
        for name in before
        if before[name].dtype != object
        and not np.array_equal(before[name], after[name], equal_nan=True)
    }
    assert not different


def load(path):
    try:
        return read_description(path)
    except DescriptionError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_a_robot_is_what_the_old_reader_made_of_it(path):
    loaded = load(path)
    for visuals in (True, False):
        assert_same(loaded, visuals)


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)
def test_so_is_one_that_hangs_and_one_of_which_the_file_says_no_mass(path):
    loaded = load(path).with_stand_in_masses()
    tree = ElementTree.fromstring(loaded.urdf)
    if 'world' not in loaded.robot.links:
        ElementTree.SubElement(tree, 'link', name='world')
        joint = ElementTree.SubElement(tree, 'joint', name='hang', type='fixed')
        ElementTree.SubElement(joint, 'origin', xyz='0.1 0.2 0.3', rpy='0.1 0.2 0.3')
        ElementTree.SubElement(joint, 'parent', link='world')
        ElementTree.SubElement(joint, 'child', link=loaded.robot.root)
    hung = parse_description(ElementTree.tostring(tree, encoding='unicode'), path)
    assert_same(hung._replace(meshes=loaded.meshes), visuals=False)
    assert_same(loaded, visuals=False)
