# SPDX-License-Identifier: Apache-2.0
"""The page in a browser that draws slowly: a tap is one step, and nothing outlives the browser."""

from collections.abc import Callable
import json
from pathlib import Path
import time
from typing import Any

import pytest
from terminals import PATIENCE

selenium = pytest.importorskip('selenium', reason='selenium is not installed')
from page_in_browser import judged_while_alive, open_page, set_page_size, skip_unless_alive  # noqa: E402
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402

pytestmark = pytest.mark.slow


def tap(browser: Any, key: str) -> None:
    """Press a key for 0.15 s."""
    ActionChains(browser).key_down(key).pause(0.15).key_up(key).perform()


def presses(path: Path) -> list[str]:
    """Return the keys that a run has saved, without HELD and RELEASE."""
    keys = [line.split(maxsplit=1)[1] for line in path.read_text().splitlines()]
    return [key for key in keys if '+' not in key]


def wait_for_key(path: Path, key: str, times: int = 1) -> None:
    """Wait until a run has saved that a key was pressed: a slow page tells of it late."""
    deadline = time.monotonic() + PATIENCE
    while presses(path).count(key) < times:
        assert time.monotonic() < deadline, f'{key} did not come: {presses(path)}'
        time.sleep(0.05)


def test_four_taps_are_four_steps_and_end_with_the_browser(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    run = run_with_page('go2', '--save-keys', 'keys.txt', '--duration', '300')
    set_page_size(browser, 500, 260)
    open_page(browser, run.url)
    skip_unless_alive(browser)
    saved = tmp_path / 'keys.txt'
    with judged_while_alive(browser):
        for key, pause in (('2', 2.2), ('4', 0.5)):
            tap(browser, key)
            wait_for_key(saved, key)
            time.sleep(pause)
        for _ in range(4):
            tap(browser, 'w')
            time.sleep(0.3)
        wait_for_key(saved, 'w', times=4)
        time.sleep(1.0)
        # Each is a step of the stick: test_page_is_lost.py looks at what they command.
        assert presses(saved) == ['2', '4', 'w', 'w', 'w', 'w']
    browser.quit()
    time.sleep(1.0)
    assert presses(saved)[-1] == 'SPACE'


def test_a_key_that_is_held_drives_and_ends_with_the_browser(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    words = ('--save-keys', 'keys.txt', '--report', 'report.json')
    run = run_with_page('mbot', '--duration', '300', *words)
    set_page_size(browser, 500, 260)
    open_page(browser, run.url)
    skip_unless_alive(browser)
    saved = tmp_path / 'keys.txt'
    ActionChains(browser).key_down('i').perform()
    with judged_while_alive(browser):
        wait_for_key(saved, 'i')
        time.sleep(1.0)
    browser.quit()
    time.sleep(1.0)
    said = saved.read_text()
    assert said.splitlines()[-1].split()[1] == 'RELEASE+i'
    assert presses(saved)[-1] == 'STOP'
    time.sleep(1.0)
    assert saved.read_text() == said
    run.end()
    report = json.loads((tmp_path / 'report.json').read_text())
    assert report['samples']['position'][-1][0] > 0.02


def test_a_browser_is_not_sent_panels_that_it_cannot_show(
    run_with_page: Callable[..., Any], browser: Any
) -> None:
    run = run_with_page('mbot', '--duration', '300')
    set_page_size(browser, 500, 260)
    open_page(browser, run.url)
    browser.execute_cdp_cmd('Emulation.setCPUThrottlingRate', {'rate': 4})
    ahead = []
    for _ in range(12):
        told, sent = browser.execute_script('return [window.told, window.sent]')
        ahead.append(sent - told)
        time.sleep(0.3)
    assert sent > 0
    # Every one but the first few, before the browser had told of anything, answers a picture.
    assert max(ahead) <= 5
