# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: the Go2 is seen with its meshes, stands up, walks, and is driven."""

from collections.abc import Callable
import json
from pathlib import Path
import re
import subprocess
import time
from typing import Any

import numpy as np
import pytest
from terminals import PATIENCE, wait_until

selenium = pytest.importorskip('selenium', reason='selenium is not installed')
from page_in_browser import (  # noqa: E402
    errors_in,
    judged_while_alive,
    open_page,
    presses,
    set_page_size,
    skip_unless_alive,
    wait_for_key,
)
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402

pytestmark = [pytest.mark.long, pytest.mark.slow]

Picture = Callable[[], np.ndarray]

# The page's own bars at the top and the bottom [pixels].
TOP, BOTTOM = 115, 35
# The model as it is sent, with the meshes; without them it has some 100 kB.
LEAST_MODEL = 3_000_000


def is_dog(image: np.ndarray) -> np.ndarray:
    """Return where the picture has the warm white of the dog; the floor and the sky are bluish."""
    scene = image[TOP:-BOTTOM]
    red, green, blue = scene[..., 0], scene[..., 1], scene[..., 2]
    found: np.ndarray = (red > 150) & (red >= blue + 3) & (abs(red - green) < 25)
    return found


def height_of_dog(image: np.ndarray) -> int:
    """Return how many rows of the picture show the dog."""
    return int((is_dog(image).sum(axis=1) > 2).sum())


def changed(one: np.ndarray, other: np.ndarray) -> float:
    """Return which share of the scene changed; that of the floor, for a dog that is followed."""
    difference = abs(one[TOP:-BOTTOM] - other[TOP:-BOTTOM]).sum(axis=2)
    return float((difference > 20).mean())


def wait_for(picture: Picture, condition: Callable[[np.ndarray], bool], what: str) -> np.ndarray:
    """Return the first picture that meets a condition; software rendering takes its time."""
    deadline = time.monotonic() + PATIENCE
    while True:
        image = picture()
        if condition(image):
            return image
        assert time.monotonic() < deadline, f'{what} has not been seen'
        time.sleep(0.3)


def tap(browser: Any, key: str) -> None:
    """Press a key of the browser for 0.15 s."""
    ActionChains(browser).key_down(key).pause(0.15).key_up(key).perform()


def see_four_taps_be_four_steps_and_end_with_the_browser(browser: Any, saved: Path) -> None:
    set_page_size(browser, 320, 200)  # a small picture is drawn often
    skip_unless_alive(browser)
    before = len(presses(saved))
    with judged_while_alive(browser):
        for key in '24':
            tap(browser, key)
            wait_for_key(saved, key, since=before)
            time.sleep(0.2)
        for _ in range(4):
            tap(browser, 'w')
            time.sleep(0.3)
        wait_for_key(saved, 'w', times=4, since=before)
        time.sleep(0.5)
        # Each is a step of the stick: test_page_is_lost.py looks at what they command.
        assert presses(saved)[before:] == ['2', '4', 'w', 'w', 'w', 'w']
    browser.quit()
    wait_until(lambda: presses(saved)[-1] == 'SPACE')


def test_the_go2_is_seen_standing_up_and_walking_and_a_tap_is_a_step(
    run_with_page: Callable[..., Any],
    browser: Any,
    picture: Picture,
    tmp_path: Path,
) -> None:
    words = ('--no-ros', '--report', 'report.json', '--save-keys', 'keys.txt')
    run = run_with_page('go2', *words, stdin=subprocess.PIPE)

    def press(keys: str) -> None:
        run.process.stdin.write(keys)
        run.process.stdin.flush()

    console = open_page(browser, run.url, spares=True)
    lying = wait_for(picture, lambda image: is_dog(image).mean() > 0.005, 'the dog')
    press('2')
    wait_for(picture, lambda image: height_of_dog(image) > 1.25 * height_of_dog(lying), 'a stand')
    time.sleep(1.2)  # until it is up
    standing = picture()
    press('4')
    time.sleep(0.5)  # sticks are centred when the state is entered
    press(8 * 'w')
    walking = wait_for(picture, lambda image: changed(standing, image) > 0.15, 'a walk')
    assert is_dog(walking).mean() > 0.5 * is_dog(standing).mean()
    console += browser.get_log('browser')
    said = ' '.join(entry['message'] for entry in console)
    (size,) = map(int, re.findall(r'Model bundle: (\d+) byte', said))
    assert size > LEAST_MODEL
    assert errors_in(console) == []
    try:
        see_four_taps_be_four_steps_and_end_with_the_browser(browser, tmp_path / 'keys.txt')
    finally:  # where the browser is too slow for taps, too
        run.end()
        report = json.loads((tmp_path / 'report.json').read_text())
        assert report['falls'] == 0
        assert report['samples']['state'][-1] == 'trotting'
        assert report['samples']['position'][-1][0] > 0.3
