# SPDX-License-Identifier: Apache-2.0
"""
A robot that differs from its description at random, as those of reinforcement learning do.

Ranges at level 1 are what policies for robots of the Go2's size are trained with: friction
[Rudin2021], mass [Margolis2023], motor strength [Kumar2021]; the centre of mass as in public
trainings of the Go2. Delays are of the order of that measured between a computer and its motors,
3 ms [Tan2018]; noise is up to five times that of the sensors as they are. At level 0 nothing
differs; between, ranges shrink linearly.
"""

from dataclasses import fields
from dataclasses import replace

import numpy as np
from robot_description.description import Description
from robot_description.morphology.quadruped import NotAQuadruped
from robot_description.morphology.quadruped import Quadruped
from robot_description.morphology.quadruped import scale_of

from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.untold import Drawn

# Where a range shrinks to at level 0, and its bounds at level 1, of a robot of the Go2's size.
MASS = (0.0, -1.0, 3.0)  # added to the base [kg]
CENTRE = (0.0, -0.05, 0.05)  # of the base's mass, along each axis of its frame [m]
FRICTION = (0.6, 0.5, 1.25)
STRENGTH = (1.0, 0.9, 1.1)  # of each motor: its torque over what it was told
DELAY = (0.0, 0.0, 0.004)  # of commands, beyond the usual, and of what sensors say [s]
NOISE = (1.0, 1.0, 5.0)  # over the usual
# Terrain and noise of the same seed have streams of their own.
STREAM = 14


def draw(level: float, seed: int, quadruped: Quadruped) -> Drawn:
    """Return how a robot differs at a level in [0, 1]; the same seed draws the same."""
    random, scale = np.random.default_rng((seed, STREAM)), scale_of(quadruped)

    def one(limits: tuple[float, float, float], unit: float = 1.0) -> float:
        neutral, low, high = limits
        return float(neutral + level * (random.uniform(low, high) - neutral)) * unit

    return Drawn(
        mass=one(MASS, scale.of('kg')),
        centre=(
            one(CENTRE, scale.of('m')),
            one(CENTRE, scale.of('m')),
            one(CENTRE, scale.of('m')),
        ),
        friction=one(FRICTION),
        command_delay=one(DELAY),
        sensor_delay=one(DELAY),
        noise=one(NOISE),
        strength={name: one(STRENGTH) for name in quadruped.joint_names},
    )


def randomise(setup: RobotSetup, seed: int, description: Description) -> RobotSetup:
    """
    Return a setup whose robot differs as its `untold.randomise` says.

    Raises:
        NotAQuadruped: it does differ, and its ranges are for quadrupeds.
    """
    level = setup.untold.randomise
    if level == 0.0:
        return setup
    try:
        drawn = draw(level, seed, description.quadruped)
    except NotAQuadruped as error:
        raise NotAQuadruped(f'randomise: {error}') from None
    noise = setup.noise
    if noise is not None:
        names = [each.name for each in fields(noise)]
        noise = replace(noise, **{name: drawn.noise * getattr(noise, name) for name in names})
    delay = setup.command_delay + drawn.command_delay
    return replace(setup, drawn=drawn, noise=noise, command_delay=delay)
