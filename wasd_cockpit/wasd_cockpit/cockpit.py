# SPDX-License-Identifier: Apache-2.0
"""The page: its theme, windows and panels, and the saved choices."""

from collections.abc import Callable, Mapping
import contextlib
import functools
import json
import logging
import math
import os
from pathlib import Path
import time
from typing import Any

from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.viewer.drawing import SLOW_PAGE
from mujoco_sim.viewer.input import LOSS, PageInput, SILENCE
from wasd_core.output_file import OutputError, OutputFile

from wasd_cockpit import style
from wasd_cockpit.layout import Layout, Place, TOUCH_SCALE
from wasd_cockpit.link import Link, Order, words_of
from wasd_cockpit.panels.drive import Drive, Keys, LEAST_SHARE
from wasd_cockpit.panels.eyes import Eyes
from wasd_cockpit.panels.map import Map
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.panels.plots import PAGES, Plots
from wasd_cockpit.panels.robot import RELEASE_LABEL, Robot, STOP_LABEL, World
from wasd_cockpit.panels.view import View
from wasd_cockpit.scene import CAMERAS, OVERLAYS, Scene
from wasd_cockpit.sight import Sight
from wasd_cockpit.widgets import columns, in_rows, Widgets

# More than this is no file of ours.
_LARGEST_SETTINGS = 100_000
_LOG = logging.getLogger(__name__)
_FIXED = style.flags(
    imgui.WindowFlags,
    'NoTitleBar',
    'NoResize',
    'NoMove',
    'NoCollapse',
    'NoSavedSettings',
    'NoBringToFrontOnFocus',
    'NoNav',  # a window that was clicked must not take the keys: they drive
)
_CHIP = _FIXED | int(imgui.WindowFlags.AlwaysAutoResize.value)
_TAB_HEIGHT = 26.0
# What may be longer than its place: it moves below the tabs.
_SCROLLED = ('robot', 'drive', 'keys', 'view', 'world')


def usual_path(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return where settings are kept, None where there is no home."""
    home = environment.get('XDG_CONFIG_HOME') or ''
    if not os.path.isabs(home):
        user = environment.get('HOME') or ''
        if not os.path.isabs(user):
            return None
        home = os.path.join(user, '.config')
    return Path(home) / 'wasd' / 'cockpit.json'


def load_settings(path: Path | None) -> dict[str, Any]:
    """Return what was kept; nothing where there is no file, or one that is broken."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        if path is not None and path.stat().st_size <= _LARGEST_SETTINGS:
            found = json.loads(path.read_text())
            if isinstance(found, dict):
                return found
    return {}


def save_settings(path: Path | None, settings: dict[str, Any]) -> None:
    """Keep settings; where they cannot be kept that is said once, and nothing else happens."""
    if path is None:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        OutputFile(path, '').write(json.dumps(settings, indent=1).encode())
    except (OSError, OutputError) as error:
        _LOG.warning('the cockpit forgets how it was set up: %s', error)


class Cockpit:
    """
    All panels of the page, drawn from the link's snapshot.

    Everything here is called in the viewer's thread.
    """

    def __init__(
        self,
        link: Link,
        settings: Path | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take the link, the file in which what is chosen is kept, a clock of wall time [s]."""
        self._clock = clock
        sight = Sight(lambda: link.snapshot)
        self.page = PageState(link, Widgets(), Layout(), sight)
        self.scene = Scene()
        # Frames of panels so far, and the CPU time of the threads that drew them [s].
        self.frames, self.cpu_time = 0, 0.0
        self._cpu_began = 0.0
        self._drive, self._plots = Drive(), Plots()
        self._panels: dict[str, Any] = {
            'robot': Robot(),
            'drive': self._drive,
            'keys': Keys(),
            'plots': self._plots,
            'eyes': Eyes(),
            'map': Map(),
            'view': View(self.scene),
            'world': World(),
        }
        self._silence = math.inf  # the longest that a button is down since before [s]
        self._began, self._is_down = 0.0, False  # the last frame of panels [s], any button in it
        self._settings = settings
        self._kept = load_settings(settings)
        self._restore(self._kept)

    def lines(self) -> list[str]:
        """Return what the panels say in words, from any thread."""
        snapshot = self.page.link.snapshot
        return [] if snapshot is None else words_of(snapshot)

    def close(self) -> None:
        """Look no more; keep what was chosen, if that is something new."""
        self.page.sight.close()
        chosen = self._chosen()
        if chosen != self._kept and self.frames:
            save_settings(self._settings, chosen)

    def _chosen(self) -> dict[str, Any]:
        return {
            'tabs': dict(self.page.layout.chosen),
            'camera': self.scene.camera,
            'shown': sorted(self.scene.shown),
            'plots': self._plots.page,
            'share': self._drive.share,
            'turns sideways': self._drive.turns_sideways,
        }

    def _restore(self, kept: dict[str, Any]) -> None:
        """Choose what was chosen before, as far as it makes sense."""
        tabs, shown, share = kept.get('tabs'), kept.get('shown'), kept.get('share')
        if isinstance(tabs, dict):
            pairs = tabs.items()
            self.page.layout.chosen = {k: v for k, v in pairs if isinstance(v, str)}
        if kept.get('camera') in CAMERAS:
            self.scene.camera = kept['camera']
        if isinstance(shown, list):
            self.scene.shown = {name for name in OVERLAYS if name in shown}
        if kept.get('plots') in PAGES:
            self._plots.page = kept['plots']
        if isinstance(share, float) and LEAST_SHARE <= share <= 1.0:
            self._drive.share = share
        self._drive.turns_sideways = kept.get('turns sideways') is True

    @property
    def panels(self) -> dict[str, Callable[[], None]]:
        """The function of each panel, in the order of drawing."""
        draw: dict[str, Callable[[], None]] = {'windows': self._draw_windows}
        draw |= {name: functools.partial(self._draw_panel, name) for name in self._panels}
        return draw | {'state': self._draw_chip, 'scene': self._draw_scene}

    @property
    def is_typing(self) -> bool:
        """Whether keys are for a field of text."""
        return self.page.widgets.is_typing

    def begin(self, viewer: Any, page_input: PageInput) -> None:
        """Begin a frame of panels."""
        self._cpu_began = time.thread_time()
        page = self.page
        page.viewer, page.input = viewer, page_input
        page.held = page.push = None
        page.snapshot = page.link.snapshot
        size = imgui.GetIO().DisplaySize
        is_moved = page.layout.resize(size.x, size.y)
        # No button is held that ImGui has down since before a silence, whose end it hears of a
        # frame late, and none clicks since before a loss. A page of another size counts as lost,
        # for its panels move away below the finger.
        before, self._began = self._began, self._clock()
        silence = max(self._began - before if self._is_down else 0.0, page_input.silence)
        if is_moved:
            silence = math.inf
        self._is_down = bool(imgui.IsAnyMouseDown())
        self._silence = max(silence, self._silence) if self._is_down else silence
        page.is_live = self._silence <= SILENCE
        page.is_there = self._silence <= LOSS and not page_input.are_several
        page.widgets.begin()
        page.widgets.scale = 1.0 if page.layout.is_desk else TOUCH_SCALE
        style.push_theme(page.widgets.scale)

    def end(self) -> None:
        """End a frame of panels in which none failed."""
        style.pop_theme()
        page = self.page
        page.widgets.end()
        page.link.hold(page.held, page.push)
        if page.input is not None:
            rects = page.widgets.rects
            page.input.e_stop = rects.get('e-stop') or rects.get('stop at once')
        self.frames += 1
        self.cpu_time += time.thread_time() - self._cpu_began

    def _draw_windows(self) -> None:
        """Draw the empty windows, with what is to be chosen in each."""
        layout = self.page.layout
        if layout.is_hidden:
            return
        for place in layout.places:
            rect = place.rect
            imgui.SetNextWindowPos(imgui.Vec2(rect.left, rect.top))
            imgui.SetNextWindowSize(imgui.Vec2(rect.width, rect.height))
            imgui.Begin(place.panels[0], flags=_FIXED)
            self._draw_tabs(place)
            imgui.End()

    def _draw_tabs(self, place: Place) -> None:
        page = self.page
        shown = page.layout.shown(place)
        # On a desk as wide as the words, else they share the page.
        width = 0.0 if page.layout.is_desk else columns(len(place.panels), 2.0)
        style.push_padding(1.0 if width else style.PADDING[0], style.PADDING[1])
        for name in in_rows(place.panels, gap=2.0):
            fill = style.FRAME if name == shown else style.PANEL
            if page.widgets.button(
                f'tab {name}', name.capitalize(), (width, _TAB_HEIGHT), fill=fill
            ):
                page.layout.choose(name)
        imgui.PopStyleVar(1)

    def _draw_panel(self, name: str) -> None:
        page = self.page
        place = page.layout.place_of(name)
        if place is None:
            return
        imgui.Begin(place.panels[0], flags=_FIXED)
        if page.snapshot is not None:
            if name in _SCROLLED:
                imgui.BeginChild(name)
            self._panels[name].draw(page, page.snapshot)
            if name in _SCROLLED:
                # A finger that drags beside what it presses moves what is longer than its window.
                is_beside = imgui.IsWindowHovered() and not imgui.IsAnyItemActive()
                if is_beside and imgui.IsMouseDragging(0):
                    imgui.SetScrollY(imgui.GetScrollY() - imgui.GetIO().MouseDelta.y)
                imgui.EndChild()
        imgui.End()

    def _draw_scene(self) -> None:
        if self.page.snapshot is not None:
            self.scene.draw(self.page, self.page.snapshot)

    def _draw_chip(self) -> None:
        """Draw what must be seen at all times: state, time, pace; what was refused."""
        page, snapshot = self.page, self.page.snapshot
        if snapshot is None:
            return
        scene = page.layout.scene
        imgui.SetNextWindowPos(imgui.Vec2(scene.left + 10.0, scene.top + 10.0))
        imgui.SetNextWindowBgAlpha(0.8)
        imgui.Begin('state', flags=_CHIP)
        if page.widgets.button('panels', '\uf0c9', (26.0 * page.widgets.scale, 0.0)):
            page.layout.hides = not page.layout.is_hidden
        imgui.SameLine()
        imgui.AlignTextToFramePadding()
        is_fallen = snapshot.state == 'fallen'
        state = '  '.join((snapshot.robots[snapshot.robot], snapshot.state))
        page.widgets.words(state, style.ALARM if is_fallen else style.TEXT)
        imgui.SameLine(0.0, 16.0)
        pace = 'paused' if snapshot.is_paused else f'x{snapshot.pace:.2f}'
        page.widgets.words(f'{snapshot.time:.1f} s   {pace}', style.DIM)
        if page.layout.place_of('robot') is None and page.widgets.button(
            'stop at once', STOP_LABEL, (110.0, 0.0), fill=style.ALARM, at_once=True
        ):
            page.link.order(Order('e-stop'))
        if (
            snapshot.stopped_by
            and page.layout.place_of('robot') is None
            and page.widgets.button('release', RELEASE_LABEL)
        ):
            page.link.order(Order('end e-stop'))
        for text in filter(None, (snapshot.message, self._slow_words)):
            page.widgets.words(text, style.ODOMETRY, width=max(scene.width - 40.0, 100.0))
            page.widgets.note('text message')
        self._draw_turns()
        imgui.End()

    def _draw_turns(self) -> None:
        """Say that somebody asks for control, who gets it from hands that rest."""
        page = self.page
        turns = page.input.turns if page.input is not None else None
        if turns is None or not turns.waiting:
            return
        imgui.AlignTextToFramePadding()
        words = f'asked for control: passes in {turns.remaining:.0f} s'
        page.widgets.words(words, style.ODOMETRY)
        imgui.SameLine()
        if page.widgets.button('give control', 'give'):
            turns.give()

    @property
    def _slow_words(self) -> str:
        if self.page.input is None or not self.page.input.is_slow:
            return ''
        # A phone's window is as large as it is.
        return SLOW_PAGE if self.page.layout.is_desk else SLOW_PAGE.partition(':')[0]
