# SPDX-License-Identifier: Apache-2.0
"""Pictures of a world, without a display; robot_description.mujoco chooses what renders."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from PIL import Image
from robot_description.mujoco import begin_drawing

from mujoco_sim.world import World

SIZE = (1280, 720)
STRIP_SIZE = (320, 240)  # of one picture of a strip
FILM_SIZE = (480, 320)
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
    """
    Write the world as it is now as a PNG, with paths drawn as dots.

    Raises:
        UserError: this process is a fork of one that has drawn.
    """
    width, height = SIZE
    camera = _camera(viewpoint)
    begin_drawing()
    renderer = mujoco.Renderer(world.model, height, width, max_geom=10_000)
    try:
        renderer.update_scene(world.data, camera)
        for trace in traces:
            for point in trace.points:
                _add_dot(renderer.scene, point, trace.rgba)
        Image.fromarray(renderer.render()).save(path)
    finally:
        renderer.close()


def take_strip(
    world: World, states: Collection[np.ndarray], viewpoint: Viewpoint, path: Path
) -> None:
    """
    Write pictures of several instants side by side as one PNG; see `_pictures`.

    The world is left as it was.
    """
    width, height = STRIP_SIZE
    strip = Image.new('RGB', (width * len(states), height))
    for index, picture in enumerate(_pictures(world, states, viewpoint, STRIP_SIZE)):
        strip.paste(picture, (width * index, 0))
    strip.save(path)


def take_film(
    world: World, states: Collection[np.ndarray], viewpoint: Viewpoint, path: Path, period: float
) -> None:
    """
    Write pictures of instants `period` [s] apart as a moving WebP; see `_pictures`.

    The world is left as it was.
    """
    first, *others = _pictures(world, states, viewpoint, FILM_SIZE)
    milliseconds = round(1e3 * period)
    first.save(
        path, save_all=True, append_images=others, duration=milliseconds, loop=0, quality=55
    )


def _pictures(
    world: World, states: Collection[np.ndarray], viewpoint: Viewpoint, size: tuple[int, int]
) -> Iterator[Image.Image]:
    """
    Yield a picture of each instant.

    `states` are generalised positions as in `World.data.qpos`; the camera follows the root on the
    ground, so `viewpoint.lookat` is relative to it.
    """
    width, height = size
    begin_drawing()
    data = mujoco.MjData(world.model)
    renderer = mujoco.Renderer(world.model, height, width, max_geom=10_000)
    try:
        for state in states:
            data.qpos[:] = state
            mujoco.mj_forward(world.model, data)
            place = np.asarray(viewpoint.lookat) + (state[0], state[1], 0.0)
            renderer.update_scene(data, _camera(viewpoint._replace(lookat=place)))
            yield Image.fromarray(renderer.render())
    finally:
        renderer.close()


def _camera(viewpoint: Viewpoint) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat[:] = viewpoint.lookat
    camera.distance = viewpoint.distance
    camera.azimuth = viewpoint.azimuth
    camera.elevation = viewpoint.elevation
    return camera


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
