# SPDX-License-Identifier: Apache-2.0
"""The browser viewer: MuJoCo Studio's page, for this machine only, with keys to drive."""

import copy
import functools
import logging
import threading
import time
from typing import Any

import mujoco
from mujoco.studio import endpoints, launch_thread, messages, plugin, viewer_protocol
import numpy as np
from wasd_core.errors import one_line, SimulationError
from wasd_core.network import LOOPBACK

from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.viewer.drawing import Pace, PageContent, Panels, PictureDetail
from mujoco_sim.viewer.input import PageInput
from mujoco_sim.viewer.server import serve_page
from mujoco_sim.viewer.studio import drop_viewer_events, LocalWebViewer, patch_server, port_of
from mujoco_sim.world import World

START_TIMEOUT = 10.0
# The page gets this part of a world's state: all that its picture is made of.
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)

handler = functools.partial(messages.handler, priority=messages.Priority.USER)


class _Page(plugin.ViewerPlugin):  # type: ignore[misc]
    """What the page adds to the scene: the camera, panels, keys."""

    def __init__(self, camera: CameraView, body: int, content: PageContent) -> None:
        self.started = threading.Event()
        self.input = PageInput()
        self.pace = Pace(self.input)
        self.port = 0
        self._camera = camera
        self.body = body
        self._detail = PictureDetail()
        self._detail_set = time.monotonic()
        self._content = content
        self._panels = Panels(content)

    def text(self) -> str:
        """Return the contents of the panels as text, for pages without panels."""
        return '\n'.join(self._content.lines())

    @handler
    def on_init(self, event: plugin.ViewerInitEvent) -> None:
        """Remember the port that was found."""
        self.port = port_of(event.viewer)
        self.started.set()

    @functools.partial(messages.handler, priority=messages.Priority.INTERNAL - 1)
    def on_model(self, event: messages.PostModelEvent) -> None:
        """Follow the robot, from where it is seen well."""
        camera = self.viewer.camera
        camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        camera.trackbodyid = self.body
        camera.distance = self._camera.distance
        camera.azimuth = self._camera.azimuth
        camera.elevation = self._camera.elevation

    @handler
    def on_gui(self, event: messages.BuildGuiEvent) -> None:
        """Draw the panels; keys belong to a field of text while there is one."""
        self._set_detail()
        self.viewer.camera.trackbodyid = self.body
        if self.viewer.is_drawing:
            self._panels.draw(self.viewer, self.input)

    def _set_detail(self) -> None:
        """Ask the browser for as much as it draws fast, or for little while none is there."""
        now = time.monotonic()
        dt, self._detail_set = now - self._detail_set, now
        if self.input.is_present:
            self._detail.step(self.input.rate, dt)
        elif not self.input.has_source:
            self._detail.reset()
        flags = self.viewer.render_flags
        flags.flags = self._detail.flags(list(flags.flags))


class WebView:
    """
    A running page for one world.

    `sync` sends the state of now, `pressed_keys` brings what was pressed on the page, with
    LOST where who pressed it went.
    """

    def __init__(
        self,
        world: World,
        camera: CameraView,
        content: PageContent,
        port: int = 0,
    ) -> None:
        """
        Start serving on 127.0.0.1; port 0 takes the first free one from 8080 on.

        Raises:
            SimulationError: the port is taken, or the viewer did not start.
        """
        self._world = world
        self._page = _Page(camera, world.root, content)
        config = viewer_protocol.ViewerConfig(title='wasd', gfx='web', http_port=port)
        patch_server(functools.partial(serve_page, self._page.input, self._page.text))

        def serve(endpoint: endpoints.ViewerEndpoint) -> None:
            viewer = LocalWebViewer(config, endpoint, self._page)
            viewer_protocol.run_viewer_loop(viewer)

        self._handle: Any = launch_thread.launch_thread(serve)
        try:
            self._wait_until_started()
            logging.getLogger('WebServer').setLevel(logging.WARNING)
            shown = copy.copy(world.model)
            # Without multi-sampling: a third of the time in software.
            shown.vis.quality.offsamples = 0
            self._handle.set_model(shown)
            self._state_size = mujoco.mj_stateSize(world.model, _STATE)
        except (RuntimeError, OSError) as error:
            reason = one_line(error)
            raise SimulationError(f'the viewer did not start: {reason}') from None

    @property
    def url(self) -> str:
        """Where the page is."""
        return f'http://{LOOPBACK}:{self._page.port}/'

    @property
    def period(self) -> float:
        """The time after which the page is to have another state [s of wall time]."""
        return self._page.pace.scene

    def sync(self, is_hurried: bool = False) -> None:
        """Send the state of now; `is_hurried` is whether the simulation has no time to spare."""
        self._page.pace.is_hurried = is_hurried
        if self._handle.is_running():
            # Not the handle's own `sync`: it compares all options with those it has sent, which
            # takes longer than a tick, and does to the world what comes from the page.
            model, state = self._world.model, np.empty(self._state_size)
            mujoco.mj_getState(model, self._world.data, state, _STATE)
            self._handle.send_to_viewer(messages.StateSnapshot(state=state, state_sig=_STATE))
            drop_viewer_events(self._handle)

    @property
    def input(self) -> PageInput:
        """What the page's browser says, and whether it is alive."""
        return self._page.input

    def pressed_keys(self) -> list[str]:
        """Return presses, HELD, RELEASE and LOST of the page since the last call."""
        return self._page.input.take_keys()

    def follow(self, world: World) -> None:
        """Look at another robot in the same model."""
        self._page.body = world.root

    def close(self) -> None:
        """Stop serving."""
        if self._handle.is_running():
            self._handle.close()

    def _wait_until_started(self) -> None:
        deadline = time.monotonic() + START_TIMEOUT
        while not self._page.started.wait(0.05):
            self._handle.is_running()  # raises what ended the viewer's thread
            if time.monotonic() > deadline:
                raise RuntimeError(f'no answer for {START_TIMEOUT:.0f} s')
