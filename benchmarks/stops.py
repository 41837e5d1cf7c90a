# SPDX-License-Identifier: Apache-2.0
"""
How far and how long each robot goes on after each way to stop it.

In simulated time, on the flat, by truth. A page that closes, or falls silent, is noticed by the
page's server within half a second of wall time; that way is not part of it.
"""

from collections.abc import Callable
import math
from typing import Any

import rclpy
from table import Row
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import keep_alone, RunOptions
from wasd_bringup.run.run import Run

SPEEDS = (0.5, 1.0, 2.0, 3.0)
# What is slower than this has stopped [m/s]; the longest that is waited for it [s].
STILL, LONGEST = 0.02, 8.0
# The Go2 stands up and follows velocities; mbot's drive allows 1 m/s.
ROBOTS: dict[str, tuple[str, float, dict[str, Any]]] = {
    'mbot': ('mbot', 1.0, {}),
    'go2': ('unitree', 3.0, {'limits': 'race'}),
}
# What the source that drove does then, at 20 Hz.
WAYS: dict[str, Callable[[Run], object]] = {
    'release': lambda session: session.robot.drive((0.0, 0.0, 0.0), 'page'),
    'silence': lambda session: None,
    'page closed': lambda session: session.robot.release('page'),
    'e-stop': lambda session: session.e_stop('page'),
}


def trial(robot: str, speed: float, way: str) -> dict[str, Any]:
    """Drive a robot straight ahead at a speed [m/s] and stop it; return how far it went on."""
    preset, _, more = ROBOTS[robot]
    options = RunOptions(robot=robot, description=robot, preset=preset, speed=0.0, **more)
    session = make_ros_run(options)
    world, advance = session.world, session.simulation.advance
    tick = round(0.05 / world.time_step)
    try:
        for key, seconds in (('2', 2.5), ('5', 0.5)) if robot == 'go2' else ():
            session.press(key)
            advance(round(seconds / world.time_step))
        for _ in range(round((2.0 + 1.5 * speed) / 0.05)):
            session.robot.drive((speed, 0.0, 0.0), 'page')
            advance(tick)
        reached = math.hypot(*world.base().planar_velocity[:2])
        place, begun, stopped = world.base().position.copy(), world.time, math.nan
        for number in range(round(LONGEST / 0.05)):
            if not number or way == 'release':
                WAYS[way](session)
            advance(tick)
            if math.hypot(*world.base().planar_velocity[:2]) > STILL:
                stopped = math.nan
            elif math.isnan(stopped):
                stopped = world.time - begun
        distance = math.dist(place[:2], world.base().position[:2])
        state = session.robot.state
    finally:
        session.close()
    return {
        **{'robot': robot, 'speed': speed, 'way': way, 'reached': round(float(reached), 3)},
        **{'distance': round(distance, 3), 'seconds': round(stopped, 2), 'state': state},
    }


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return a row for each robot and each way to stop."""
    keep_alone()
    rclpy.init()
    rows = []
    for robot, (_, fastest, _) in ROBOTS.items():
        speeds = [speed for speed in SPEEDS if speed <= fastest]
        for way in WAYS:
            note(f'{robot}: {way}')
            trials = [trial(robot, speed, way) for speed in speeds]
            shown = ', '.join(
                f'{each["distance"]:.2f} m {each["seconds"]:.1f} s' for each in trials
            )
            names = ', '.join(f'{speed:g}' for speed in speeds)
            rows.append(
                Row(
                    what=f'{robot} at {names} m/s, stopped by {way}: way and time',
                    measured=shown,
                    must='stands',
                    passed=all(math.isfinite(each['seconds']) for each in trials),
                    trials=trials,
                )
            )
    rclpy.try_shutdown()
    return rows
