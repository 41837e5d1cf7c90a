# SPDX-License-Identifier: Apache-2.0
"""Ground that is not flat: it begins AHEAD of the robot, which starts on a plane."""

import math

import mujoco
import numpy as np

# The robot starts at the origin, looking along x, with a plane of this length before it [m].
AHEAD = 0.8
LENGTH = 8.0
HALF_WIDTH = 3.0
GROUND = (0.34, 0.40, 0.46, 1.0)
TREAD = 0.30
STEPS = 6
CELL = 0.25


def add_slope(spec: mujoco.MjSpec, degrees: float, _: np.random.Generator) -> None:
    """Go uphill, or downhill for a negative angle, for LENGTH metres."""
    angle = math.radians(degrees)
    cos, sin = math.cos(angle), math.sin(angle)
    half = LENGTH / 2.0
    _add_box(
        spec,
        (AHEAD + half * cos + 0.5 * sin, 0.0, half * sin - 0.5 * cos),
        (half, HALF_WIDTH, 0.5),
        quaternion=(math.cos(angle / 2.0), 0.0, -math.sin(angle / 2.0), 0.0),
    )
    if degrees < 0.0:
        _end_floor(spec, AHEAD)


def add_stairs(spec: mujoco.MjSpec, rise: float, _: np.random.Generator) -> None:
    """Climb STEPS steps of a rise [m], each TREAD deep, to a landing."""
    for step in range(STEPS):
        height = rise * (step + 1)
        start = AHEAD + TREAD * step
        half = (LENGTH - TREAD * step) / 2.0
        _add_box(spec, (start + half, 0.0, height / 2.0), (half, HALF_WIDTH, height / 2.0))


def add_step(spec: mujoco.MjSpec, height: float, random: np.random.Generator) -> None:
    """Step up once [m], where the seed says: each run meets the edge with another leg."""
    start = AHEAD + float(random.uniform(0.0, 0.3))
    half = LENGTH / 2.0
    _add_box(spec, (start + half, 0.0, height / 2.0), (half, HALF_WIDTH, height / 2.0))


def add_boxes(spec: mujoco.MjSpec, height: float, random: np.random.Generator) -> None:
    """Cover the ground with boxes of CELL, each of a random height up to `height` [m]."""
    for row in range(round(LENGTH / CELL)):
        for column in range(round(-2.0 / CELL), round(2.0 / CELL)):
            top = float(random.uniform(0.0, height))
            if top < 0.002:
                continue
            place = (AHEAD + (row + 0.5) * CELL, (column + 0.5) * CELL, top / 2.0)
            shade = 0.75 + 0.5 * top / height
            _add_box(spec, place, (CELL / 2.0, CELL / 2.0, top / 2.0), shade=shade)


def add_rough(spec: mujoco.MjSpec, height: float, random: np.random.Generator) -> None:
    """Roll the ground smoothly, `height` [m] from trough to crest, fading in from a plane."""
    rows, columns = 80, 200
    smooth = random.normal(size=(rows, columns))
    for _ in range(6):  # repeated averaging: features of about 0.15 m
        rolled = [np.roll(smooth, shift, axis) for axis in (0, 1) for shift in (-1, 1)]
        smooth = np.mean(rolled, axis=0)
    smooth -= smooth.min()
    smooth *= np.clip(np.linspace(0.0, 8.0, columns), 0.0, 1.0) / smooth.max()
    spec.add_hfield(
        name='rough',
        size=[LENGTH / 2.0, 2.0, height, 0.1],
        nrow=rows,
        ncol=columns,
        userdata=smooth.flatten().tolist(),
    )
    spec.worldbody.add_geom(
        name='rough',
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname='rough',
        pos=[AHEAD + LENGTH / 2.0, 0.0, 0.0],
        rgba=GROUND,
    )


def _add_box(
    spec: mujoco.MjSpec,
    position: tuple[float, float, float],
    half_size: tuple[float, float, float],
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    shade: float = 1.0,
) -> None:
    rgba = [shade * channel for channel in GROUND[:3]] + [1.0]
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=position,
        size=half_size,
        quat=quaternion,
        rgba=np.clip(rgba, 0.0, 1.0),
    )


def _end_floor(spec: mujoco.MjSpec, x: float) -> None:
    """Let the endless floor end at x, so that it is not in the way of what goes down."""
    floor = spec.geom('floor')
    floor.type = mujoco.mjtGeom.mjGEOM_BOX
    floor.size = [3.0, HALF_WIDTH, 0.05]
    floor.pos = [x - 3.0, 0.0, -0.05]
