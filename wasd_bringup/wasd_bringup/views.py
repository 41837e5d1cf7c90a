# SPDX-License-Identifier: Apache-2.0
"""What shows a run: the page in a browser with its cockpit, or a window; and the terminal."""

import math
from typing import Protocol

from mujoco_sim.simulation import Simulation
from mujoco_sim.viewer.drawing import PageContent
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.viewer.page import WebView
from mujoco_sim.world import World
from teleop_keyboard.dashboard import board
from teleop_keyboard.dashboard import Line
from teleop_keyboard.dashboard import Status
from teleop_keyboard.dashboard import status_line


class View(Protocol):
    """What a session needs of a viewer."""

    @property
    def period(self) -> float:
        """The time after which it is to be synchronised again [s of wall time]."""

    def sync(self, is_hurried: bool = False) -> None:
        """Show the state of now; `is_hurried` is whether the simulation has no time to spare."""

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


def say_status(status: Status, name: str, simulation: Simulation, width: int) -> str:
    """Return a terminal's line on the robot that the keys drive, by its name where that helps."""
    pace = f'x{simulation.pacer.real_time_factor:.2f}' if not simulation.paused else 'paused'
    if name:
        status = status._replace(state=f'[{name}] {status.state}')
    return status_line(status, f'{simulation.world.time:.1f} s {pace}', width)


def say_plainly(status: Status, name: str) -> str:
    """Return what seldom changes of a status, for an output in which nothing is rewritten."""
    words = f'[{name}] {status.state}' if name else status.state
    return f'{words}: {status.message}' if status.message else words


def draw_board(
    status: Status, world: World, first_keys: str, width: int, height: int
) -> list[Line]:
    """Return what a window with room for it shows above that line."""
    if status.axes:
        base = world.base()
        lift = round(float(base.position[2]), 2) + 0.0  # no -0.00
        body = f'height {lift:.2f} m   tilt {math.degrees(base.tilt):.1f} deg'
        status = status._replace(body=body)
    return board(status, first_keys, width, height)
