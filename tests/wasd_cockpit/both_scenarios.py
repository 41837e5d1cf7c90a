# SPDX-License-Identifier: Apache-2.0
"""What a hand does on the page of the Go2 and mbot together; see run_scenarios.py."""

import math
import random

from map_scenarios import goal
from mbot_scenarios import column, top_of
import numpy as np
from page_puppet import code, input_packet
from quadruped_sim.keys import STATE_KEYS, TRANSITIONS
from quadruped_sim.presets import GAITS
from run_scenarios import DESK, Page, paused
from wasd_cockpit.link import Columns
from wasd_cockpit.scene import axes_of
from websockets.sync.client import connect

# A desk whose plots have hardly more room than their names.
SMALL = (1040, 560)
# The lowest that shows plots, and how high each is at least [pixels].
LOW, PLOT_HEIGHT = (1002, 490), 60.0


def enter(page: Page, state: str) -> None:
    """Click a state's button, and wait for the state."""
    page.click(state)
    page.wait_until(lambda: page.snapshot.state == state, state)


def stand(page: Page) -> None:
    """Stand up from whatever state there is, and have stood for a while."""
    if page.snapshot.state == 'passive':
        enter(page, 'fixed stand')
        page.wait(1.8)
    elif page.snapshot.state != 'fixed stand':
        enter(page, 'fixed stand')
        page.wait(0.7)


def trot(page: Page) -> None:
    """Trot, from whatever state there is."""
    if page.snapshot.state != 'trotting':
        stand(page)
        enter(page, 'trotting')


def scenario_each_state_is_a_button_and_what_cannot_follow_is_grey_with_the_reason(
    page: Page,
) -> None:
    page.wait_until(lambda: page.snapshot and page.snapshot.choices, 'buttons')
    shown = [state for state in STATE_KEYS.values() if state != 'policy']  # it plays no network
    assert [choice.name for choice in page.snapshot.choices] == shown
    for choice in page.snapshot.choices:
        page.wait_until(lambda name=choice.name: name in page.rects, choice.name)
        key = next(key for key, state in STATE_KEYS.items() if state == choice.name)
        may_follow = key in TRANSITIONS[STATE_KEYS['1']]
        assert bool(choice.refusal) != may_follow or choice.is_on
    page.click('trotting')  # grey: it lies
    page.wait(0.2)
    assert page.snapshot.state == 'passive'
    assert page.robot.notice.text == ''


def scenario_the_elevation_is_mapped_while_it_is_shown(page: Page) -> None:
    mapper = page.robot.elevation.mapper
    page.click('tab eyes')
    page.wait(0.3)
    assert page.snapshot.elevation is None
    assert np.isnan(mapper.elevation.heights()).all()
    page.click('elevation')
    page.show('shown elevation')
    page.wait_until(lambda: np.isfinite(page.snapshot.elevation.heights).sum() > 1000, 'cells')
    assert len(page.snapshot.elevation.feet) == 4
    assert page.failed() == set()
    desk = page.cockpit.page.layout.places[3].rect
    assert page.rects['text highest'].right < desk.right
    assert page.rects['elevation'].right < desk.right
    page.click('elevation')
    page.wait_until(lambda: page.snapshot.elevation is None, 'it is still mapped')
    page.click('tab view')


def scenario_the_stick_walks_in_trotting_and_letting_go_is_stop(page: Page) -> None:
    trot(page)
    page.puppet.press_at(page.show('pad'))
    page.puppet.drag_to(top_of(page, 'pad', 0.5))
    since = page.session.world.time
    page.wait_until(lambda: (column(page, Columns.TRUTH, since)[1] > 0.2).any(), 'it walks')
    page.puppet.let_go()
    page.wait_until(lambda: page.robot.legs.controller.sticks.values.ly == 0.0, 'stick centred')
    page.wait(0.5)
    assert column(page, Columns.COMMAND, page.session.world.time - 0.2)[1].max() == 0.0


def scenario_whatever_a_spectator_sends_the_go2_walks_on(page: Page) -> None:
    controller = page.robot.legs.controller
    trot(page)
    page.tap('W')
    page.wait(0.5)
    chance, sticks = random.Random(1), controller.sticks.values
    words = ('force_control', 'request_control', 'leave_queue', 'grant', 'theme=light', 'w', '')
    driver = page.puppet
    with connect(
        f'{page.url.replace("http", "ws")}state?sid=spectator', max_queue=None
    ) as spectator:
        for _ in range(1000):
            keys = {code(chance.choice(('W', 'N1', 'N2', 'Space')))}
            packet = input_packet(keys, buttons=chance.choice((0, 1)))
            spectator.send(chance.choice((*words, 'max_spectators=0', packet)))
        spectator.send('leave_queue')
        page.wait(0.5)
    assert controller.state == 'trotting'
    assert controller.sticks.values == sticks
    assert page.session.world.base().tilt < 0.3
    frames = driver.frames
    page.wait_until(lambda: driver.frames > frames + 3, 'the driver still drives')
    page.tap('Space')


@paused
def scenario_gaits_are_chosen_by_name(page: Page) -> None:
    chosen = page.robot.legs.controller
    for gait in reversed(GAITS):
        page.click(f'gait {gait}')
        page.wait_until(lambda gait=gait: chosen.gait == gait, gait)


def scenario_the_stick_drives_in_move_base_by_velocities(page: Page) -> None:
    stand(page)
    enter(page, 'move base')
    page.puppet.press_at(page.show('pad'))
    page.puppet.drag_to(top_of(page, 'pad', 0.5))
    request = page.robot.legs.controller.command_filter
    page.wait_until(lambda: request.command[0] > 0.2, 'a command')
    page.puppet.let_go()
    page.wait_until(lambda: not np.any(request._request), 'no request')


def scenario_the_stick_drives_the_robot_that_was_chosen(page: Page) -> None:
    page.click('robot mbot')
    page.wait_until(lambda: page.snapshot.robots[page.snapshot.robot] == 'mbot', 'mbot')
    page.puppet.press_at(page.show('pad'))
    page.puppet.drag_to(top_of(page, 'pad'))
    target = page.session.robots[1].drive_unit.controller
    page.wait_until(lambda: target.target.linear > 0.05, 'mbot drives')
    page.puppet.let_go()
    page.wait_until(lambda: target.target.linear == 0.0, 'mbot stands')


def scenario_the_emergency_stop_stops_all_robots_at_once(page: Page) -> None:
    page.puppet.keys = {code('I')}
    target = page.session.robots[1].drive_unit.controller
    page.wait_until(lambda: target.target.linear > 0.0, 'mbot drives')
    page.click('e-stop')
    page.puppet.keys = set()
    page.wait_until(lambda: target.target.linear == 0.0, 'mbot stands')
    legs = page.robot.legs.controller
    page.wait_until(lambda: legs.state == 'passive', 'the legs are passive')
    assert legs.event == 'E-STOP by the page'
    page.click('robot go2')
    page.wait_until(lambda: page.snapshot.state == 'passive', 'go2 again')


@paused
def scenario_every_page_of_plots_has_something_to_show(page: Page) -> None:
    for name, plot in (
        ('velocity', 'plot of turn rad/s'),
        ('torque', 'plot of torque 2'),
        ('feet', 'plot of gait'),
        ('pace', 'plot of controller ms'),
    ):
        page.click(f'plot {name}')
        page.show(plot)
        assert page.rects[plot].width > 100
    page.click('plot velocity')


@paused
def scenario_a_legend_is_whole_on_a_small_desk(page: Page) -> None:
    layout = page.cockpit.page.layout
    page.open('small', SMALL)
    page.wait_until(lambda: layout._size == SMALL, 'a small page')
    for name in ('velocity', 'torque', 'feet'):
        page.click(f'plot {name}')
        page.puppet.draw(4)
        ends = [at.right for label, at in page.rects.items() if label.startswith('text legend ')]
        assert 0.0 < max(ends) <= layout.place_of('plots').rect.right
    page.click('plot velocity')
    page.open()
    page.wait_until(lambda: layout._size == DESK, 'the usual page')


@paused
def scenario_plots_of_a_low_desk_are_as_high_as_they_must_be_and_apart(page: Page) -> None:
    layout = page.cockpit.page.layout
    page.open('low', LOW)
    page.wait_until(lambda: layout._size == LOW, 'a low page')
    for name in ('velocity', 'torque', 'feet', 'pace'):
        page.click(f'plot {name}')
        page.puppet.draw(4)
        plots = [rect for label, rect in page.rects.items() if label.startswith('plot of ')]
        assert len(plots) > 1
        for plot, following in zip(plots, plots[1:], strict=False):
            assert plot.right < following.left or plot.bottom < following.top
        assert min(plot.height for plot in plots) >= PLOT_HEIGHT
    page.click('plot velocity')
    page.open()
    page.wait_until(lambda: layout._size == DESK, 'the usual page')


def scenario_no_panel_has_failed(page: Page) -> None:
    assert page.cockpit.frames > 100
    assert page.failed() == set()


def scenario_each_robot_makes_a_map_of_its_own(page: Page) -> None:
    navigations = page.session.navigations
    page.wait_until(lambda: all(each.view() for each in navigations), 'no maps')
    frames = [each.unit.settings.map_frame for each in navigations]
    assert frames == ['go2/map', 'mbot/map']
    saved = [each.unit.settings.save_map for each in navigations]
    assert saved == ['go2_map', 'mbot_map']


def on_the_floor(page: Page, x: float, y: float) -> np.ndarray:
    """Return which point of the floor (x, y) [m] a camera sees at a place of the page [pixels]."""
    view = page.session.view._page.viewer
    right, up = axes_of(view.camera)
    ahead = np.cross(up, right)
    width, height = page.puppet.size
    half = 0.5 * height / math.tan(math.radians(0.5 * view.model.vis.global_.fovy))
    ray = half * ahead + (x - 0.5 * width) * right + (0.5 * height - y) * up
    looked_at = page.session.world.data.subtree_com[page.session.world.root]
    eye = looked_at - view.camera.distance * ahead
    return (eye - eye[2] / ray[2] * ray)[:2]


def scenario_a_click_in_the_scene_is_a_goal_of_the_robot_in_turn(page: Page) -> None:
    page.click('robot mbot')
    page.wait_until(lambda: page.snapshot.robots[page.snapshot.robot] == 'mbot', 'mbot')
    _, mbot = page.session.robots
    page.click('goal')
    page.show('hand')
    hand = page.rects['hand']
    place = round(hand.left + 0.3 * hand.width), round(hand.bottom - 60.0)
    wanted = on_the_floor(page, *place) - mbot.world.setup.place
    page.puppet.press_at(place)
    page.puppet.let_go()
    page.wait_until(lambda: goal(page) is not None, 'no goal')
    assert np.abs(wanted - goal(page)[:2]).max() < 0.05
    assert page.session.navigations[0].navigator.goal is None
    before = mbot.world.base().position
    page.wait_until(lambda: math.dist(mbot.world.base().position, before) > 0.1, 'stands')
    page.click('cancel goal')
    page.click('goal')
    page.wait_until(lambda: goal(page) is None, 'the goal stays')
    page.click('robot go2')
