# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: E402  # the hand on a page is the tests' own
"""
Draws pictures/cockpit.png and pictures/cockpit_phone.png: the page in a headless Chromium.

As on a machine with a graphics card and a sharp screen: the robot's meshes are whole, and each
pixel is the mean of FINENESS x FINENESS.

    python docs/draw_cockpit.py [FOLDER]

A Go2 trots a bend through a room and maps it; then time is paused, so a slow machine draws the
same page as a fast one. Needs chromium, chromedriver and selenium.
"""

import os
from pathlib import Path
import sys
import tempfile
import time
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
TESTS = ROOT / 'tests'
sys.path[:0] = [str(TESTS), str(TESTS / 'wasd_cockpit')]

from mujoco_sim.viewer.input import PageInput
from page_in_browser import chromium, open_page, screenshot, set_page_size
from PIL import Image
from robot_description.mujoco import geoms
from run_scenarios import Page, run_with_hand
from wasd_cockpit.link import Order
from wasd_core.network import set_range

FOLDER = ROOT / 'docs' / 'pictures'
# From when on [s] which keys are pressed: it stands, trots, goes ahead and turns to the left.
KEYS = ((0.2, '2'), (2.4, '4'), (3.0, 'wwwww'), (4.0, 'jjjjj'))
PAUSED_AT = 11.0  # [s]
# Pixels of the browser along one of the picture: with one, letters on the trunk break into dashes.
FINENESS = 2
# Until the eyes have looked, and the browser has drawn it [s].
DRAWN_AFTER = 15.0


class Picture(NamedTuple):
    """A page of a size [pixels], and what is clicked on it first."""

    name: str
    size: tuple[int, int]
    clicks: tuple[str, ...]


PICTURES = (
    Picture('cockpit', (1280, 720), ('tab eyes', 'picture')),
    Picture('cockpit_phone', (390, 844), ('tab drive',)),
)


def drive(page: Page) -> None:
    """Press KEYS, as from a terminal, and stop time afterwards."""
    session, left = page.session, list(KEYS)

    def press_what_is_due() -> None:
        while left and session.world.time >= left[0][0]:
            for key in left.pop(0)[1]:
                session.press(key)

    session.simulation.schedule.every(0.1, press_what_is_due)
    while session.world.time < PAUSED_AT:
        time.sleep(0.05)
    page.cockpit.page.link.order(Order('pause', value=1.0))


def take(page: Page, picture: Picture, folder: Path) -> None:
    """Write one picture of the page as it is."""
    # By a hand that is faster than a Chromium without a graphics card.
    page.open(picture.name, picture.size)
    for name in picture.clicks:
        page.click(name)
    page.close()
    is_phone = picture.size[0] < picture.size[1]
    browser = chromium(*picture.size, is_phone=is_phone)
    try:
        set_page_size(browser, *picture.size, is_phone=is_phone, fineness=FINENESS)
        open_page(browser, page.url)
        time.sleep(DRAWN_AFTER)
        image = Image.fromarray(screenshot(browser).astype('uint8')).reduce(FINENESS)
    finally:
        browser.quit()
    target = folder / f'{picture.name}.png'
    image.save(target, optimize=True)
    print(f'wrote {target}')


def main() -> int:
    """Draw the pictures; return the exit status."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    # Software draws slowly, of which a picture is not to complain.
    PageInput.is_slow = property(lambda _: False)
    PageInput.can_hold = property(lambda _: True)
    geoms.has_graphics_card = lambda: True

    def play(page: Page) -> None:
        drive(page)
        for picture in PICTURES:
            take(page, picture, folder)

    set_range(os.environ, 'off')
    with tempfile.TemporaryDirectory() as name:
        os.environ['XDG_CONFIG_HOME'] = name  # not what somebody has chosen on a page
        words = ['go2', '--viewer', 'web', '--world', 'room', '--map', '--seed', '1']
        run_with_hand(words, play, visuals=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
