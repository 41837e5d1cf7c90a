# SPDX-License-Identifier: Apache-2.0
"""What `./wasd` installs: exact versions with hashes, within the ranges of the wheel."""

import re

from cases import for_all
from packaging.requirements import Requirement
from source_trees import PROJECT, ROOT
import yaml

from robot_description import build_interfaces

RUN, TEST = (ROOT / f'requirements/{name}.txt' for name in ('run', 'test'))
PROJECT_TABLE = PROJECT['project']


def canonical(name):
    return re.sub('[-_.]+', '-', name).lower()


def rows(path):
    """Return the versions of a file, by package, and how many hashes each has."""
    found = {}
    for row in re.split(r'\n(?=\S)', path.read_text())[1:]:
        name, version = row.split()[0].split('==')
        found[name] = (version, row.count('--hash=sha256:'))
    return found


@for_all('path', [RUN, TEST])
def test_each_package_has_one_version_and_the_hash_of_each_file(path):
    assert all(hashes >= 1 for _, hashes in rows(path).values())
    assert len(rows(path)) == path.read_text().count('==')
    assert '://' not in path.read_text()  # from where is for the machine to say
    assert not set(rows(RUN)) & set(rows(TEST))


def test_the_versions_are_within_the_ranges_of_the_wheel():
    known = rows(RUN) | rows(TEST)
    asked = [*PROJECT['build-system']['requires'], *PROJECT_TABLE['dependencies']]
    for word in [*asked, *PROJECT_TABLE['optional-dependencies']['test']]:
        asks = Requirement(word)
        if asks.name != 'wasd-interfaces':  # made from this checkout
            version, _ = known[canonical(asks.name)]
            assert asks.specifier.contains(version), word


def test_the_wheel_asks_for_ranges_that_end():
    for word in PROJECT_TABLE['dependencies']:
        bounds = {part.operator for part in Requirement(word).specifier}
        assert bounds == {'>=', '<'}, word


def test_ros_comes_as_wheels_where_there_are_some_and_is_not_asked_for_elsewhere():
    machines = {('linux', 'x86_64'): True, ('linux', 'aarch64'): False, ('darwin', 'arm64'): False}
    asked = [Requirement(word) for word in PROJECT_TABLE['dependencies']]
    for (system, machine), has_ros in machines.items():
        here = {'sys_platform': system, 'platform_machine': machine}
        there = {r.name for r in asked if r.marker is None or r.marker.evaluate(here)}
        assert ('ros-jazzy-rclpy' in there) == has_ros
        assert {'mujoco', 'pin', 'numba'} <= there


def test_wheels_are_built_for_the_pythons_that_were_tried_and_are_named():
    tried = RUN.read_text().splitlines()[0].partition('CPython ')[2].partition(' on')[0]
    named = [word.rpartition(' ')[2] for word in PROJECT_TABLE['classifiers'] if '3.' in word]
    for name in ('ci', 'release'):
        jobs = yaml.safe_load((ROOT / f'.github/workflows/{name}.yml').read_text())['jobs']
        built = jobs['wheels']['strategy']['matrix']['python']
        assert built == named == tried.split(', ')


def test_the_ranges_hold_the_interfaces_that_are_built():
    (asked,) = (
        Requirement(word) for word in PROJECT_TABLE['dependencies'] if 'wasd-interfaces' in word
    )
    assert asked.specifier.contains(build_interfaces.VERSION)


def test_the_page_of_installing_names_the_extras_of_users():
    page = (ROOT / 'docs/install.md').read_text()
    named = set(re.findall(r'\| `(\w+)` \|', page.partition('| extra |')[2].partition('\n\n')[0]))
    of_developers = {'test', 'colcon', 'anchors', 'lint'}
    assert named == set(PROJECT_TABLE['optional-dependencies']) - of_developers
