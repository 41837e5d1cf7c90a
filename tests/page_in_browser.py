# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, with a count of what it tells and of what it is sent."""

import base64
from collections.abc import Iterator
import contextlib
import io
from pathlib import Path
import shutil
import time
from typing import Any

from mujoco_sim.viewer.input import SILENCE
import numpy as np
from PIL import Image
import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from terminals import PATIENCE

FLAGS = (
    '--headless=new',
    '--no-sandbox',
    '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader',
    '--ignore-gpu-blocklist',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-quic',
    '--disable-sync',
    '--no-first-run',
)
# A page that draws fewer pictures a second than this cannot be told from one that is lost.
LEAST_RATE = 1.5
# A browser that renders in software draws all the time if it may: so many pictures a second do.
MOST_RATE = 12.0
SPARE = f"""
const Draw = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = draw => setTimeout(() => Draw(draw), {1000.0 / MOST_RATE:.0f});
"""
# Counts the pictures that the page tells of, and the panels and states that it is sent.
COUNT = """
window.told = window.sent = window.states = window.longest = 0;
window.last = performance.now();
const Plain = WebSocket;
window.WebSocket = class extends Plain {
  constructor(...words) {
    super(...words);
    if (String(words[0]).includes('/state')) this.addEventListener('message', event => {
      if (typeof event.data !== 'string') window.states += 1;
    });
    if (!String(words[0]).includes('/ui')) return;
    this.addEventListener('message', event => {
      const count = data => { if (new DataView(data).getUint8(4) === 3) window.sent += 1; };
      if (event.data instanceof ArrayBuffer) count(event.data);
      else if (event.data instanceof Blob) event.data.arrayBuffer().then(count);
    });
  }
  send(data) {
    if ((data.byteLength ?? data.size) === 616) {
      window.told += 1;
      window.longest = Math.max(window.longest, performance.now() - window.last);
      window.last = performance.now();
    }
    super.send(data);
  }
};
"""

# Not every browser makes a TouchEvent of an array of touches, as this one does.
NO_TOUCH_EVENT = 'window.TouchEvent = undefined;'

# Draws nothing, and so is fast without a graphics card: what is pressed needs no picture.
BLIND = """
for (const name of Object.getOwnPropertyNames(WebGL2RenderingContext.prototype))
  if (/^draw(Arrays|Elements|Range)/.test(name))
    WebGL2RenderingContext.prototype[name] = () => {};
"""


def chromium(width: int, height: int, is_phone: bool = False) -> Any:
    """
    Return a headless Chromium that renders in software, with a page of so many pixels.

    Raises:
        LookupError: none is installed, with what drives it.
    """
    binary, driver = shutil.which('chromium'), shutil.which('chromedriver')
    if binary is None or driver is None:
        raise LookupError('no chromium with chromedriver (Debian: apt install chromium-driver)')
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in (*FLAGS, f'--window-size={width},{height}'):
        options.add_argument(flag)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    set_page_size(browser, width, height, is_phone)
    if is_phone:
        browser.execute_cdp_cmd('Emulation.setTouchEmulationEnabled', {'enabled': True})
    return browser


def set_page_size(
    browser: Any, width: int, height: int, is_phone: bool = False, fineness: int = 1
) -> None:
    """
    Have a page of so many pixels, each of `fineness` squared of the screen's.

    Of a window's size the browser takes some for itself.
    """
    screen = {'deviceScaleFactor': fineness, 'mobile': is_phone}
    browser.execute_cdp_cmd(
        'Emulation.setDeviceMetricsOverride', {'width': width, 'height': height, **screen}
    )


def screenshot(browser: Any) -> np.ndarray:
    """
    Return what a browser shows, shape (height, width, 3).

    By the protocol itself: a busy machine misses the ten seconds that its driver has for that.
    """
    shot = browser.execute_cdp_cmd('Page.captureScreenshot', {'format': 'png'})
    png = io.BytesIO(base64.b64decode(shot['data']))
    return np.asarray(Image.open(png).convert('RGB')).astype(int)


def open_page(
    browser: Any, url: str, spares: bool = False, is_blind: bool = False
) -> list[dict[str, Any]]:
    """
    Open a page, wait until it shows a panel, and give it the keys; return its console.

    One that `spares` the processor draws at most MOST_RATE pictures a second.
    """
    source = COUNT + NO_TOUCH_EVENT + SPARE * spares + BLIND * is_blind
    browser.execute_cdp_cmd('Page.addScriptToEvaluateOnNewDocument', {'source': source})
    browser.get(url)
    deadline, said = time.monotonic() + PATIENCE, list[dict[str, Any]]()
    while not any('First remote draw frame applied' in entry['message'] for entry in said):
        assert time.monotonic() < deadline, 'the page shows no panel'
        time.sleep(0.3)
        said += browser.get_log('browser')
    canvas = browser.find_element(By.TAG_NAME, 'canvas')
    ActionChains(browser).move_to_element(canvas).click().perform()
    return said


def errors_in(console: list[dict[str, Any]]) -> list[str]:
    """Return what a page's console says that is an error; it may miss its icon."""
    errors = [entry['message'] for entry in console if entry['level'] == 'SEVERE']
    return [error for error in errors if 'favicon' not in error]


def rate_of(browser: Any) -> float:
    """Return how many pictures a second the browser draws."""
    before = browser.execute_script('return window.told')
    time.sleep(2.0)
    return float(browser.execute_script('return window.told') - before) / 2.0


def skip_unless_alive(browser: Any) -> None:
    """Skip a test that drives where Chromium draws too few pictures a second to count as alive."""
    rate = rate_of(browser)
    if rate < LEAST_RATE:
        pytest.skip(f'Chromium draws {rate:.1f} pictures a second here: too few to drive')


@contextlib.contextmanager
def judged_while_alive(browser: Any) -> Iterator[None]:
    """
    Skip a test that fails where the machine left Chromium no picture for as long as SILENCE.

    The run counts that as silence, and, where it reads the next one late, as a loss.
    """
    browser.execute_script('window.longest = 0')
    try:
        yield
    except AssertionError:
        gap = browser.execute_script(
            'return Math.max(window.longest, performance.now() - window.last) / 1000'
        )
        if gap >= SILENCE:
            pytest.skip(f'Chromium drew nothing for {gap:.1f} s: as good as lost')
        raise


def presses(path: Path) -> list[str]:
    """Return the keys that a run has saved, without HELD and RELEASE."""
    return [key for key in saved_keys(path) if '+' not in key]


def saved_keys(path: Path) -> list[str]:
    """Return all keys that a run has saved."""
    return [line.split(maxsplit=1)[1] for line in path.read_text().splitlines()]


def wait_for_key(path: Path, key: str, times: int = 1, since: int = 0) -> None:
    """Wait until a run has saved a key, after so many others: a slow page tells of it late."""
    deadline = time.monotonic() + PATIENCE
    named = saved_keys if '+' in key else presses
    while named(path)[since:].count(key) < times:
        assert time.monotonic() < deadline, f'{key} did not come: {presses(path)}'
        time.sleep(0.05)
