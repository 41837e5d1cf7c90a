# SPDX-License-Identifier: Apache-2.0
"""
A hand that does anything on every panel, and what that leaves in memory.

The benchmark does it, too: nothing here is of what only tests install.
"""

import ctypes
import gc
from pathlib import Path
import random

from mujoco.studio.dear_imgui import dear_imgui as imgui
from page_puppet import SCENE
from run_scenarios import Page


def resident() -> int:
    """Return this process's resident memory [bytes], without what is free or garbage."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path('/proc/self/statm').read_text().split()[1]) * 4096


def scribble_everywhere(
    page: Page, count: int, chance: random.Random, presses: float = 0.1
) -> list[int]:
    """Do so many things on each panel; return the memory before and after each [bytes]."""
    sizes = [resident()]
    for panel in page.cockpit._panels:
        layout = page.cockpit.page.layout
        layout.choose(panel)
        page.puppet.draw()
        page.puppet.scribble(count, layout.place_of(panel).rect, chance, presses)
        page.rest()
        # All of it has been done, and what was asked for last, before that is undone.
        page.wait_until(lambda: pointer() == SCENE, 'the last of it')
        page.wait_until(lambda: not page.cockpit.page.link._orders, 'orders')
        page.session.simulation.pacer.speed = 1.0
        if page.snapshot.is_paused:
            page.click('pause')
        sizes.append(resident())
    return sizes


def pointer() -> tuple[float, float]:
    """Return where the page's pointer is for the panels [pixels]."""
    place = imgui.GetMousePos()
    return place.x, place.y
