# SPDX-License-Identifier: Apache-2.0
"""What shows a run: the page in a browser with its content, or a window on this display."""

import os
import queue
from typing import Any, TYPE_CHECKING
import warnings

from wasd_core.errors import SimulationError
from wasd_core.timing import LOST

from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.viewer.drawing import PageContent
from mujoco_sim.world import World

# Between two pictures [s].
_PERIOD = 1.0 / 60.0
# GLFW's codes of keys that are no characters.
_NAMED_KEYS = {256: 'ESC', 262: 'RIGHT', 263: 'LEFT', 264: 'DOWN', 265: 'UP'}


def _has_display() -> bool:
    """Whether there is a display that answers; the one named may be left over from a login."""
    if not (os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')):
        return False
    # Here, because it loads a window system.
    from mujoco.viewer import glfw

    with warnings.catch_warnings(action='ignore'):
        return bool(glfw.init())


class NativeView:
    """
    MuJoCo's own window for one world.

    The window keeps some keys for itself and reports presses, not repeats: for driving, keep the
    terminal or use the browser viewer.
    """

    def __init__(self, world: World, camera: CameraView) -> None:
        """
        Open the window.

        Raises:
            SimulationError: there is no display.
        """
        if not _has_display():
            raise SimulationError('--viewer native: no display here (use --viewer web)')
        import mujoco.viewer

        self._keys: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._window: Any = mujoco.viewer.launch_passive(
            world.model,
            world.data,
            key_callback=self._on_key,
            show_left_ui=False,
            show_right_ui=False,
        )
        self._is_open = True
        with self._window.lock():
            view = self._window.cam
            view.type = mujoco.mjtCamera.mjCAMERA_TRACKING
            view.trackbodyid = world.root
            view.distance = camera.distance
            view.azimuth = camera.azimuth
            view.elevation = camera.elevation

    @property
    def period(self) -> float:
        """The time after which the window is to have another picture [s of wall time]."""
        return _PERIOD

    def sync(self, is_hurried: bool = False) -> None:
        """Show the state of now, `is_hurried` or not: the window draws in a thread of its own."""
        if self._window.is_running():
            self._window.sync()

    def pressed_keys(self) -> list[str]:
        """Return the keys pressed in the window since the last call; LOST when it was closed."""
        pressed = []
        while not self._keys.empty():
            pressed.append(self._keys.get())
        was_open, self._is_open = self._is_open, self._window.is_running()
        return [*pressed, LOST] if was_open and not self._is_open else pressed

    def follow(self, world: World) -> None:
        """Look at another robot in the same model."""
        with self._window.lock():
            self._window.cam.trackbodyid = world.root

    def close(self) -> None:
        """Close the window."""
        self._window.close()

    def _on_key(self, code: int) -> None:
        name = _NAMED_KEYS.get(code) or (chr(code).lower() if 32 <= code < 127 else None)
        if name is not None:
            self._keys.put(name)


if TYPE_CHECKING:
    from mujoco_sim.viewer.page import WebView

    View = NativeView | WebView


def start_view(
    kind: str, world: World, camera: CameraView, content: PageContent, port: int
) -> 'tuple[View, str]':
    """
    Start a viewer, `web` or `native`, on a world; return it and where it is.

    A page has a content; a window is MuJoCo's own.

    Raises:
        SimulationError: the port is taken, or there is no display.
    """
    if kind == 'native':
        return NativeView(world, camera), 'a window on this display'
    # Here, because it loads a server that a run without a page does not need.
    from mujoco_sim.viewer.page import WebView

    web = WebView(world, camera, content, port=port)
    return web, web.url
