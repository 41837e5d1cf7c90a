# SPDX-License-Identifier: Apache-2.0
"""Pictures of a world, rendered without a display; see `renderer_choice` for with what."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from PIL import Image

from mujoco_sim.world import World

SIZE = (1280, 720)
DOT_RADIUS = 0.012


class Viewpoint(NamedTuple):
    """A camera: what it looks at [m], from how far [m], from where [degrees, as MuJoCo has it]."""

    lookat: Sequence[float]
    distance: float
    azimuth: float
    elevation: float


class Trace(NamedTuple):
    """A path to draw: points, shape (n, 3) [m], and their colour."""

    points: np.ndarray
    rgba: tuple[float, float, float, float]


def take_picture(
    world: World, viewpoint: Viewpoint, path: Path, traces: Sequence[Trace] = ()
) -> None:
    """Write the world as it is now as a PNG, with paths drawn as dots."""
    width, height = SIZE
    camera = mujoco.MjvCamera()
    camera.lookat[:] = viewpoint.lookat
    camera.distance = viewpoint.distance
    camera.azimuth = viewpoint.azimuth
    camera.elevation = viewpoint.elevation
    renderer = mujoco.Renderer(world.model, height, width, max_geom=10_000)
    try:
        renderer.update_scene(world.data, camera)
        for trace in traces:
            for point in trace.points:
                _add_dot(renderer.scene, point, trace.rgba)
        Image.fromarray(renderer.render()).save(path)
    finally:
        renderer.close()


def _add_dot(scene: mujoco.MjvScene, point: np.ndarray, rgba: Sequence[float]) -> None:
    if scene.ngeom >= scene.maxgeom:
        return
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_SPHERE,
        np.full(3, DOT_RADIUS),
        np.asarray(point, dtype=float),
        np.eye(3).flatten(),
        np.asarray(rgba, dtype=np.float32),
    )
    scene.ngeom += 1
