# SPDX-License-Identifier: Apache-2.0
"""A picture of a robot, rendered without a display."""

import io
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image
from wasd_core.errors import DescriptionError
from wasd_core.output_file import OutputFile

from robot_description.mujoco.builder import add_sky, compile_model, to_mujoco
from robot_description.mujoco.geoms import VISUAL_GROUP
from robot_description.mujoco.renderer import begin_drawing, find_renderer, why_no_renderer
from robot_description.robot import Robot

SIZE = (1280, 960)
# How much of the ball around the robot has to be in view, and from where [degrees].
MARGIN = 0.8
AZIMUTH = 130.0
ELEVATION = -20.0


def draw(robot: Robot, path: Path) -> None:
    """
    Write a picture of the robot as a PNG: joints at 0, or as near to it as their limits allow.

    To be called with MUJOCO_GL set, see `robot_description.mujoco.choose_renderer`.

    Raises:
        DescriptionError: nothing renders here, the robot does not load, or `path` is no place.
    """
    if path.suffix.lower() != '.png':
        raise DescriptionError(f'--picture {path}: wanted FILE.png')
    file = OutputFile(path, '--picture')  # first: a wrong place is said before anything is drawn
    if find_renderer() is None:
        raise DescriptionError(f'--picture: {why_no_renderer()}')
    spec = to_mujoco(robot, visuals=True)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = SIZE
    spec.visual.headlight.ambient = np.full(3, 0.4)
    add_sky(spec, [0.75, 0.82, 0.90], [0.97, 0.98, 1.0])
    model = compile_model(spec)
    data = mujoco.MjData(model)
    for name, position in robot.rest_positions.items():
        data.joint(name).qpos[0] = position
    mujoco.mj_forward(model, data)
    pixels = _render(model, data)
    png = io.BytesIO()
    Image.fromarray(pixels).save(png, format='PNG')
    file.write(png.getvalue())


def _render(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the picture, shape (height, width, 3), with all that is drawn in view."""
    drawn = model.geom_group == VISUAL_GROUP
    reach = model.geom_rbound[drawn, None]
    low = (data.geom_xpos[drawn] - reach).min(axis=0, initial=np.inf)
    high = (data.geom_xpos[drawn] + reach).max(axis=0, initial=-np.inf)
    if not drawn.any():
        low, high = np.full(3, -0.5), np.full(3, 0.5)
    camera = mujoco.MjvCamera()
    camera.lookat = (low + high) / 2.0
    half_angle = np.deg2rad(model.vis.global_.fovy) / 2.0
    camera.distance = MARGIN * float(np.linalg.norm(high - low)) / 2.0 / np.tan(half_angle)
    camera.azimuth, camera.elevation = AZIMUTH, ELEVATION
    width, height = SIZE
    begin_drawing()
    renderer = mujoco.Renderer(model, height, width)
    try:
        renderer.update_scene(data, camera)
        return np.array(renderer.render())
    finally:
        renderer.close()
