# SPDX-License-Identifier: Apache-2.0
"""The browser viewer: MuJoCo Studio's page, for this machine only, with keys to drive."""

from collections.abc import Callable, Sequence
import logging
import queue
import threading
import time
from typing import Any, NamedTuple

import mujoco
from mujoco.studio import endpoints
from mujoco.studio import launch_thread
from mujoco.studio import messages
from mujoco.studio import plugin
from mujoco.studio import viewer_protocol
from mujoco.studio import web_viewer
from mujoco.studio.dear_imgui import dear_imgui as imgui

from mujoco_sim.errors import SimulationError
from mujoco_sim.world import World

HOST = '127.0.0.1'
START_TIMEOUT = 10.0
REPEAT_PERIOD = 1.0 / 30.0
# Named keys of the page; letters and digits are added below.
_KEYS = {
    imgui.Key.UpArrow: 'UP',
    imgui.Key.DownArrow: 'DOWN',
    imgui.Key.LeftArrow: 'LEFT',
    imgui.Key.RightArrow: 'RIGHT',
    imgui.Key.Escape: 'ESC',
    imgui.Key.Space: ' ',
    imgui.Key.Comma: ',',
    imgui.Key.Period: '.',
}
_KEYS |= {getattr(imgui.Key, letter): letter.lower() for letter in 'ABCDEFGHIJKLMNOPQRSTUVWXYZ'}
_KEYS |= {getattr(imgui.Key, f'N{digit}'): str(digit) for digit in range(10)}


_OVERLAY = (
    imgui.WindowFlags.NoDecoration.value
    | imgui.WindowFlags.AlwaysAutoResize.value
    | imgui.WindowFlags.NoInputs.value
)


class CameraView(NamedTuple):
    """A camera that follows a body: distance [m], angles [degrees] as MuJoCo has them."""

    distance: float
    azimuth: float
    elevation: float


class Panel(NamedTuple):
    """Text on the page: `status` is asked for every frame, `help` unfolds on a click."""

    status: Callable[[], Sequence[str]]
    help: Sequence[str]


class _LocalWebViewer(web_viewer.WebViewer):
    """Studio's viewer, which would listen on all interfaces, made to listen on one."""

    # The base class sets '::' before it binds; a constant in its place keeps the page private.
    _host = property(lambda self: HOST, lambda self, _: None)

    @messages.handler(priority=messages.Priority.INTERNAL)
    def _on_post_model(self, event: messages.PostModelEvent) -> None:
        """Serve the new model without the base class's line on stdout."""
        self._update_model()


class _Page(plugin.ViewerPlugin):
    """What the page adds to the scene: the camera, a panel of text, keys."""

    def __init__(self, camera: CameraView, body: int, panel: Panel) -> None:
        self.started = threading.Event()
        self.keys: queue.SimpleQueue[str] = queue.SimpleQueue()
        self.port = 0
        self._due: dict[str, float] = {}
        self._camera = camera
        self.body = body
        self._panel = panel

    @messages.handler
    def on_init(self, event: plugin.ViewerInitEvent) -> None:
        """Remember the port that was found."""
        self.port = event.viewer._http_port
        self.started.set()

    @messages.handler(priority=messages.Priority.INTERNAL - 1)
    def on_model(self, event: messages.PostModelEvent) -> None:
        """Follow the robot, from where it is seen well."""
        camera = self.viewer.camera
        camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        camera.trackbodyid = self.body
        camera.distance = self._camera.distance
        camera.azimuth = self._camera.azimuth
        camera.elevation = self._camera.elevation

    @messages.handler
    def on_gui(self, event: messages.BuildGuiEvent) -> None:
        """Draw the panel and collect the keys pressed on the page."""
        self.viewer.camera.trackbodyid = self.body
        self._draw_status()
        self._draw_help()
        shift = imgui.IsKeyDown(imgui.Key.LeftShift) or imgui.IsKeyDown(imgui.Key.RightShift)
        now = time.monotonic()
        for key, name in _KEYS.items():
            if not imgui.IsKeyDown(key):
                self._due.pop(name, None)
            elif now >= self._due.get(name, now):
                # A key that is down repeats from the start, as a keyboard's does after a while.
                self._due[name] = now + REPEAT_PERIOD
                self.keys.put(name.upper() if shift else name)

    def _draw_status(self) -> None:
        imgui.SetNextWindowPos(imgui.Vec2(12.0, 12.0), imgui.Cond.Always)
        imgui.SetNextWindowBgAlpha(0.6)
        imgui.Begin('status', flags=_OVERLAY)
        for line in self._panel.status():
            imgui.Text(line)
        imgui.End()

    def _draw_help(self) -> None:
        """Keep the keys folded until the user wants them: the robot is to be seen."""
        below = 30.0 + imgui.GetTextLineHeightWithSpacing() * (len(self._panel.status()) + 0.5)
        imgui.SetNextWindowPos(imgui.Vec2(12.0, below), imgui.Cond.FirstUseEver)
        imgui.SetNextWindowCollapsed(True, imgui.Cond.FirstUseEver)
        imgui.SetNextWindowBgAlpha(0.8)
        imgui.Begin('keys (double-click)', flags=imgui.WindowFlags.AlwaysAutoResize)
        for line in self._panel.help:
            imgui.Text(line)
        imgui.End()


class WebView:
    """
    A running page for one world.

    `sync` sends the state of now, `pressed_keys` brings what was pressed on the page.
    """

    def __init__(
        self,
        world: World,
        camera: CameraView,
        panel: Panel,
        port: int = 0,
    ) -> None:
        """
        Start serving on 127.0.0.1; port 0 takes the first free one from 8080 on.

        Raises:
            SimulationError: the port is taken, or the viewer did not start.
        """
        self._world = world
        self._page = _Page(camera, world.root, panel)
        config = viewer_protocol.ViewerConfig(title='wasd', gfx='web', http_port=port)
        web_viewer._print_url_banner = lambda host, port: None  # we say where it is ourselves

        def serve(endpoint: endpoints.ViewerEndpoint) -> None:
            viewer = _LocalWebViewer(config, endpoint, plugins=[self._page])
            viewer_protocol.run_viewer_loop(viewer)

        self._handle: Any = launch_thread.launch_thread(serve)
        try:
            self._wait_until_started()
            logging.getLogger('WebServer').setLevel(logging.WARNING)
            self._handle.set_model(world.model)
        except (RuntimeError, OSError) as error:
            reason = ' '.join(str(error).split())
            raise SimulationError(f'the viewer did not start: {reason}') from None

    @property
    def url(self) -> str:
        """Where the page is."""
        return f'http://{HOST}:{self._page.port}/'

    def sync(self) -> None:
        """Send the state of now to the page."""
        if self._handle.is_running():
            self._handle.sync(self._handle.model, self._world.data)

    def pressed_keys(self) -> list[str]:
        """Return the keys pressed on the page since the last call."""
        pressed = []
        while not self._page.keys.empty():
            pressed.append(self._page.keys.get())
        return pressed

    def follow(self, world: World) -> None:
        """Look at another robot in the same model."""
        self._page.body = world.root

    def close(self) -> None:
        """Stop serving."""
        if self._handle.is_running():
            self._handle.close()

    def _wait_until_started(self) -> None:
        waited = 0.0
        while not self._page.started.wait(0.05):
            waited += 0.05
            self._handle.is_running()  # raises what ended the viewer's thread
            if waited > START_TIMEOUT:
                raise RuntimeError(f'no answer for {START_TIMEOUT:.0f} s')
