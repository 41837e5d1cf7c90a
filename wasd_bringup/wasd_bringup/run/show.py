# SPDX-License-Identifier: Apache-2.0
"""Shows one robot in a terminal: its status as a line, or as a board where there is room."""

import math

from mujoco_sim.simulation import Simulation
from mujoco_sim.world import World
from teleop_keyboard.dashboard import board, Line, Status, status_line
from teleop_keyboard.screen import StatusLine

from wasd_bringup.run.robot import Robot


def show_robot(robot: Robot, line: StatusLine, name: str, now: float, is_told: bool) -> None:
    """
    Show in a terminal how a robot is, by a `name` where that helps; `now` in [s].

    `is_told`: also write lines to an output that is no terminal.
    """
    line.show(
        lambda width: say_status(robot.status(), name, robot.simulation, width),
        now,
        lambda *size: draw_board(robot.status(), robot.world, robot.first_keys, *size),
        lambda: say_plainly(robot.status(), name) if is_told else '',
    )


def say_status(status: Status, name: str, simulation: Simulation, width: int) -> str:
    """Return a terminal's line on the robot that the keys drive, by its name where that helps."""
    pace = f'x{simulation.pacer.real_time_factor:.2f}' if not simulation.paused else 'paused'
    if name:
        status = status._replace(state=f'[{name}] {status.state}')
    return status_line(status, f'{simulation.world.time:.1f} s {pace}', width)


def say_plainly(status: Status, name: str) -> str:
    """Return the parts of a status that seldom change, for an output that cannot be rewritten."""
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
