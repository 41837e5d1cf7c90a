# SPDX-License-Identifier: Apache-2.0
"""What a hand does on mbot's page; see run_scenarios.py."""

import math
import random
import time
import urllib.request

from mujoco_sim.viewer.drawing import SLOW_PAGE
import numpy as np
from page_puppet import code, middle_of, PagePuppet, SCENE
import pytest
from run_scenarios import Page, paused
from scribbling import scribble_everywhere
from wasd_cockpit.link import Columns, STICK_PROOF
from wasd_cockpit.panels.drive import LEAST_SHARE
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

# A stick that is let go means zero so soon [s], and one of a page that is gone, too.
STOP_TIME = 0.3
PHONE = (390, 844)
# What a finger presses is so high at least [pixels].
FINGER = 30.0
# Of the things that are done at random so many are presses, and half as many keys and characters.
PRESSES = 0.3
# A camera so low [degrees] is behind a wall of the room, if it is outside.
LOW = -4.0


def top_of(page: Page, name: str, share: float = 0.9) -> tuple[int, int]:
    """Return the place at which a stick is as far forward as this share of the way."""
    rect = page.rects[name]
    x, y = middle_of(rect)
    return x, round(y - share * 0.5 * rect.height)


def column(page: Page, first: int, since: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and the largest of three columns of the history since a time."""
    history = page.snapshot.history
    rows = history[history[:, 0] >= since]
    return rows[:, 0], np.abs(rows[:, first : first + 3]).max(axis=1)


def last_command(page: Page, since: float) -> float:
    """Return when the command was last not zero [s], counted from a time."""
    times, commands = column(page, Columns.COMMAND, since)
    moving = times[commands > 0.0]
    return float(moving.max() - since) if len(moving) else 0.0


def hold_stick(page: Page) -> None:
    """Have the stick forward, and the robot drive."""
    page.puppet.press_at(page.show('pad'))
    page.puppet.drag_to(top_of(page, 'pad'))
    since = page.session.world.time
    page.wait(0.5)
    _, speeds = column(page, Columns.TRUTH, since)
    assert speeds.max() > 0.08, speeds


def scenario_the_stick_drives_and_letting_go_is_stop(page: Page) -> None:
    before = page.session.world.base().position[0]
    hold_stick(page)
    page.puppet.let_go()
    since = page.session.world.time
    page.wait(1.2)
    assert last_command(page, since) <= STOP_TIME
    assert column(page, Columns.TRUTH, since + 1.0)[1].max() < 0.01
    assert page.session.world.base().position[0] > before + 0.05


def scenario_turning_turns(page: Page) -> None:
    yaw = page.session.world.base().rpy[2]
    page.puppet.press_at(page.show('turning'))
    x, y = middle_of(page.rects['turning'])
    page.puppet.drag_to((round(x - 0.4 * page.rects['turning'].width), y))
    page.wait(0.6)
    page.puppet.let_go()
    turned = math.remainder(page.session.world.base().rpy[2] - yaw, 2.0 * math.pi)
    assert turned > 0.1


def scenario_a_stick_of_a_silent_page_is_let_go(page: Page) -> None:
    hold_stick(page)
    page.puppet.is_silent = True
    since = page.session.world.time
    page.wait(1.0)
    page.puppet.is_silent = False
    assert last_command(page, since) <= STICK_PROOF + STOP_TIME
    # What is down since before the silence counts for nothing until it was up.
    page.puppet.draw(10)
    since = page.session.world.time
    page.wait(0.5)
    assert last_command(page, since) == 0.0
    page.puppet.let_go()


def scenario_the_first_press_counts_on_a_page_that_follows_one_lost_with_its_button_down(
    page: Page,
) -> None:
    hold_stick(page)
    page.puppet.keys = {code('LeftCtrl')}  # as of Ctrl-R
    page.puppet.draw()
    page.open('another', page.puppet.size)
    page.puppet.draw()
    page.puppet.keys = {code('I')}
    target = page.robot.drive_unit.controller
    page.wait_until(lambda: target.target.linear > 0.0, 'drives')
    page.puppet.press_at(middle_of(page.rects['e-stop']))
    page.wait_until(lambda: target.target.linear == 0.0, 'stands')
    page.puppet.let_go()
    page.puppet.keys = set()


def scenario_a_stick_that_moves_away_below_the_finger_is_let_go(page: Page) -> None:
    width, height = page.puppet.size
    hold_stick(page)
    since = page.session.world.time
    page.puppet.size = (width - 60, height - 90)
    page.wait(1.0)
    assert last_command(page, since) <= STICK_PROOF + STOP_TIME
    page.puppet.let_go()
    page.puppet.size = (width, height)
    page.puppet.draw()


def scenario_a_stick_that_is_held_over_an_e_stop_stays_still_though_the_page_is_late(
    page: Page,
) -> None:
    target = page.robot.drive_unit.controller
    hold_stick(page)
    page.puppet.keys = {code('Escape')}
    page.wait_until(lambda: target.target.linear == 0.0, 'stands')
    page.puppet.keys = set()
    page.puppet.is_silent = True
    time.sleep(1.3 * STICK_PROOF)
    page.puppet.is_silent = False
    page.puppet.draw(4)
    since = page.session.world.time
    page.wait(0.5)
    assert last_command(page, since) == 0.0
    page.puppet.let_go()


@paused
def scenario_keys_drive_after_a_click_on_a_button(page: Page) -> None:
    page.click('tab keys')
    page.tap('I')
    page.wait_until(lambda: page.robot.logic.last_key == 'i', 'i was pressed')
    assert page.show('key i')
    page.click('tab drive')


def scenario_a_tap_counts_however_short_it_is(page: Page) -> None:
    simulation = page.session.simulation
    for _ in range(10):
        place, was_paused = page.show('pause'), simulation.paused
        page.puppet.tap_at(place)
        page.wait_until(lambda was=was_paused: simulation.paused != was, 'the tap counts')


def scenario_keys_count_while_the_stick_is_held(page: Page) -> None:
    hold_stick(page)
    page.puppet.keys = {code('K')}
    page.wait_until(lambda: page.robot.logic.last_key == 'k', 'k was pressed')


@paused
def scenario_a_key_that_is_clicked_is_pressed_and_lit(page: Page) -> None:
    page.click('tab keys')
    page.click('key k')
    page.wait_until(lambda: page.robot.logic.last_key == 'k', 'k was pressed')
    page.click('tab drive')


def scenario_what_is_typed_in_a_field_drives_nothing(page: Page) -> None:
    page.tap('K')
    page.wait_until(lambda: page.robot.logic.last_key == 'k', 'k was pressed')
    page.click('speed')
    page.puppet.draw(5)
    mouse = page.puppet.mouse
    since = page.session.world.time
    page.tap('I')
    page.tap('U')
    page.puppet.mouse = mouse
    page.wait(0.4)
    assert page.robot.logic.last_key == 'k'
    assert last_command(page, since) == 0.0
    page.tap('Escape')
    page.tap('L')
    page.wait_until(lambda: page.robot.logic.last_key == 'l', 'keys drive again')
    page.tap('K')


def type_speed(page: Page, text: str) -> None:
    """Type how fast time is to go."""
    page.click('speed')
    page.wait_until(lambda: page.cockpit.page.widgets.is_typing, 'the field takes what is typed')
    page.puppet.keys = {code('LeftCtrl'), code('A')}
    page.puppet.draw(4)
    page.puppet.keys = set()
    page.puppet.type(text)
    page.tap('Enter')
    wanted = float(text)
    page.wait_until(lambda: page.session.simulation.pacer.speed == wanted, text)


@paused
def scenario_whatever_is_typed_the_stick_s_share_of_full_speed_is_on_its_slider(
    page: Page,
) -> None:
    control = {code('LeftCtrl'), code('ReservedForModCtrl')}
    drive = page.cockpit._drive
    for text, share in (('5', 1.0), ('-1', LEAST_SHARE), ('1e39', 1.0), ('0.25', 0.25)):
        page.puppet.keys = control
        page.click('share')
        page.puppet.keys = control | {code('A')}
        page.puppet.draw(4)
        page.puppet.keys = set()
        page.puppet.type(text)
        page.tap('Enter')
        page.wait_until(lambda share=share: drive.share == pytest.approx(share), text)
    drive.share = 0.5


@paused
def scenario_time_goes_as_fast_as_the_field_says(page: Page) -> None:
    for text in ('0.5', '0', '1.25', '1'):
        type_speed(page, text)


@paused
def scenario_what_is_typed_and_entered_within_a_picture_is_taken_whole(page: Page) -> None:
    page.click('speed')
    page.wait_until(lambda: page.cockpit.page.widgets.is_typing, 'the field takes what is typed')
    page.puppet.keys = {code('LeftCtrl'), code('A')}
    page.puppet.draw(4)
    page.puppet.keys = {code('Enter')}
    page.puppet.type('0.75', at_once=True)
    page.wait_until(lambda: page.session.simulation.pacer.speed == 0.75, 'all four characters')
    page.puppet.keys = set()
    page.puppet.draw(4)
    type_speed(page, '1')


@paused
def scenario_a_click_elsewhere_comes_after_all_that_was_typed_before_it(page: Page) -> None:
    elsewhere = page.show('tab keys')
    page.click('speed')
    page.wait_until(lambda: page.cockpit.page.widgets.is_typing, 'the field takes what is typed')
    page.puppet.keys = {code('LeftCtrl'), code('A')}
    page.puppet.draw(4)
    page.puppet.rate = 4.0
    back = ({code('Backspace')}, ''), (set(), '')
    page.puppet.strike((set(), '0.7599'), *back, *back, *back, ({code('Enter')}, ''), (set(), ''))
    page.puppet.mouse, page.puppet.buttons = elsewhere, 1
    page.puppet.draw()
    page.puppet.let_go()
    page.wait_until(lambda: page.session.simulation.pacer.speed == 0.7, 'what was typed')
    page.rest()
    page.click('tab drive')
    type_speed(page, '1')


def scenario_a_key_that_is_held_right_after_enter_drives(page: Page) -> None:
    page.tap('K')
    page.click('speed')
    page.wait_until(lambda: page.cockpit.page.widgets.is_typing, 'the field takes what is typed')
    page.puppet.keys = {code('LeftCtrl'), code('A')}
    page.puppet.draw(4)
    enter, held = {code('Enter')}, {code('I')}
    page.puppet.strike((set(), ''), (set(), '1'), (enter, ''), (set(), ''), (held, 'i'))
    page.wait_until(lambda: page.robot.logic.last_key == 'i', 'the key drives')
    assert page.session.simulation.pacer.speed == 1.0
    page.puppet.keys = set()
    page.tap('K')


@paused
def scenario_time_that_goes_slower_by_steps_goes_on(page: Page) -> None:
    pacer = page.session.simulation.pacer
    type_speed(page, '0.3')
    page.show('speed')
    rect = page.rects['speed']  # its last two squares are - and +
    minus = round(rect.right - 1.5 * rect.height - 4.0), middle_of(rect)[1]
    for _ in range(5):
        page.puppet.press_at(minus)
        page.puppet.let_go()
        page.puppet.draw(4)
    assert pacer.speed == 0.1
    type_speed(page, '1')


def scenario_pause_step_and_run(page: Page) -> None:
    world = page.session.world
    page.click('step')  # grey: not paused
    page.click('pause')
    page.wait_until(lambda: page.snapshot.is_paused, 'paused')
    time = world.time
    page.click('step')
    page.wait_until(lambda: world.time > time, 'a step')
    assert world.time - time < 0.1
    page.click('pause')
    page.wait_until(lambda: not page.snapshot.is_paused, 'runs')


def scenario_reset_puts_the_robot_back(page: Page) -> None:
    hold_stick(page)
    page.puppet.let_go()
    page.wait(0.4)
    page.click('reset')
    page.wait_until(lambda: abs(page.session.world.base().position[0]) < 0.01, 'back')


def scenario_the_emergency_stop_ends_a_motion_that_keys_have_set_going(page: Page) -> None:
    page.puppet.keys = {code('I')}
    page.wait_until(lambda: page.robot.drive_unit.controller.target.linear > 0.0, 'drives')
    page.puppet.press_at(page.show('e-stop'))  # and not let go: neither the button nor the key
    page.wait_until(lambda: page.robot.drive_unit.controller.target.linear == 0.0, 'stands')
    since = page.session.world.time
    page.wait(1.0)
    assert last_command(page, since + 0.1) == 0.0
    page.puppet.let_go()
    page.puppet.keys = set()
    page.puppet.draw(4)
    page.puppet.keys = {code('I')}
    page.wait_until(lambda: page.robot.drive_unit.controller.target.linear > 0.0, 'drives')


def scenario_the_emergency_stop_counts_though_the_pointer_passes_over_it(page: Page) -> None:
    target = page.robot.drive_unit.controller
    for _ in range(5):
        page.puppet.keys = {code('I')}
        page.wait_until(lambda: target.target.linear > 0.0, 'drives')
        page.puppet.tap_at(page.show('e-stop'), away=SCENE)
        page.wait_until(lambda: target.target.linear == 0.0, 'stands')
        page.puppet.keys = set()
        page.puppet.draw(4)


def scenario_a_page_without_panels_still_has_the_emergency_stop(page: Page) -> None:
    page.click('panels')
    page.wait_until(lambda: 'pad' not in page.rects, 'no panels')
    page.puppet.keys = {code('I')}
    page.wait_until(lambda: page.robot.drive_unit.controller.target.linear > 0.0, 'drives')
    page.click('stop at once')
    page.puppet.keys = set()
    page.wait_until(lambda: page.robot.drive_unit.controller.target.linear == 0.0, 'stands')
    page.click('panels')
    page.show('pad')


@paused
def scenario_a_page_that_draws_few_pictures_is_told_so(page: Page) -> None:
    usual, page.puppet.rate = page.puppet.rate, 5.0
    page.wait_until(lambda: SLOW_PAGE in page.cockpit._slow_words, 'it is told')
    assert 'text cannot hold' not in page.rects
    page.puppet.rate = 2.0
    page.wait_until(lambda: 'text cannot hold' in page.rects, 'it is told at the stick')
    page.puppet.rate = usual
    page.wait_until(lambda: not page.cockpit._slow_words, 'it is told no more')
    page.wait_until(lambda: 'text cannot hold' not in page.rects, 'nor at the stick')


@paused
def scenario_however_much_is_to_be_said_it_stays_within_the_scene(page: Page) -> None:
    say = page.robot.say
    say('a lot')
    page.wait_until(lambda: 'text message' in page.rects, 'it is said')
    page.puppet.draw(4)
    line = page.rects['text message'].height
    say('a lot ' * 60)
    page.wait_until(
        lambda: page.rects['text message'].height > 1.5 * line, 'in more than one line'
    )
    page.puppet.draw(4)
    assert page.rects['text message'].right < page.cockpit.page.layout.scene.right
    say('')


def scenario_the_mode_of_the_drive_and_its_limits_are_shown(page: Page) -> None:
    (setting,) = page.snapshot.settings
    assert setting.chosen == 'sim'
    assert 'mode arbotix' in page.rects
    full = page.robot.logic
    words = f'full {full.speed:.2f} m/s {full.turn:.2f} rad/s'
    assert words in page.snapshot.facts
    with urllib.request.urlopen(f'{page.url}status') as answer:
        assert words.encode() in answer.read()


def scenario_the_map_shows_what_rays_hit_and_where_the_robot_was(page: Page) -> None:
    page.show('floor')
    sight = page.cockpit.page.sight
    page.wait_until(lambda: len(sight.seen.points) > 50, 'walls')
    assert np.abs(sight.seen.points).max() < 12.0
    page.click('map farther')
    page.click('map closer')
    assert page.snapshot.trail.shape[1] == 2


@paused
def scenario_pictures_come_when_they_are_wanted(page: Page) -> None:
    page.click('tab eyes')
    sight = page.cockpit.page.sight
    page.puppet.draw(10)
    assert sight.seen.picture is None
    page.click('picture')
    page.show('shown picture')
    pixels = np.frombuffer(sight.seen.picture, dtype=np.uint8)
    assert pixels.size == 320 * 240 * 4
    assert pixels.std() > 10.0
    page.click('picture')
    page.click('tab view')


@paused
def scenario_a_robot_without_a_lidar_of_points_says_so_in_place_of_its_elevation(
    page: Page,
) -> None:
    page.click('tab eyes')
    page.click('elevation')  # grey
    page.puppet.draw(10)
    assert page.snapshot.no_elevation
    assert page.snapshot.elevation is None
    assert 'shown elevation' not in page.rects
    page.click('tab view')


@paused
def scenario_the_camera_goes_where_it_is_sent_and_back(page: Page) -> None:
    camera = page.cockpit.page.viewer.camera
    azimuth, distance = camera.azimuth, camera.distance
    page.click('about left')
    page.wait_until(lambda: camera.azimuth != azimuth, 'from another side')
    page.click('camera first person')
    page.wait_until(lambda: camera.distance == 0.05, 'first person')
    eye = np.array(camera.lookat)
    place = page.session.world.base().position
    assert np.hypot(*(eye - place)[:2]) < 0.5
    page.click('camera free')
    page.click('camera back')
    page.wait_until(lambda: (camera.azimuth, camera.distance) == (azimuth, distance), 'back')


def scenario_a_camera_that_follows_goes_up_where_a_wall_hides_the_robot(page: Page) -> None:
    camera, scene = page.cockpit.page.viewer.camera, page.cockpit.scene
    page.wait_until(lambda: scene.lifted == 0.0, 'something is in the way already')
    elevation = camera.elevation

    def is_lifted() -> bool:
        if camera.elevation == elevation:  # also when the page wrote it at the same time
            camera.distance, camera.elevation = 8.0, LOW
        return scene.lifted > 5.0

    page.wait_until(is_lifted, 'the robot is hidden')
    page.wait(1.0)
    # Its thread may be between the one and the other.
    page.wait_until(lambda: abs(LOW - camera.elevation - scene.lifted) < 1e-6, 'it is lifted')
    page.click('camera free')  # nobody is to be taken away from what he looks at
    up = camera.elevation
    page.wait(0.5)
    assert camera.elevation == up
    page.click('camera back')
    page.wait_until(lambda: abs(camera.elevation - elevation) < 1e-6, 'it stays up')


@paused
def scenario_marks_are_drawn_where_they_are_wanted(page: Page) -> None:
    geoms = page.cockpit.page.viewer.extra_geoms
    for name in ('lidar', 'estimate', 'trail'):
        page.click(f'show {name}')
    page.wait_until(lambda: len(geoms) > 20, 'marks')
    for name in ('lidar', 'estimate', 'trail'):
        page.click(f'show {name}')
    page.wait_until(lambda: len(geoms) <= 2, 'no marks')


def scenario_a_hand_pushes_the_robot_and_lets_it_go(page: Page) -> None:
    page.click('push')
    before = page.session.world.base().position
    page.puppet.press_at(page.show('hand'))
    x, y = page.puppet.mouse
    page.puppet.drag_to((x + 200, y))
    page.wait_until(lambda: page.cockpit.page.link.push, 'a force')
    page.wait(0.6)
    page.puppet.let_go()
    page.wait_until(lambda: page.cockpit.page.link.push is None, 'no force')
    page.wait(0.2)
    assert not page.session.world.data.xfrc_applied.any()
    assert np.abs(page.session.world.base().position - before).max() > 0.005
    page.click('push')
    page.click('reset')
    assert page.failed() == set()


def scenario_a_spectator_has_no_panels_and_moves_nothing(page: Page) -> None:
    since = page.session.world.time
    size = page.puppet.size
    other = PagePuppet(page.url, session='spectator', size=size, patience=0.0)
    with pytest.raises(ConnectionClosed, match='4001'), other:
        pass
    with urllib.request.urlopen(f'{page.url}status') as answer:
        assert f'mbot   {page.snapshot.state}'.encode() in answer.read()
    page.wait(0.2)
    assert last_command(page, since) == 0.0


@paused
def scenario_on_a_phone_all_is_within_the_page_and_high_enough_for_a_finger(page: Page) -> None:
    page.open('phone', PHONE)
    page.wait_until(lambda: page.cockpit.page.layout.is_tall, 'a page that is higher than wide')
    panels = tuple(page.cockpit._panels)
    for panel in panels:
        page.click(f'tab {panel}')
        page.puppet.draw(4)
        rects = page.rects
        assert {f'tab {name}' for name in panels} < set(rects)
        outside = {name for name, at in rects.items() if at.left < 0 or at.right > PHONE[0]}
        assert outside == set(), panel
        pressed = {name: at for name, at in rects.items() if not name.startswith('text ')}
        small = {name: at.height for name, at in pressed.items() if at.height < FINGER}
        assert small == {}, panel
    page.click('tab drive')
    page.open()
    page.show('pad')


def scenario_who_drives_is_asked_for_control_and_gives_it(page: Page) -> None:
    hold_stick(page)
    with connect(f'{page.url.replace("http", "ws")}state?sid=second') as spectator:
        spectator.send('request_control')
        page.puppet.let_go()
        page.puppet.press_at(page.show('give control'))
        since = page.session.world.time
        page.puppet.buttons = 0
        while spectator.recv() != 'grant':
            pass
        page.open('second')
        page.wait_until(lambda: 'give control' not in page.rects, 'nobody waits')
        page.wait(0.3)
        assert last_command(page, since) <= STOP_TIME
        hold_stick(page)


def scenario_whatever_a_hand_does_no_panel_fails_and_nothing_grows(page: Page) -> None:
    chance = random.Random(1)
    # What is made once is made in the first round. After that, 2 kB for each of the things that
    # are no moves would be 1.2 MB.
    scribble_everywhere(page, 100, chance)
    for _ in range(3):  # what grows does so each time, and not by a large piece once
        sizes = scribble_everywhere(page, 150, chance, PRESSES)
        if max(sizes) - sizes[0] < 750_000:
            break
    else:
        raise AssertionError(f'memory grows: {sizes}')
    assert page.failed() == set()
    page.wait_until(lambda: not page.session.simulation.paused, 'runs')
    page.click('tab drive')
    page.cockpit._drive.share = 0.5
    page.click('reset')
    page.tap('K')
    scenario_turning_turns(page)
