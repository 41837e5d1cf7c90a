# SPDX-License-Identifier: Apache-2.0
"""What shows a run: the page in a browser with its cockpit, or a window."""

from typing import Protocol

from mujoco_sim.viewer.drawing import PageContent
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.viewer.page import WebView
from mujoco_sim.world import World


class View(Protocol):
    """What a session needs of a viewer."""

    def sync(self) -> None:
        """Show the state of now."""

    def pressed_keys(self) -> list[str]:
        """Return the keys pressed in the viewer since the last call; LOST where its user went."""

    def follow(self, world: World) -> None:
        """Look at another robot."""

    def close(self) -> None:
        """End it."""


def start_view(
    kind: str, world: World, camera: CameraView, content: PageContent, port: int
) -> tuple[View, str]:
    """
    Start a viewer, `web` or `native`, on a world; return it and where it is.

    A page has a content; a window is MuJoCo's own.

    Raises:
        SimulationError: the port is taken, or there is no display.
    """
    if kind == 'native':
        # Here, because it loads a window system.
        from mujoco_sim.viewer.native import NativeView

        return NativeView(world, camera), 'a window on this display'
    web = WebView(world, camera, content, port=port)
    return web, web.url
