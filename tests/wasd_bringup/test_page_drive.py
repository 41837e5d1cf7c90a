# SPDX-License-Identifier: Apache-2.0
"""What a page's keys have set moving is known, and what others have is not the page's."""

import pytest
from wasd_bringup.inputs import PageDrive


class Sticks:
    """Keys as the Go2 takes them: w and s stay, a blank ends them."""

    def latches(self, key: str) -> bool:
        """Whether it is a stick."""
        return key in 'ws'

    def stops(self, key: str) -> bool:
        """Whether it centres the sticks."""
        return key == ' '


@pytest.fixture
def drive() -> PageDrive:
    """Return what is known of two robots."""
    return PageDrive([Sticks(), Sticks()])


def test_a_stick_set_by_the_page_is_the_pages(drive):
    drive.press(1, 'w', from_view=True)
    drive.press(1, 'RELEASE+w', from_view=True)
    assert drive.moved == [1]


def test_a_robot_that_only_the_terminal_drives_is_not_the_pages(drive):
    for key in ('2', '4'):
        for name in (key, f'HELD+{key}', f'RELEASE+{key}'):
            drive.press(0, name, from_view=True)
    drive.press(0, 'w', from_view=False)
    assert drive.moved == []


def test_a_key_that_is_down_on_the_page_is_the_pages_until_it_is_up(drive):
    drive.press(0, 'i', from_view=True)
    drive.press(0, 'HELD+i', from_view=True)
    assert drive.moved == [0]
    drive.press(0, 'RELEASE+i', from_view=True)
    assert drive.moved == []


@pytest.mark.parametrize('from_view', [True, False])
def test_what_anybody_has_stopped_is_not_the_pages(drive, from_view):
    drive.press(0, 'w', from_view=True)
    drive.press(0, ' ', from_view=from_view)
    drive.press(0, 'w', from_view=False)
    assert drive.moved == []


def test_a_robot_that_was_stopped_or_reset_is_not_the_pages(drive):
    for robot in (0, 1):
        drive.press(robot, 's', from_view=True)
    drive.forget(0)
    assert drive.moved == [1]
    drive.reset()
    assert drive.moved == []
