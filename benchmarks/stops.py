# SPDX-License-Identifier: Apache-2.0
"""
How far and how long each robot goes on after each way to stop it.

In simulated time, on the flat, by truth. A page that closes, or falls silent, is noticed by the
page's server within half a second of wall time; that way is not part of it.
"""

from collections.abc import Callable
import math
import os
from typing import Any

import rclpy
from table import Row
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.network import set_range

SPEEDS = (0.5, 1.0, 2.0, 3.0)
# What is slower than this has stopped [m/s]; the longest that is waited for it [s].
STILL, LONGEST = 0.02, 8.0
# At least this share of a speed has to be reached before the stop.
REACHED = 0.9
UP = (('2', 2.5), ('5', 0.5))
# How fast each is driven at most [m/s]; keys that make it follow velocities, and for how long it
# does what they say [s]; options. mbot's drive allows 1 m/s, as does our network.
ROBOTS: dict[str, tuple[float, tuple[tuple[str, float], ...], dict[str, Any]]] = {
    'mbot': (1.0, (), {'robot': 'mbot'}),
    'go2': (3.0, UP, {'robot': 'go2', 'preset': 'unitree', 'limits': 'race'}),
    'go2 by the network of ours': (
        1.0,
        (('2', 2.5), ('p', 1.0)),
        {'robot': 'go2', 'preset': 'unitree', 'policy': 'ours'},
    ),
}
# What the source that drove does then, at 20 Hz.
WAYS: dict[str, Callable[[Run], object]] = {
    'release': lambda session: session.robot.drive((0.0, 0.0, 0.0), 'page'),
    'silence': lambda session: None,
    'page closed': lambda session: session.robot.release('page'),
    'e-stop': lambda session: session.e_stop('page'),
    'key 1': lambda session: session.press('1'),  # legs lie down
}
# After these it is in the state that it was in, and may be driven on.
KEEPING = ('release', 'silence', 'page closed')


def trial(robot: str, speed: float, way: str) -> dict[str, Any]:
    """Drive a robot straight ahead at a speed [m/s] and stop it; return how far it went on."""
    _, keys, more = ROBOTS[robot]
    options = RunOptions(description=more['robot'], speed=0.0, **{'preset': 'mbot', **more})
    session = make_ros_run(options)
    world, advance = session.world, session.simulation.advance
    tick = round(0.05 / world.time_step)
    try:
        for key, seconds in keys:
            session.press(key)
            advance(round(seconds / world.time_step))
        stood = session.robot.state
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
    has_kept = way not in KEEPING or state == stood
    passed = math.isfinite(stopped) and reached >= REACHED * speed and has_kept
    return {
        **{'passed': passed, 'robot': robot, 'speed': speed, 'way': way, 'state': state},
        **{'reached': round(float(reached), 3), 'distance': round(distance, 3)},
        'seconds': round(stopped, 2),
    }


def measure(quick: bool, note: Callable[[str], None]) -> list[Row]:
    """Return a row for each robot and each way to stop."""
    set_range(os.environ, 'off')
    rclpy.init()
    rows = []
    for robot, (fastest, _, _) in ROBOTS.items():
        ways = [way for way in WAYS if way != 'key 1' or robot != 'mbot']
        speeds = [speed for speed in SPEEDS if speed <= fastest]
        for way in ways:
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
                    must=f'{100 * REACHED:g} % of the speed reached, then stands',
                    passed=all(each['passed'] for each in trials),
                    trials=trials,
                )
            )
    rclpy.try_shutdown()
    return rows
