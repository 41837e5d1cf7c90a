# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: mbot is seen, it moves, keys on the page drive it."""

from collections.abc import Callable, Iterator
import io
import json
from pathlib import Path
import re
import shutil
import subprocess
import sys
import time
from typing import Any

import numpy as np
from PIL import Image
import pytest

selenium = pytest.importorskip('selenium', reason='selenium is not installed')
from selenium import webdriver  # noqa: E402
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402

CHROMIUM, CHROMEDRIVER = shutil.which('chromium'), shutil.which('chromedriver')
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None or CHROMEDRIVER is None,
        reason='no chromium with chromedriver (Debian: apt install chromium chromium-driver)',
    ),
]
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
    '--window-size=900,650',
)


class Run:
    """A run of `wasd mbot` with its page."""

    def __init__(self, process: 'subprocess.Popen[str]', url: str) -> None:
        self.process = process
        self.url = url
        self.port = int(url.rsplit(':', 1)[1].strip('/'))


@pytest.fixture
def run_with_page(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Return a function that starts `wasd mbot --viewer web` and waits for its page."""
    runs: list[Run] = []

    def start(*arguments: str) -> Run:
        process = subprocess.Popen(
            [sys.executable, '-m', 'wasd_bringup.cli', 'mbot', '--viewer', 'web', *arguments],
            env=environment,
            cwd=tmp_path,
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        assert process.stdout is not None
        first = process.stdout.readline()
        found = re.fullmatch(r'viewer: (http://127\.0\.0\.1:\d+/)\n', first)
        assert found, first
        runs.append(Run(process, found[1]))
        return runs[-1]

    yield start
    for run in runs:
        run.process.terminate()
        run.process.wait(10.0)


@pytest.fixture
def browser() -> Iterator[Any]:
    """Yield a headless Chromium that renders in software."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    service = webdriver.ChromeService(str(CHROMEDRIVER))
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()


def picture(browser: Any) -> np.ndarray:
    """Return a screenshot, shape (height, width, 3)."""
    png = browser.get_screenshot_as_png()
    return np.asarray(Image.open(io.BytesIO(png)).convert('RGB')).astype(int)


def share_of_orange(image: np.ndarray) -> float:
    """Return how much of a picture has the colour of mbot's drum."""
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    return float(((red > 150) & (green > 0.2 * red) & (green < 0.6 * red) & (blue < 80)).mean())


def wait_for_robot(browser: Any, timeout: float = 40.0) -> np.ndarray:
    """Return the first picture in which mbot is seen."""
    deadline = time.monotonic() + timeout
    while True:
        image = picture(browser)
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


def test_mbot_is_seen_moving_without_an_error_on_the_console(
    run_with_page: Callable[..., Run], browser: Any, tmp_path: Path
) -> None:
    (tmp_path / 'circle.txt').write_text('0 0.15 0 0.5')
    run = run_with_page('--twist', 'circle.txt', '--duration', '60')
    browser.get(run.url)
    first = wait_for_robot(browser)
    time.sleep(1.0)
    second = picture(browser)
    assert share_of_orange(second) > 0.01
    # The floor turns under the camera that follows the robot: most of the picture changes.
    assert (abs(first - second).sum(axis=2) > 20).mean() > 0.05
    errors = [entry for entry in browser.get_log('browser') if entry['level'] == 'SEVERE']
    assert [entry for entry in errors if 'favicon' not in entry['message']] == []


def test_the_page_is_for_this_machine_only(run_with_page: Callable[..., Run]) -> None:
    run = run_with_page('--duration', '20')
    deadline = time.monotonic() + 10.0
    while not listeners(run.port) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert listeners(run.port) == {'0100007F'}


def test_a_second_run_takes_the_next_port(run_with_page: Callable[..., Run]) -> None:
    first, second = run_with_page('--duration', '20'), run_with_page('--duration', '20')
    assert first.port != second.port


def test_keys_on_the_page_drive_it(
    run_with_page: Callable[..., Run], browser: Any, tmp_path: Path
) -> None:
    run = run_with_page('--duration', '60', '--report', 'report.json')
    browser.get(run.url)
    wait_for_robot(browser)
    canvas = browser.find_element(By.TAG_NAME, 'canvas')
    for _ in range(5):  # a busy machine takes its time to give the page the focus
        ActionChains(browser).move_to_element(canvas).click().perform()
        ActionChains(browser).key_down('i').pause(1.5).key_up('i').perform()
        time.sleep(0.5)
    run.process.terminate()
    run.process.wait(10.0)
    report = json.loads((tmp_path / 'report.json').read_text())
    assert report['samples']['position'][-1][0] > 0.1
