# SPDX-License-Identifier: Apache-2.0
"""
Benchmark of the page: how soon a click acts, and what an open page costs a walking Go2.

The hand is a page without a browser, in a process of its own, which sends and takes what one
does and draws nothing: the figures are the product's and not a renderer's, which would have the
second core to itself. What a real one shows is looked at where there is a Chromium. Figures of
wall time: they are worth something on a machine that does nothing else.
"""

from collections.abc import Callable, Iterator
import contextlib
import json
import os
from pathlib import Path
import random
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any, TYPE_CHECKING

from environment import alone
from quadruped_sim.keys import ZERO_KEYS
from table import at_most, Row
from wasd_cockpit.link import Order

if TYPE_CHECKING:
    from run_scenarios import Page

TESTS = Path(__file__).parents[1] / 'tests'
CLIENT = Path(__file__).with_name('cockpit_client.py')
CLICK, FACTOR, PANELS, BANDWIDTH = 150.0, 0.85, 2.5, 1.5  # [ms], share, [ms], [MB/s]
# What a click at random may leave in memory is a few times this, as some things are none [kB].
GROWTH, PRESSES = 0.5, 0.6
WINDOW = 3.0  # of wall time, in which a real-time factor is measured [s]
# A picture of a panel has more than one colour: its pixels' standard deviation.
LEAST_DEVIATION = 3.0
# What each panel shows at least, by the panel.
SHOWN = {
    'robot': 'e-stop',
    'drive': 'pad',
    'keys': 'key i',
    'plots': 'plot of forward m/s',
    'map': 'floor',
    'view': 'camera follow',
    'world': 'restart',
}


@contextlib.contextmanager
def client(page: 'Page') -> Iterator[list[float]]:
    """Context of a browser in another process; afterwards the list has its bytes a second."""
    rates: list[float] = []
    process = subprocess.Popen(
        [sys.executable, str(CLIENT), page.url],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == 'open\n'
    yield rates
    said, _ = process.communicate('')
    rates += map(float, said.split())


def clicks(page: 'Page', count: int) -> list[float]:
    """Return how long each of some clicks on a state took until the state was entered [ms]."""
    controller = page.session.robot.legs.controller
    took = []
    for number in range(count):
        state = ('free stand', 'fixed stand')[number % 2]
        page.puppet.press_at(page.show(state))
        since = time.perf_counter()
        page.puppet.buttons = 0
        while controller.state != state:
            time.sleep(0.001)
        took.append(1e3 * (time.perf_counter() - since))
        page.wait(0.8)
    return took


def cost_of_panels(page: 'Page', seconds: float) -> dict[str, float]:
    """Return the CPU time of a frame of panels [ms] with each page of plots."""
    costs = {}
    for plots in ('velocity', 'torque', 'feet', 'pace'):
        page.click(f'plot {plots}')
        before = page.cockpit.frames, page.cockpit.cpu_time
        time.sleep(seconds)
        frames, total = page.cockpit.frames, page.cockpit.cpu_time
        costs[plots] = 1e3 * (total - before[1]) / (frames - before[0])
    page.click('plot velocity')
    return costs


def factor(page: 'Page') -> float:
    """Return how many simulated seconds pass in one, with the Go2 walking."""
    walk(page)
    before = page.session.world.time
    time.sleep(WINDOW)
    return float(page.session.world.time - before) / WINDOW


def factors(page: 'Page', pairs: int) -> list[dict[str, float]]:
    """
    Return the real-time factor without and with an open page, in pairs.

    Each begins with what the one before has ended with, so that a machine that grows faster or
    slower favours neither. The first walk is not counted: it may compile.
    """
    page.close()
    page.session.simulation.pacer.speed = 0.0
    factor(page)
    found = []
    for number in range(pairs):
        closed = factor(page) if number % 2 == 0 else 0.0
        with client(page):
            opened = factor(page)
        closed = closed or factor(page)
        found.append({'closed': closed, 'open': opened, 'share': opened / closed})
    page.session.simulation.pacer.speed = 1.0
    page.session.simulation.pacer.restart()
    return found


def handle(page: 'Page', count: int) -> tuple[float, set[str]]:
    """
    Return what each of so many things on each panel left in memory [kB], and panels that failed.

    Most are clicks; what is made once is made before.
    """
    from scribbling import scribble_everywhere

    chance = random.Random(1)
    scribble_everywhere(page, 200, chance, PRESSES)
    sizes = scribble_everywhere(page, count, chance, PRESSES)
    return 1e-3 * (max(sizes) - sizes[0]) / (count * (len(sizes) - 1)), page.failed()


def walk(page: 'Page') -> None:
    """Let the Go2 trot ahead: a page that was closed has stopped it."""
    for key in (ZERO_KEYS[0], 'w', 'w', 'w'):
        page.cockpit.page.link.order(Order('key', key))
    page.wait(1.0)


def on_a_page(quick: bool, note: Callable[[str], None]) -> dict[str, Any]:
    """Return all that is measured on the page of one run."""
    # Here, because it loads ROS and the simulator, which other parts of the benchmark do without.
    sys.path.insert(0, str(TESTS))
    sys.path.insert(0, str(TESTS / 'wasd_cockpit'))
    from run_scenarios import run_with_hand

    found: dict[str, Any] = {}

    def play(page: 'Page') -> None:
        page.open()
        page.click('fixed stand')
        page.wait(3.0)
        note('page: clicks')
        found['clicks'] = clicks(page, 10 if quick else 40)
        page.click('trotting')
        page.wait(0.5)
        walk(page)
        note('page: panels')
        found['panels'] = cost_of_panels(page, 2.0 if quick else 6.0)
        note('page: factor')
        found['factors'] = factors(page, 4 if quick else 8)
        note('page: bandwidth')
        with client(page) as rates:
            walk(page)
            time.sleep(3.0 if quick else 10.0)
        found['rates'] = [1e-6 * rate for rate in rates]
        note('page: a hand that does anything')
        page.open()
        found['things'] = 200 if quick else 1000
        found['grown'], found['failed'] = handle(page, found['things'])

    run_with_hand(['go2', '--viewer', 'web'], play)
    return found


def shown_in_chromium(folder: Path, size: tuple[int, int]) -> tuple[dict[str, float], list[str]]:
    """Return the deviation of the pixels of each panel, and errors of the browser's console."""
    from page_in_browser import chromium, open_page

    rects = folder / f'rects_{size[0]}.json'
    words = [
        str(TESTS / 'page_watch.py'),
        str(rects),
        'mbot',
        '--viewer',
        'web',
        '--world',
        'room',
    ]
    run = subprocess.Popen(
        [sys.executable, *words],
        env={**alone(), 'XDG_CONFIG_HOME': str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )
    browser = chromium(*size, is_phone=size[0] < size[1])
    try:
        assert run.stdout is not None
        open_page(browser, run.stdout.readline().split()[1])
        shown = {name: deviation(browser, rects, name) for name in SHOWN}
        log = browser.get_log('browser')
    finally:
        browser.quit()
        run.terminate()
        run.wait()
    errors = [entry['message'] for entry in log if entry['level'] == 'SEVERE']
    return shown, [error for error in errors if 'favicon' not in error]


def deviation(browser: Any, rects: Path, panel: str) -> float:
    """Return how much the pixels of a panel differ, 0 where it is not shown."""
    from page_in_browser import screenshot

    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        found = json.loads(rects.read_text())
        if SHOWN[panel] in found:
            time.sleep(2.0)  # until the browser has drawn it
            left, top, right, bottom = map(round, found[SHOWN[panel]])
            pixels = screenshot(browser)[top:bottom, left:right]
            return float(pixels.std()) if pixels.size else 0.0
        left, top, right, bottom = found[f'tab {panel}']
        place = {'x': (left + right) / 2, 'y': (top + bottom) / 2, 'button': 'left'}
        for kind in ('mouseMoved', 'mousePressed', 'mouseReleased'):
            words = {**place, 'type': kind, 'clickCount': int(kind != 'mouseMoved')}
            browser.execute_cdp_cmd('Input.dispatchMouseEvent', words)
            time.sleep(0.5)
        time.sleep(2.0)
    return 0.0


def chromium_rows(note: Callable[[str], None]) -> list[Row]:
    """Return what a real browser shows, on a desk and on a phone; nothing where there is none."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for size in ((1280, 720), (390, 844)):
            note(f'page: Chromium {size[0]}x{size[1]}')
            try:
                shown, errors = shown_in_chromium(Path(name), size)
            except (ImportError, LookupError):
                return []
            count = sum(value >= LEAST_DEVIATION for value in shown.values())
            rows.append(
                Row(
                    what=f'page in Chromium, {size[0]}x{size[1]}: panels shown, console errors',
                    measured=f'{count} of {len(SHOWN)}, {len(errors)}',
                    must='all, 0',
                    passed=count == len(SHOWN) and not errors,
                    trials=[{'shown': shown, 'errors': errors}],
                )
            )
    return rows


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return the rows of the page."""
    os.environ.update(alone())
    with tempfile.TemporaryDirectory() as name:
        os.environ['XDG_CONFIG_HOME'] = name  # not what somebody has chosen on a page
        found = on_a_page(quick, note)
    share = statistics.median(pair['share'] for pair in found['factors'])
    worst = max(found['panels'].values())
    return [
        at_most('page: from a click to the state', found['clicks'], 'ms', CLICK),
        Row(
            what='... real-time factor of a Go2 with it open, of that without, --speed 0',
            measured=f'{100 * share:.0f} %',
            must=f'>= {100 * FACTOR:.0f} %',
            passed=share >= FACTOR,
            trials=found['factors'],
        ),
        Row(
            what='... CPU of its panels, a frame, the dearest plots',
            measured=f'{worst:.2f} ms',
            must=f'<= {PANELS} ms',
            passed=worst <= PANELS,
            trials=[found['panels']],
        ),
        at_most('... panels and scene, without pictures', sum(found['rates']), 'MB/s', BANDWIDTH),
        Row(
            what=f'... {found["things"]} clicks and keys at random a panel: failed, growth each',
            measured=f'{len(found["failed"])}, {found["grown"]:.2f} kB',
            must=f'0, <= {GROWTH} kB',
            passed=not found['failed'] and found['grown'] <= GROWTH,
            trials=[],
        ),
        *chromium_rows(note),
    ]
