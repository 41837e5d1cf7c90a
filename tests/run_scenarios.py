# SPDX-License-Identifier: Apache-2.0
"""
A run with its page in one process, and what a hand does on the page in another thread of it.

As a program, `python -m run_scenarios MODULE WORDS...`, it runs `wasd WORDS` and every function
`scenario_*` of a module with the Page, and prints what failed as JSON; Studio has one page in a
process.
"""

import argparse
from collections.abc import Callable
import functools
import importlib
import json
from pathlib import Path
import sys
import threading
import time
import traceback
from typing import Any

from page_puppet import code, middle_of, PagePuppet, SCENE
from terminals import PATIENCE
from wasd_bringup.cli import make_parser
from wasd_bringup.cli.options import read_options
from wasd_bringup.page.bridge import open_view
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

DESK = (1280, 720)
# As many pictures a second as most browsers draw: two for each frame of panels.
RATE = 60.0
SCENARIOS = Path(__file__).with_name('wasd_cockpit')


class Page:
    """A hand on the page of a run, which knows of the run what is to be seen."""

    def __init__(self, session: Run, url: str) -> None:
        self.session = session
        self.url = url
        self.cockpit = session.view._page._content
        self.puppet: Any = None

    @property
    def robot(self) -> Any:
        """The first robot of the run."""
        return self.session.robots[0]

    @property
    def snapshot(self) -> Any:
        """What the page was told last."""
        return self.cockpit.page.link.snapshot

    @property
    def rects(self) -> dict[str, Any]:
        """Where the widgets are."""
        return self.cockpit.page.widgets.rects

    def failed(self) -> set[str]:
        """Return the panels that failed."""
        panels: set[str] = self.session.view._page._panels.failed
        return panels

    def wait_until(self, condition: Callable[[], Any], what: str) -> None:
        """Wait for a condition."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, what
            time.sleep(0.005)

    def wait(self, seconds: float) -> None:
        """Wait for simulated time to pass."""
        end = self.session.world.time + seconds
        self.wait_until(lambda: self.session.world.time >= end, f'{seconds} s of simulated time')

    def rest(self) -> None:
        """Take the hand off everything."""
        self.puppet.mouse, self.puppet.buttons, self.puppet.keys = SCENE, 0, set()
        self.puppet.is_silent = False
        self.puppet.draw(4)

    def show(self, name: str) -> tuple[int, int]:
        """Wait for a widget, and return the point in its middle."""
        self.wait_until(lambda: name in self.rects, f'{name} in {sorted(self.rects)}')
        self.puppet.draw()
        return middle_of(self.rects[name])

    def click(self, name: str) -> None:
        """Click a widget."""
        self.puppet.press_at(self.show(name))
        self.puppet.let_go()

    def open(self, session: str = 'puppet', size: tuple[int, int] = DESK) -> None:
        """Go on as a browser of another session, or begin, with a page of a size [pixels]."""
        self.close()
        self.puppet = PagePuppet(self.url, RATE, session, size)
        self.puppet.__enter__()

    def close(self) -> None:
        """Close the browser."""
        if self.puppet is not None:
            self.puppet.__exit__()
            self.puppet = None

    def tap(self, *keys: str) -> None:
        """Press keys by their names in ImGui, with the pointer on the scene."""
        self.puppet.mouse = SCENE
        self.puppet.keys = {code(key) for key in keys}
        self.puppet.draw(4)
        self.puppet.keys = set()
        self.puppet.draw(4)


def paused(scenario: Callable[[Page], None]) -> Callable[[Page], None]:
    """Stop time during a scenario that only looks at panels."""

    @functools.wraps(scenario)
    def play(page: Page) -> None:
        page.session.simulation.paused = True
        try:
            scenario(page)
        finally:
            page.session.simulation.paused = False

    return play


def run(module: str, words: list[str]) -> dict[str, str]:
    """Run `wasd` with words and the scenarios of a module; return what failed of each, or ''."""
    scenarios = {
        name: function
        for name, function in vars(importlib.import_module(module)).items()
        if name.startswith('scenario_')
    }
    results: dict[str, str] = {}

    def play(page: Page) -> None:
        page.open()
        for name, scenario in scenarios.items():
            try:
                scenario(page)
                results[name] = ''
            except BaseException:
                results[name] = traceback.format_exc()
            page.rest()

    run_with_hand(words, play)
    return results


def run_with_hand(words: list[str], play: Callable[[Page], None], visuals: bool = False) -> None:
    """
    Run `wasd` with words until a hand has done something on its page, in another thread.

    `visuals` are what only a picture needs. What fails the hand is raised at the end of the run.
    """
    session = make_run(read_options(make_parser().parse_args(words)), visuals)
    page = Page(session, open_view(session, 'web'))

    failures: list[BaseException] = []

    def play_and_leave() -> None:
        try:
            play(page)
        except BaseException as error:
            failures.append(error)
        finally:
            page.close()

    hand = threading.Thread(target=play_and_leave)
    hand.start()
    stop = argparse.Namespace()
    type(stop).requested = property(lambda _: not hand.is_alive())
    session.run(stop)
    session.close()
    for failure in failures:
        raise failure


def make_run(options: RunOptions, visuals: bool) -> Run:
    """Return a run, on ROS unless that is refused."""
    if not options.uses_ros:
        return Run(options, None, visuals)
    # Here, because it loads ROS.
    from wasd_bringup.ros.face import make_ros_run
    from wasd_core.node import init_ros

    init_ros([])
    return make_ros_run(options, visuals=visuals)


if __name__ == '__main__':
    sys.path.append(str(SCENARIOS))
    print(json.dumps(run(sys.argv[1], sys.argv[2:])))
