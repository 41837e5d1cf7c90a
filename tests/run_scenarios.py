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
import math
from pathlib import Path
import sys
import threading
import time
import traceback
from typing import Any

from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.viewer.drawing import buttons_down
from mujoco_sim.viewer.input import PAGE_KEYS, SEVERAL, SHIFT, SHORTCUT
from page_puppet import code, CutOff, middle_of, PagePuppet, SCENE
from terminals import PATIENCE
from wasd_bringup.cli import make_parser
from wasd_bringup.cli.options import read_options
from wasd_bringup.page.bridge import open_view
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

DESK = (1280, 720)
# As many pictures a second as most browsers draw: two for each frame of panels. A scenario needs
# but one for each; far fewer would make a slow page of it on a busy machine.
RATE, SPARING = 60.0, 36.0
# A page that draws its picture so much too late [s] has been kept from it by a busy machine.
LATE = 0.1
# The keys of which panels are asked whether they have seen them.
SEEN_KEYS = {key: imgui.Key(key) for key in PAGE_KEYS.keys() | SHIFT | SHORTCUT | SEVERAL}
SCENARIOS = Path(__file__).with_name('wasd_cockpit')


class Frames:
    """The frames of panels of a page: what they have seen of a hand, in its own thread."""

    def __init__(self, panels: Any) -> None:
        self._draw = panels.draw
        self._drawn = threading.Condition()
        self._count = 0
        self._seen: Any = None
        self._same = 0  # frames that have seen the same, up to the last one
        panels.draw = self._draw_and_look

    def wait_for(
        self, wanted: Callable[[], Any], count: int, is_there: Callable[[], bool]
    ) -> None:
        """
        Wait for so many frames from now on that see what is wanted.

        Raises:
            CutOff: who wants it is not there any more.
        """
        before, deadline = self._count, time.monotonic() + PATIENCE

        def have_seen() -> bool:
            return self._seen == wanted() and min(self._same, self._count - before) >= count

        with self._drawn:
            while not self._drawn.wait_for(have_seen, 0.1):
                if not is_there():
                    raise CutOff('the page was cut off')
                assert time.monotonic() < deadline, f'{self._seen} in place of {wanted()}'

    def _draw_and_look(self, viewer: Any, page_input: Any) -> None:
        self._draw(viewer, page_input)
        place, size = imgui.GetMousePos(), imgui.GetIO().DisplaySize
        keys = {number for number, key in SEEN_KEYS.items() if imgui.IsKeyDown(key)}
        seen = (place.x, place.y), buttons_down(), (size.x, size.y), keys
        with self._drawn:
            self._same = self._same + 1 if seen == self._seen else 1
            self._seen = seen
            self._count += 1
            self._drawn.notify_all()


class PageClock:
    """
    The wall time [s] of a page, without that in which a busy machine keeps it from drawing.

    Else such a page would be lost, and what is done on it would rightly count for nothing. The
    time of one that is silent, or closed, passes as ever.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._due, self._lost = math.inf, 0.0

    def __call__(self) -> float:
        """Return the time."""
        with self._lock:
            return min(time.monotonic(), self._due) - self._lost

    def expect(self, seconds: float) -> None:
        """Take that the page is to draw its next picture in so long [s]."""
        with self._lock:
            now = time.monotonic()
            self._lost += max(0.0, now - self._due)
            self._due = now + seconds + LATE


class Hand(PagePuppet):
    """A puppet that goes on once panels have seen what it does, however late that is."""

    def __init__(self, frames: Frames, clock: PageClock, *words: Any) -> None:
        super().__init__(*words)
        self._frames, self._clock = frames, clock

    def draw(self, pictures: int = 3) -> None:
        """
        Wait for a frame of panels for each three pictures that has seen this hand as it is now.

        Raises:
            CutOff: the connection has ended.
        """
        self._frames.wait_for(self._shown, -(-pictures // 3), self._is_there)

    def _is_there(self) -> bool:
        return all(thread.is_alive() for thread in self._threads)

    def _shown(self) -> Any:
        return self.mouse, self.buttons, self.size, SEEN_KEYS.keys() & self.keys

    def _rest(self) -> bool:
        self._clock.expect(math.inf if self.is_silent else 1.0 / self.rate)
        return super()._rest()

    def _draw(self) -> None:
        try:
            super()._draw()
        finally:
            self._clock.expect(math.inf)


class Page:
    """A hand on the page of a run, which knows of the run what is to be seen."""

    def __init__(self, session: Run, url: str, rate: float = RATE) -> None:
        self.session = session
        self.url = url
        self.rate = rate
        self.cockpit = session.view._page._content
        self.puppet: Any = None
        self._frames = Frames(session.view._page._panels)
        self._clock = PageClock()
        session.view.input._clock = self._clock
        self.cockpit._clock = self.cockpit.page.link._clock = self._clock

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
            time.sleep(0.01)

    def wait(self, seconds: float) -> None:
        """Wait for simulated time to pass."""
        end = self.session.world.time + seconds
        self.wait_until(lambda: self.session.world.time >= end, f'{seconds} s of simulated time')

    def rest(self) -> None:
        """Take the hand off everything."""
        self.puppet.mouse, self.puppet.buttons, self.puppet.keys = SCENE, 0, set()
        self.puppet.is_silent, self.puppet.rate = False, self.rate
        self.puppet.draw(4)

    def show(self, name: str) -> tuple[int, int]:
        """Wait for a widget, and return the point in its middle."""
        self.wait_until(lambda: name in self.rects, f'{name} in {sorted(self.rects)}')
        self.puppet.draw(6)  # what moves into its place takes two frames
        return middle_of(self.rects[name])

    def click(self, name: str) -> None:
        """Click a widget."""
        self.puppet.press_at(self.show(name))
        self.puppet.let_go()

    def open(self, session: str = 'puppet', size: tuple[int, int] = DESK) -> None:
        """Go on as a browser of another session, or begin, with a page of a size [pixels]."""
        self.close()
        self.puppet = Hand(self._frames, self._clock, self.url, self.rate, session, size)
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

    run_with_hand(words, play, rate=SPARING)
    return results


def run_with_hand(
    words: list[str],
    play: Callable[[Page], None],
    visuals: bool = False,
    rate: float = RATE,
) -> None:
    """
    Run `wasd` with words until a hand has done something on its page, in another thread.

    `visuals` are what only a picture needs, `rate` are the page's pictures a second. What fails
    the hand is raised at the end of the run.
    """
    session = make_run(read_options(make_parser().parse_args(words)), visuals)
    page = Page(session, open_view(session, 'web'), rate)

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
