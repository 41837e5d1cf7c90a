# SPDX-License-Identifier: Apache-2.0
"""Shows one robot in a terminal: its status as a line, or as a board where there is room."""

import math

from teleop_keyboard.dashboard import board, Line, status_line
from teleop_keyboard.screen import StatusLine

from wasd_bringup.run.robot import Robot


def show_robot(robot: Robot, line: StatusLine, name: str, now: float, is_told: bool) -> None:
    """
    Show in a terminal how a robot is, by a `name` where that helps; `now` in [s].

    `is_told`: also write lines to an output that is no terminal.
    """
    called = f'[{name}] ' if name else ''

    def compose(width: int) -> str:
        status, pacer = robot.status(), robot.simulation.pacer
        pace = 'paused' if robot.simulation.paused else f'x{pacer.real_time_factor:.2f}'
        clock = f'{robot.world.time:.1f} s {pace}'
        return status_line(status._replace(state=f'{called}{status.state}'), clock, width)

    def draw_board(width: int, height: int) -> list[Line]:
        status = robot.status()
        if status.axes:
            base = robot.world.base()
            lift = round(float(base.position[2]), 2) + 0.0  # no -0.00
            body = f'height {lift:.2f} m   tilt {math.degrees(base.tilt):.1f} deg'
            status = status._replace(body=body)
        return board(status, robot.first_keys, width, height)

    def say_plainly() -> str:
        """Return what seldom changes, for an output that cannot be rewritten."""
        status = robot.status()
        return called + ': '.join(filter(None, (status.state, status.message)))

    line.show(compose, now, draw_board, say_plainly if is_told else lambda: '')
