# SPDX-License-Identifier: Apache-2.0
"""Quadrupeds nobody tuned for stand up from lying, trot and follow: another one, a shrunk one."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
import xml.etree.ElementTree as ElementTree

from descriptions import robot_named
import numpy as np
import pytest
from robot_description.packages import description_path, share_directory
from robot_description.xacro.session import expand_document
import wasd

pytestmark = pytest.mark.slow

KEYS = '0.1 2\n0.2 5\n'
SHRUNK = (0.7, 0.5)  # length, mass


def resize(tree: ElementTree.Element, length: float, mass: float) -> None:
    """Resize a robot without meshes to collide with; its motors grow with what they carry."""
    powers = {
        'origin': {'xyz': length},
        'box': {'size': length},
        'cylinder': {'radius': length, 'length': length},
        'sphere': {'radius': length},
        'mass': {'value': mass},
        'inertia': dict.fromkeys(('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'), mass * length**2),
        'limit': {'effort': mass * length, 'velocity': length**-0.5},
        'dynamics': {'friction': mass * length, 'damping': mass * length**1.5},
    }
    for tag, attributes in powers.items():
        for element in tree.iter(tag):
            for attribute, factor in attributes.items():
                if attribute in element.attrib:
                    values = element.attrib[attribute].split()
                    element.set(attribute, ' '.join(str(factor * float(v)) for v in values))


def shrunk_go2(folder: Path) -> str:
    """Write a Go2 of 70 % of the size and half the mass whose names say nothing."""
    tree = ElementTree.fromstring(expand_document(description_path('go2')).urdf)
    resize(tree, *SHRUNK)
    text = ElementTree.tostring(tree, encoding='unicode')
    for old, new in (('"base"', '"torso"'), ('_hip', '_haa'), ('FL_', 'lf_'), ('RR_', 'rh_')):
        text = text.replace(old, new)
    path = folder / 'puppy.urdf'
    path.write_text(text)
    return str(path)


def a1(folder: Path) -> str:
    """Return where Unitree's A1 is."""
    return str(share_directory('example-robot-data') / 'robots/a1_description/urdf/a1.urdf')


@pytest.fixture(scope='module', params=[(a1, 0.27, 0.34), (shrunk_go2, 0.28 * SHRUNK[0], 0.26)])
def walked(request: pytest.FixtureRequest, new_runner: Callable[[], Any]) -> dict[str, Any]:
    """Return the report of a walk ahead while turning, and how high the hips should be."""
    make, low, high = request.param
    runner = new_runner()
    report: dict[str, Any] = runner.report(
        'go2', '--description', make(runner.folder), '--duration', '4.6', '--seed', '77',
        play=KEYS, twist='1.5 0.4 0 0.5\n',
    )  # fmt: skip
    return {**report, 'heights': (low, high)}


def test_it_stands_up_from_lying_and_walks_without_a_fall(walked: dict[str, Any]) -> None:
    samples, (low, high) = walked['samples'], walked['heights']
    assert walked['falls'] == 0
    assert samples['state'][-1] == 'move base'
    height = np.array(samples['position'])[:, 2]
    assert height[0] < 0.15
    assert (height[np.array(samples['t']) > 2.1] > low).all()
    assert height.max() < high + 0.1


def test_it_follows_what_it_is_told(walked: dict[str, Any]) -> None:
    samples = walked['samples']
    steady = np.array(samples['t']) > 3.0
    mean = np.array(samples['velocity'])[steady].mean(axis=0)
    np.testing.assert_allclose(mean[[0, 2]], (0.4, 0.5), rtol=0.1)
    assert abs(mean[1]) < 0.04
    rpy = np.array(samples['rpy'])[steady, :2]
    assert np.degrees(rpy.std(axis=0)).max() < 1.0


def test_it_knows_where_it_is_and_when_its_feet_touch(walked: dict[str, Any]) -> None:
    samples = walked['samples']
    odometry, place = np.array(samples['odom'])[:, :2], np.array(samples['position'])[:, :2]
    path = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    drift = odometry[-1] - odometry[0] - (place[-1] - place[0])
    assert np.linalg.norm(drift) < 0.05 * path
    touching = np.array(samples['contacts'])[np.array(samples['t']) > 3.0].mean(axis=0)
    assert ((touching > 0.4) & (touching < 0.75)).all()


def with_root(folder: Path, z: float) -> wasd.Go2:
    """Return a Go2 with a root `z` [m] below its base."""
    tree = ElementTree.fromstring(robot_named('go2').urdf)
    tree.append(ElementTree.fromstring('<link name="below"/>'))
    weld = '<joint name="weld" type="fixed"><parent link="below"/><child link="base"/></joint>'
    joint = ElementTree.fromstring(weld)
    ElementTree.SubElement(joint, 'origin', xyz=f'0 0 {z}')
    tree.append(joint)
    file = folder / 'go2.urdf'
    file.write_text(ElementTree.tostring(tree, encoding='unicode'))
    return wasd.Go2(description=str(file), seed=1)


def walked_from_root(folder: Path, z: float) -> tuple[str, np.ndarray]:
    """Return state and place (2,) [m] after a walk of that robot."""
    dog = with_root(folder, z)
    dog.press('2')
    dog.run(0.02)
    dog.press('5')
    dog.run(2.2)
    dog.drive(0.5, 0.0, 0.3)
    dog.run(1.2)
    return dog.state, dog.truth.position[:2]


def test_it_walks_alike_wherever_its_root_is(tmp_path: Path) -> None:
    state, place = walked_from_root(tmp_path, 0.0)
    assert state == 'move base'
    assert place[0] > 0.4
    # In the ground, and above the trunk.
    for z in 0.45, -0.3:
        other, end = walked_from_root(tmp_path, z)
        assert other == state
        np.testing.assert_allclose(end, place, atol=2e-3)


def test_it_jumps_where_its_root_is_in_the_ground(tmp_path: Path) -> None:
    dog = with_root(tmp_path, 0.45)
    for key, seconds in (('2', 2.2), ('v', 2.5)):
        dog.press(key)
        dog.run(seconds)
    assert dog.state == 'fixed stand'
