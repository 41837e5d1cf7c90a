# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: mbot is seen, moves, and is driven; nothing outlives the browser."""

from collections.abc import Callable
import json
from pathlib import Path
import signal
import time
from typing import Any
import urllib.request

import numpy as np
from page_puppet import code, PagePuppet
import pytest
from terminals import PATIENCE, wait_until

selenium = pytest.importorskip('selenium', reason='selenium is not installed')
from page_in_browser import (  # noqa: E402
    BLIND,
    errors_in,
    judged_while_alive,
    open_page,
    presses,
    saved_keys,
    set_page_size,
    skip_unless_alive,
    SPARE,
    wait_for_key,
)
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402

pytestmark = pytest.mark.slow

Picture = Callable[[], np.ndarray]
# The E-STOP of a page that does not drive.
BUTTON = "document.querySelector('button')"
# A blind page is sent so many states a second at least, if its machine has time for it.
FAST_ENOUGH = 30.0


def share_of_orange(image: np.ndarray) -> float:
    """Return how much of a picture has the colour of mbot's drum."""
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    return float(((red > 150) & (green > 0.2 * red) & (green < 0.6 * red) & (blue < 80)).mean())


def wait_for_robot(picture: Picture, timeout: float = PATIENCE) -> np.ndarray:
    """Return the first picture in which mbot is seen."""
    deadline = time.monotonic() + timeout
    while True:
        image = picture()
        if share_of_orange(image) > 0.01:
            return image
        assert time.monotonic() < deadline, 'mbot has not appeared'
        time.sleep(0.5)


def listeners(port: int) -> set[str]:
    """Return the local addresses that listen on a port, as the kernel writes them."""
    found = set()
    for table in ('/proc/net/tcp', '/proc/net/tcp6'):
        for line in Path(table).read_text().splitlines()[1:]:
            address, state = line.split()[1], line.split()[3]
            if state == '0A' and int(address.rsplit(':', 1)[1], 16) == port:
                found.add(address.rsplit(':', 1)[0])
    return found


def test_mbot_is_seen_moving_without_an_error_and_without_panels_that_cannot_be_shown(
    run_with_page: Callable[..., Any], browser: Any, picture: Picture, tmp_path: Path
) -> None:
    (tmp_path / 'circle.txt').write_text('0 0.15 0 0.5')
    run = run_with_page('mbot', '--no-ros', '--twist', 'circle.txt', '--duration', '300')
    console = open_page(browser, run.url, spares=True)
    first = wait_for_robot(picture)
    # The floor turns under the camera that follows the robot: most of the picture changes.
    wait_until(lambda: (abs(first - picture()).sum(axis=2) > 20).mean() > 0.05)
    assert share_of_orange(picture()) > 0.01
    assert errors_in(console + browser.get_log('browser')) == []
    see_a_slow_browser_not_be_sent_panels_that_it_cannot_show(browser)


def see_a_slow_browser_not_be_sent_panels_that_it_cannot_show(browser: Any) -> None:
    browser.execute_cdp_cmd('Emulation.setCPUThrottlingRate', {'rate': 4})
    ahead = []
    for _ in range(6):
        told, sent = browser.execute_script('return [window.told, window.sent]')
        ahead.append(sent - told)
        time.sleep(0.3)
    assert sent > 0
    # Every one but the first few, before the browser had told of anything, answers a picture.
    assert max(ahead) <= 5


def test_a_page_that_draws_slowly_is_sent_fewer_states_than_one_that_draws_fast(
    run_with_page: Callable[..., Any], browser: Any
) -> None:
    def counted() -> tuple[float, float]:
        """Return how many pictures a second the page draws, and how many states it is sent."""
        count = 'return [performance.now() / 1000, window.told, window.states]'
        before = browser.execute_script(count)
        time.sleep(3.0)
        seconds, told, states = np.subtract(browser.execute_script(count), before)
        return told / seconds, states / seconds

    # So slow a run has time to spare on a busy machine, too: the page alone sets the pace.
    run = run_with_page('mbot', '--no-ros', '--speed', '0.1')
    open_page(browser, run.url, is_blind=True)
    for _ in range(4):
        fast_pictures, fast = counted()
        if fast >= FAST_ENOUGH:
            break
    else:
        pytest.skip(f'a fast page is sent {fast:.0f} states a second here: as few as a slow one')
    browser.execute_script("""
        const draw = window.requestAnimationFrame.bind(window);
        window.requestAnimationFrame = picture => setTimeout(() => draw(picture), 500);
    """)
    # What was sent before the page became slow may reach it late on a busy machine.
    for _ in range(4):
        slow_pictures, slow = counted()
        if slow < 0.75 * fast:
            break
    assert slow_pictures < 0.5 * fast_pictures
    assert slow_pictures < slow < 0.75 * fast


def test_a_key_that_is_held_ends_where_its_page_is_left_and_with_the_browser(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    saves = ('--save-keys', 'keys.txt', '--report', 'report.json')
    run = run_with_page('mbot', '--no-ros', *saves)
    open_page(browser, run.url, spares=True)
    skip_unless_alive(browser)
    saved = tmp_path / 'keys.txt'
    see_a_key_that_is_held_while_the_page_is_left_count_after_its_release(browser, saved)
    see_a_key_that_is_held_drive_and_end_with_the_browser(browser, saved)
    run.end()
    report = json.loads((tmp_path / 'report.json').read_text())
    assert report['samples']['position'][-1][0] > 0.02


def see_a_key_that_is_held_while_the_page_is_left_count_after_its_release(
    browser: Any, saved: Path
) -> None:
    def tell(what: str, is_repeat: bool = False) -> None:
        key = {'key': 'i', 'code': 'KeyI', 'windowsVirtualKeyCode': 73}
        words = {'type': what, 'autoRepeat': is_repeat, **key}
        browser.execute_cdp_cmd('Input.dispatchKeyEvent', words)

    tell('keyDown')
    wait_for_key(saved, 'i')
    browser.execute_script("dispatchEvent(new Event('blur'))")
    wait_for_key(saved, 'RELEASE+i')
    pressed = presses(saved).count('i')
    for _ in range(20):
        tell('keyDown', is_repeat=True)
        time.sleep(0.1)
    assert presses(saved).count('i') == pressed
    tell('keyUp')
    time.sleep(1.0)
    tell('keyDown')
    wait_for_key(saved, 'i', pressed + 1)
    tell('keyUp')
    wait_for_key(saved, 'RELEASE+i', 2)


def see_a_key_that_is_held_drive_and_end_with_the_browser(browser: Any, saved: Path) -> None:
    before = len(presses(saved))
    ActionChains(browser).key_down('i').perform()
    with judged_while_alive(browser):
        wait_for_key(saved, 'i', since=before)
        time.sleep(1.0)
    browser.quit()
    wait_until(lambda: presses(saved)[-1] == 'STOP')
    wait_until(lambda: saved_keys(saved)[-1] == 'RELEASE+i')
    said = saved.read_text()
    time.sleep(1.0)
    assert saved.read_text() == said


def test_the_last_of_fingers_and_a_mouse_presses_the_e_stop(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    def touch(what: str, *places: tuple[int, int], first: int = 0) -> None:
        points = [{'x': x, 'y': y, 'id': number} for number, (x, y) in enumerate(places, first)]
        words = {'type': what, 'touchPoints': points}
        browser.execute_cdp_cmd('Input.dispatchTouchEvent', words)
        time.sleep(0.5)

    def mouse(what: str, place: tuple[int, int], is_down: bool) -> None:
        words = {'type': what, 'x': place[0], 'y': place[1], 'button': 'left', 'clickCount': 1}
        browser.execute_cdp_cmd('Input.dispatchMouseEvent', words | {'buttons': int(is_down)})
        time.sleep(0.5)

    run = run_with_page('mbot', '--no-ros', '--save-keys', 'keys.txt')
    browser.execute_cdp_cmd(
        'Emulation.setTouchEmulationEnabled', {'enabled': True, 'maxTouchPoints': 2}
    )
    open_page(browser, run.url, spares=True, is_blind=True)
    skip_unless_alive(browser)
    scene, e_stop, saved = (300, 200), (60, 70), tmp_path / 'keys.txt'
    touch('touchStart', scene)
    touch('touchStart', scene, e_stop)
    with judged_while_alive(browser):
        wait_for_key(saved, 'ESC')
    touch('touchEnd')
    see_a_finger_press_no_more_when_the_one_after_it_has_left(touch, saved, e_stop, scene)
    see_the_newer_of_a_mouse_and_a_finger_press(touch, mouse, saved, e_stop, scene)


def test_a_page_that_watches_stops_the_robot_and_says_so_or_that_nobody_answers(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    def press() -> None:
        browser.execute_script('window.said = []')
        words = {'type': 'touchStart', 'touchPoints': [{'x': 75, 'y': 65}]}
        browser.execute_cdp_cmd('Input.dispatchTouchEvent', words)
        words = {'type': 'touchEnd', 'touchPoints': []}
        browser.execute_cdp_cmd('Input.dispatchTouchEvent', words)

    def wait_for_answer(words: str) -> None:
        wait_until(lambda: words in browser.execute_script('return window.said'))

    run = run_with_page('mbot', '--no-ros', '--latched', '--save-keys', 'keys.txt')
    saved = tmp_path / 'keys.txt'
    browser.execute_cdp_cmd('Emulation.setTouchEmulationEnabled', {'enabled': True})
    with PagePuppet(run.url) as driver:
        driver.draw()
        driver.keys = {code('I')}
        browser.execute_cdp_cmd('Page.addScriptToEvaluateOnNewDocument', {'source': SPARE + BLIND})
        browser.get(run.url)
        wait_until(lambda: browser.execute_script('return Module.isSpectator') is True)
        browser.execute_script(f"""
            new MutationObserver(() => window.said.push({BUTTON}.textContent)).observe(
                {BUTTON}, {{childList: true}});
        """)
        wait_for_key(saved, 'i')
        press()
        wait_for_key(saved, 'ESC')
        wait_for_answer('STOPPED')
        driver.is_silent = True
        wait_for_key(saved, 'RELEASE+i')
        press()
        wait_for_key(saved, 'ESC', 2)
        wait_for_answer('STOPPED')
        run.process.send_signal(signal.SIGSTOP)
        press()
        wait_for_answer('NO ANSWER')
        run.process.send_signal(signal.SIGCONT)
        wait_for_key(saved, 'ESC', 3)
    assert not browser.execute_script(f'return {BUTTON}.hidden')
    open_page(browser, run.url, spares=True, is_blind=True)
    assert browser.execute_script(f'return {BUTTON}.hidden')
    assert presses(saved).count('ESC') == 3


def test_a_phone_that_is_turned_and_turned_back_shows_the_page_as_large_as_before(
    run_with_page: Callable[..., Any], browser: Any
) -> None:
    run = run_with_page('mbot', '--no-ros')
    set_page_size(browser, 390, 844, is_phone=True)
    open_page(browser, run.url, spares=True, is_blind=True)
    for width, height in ((844, 390), (390, 844)):
        set_page_size(browser, width, height, is_phone=True)
        time.sleep(1.5)
    assert browser.execute_script('return [innerWidth, innerHeight]') == [390, 844]


def see_a_finger_press_no_more_when_the_one_after_it_has_left(
    touch: Callable[..., None], saved: Path, e_stop: tuple[int, int], scene: tuple[int, int]
) -> None:
    touch('touchStart', e_stop)
    wait_for_key(saved, 'ESC', 2)
    touch('touchStart', e_stop, scene)
    touch('touchEnd', scene, first=1)
    touch('touchMove', (e_stop[0] + 3, e_stop[1]))
    touch('touchEnd')
    assert presses(saved).count('ESC') == 2


def see_the_newer_of_a_mouse_and_a_finger_press(
    touch: Callable[..., None],
    mouse: Callable[..., None],
    saved: Path,
    e_stop: tuple[int, int],
    scene: tuple[int, int],
) -> None:
    mouse('mousePressed', scene, is_down=True)
    touch('touchStart', e_stop)
    wait_for_key(saved, 'ESC', 3)
    mouse('mouseReleased', scene, is_down=False)
    touch('touchEnd')

    touch('touchStart', scene)
    mouse('mouseMoved', e_stop, is_down=False)
    mouse('mousePressed', e_stop, is_down=True)
    wait_for_key(saved, 'ESC', 4)
    mouse('mouseReleased', e_stop, is_down=False)
    touch('touchEnd')


def test_without_ros_the_page_answers_this_machine_only_and_a_second_run_takes_the_next_port(
    run_with_page: Callable[..., Any],
) -> None:
    first, second = (run_with_page('mbot', '--no-ros') for _ in range(2))
    assert first.port != second.port
    deadline = time.monotonic() + PATIENCE
    while not listeners(first.port) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert listeners(first.port) == {'0100007F'}
    with urllib.request.urlopen(first.url, timeout=PATIENCE) as page:
        assert page.status == 200
        assert b'<canvas' in page.read()
