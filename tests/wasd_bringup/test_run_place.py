# SPDX-License-Identifier: Apache-2.0
"""A namespace on the command line: what is kept apart with it."""

from cases import for_all
from wasd_bringup.ros.home import with_own_frames

OWN = ['-r', '/clock:=clock', '-r', '/tf:=tf', '-r', '/tf_static:=tf_static']
NAMESPACE = ['--ros-args', '-r', '__ns:=/robot1']


@for_all('words', [[], ['--ros-args', '-p', 'speed:=2.0']])
def test_without_a_namespace_nothing_is_added(words):
    assert with_own_frames(words) == words


def test_a_namespace_has_a_clock_and_frames_of_its_own():
    assert with_own_frames(NAMESPACE) == [*NAMESPACE, *OWN]


def test_a_rule_of_the_users_comes_first():
    asked = [*NAMESPACE, '-r', '/tf:=/tf']
    assert with_own_frames(asked) == [*asked, *OWN]
    assert with_own_frames([*asked, '--']) == [*asked, *OWN]
