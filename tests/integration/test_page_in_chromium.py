# SPDX-License-Identifier: Apache-2.0
"""The page in a browser that draws slowly: a tap is one step, and nothing outlives the browser."""

from collections.abc import Callable
from pathlib import Path
import time
from typing import Any

import pytest

selenium = pytest.importorskip('selenium', reason='selenium is not installed')
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402

pytestmark = pytest.mark.slow

# A page that draws fewer pictures a second than this is not known to be alive all the time.
LEAST_RATE = 5.0
# Counts the pictures that the page tells of, and the panels that it is sent, on their connection.
COUNT = """
window.told = window.sent = 0;
const Plain = WebSocket;
window.WebSocket = class extends Plain {
  constructor(...words) {
    super(...words);
    if (!String(words[0]).includes('/ui')) return;
    this.addEventListener('message', event => {
      const count = data => { if (new DataView(data).getUint8(4) === 3) window.sent += 1; };
      if (event.data instanceof ArrayBuffer) count(event.data);
      else if (event.data instanceof Blob) event.data.arrayBuffer().then(count);
    });
  }
  send(data) {
    if ((data.byteLength ?? data.size) === 616) window.told += 1;
    super.send(data);
  }
};
"""


def open_page(browser: Any, url: str) -> None:
    """Open a page, wait until it shows a panel, and give it the keys."""
    browser.set_window_size(500, 400)
    browser.execute_cdp_cmd('Page.addScriptToEvaluateOnNewDocument', {'source': COUNT})
    browser.get(url)
    deadline, said = time.monotonic() + 90.0, ''
    while 'First remote draw frame applied' not in said:
        assert time.monotonic() < deadline, 'the page shows no panel'
        time.sleep(0.3)
        said += ''.join(entry['message'] for entry in browser.get_log('browser'))
    canvas = browser.find_element(By.TAG_NAME, 'canvas')
    ActionChains(browser).move_to_element(canvas).click().perform()


def rate_of(browser: Any) -> float:
    """Return how many pictures a second the browser draws."""
    before = browser.execute_script('return window.told')
    time.sleep(3.0)
    return float(browser.execute_script('return window.told') - before) / 3.0


def tap(browser: Any, key: str) -> None:
    """Press a key for 0.15 s."""
    ActionChains(browser).key_down(key).pause(0.15).key_up(key).perform()


def presses(path: Path) -> list[str]:
    """Return the keys that a run has saved, without HELD and RELEASE."""
    keys = [line.split(maxsplit=1)[1] for line in path.read_text().splitlines()]
    return [key for key in keys if '+' not in key]


def wait_for_key(path: Path, key: str) -> None:
    """Wait until a run has saved that a key was pressed."""
    deadline = time.monotonic() + 20.0
    while key not in presses(path):
        assert time.monotonic() < deadline, f'{key} did not come: {presses(path)}'
        time.sleep(0.05)


def test_four_taps_are_four_steps_and_end_with_the_browser(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    run = run_with_page('go2', '--save-keys', 'keys.txt', '--duration', '300')
    open_page(browser, run.url)
    rate = rate_of(browser)
    if rate < LEAST_RATE:
        pytest.skip(f'Chromium draws {rate:.1f} pictures a second here: too few to drive')
    saved = tmp_path / 'keys.txt'
    for key, pause in (('2', 3.0), ('4', 1.0)):
        tap(browser, key)
        wait_for_key(saved, key)
        time.sleep(pause)
    for _ in range(4):
        tap(browser, 'w')
        time.sleep(0.3)
    time.sleep(1.0)
    # Each is a step of the stick: test_page_is_lost.py looks at what they command.
    assert presses(saved) == ['2', '4', 'w', 'w', 'w', 'w']
    browser.quit()
    time.sleep(1.0)
    assert presses(saved)[-1] == 'SPACE'


def test_a_key_that_is_held_ends_with_the_browser(
    run_with_page: Callable[..., Any], browser: Any, tmp_path: Path
) -> None:
    run = run_with_page('mbot', '--save-keys', 'keys.txt', '--duration', '300')
    open_page(browser, run.url)
    rate = rate_of(browser)
    if rate < LEAST_RATE:
        pytest.skip(f'Chromium draws {rate:.1f} pictures a second here: too few to drive')
    saved = tmp_path / 'keys.txt'
    ActionChains(browser).key_down('i').perform()
    wait_for_key(saved, 'i')
    browser.quit()
    time.sleep(1.0)
    said = saved.read_text()
    assert said.splitlines()[-1].split()[1] == 'RELEASE+i'
    assert presses(saved)[-1] == 'STOP'
    time.sleep(2.0)
    assert saved.read_text() == said


def test_a_browser_is_not_sent_panels_that_it_cannot_show(
    run_with_page: Callable[..., Any], browser: Any
) -> None:
    run = run_with_page('mbot', '--duration', '300')
    open_page(browser, run.url)
    browser.execute_cdp_cmd('Emulation.setCPUThrottlingRate', {'rate': 4})
    ahead = []
    for _ in range(20):
        told, sent = browser.execute_script('return [window.told, window.sent]')
        ahead.append(sent - told)
        time.sleep(0.3)
    assert sent > 0
    # Every one but the first few, before the browser had told of anything, answers a picture.
    assert max(ahead) <= 5
