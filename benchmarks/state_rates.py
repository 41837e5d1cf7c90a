# SPDX-License-Identifier: Apache-2.0
"""
How often a leg controller must be told the state, when its answers come late: falls of a Go2.

    .venv/bin/python benchmarks/state_rates.py [--seeds 3]

Over topics, physics runs at most three states ahead of a controller in another process. Each row
is a rate [Hz], by how many states every answer is late, and of so many runs how many fell: in move
base at 2 m/s, in a curve, backward, and in the tests of swing, step and balance.
"""

import argparse
from collections import deque
import itertools

from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.world import build_world
from quadruped_sim.leg_controller import LegController
from quadruped_sim.robot_model import JointMap, RobotModel
from robot_description.description import load_robot

STEPS = (1, 2, 3, 4, 5, 6, 10, 20)  # of physics, of a millisecond each, between two states
LATE = (0, 1, 2, 3)  # [states]
RUNS = {
    '2 m/s': ('5', (2.0, 0.0, 0.0)),
    'curve': ('5', (1.0, 0.3, 1.0)),
    'back': ('5', (-1.0, 0.0, 0.0)),
    'swing': ('9', None),
    'step': ('8', None),
    'balance': ('0', None),
}


class LateRobot:
    """A Go2 whose controller sees it every so many steps, and is heard some states later."""

    def __init__(self, steps: int, late: int, seed: int) -> None:
        loaded = load_robot('go2')
        self._world = build_world(loaded, 'flat', seed, usual_setup(loaded))
        model = RobotModel(loaded)
        self.controller = LegController(model)
        self._joints = JointMap(model.quadruped, self._world.joint_names, self._world.motor_names)
        self._steps, self._late = steps, late
        self._answers: deque = deque()

    def run(self, seconds, velocity=None):
        """Let time pass [s], driving in move base."""
        dt = self._steps * self._world.time_step
        for _ in range(round(seconds / dt)):
            if velocity is not None:
                self.controller.set_velocity(*velocity)
            reading = self._joints.reading(self._world.read())
            self._answers.append(self._joints.command(self.controller.step(reading, dt)))
            if len(self._answers) > self._late:
                self._world.apply(self._answers.popleft())
            self._world.step(self._steps)


def falls(steps, late, seed, key, velocity):
    """Return whether a Go2 falls in one of `RUNS`, of 8 s."""
    dog = LateRobot(steps, late, seed)
    dog.controller.press('2')
    dog.run(2.5)
    dog.controller.press(key)
    dog.run(8.0, velocity)
    return dog.controller.state in ('passive', 'fixed stand')


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seeds', type=int, default=3)
    seeds = parser.parse_args().seeds
    print(f'falls of {seeds}', *RUNS, sep='\t')
    for steps, late in itertools.product(STEPS, LATE):
        counts = [
            sum(falls(steps, late, seed, key, velocity) for seed in range(seeds))
            for key, velocity in RUNS.values()
        ]
        print(f'{1000 / steps:.0f} Hz, {late} late', *counts, sep='\t', flush=True)


if __name__ == '__main__':
    main()
