# SPDX-License-Identifier: Apache-2.0
"""Whole runs of the command, each in a process and a ROS domain of its own."""

from collections.abc import Callable, Iterator
import io
import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from typing import Any

import numpy as np
from PIL import Image
import pytest

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
CHROMIUM, CHROMEDRIVER = shutil.which('chromium'), shutil.which('chromedriver')
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


def private_environment(folder: Path, domain: int) -> dict[str, str]:
    """Return an environment that no other ROS program on this machine shares."""
    return {
        **os.environ,
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_LOG_DIR': str(folder / 'log'),
    }


class Runner:
    """Runs `wasd` in a folder, without a terminal; `said` is the last run's standard error."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder = folder
        self.said = ''
        self._environment = environment

    def __call__(self, *arguments: str, **options: Any) -> 'subprocess.CompletedProcess[str]':
        """Run with arguments and capture what is printed."""
        done = subprocess.run(
            [*WASD, *arguments],
            env=self._environment,
            cwd=self.folder,
            text=True,
            capture_output=True,
            start_new_session=True,
            timeout=options.pop('timeout', 60),
            check=False,
            **{'stdin': subprocess.DEVNULL, **options},
        )
        self.said = done.stderr
        return done

    def start(self, *arguments: str, **options: Any) -> 'subprocess.Popen[str]':
        """Start with arguments and do not wait; nothing is captured unless asked for."""
        return subprocess.Popen(
            [*WASD, *arguments],
            env=self._environment,
            cwd=self.folder,
            text=True,
            start_new_session=True,
            **{
                'stdin': subprocess.DEVNULL,
                'stdout': subprocess.DEVNULL,
                'stderr': subprocess.DEVNULL,
                **options,
            },
        )

    def report(
        self,
        robot: str,
        *arguments: str,
        play: str | None = None,
        twist: str | None = None,
        speed: str = '0',
    ) -> dict[str, Any]:
        """Run a robot on scripts given as text; return its report."""
        words = [robot, '--speed', speed, '--report', 'report.json', *arguments]
        for option, text in (('--play', play), ('--twist', twist)):
            if text is not None:
                (self.folder / f'{option[2:]}.txt').write_text(text)
                words += [option, f'{option[2:]}.txt']
        done = self(*words, timeout=120)
        assert done.returncode == 0, done.stderr
        report: dict[str, Any] = json.loads((self.folder / 'report.json').read_text())
        return report


@pytest.fixture
def environment(tmp_path: Path, ros_domains: Iterator[int]) -> dict[str, str]:
    """Return an environment that no other ROS program on this machine shares."""
    return private_environment(tmp_path, next(ros_domains))


@pytest.fixture
def wasd(environment: dict[str, str], tmp_path: Path) -> Runner:
    """Return a function that runs `wasd` with arguments, without a terminal, and captures it."""
    return Runner(tmp_path, environment)


@pytest.fixture(scope='session')
def new_runner(
    tmp_path_factory: pytest.TempPathFactory, ros_domains: Iterator[int]
) -> Callable[..., Runner]:
    """
    Return a function that makes a Runner, for runs that several tests look at.

    It takes the ROS domain to run in; without, the Runner has one of its own.
    """

    def make(domain: int | None = None) -> Runner:
        folder = tmp_path_factory.mktemp('run')
        chosen = domain or next(ros_domains)
        return Runner(folder, private_environment(folder, chosen))

    return make


@pytest.fixture
def report_of(wasd: Runner) -> Callable[..., dict[str, Any]]:
    """Return a function that runs `wasd mbot` on a script and returns its report."""
    return lambda *arguments, **scripts: wasd.report('mbot', *arguments, **scripts)


class Page:
    """A run of `wasd` with its page."""

    def __init__(self, process: 'subprocess.Popen[str]', url: str) -> None:
        self.process = process
        self.url = url
        self.port = int(url.rsplit(':', 1)[1].strip('/'))

    def end(self) -> None:
        """End the run."""
        self.process.terminate()
        self.process.wait(10.0)


@pytest.fixture
def run_with_page(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Page]]:
    """Return a function that starts `wasd ROBOT --viewer web` and waits for its page."""
    pages: list[Page] = []

    def start(robot: str, *arguments: str) -> Page:
        process = subprocess.Popen(
            [*WASD, robot, '--viewer', 'web', *arguments],
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
        pages.append(Page(process, found[1]))
        return pages[-1]

    yield start
    for page in pages:
        page.end()


@pytest.fixture
def browser() -> Iterator[Any]:
    """Yield a headless Chromium that renders in software."""
    if CHROMIUM is None or CHROMEDRIVER is None:
        pytest.skip('no chromium with chromedriver (Debian: apt install chromium chromium-driver)')
    webdriver = pytest.importorskip('selenium.webdriver', reason='selenium is not installed')
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    service = webdriver.ChromeService(CHROMEDRIVER)
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()


@pytest.fixture
def picture(browser: Any) -> Callable[[], np.ndarray]:
    """Return a function that takes a screenshot, shape (height, width, 3)."""

    def take() -> np.ndarray:
        png = browser.get_screenshot_as_png()
        return np.asarray(Image.open(io.BytesIO(png)).convert('RGB')).astype(int)

    return take
