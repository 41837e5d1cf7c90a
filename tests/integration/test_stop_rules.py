# SPDX-License-Identifier: Apache-2.0
"""Whatever walks, the model or a network, stops alike when its driver stops, leaves or is lost."""

import math

import pytest
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

pytestmark = pytest.mark.slow

# Keys that make it follow velocities, and for how long it does what they say [s]; options.
WALKERS = {
    'model': ((('2', 1.3), ('5', 0.3)), {}),
    'network': ((('2', 1.3), ('p', 0.3)), {'policy': 'ours'}),
}
# What happens, the state that is left, and how far it goes on at most [m].
WAYS = {
    'the stick is let go': (lambda run: run.robot.drive((0.0, 0.0, 0.0), 'page'), None, 0.5),
    'nothing more is said': (lambda run: None, None, 1.0),
    'the page closes': (lambda run: run.robot.release('page'), None, 0.5),
    'e-stop': (lambda run: run.e_stop('page'), 'passive', 0.4),
    'key 1': (lambda run: run.press('1'), 'passive', 0.4),
}


@pytest.mark.parametrize('walker', WALKERS)
def test_at_a_metre_a_second_it_stops(walker):
    keys, more = WALKERS[walker]
    run = Run(RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0, **more))
    world = run.world

    def advance(seconds):
        run.simulation.advance(round(seconds / world.time_step))

    def speed():
        return math.hypot(*world.base().planar_velocity[:2])

    def wait_for_rest():
        """Let time pass until it has been at rest for half a second: 3 s at most."""
        end, rests = world.time + 3.0, 0
        while rests < 5 and world.time < end:
            advance(0.1)
            rests = rests + 1 if speed() < 0.02 else 0

    try:
        for way, (stop, left, most) in WAYS.items():
            if run.robot.state == 'passive':
                for key, seconds in keys:
                    run.press(key)
                    advance(seconds)
            walks = run.robot.state
            for _ in range(34):
                run.robot.drive((1.0, 0.0, 0.0), 'page')
                advance(0.05)
            assert speed() > 0.85, way
            place = world.base().position.copy()
            stop(run)
            wait_for_rest()
            assert speed() < 0.02, way
            assert math.dist(place[:2], world.base().position[:2]) < most, way
            assert run.robot.state == (left or walks), way
            assert world.base().tilt < 0.3, way
    finally:
        run.close()
