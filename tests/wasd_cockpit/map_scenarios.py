# SPDX-License-Identifier: Apache-2.0
"""What a hand does on the map of a robot that navigates; see run_scenarios.py."""

from collections.abc import Callable
import math
import time

from mujoco_sim.viewer.input import SEVERAL, SILENCE
from run_scenarios import Page
from wasd_cockpit.panels.map import REACHES
from wasd_navigation.waypoints import Waypoints


def at_floor(page: Page, ahead: float) -> tuple[int, int]:
    """Return the place of the page that is so far ahead [m] of the robot, which looks along x."""
    x, y = page.show('floor')
    rect = page.rects['floor']
    scale = 0.5 * min(rect.width, rect.height) / REACHES[2]
    return round(x + scale * ahead), y


def goal(page: Page):
    """Return the goal that the page was told of."""
    shown = page.snapshot.navigation
    return None if shown is None else shown.goal


def scenario_the_map_grows(page: Page) -> None:
    page.wait_until(lambda: page.snapshot.navigation is not None, 'no map')
    assert (page.snapshot.navigation.cells == 100).sum() > 50
    page.show('floor')
    window = page.cockpit.page.layout.place_of('map').rect
    for order in ('save map', 'cancel goal', 'explore'):
        page.show(order)
        assert page.rects[order].right < window.right
    assert page.failed() == set()


def scenario_a_click_is_a_goal_that_a_key_takes_away(page: Page) -> None:
    page.puppet.press_at(at_floor(page, 0.8))
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'no goal')
    assert abs(goal(page).x - 0.8) < 0.1
    assert abs(goal(page).y) < 0.1
    before = page.session.world.base().position[0]
    page.wait_until(lambda: page.session.world.base().position[0] > before + 0.05, 'stands')
    assert page.snapshot.marks.path is not None
    assert page.failed() == set()
    page.tap('K')
    page.wait_until(lambda: goal(page) is None, 'a key takes over')
    assert page.snapshot.navigation.state == 'cancelled'


def scenario_a_click_on_a_slow_page_is_a_goal(page: Page) -> None:
    place = at_floor(page, 0.8)
    usual, page.puppet.rate = page.puppet.rate, 1.6
    page.puppet.press_at(place)
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'no goal')
    page.puppet.rate = usual
    page.click('cancel goal')
    page.wait_until(lambda: goal(page) is None, 'the goal stays')


def scenario_a_drag_says_which_way_to_look_and_a_button_cancels(page: Page) -> None:
    x, y = at_floor(page, 0.5)
    page.puppet.press_at((x, y))
    page.puppet.drag_to((x, y - 40))
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'no goal')
    # Up on the map is along y.
    assert abs(goal(page).yaw - math.pi / 2.0) < 0.2
    page.click('cancel goal')
    page.wait_until(lambda: goal(page) is None, 'the goal stays')


def scenario_two_fingers_on_the_map_are_no_goal(page: Page) -> None:
    x, y = at_floor(page, 0.5)
    page.puppet.press_at((x, y))
    page.puppet.keys = set(SEVERAL)
    page.puppet.let_go()
    page.puppet.press_at((x + 20, y))
    page.puppet.let_go()
    page.puppet.keys = set()
    page.puppet.draw()
    assert goal(page) is None
    page.puppet.press_at((x, y))
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'one finger is no goal any more')
    page.click('cancel goal')
    page.wait_until(lambda: goal(page) is None, 'the goal stays')


def scenario_a_button_cancels_a_patrol_that_waits_where_it_stands(page: Page) -> None:
    navigation = page.session.navigations[0]
    waypoints = Waypoints([navigation.navigator.pose.copy()], rounds=None)

    def begin(*_: float) -> None:
        navigation.on_step.remove(begin)
        navigation.unit.follow(waypoints)

    def is_waiting() -> bool:
        shown = page.snapshot.navigation
        return waypoints.rest(0.0) and shown.is_following and shown.goal is None

    navigation.on_step.append(begin)
    page.wait_until(is_waiting, 'it drives to where it stands')
    page.click('cancel goal')
    page.wait_until(lambda: not navigation.unit.is_following, 'the patrol goes on')


def scenario_a_goal_that_cannot_be_is_refused_with_the_reason(page: Page) -> None:
    locator = page.session.navigations[0].navigator.locator
    page.click('map farther')
    locator.grows = False  # as that of a saved map, which shows nothing there
    page.puppet.press_at(at_floor(page, 3.6))
    page.puppet.let_go()
    page.wait_until(lambda: page.snapshot.navigation.state == 'refused', 'not refused')
    locator.grows = True
    assert page.snapshot.navigation.reason
    page.click('map closer')


def ends_without_its_page(page: Page, lose: Callable[[], None]) -> None:
    """Click a goal, lose the page on the way, and see the robot stand."""
    x, y = at_floor(page, 0.8)
    page.puppet.press_at((x, y))
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'no goal')
    navigator = page.session.navigations[0].navigator
    lose()
    page.wait_until(lambda: navigator.goal is None, 'it drives on for nobody')
    assert navigator.outcome == ('cancelled', 'the page is gone')
    page.wait(1.0)
    assert abs(page.session.world.base().planar_velocity).max() < 0.01


def scenario_a_goal_of_a_silent_page_is_cancelled(page: Page) -> None:
    def fall_silent() -> None:
        page.puppet.is_silent = True

    ends_without_its_page(page, fall_silent)


def scenario_a_goal_of_a_page_that_was_closed_is_cancelled(page: Page) -> None:
    ends_without_its_page(page, page.close)
    page.open()


def scenario_a_goal_stays_where_the_floor_was_pressed_while_the_robot_drives(page: Page) -> None:
    page.puppet.press_at(at_floor(page, 1.5))
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'no goal')
    before = page.session.world.base().position[0]
    page.wait_until(lambda: page.session.world.base().position[0] > before + 0.2, 'stands')
    first, (x, y) = goal(page), at_floor(page, 0.8)
    least = page.snapshot.navigation.pose.x
    page.puppet.press_at((x, y))
    most = page.snapshot.navigation.pose.x
    page.puppet.drag_to((x, y - 40))
    page.wait_until(lambda: page.snapshot.navigation.pose.x > most + 0.25, 'it drives on')
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) not in (None, first), 'no second goal')
    assert least - 0.05 < goal(page).x - 0.8 < most + 0.05
    page.click('cancel goal')
    page.wait_until(lambda: goal(page) is None, 'the goal stays')


def stays_without_a_goal(page: Page) -> None:
    """See that nothing was ordered, once the page has told all that it had to."""
    page.puppet.draw(6)
    page.wait(0.5)
    assert page.session.navigations[0].navigator.goal is None
    assert page.snapshot.navigation.state != 'refused'


def scenario_a_hand_that_leaves_while_the_map_is_hidden_has_chosen_no_goal(page: Page) -> None:
    page.open('phone', (390, 844))
    page.wait_until(lambda: page.cockpit.page.layout.is_tall, 'no phone')
    page.click('tab map')
    x, y = page.show('floor')
    page.puppet.press_at((x + 20, y))
    page.puppet.size = (844, 390)
    page.puppet.draw(6)
    assert page.cockpit.page.layout.is_hidden
    page.puppet.buttons = 0
    page.puppet.draw(6)
    page.puppet.size = (390, 844)
    stays_without_a_goal(page)
    page.open()


def scenario_a_hand_that_leaves_while_the_page_is_lost_has_chosen_no_goal(page: Page) -> None:
    page.puppet.press_at(at_floor(page, 0.6))
    page.puppet.is_silent = True
    time.sleep(2.0 * SILENCE)
    page.puppet.buttons = 0
    page.puppet.is_silent = False
    stays_without_a_goal(page)
