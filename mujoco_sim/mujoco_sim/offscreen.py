# SPDX-License-Identifier: Apache-2.0
"""Pictures rendered off-screen for cameras: quick ones, without shadows and smooth edges."""

import contextlib
import importlib
from typing import Any

import mujoco
import numpy as np
from robot_description.mujoco import find_renderer
from robot_description.mujoco import NO_RENDERER
from wasd_core.errors import one_line
from wasd_core.rotations import Pose

from mujoco_sim.errors import SimulationError
from mujoco_sim.world import World

MOST_GEOMS = 10_000


class Frustum:
    """What a camera sees: half sizes of the picture at distance 1, and the clip distances [m]."""

    def __init__(self, field_of_view: float, width: int, height: int, near: float, far: float):
        """Take the horizontal field of view [rad] and the size [pixels]; pixels are square."""
        self.half_width = float(np.tan(0.5 * field_of_view))
        self.half_height = self.half_width * height / width
        self.near = near
        self.far = far


class Offscreen:
    """
    An OpenGL context without a window, for pictures up to one size, of one world.

    It belongs to the thread that made it.
    """

    def __init__(self, world: World, width: int, height: int) -> None:
        """
        Make the context and hand the model's meshes and textures to it.

        Raises:
            SimulationError: there is no library to render with, or it does not work.
        """
        name = find_renderer()
        if name is None:
            raise SimulationError(NO_RENDERER)
        try:
            self._context: Any = importlib.import_module(f'mujoco.{name}').GLContext(width, height)
            self._context.make_current()
            with _quick_quality(world.model, width, height):
                self._renderer = mujoco.MjrContext(
                    world.model, mujoco.mjtFontScale.mjFONTSCALE_100.value
                )
        except Exception as error:  # OpenGL's own, ImportError, mujoco.FatalError, ...
            reason = one_line(error)
            raise SimulationError(f'{name} does not work here: {reason}') from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        # Zero is far away: floats are finest there, where distances are coarsest.
        self._renderer.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._model = world.model
        self._scene = mujoco.MjvScene(world.model, MOST_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()

    def look(
        self,
        data: mujoco.MjData,
        camera: Pose,
        frustum: Frustum,
        size: tuple[int, int],
        sky: bool = True,
    ) -> None:
        """
        Render what a camera that looks along x of its pose sees; `size` is (width, height).

        MuJoCo's sky has a depth: without it there is nothing where nothing is.
        """
        self._context.make_current()
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = sky
        mujoco.mjv_updateScene(
            self._model,
            data,
            self._option,
            None,
            mujoco.MjvCamera(),
            mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        for eye in self._scene.camera:  # both eyes in one place: no stereo
            eye.pos[:] = camera.position
            eye.forward[:] = camera.rotation[:, 0]
            eye.up[:] = camera.rotation[:, 2]
            eye.frustum_center = 0.0
            eye.frustum_width = frustum.near * frustum.half_width
            eye.frustum_top = frustum.near * frustum.half_height
            eye.frustum_bottom = -frustum.near * frustum.half_height
            eye.frustum_near = frustum.near
            eye.frustum_far = frustum.far
        for light in self._scene.lights[: self._scene.nlight]:
            if light.headlight:
                light.pos[:], light.dir[:] = camera.position, camera.rotation[:, 0]
        self._rectangle = mujoco.MjrRect(0, 0, *size)
        mujoco.mjr_render(self._rectangle, self._scene, self._renderer)

    def colours(self) -> np.ndarray:
        """Return what was rendered last, shape (height, width, 3) in red, green, blue."""
        shape = (self._rectangle.height, self._rectangle.width, 3)
        image = np.empty(shape, dtype=np.uint8)
        mujoco.mjr_readPixels(image, None, self._rectangle, self._renderer)
        return np.flipud(image)

    def depths(self, frustum: Frustum) -> np.ndarray:
        """
        Return how far ahead of the camera's plane each pixel is [m], shape (height, width).

        It is infinite where nothing is within the far clip distance (REP 118).
        """
        shape = (self._rectangle.height, self._rectangle.width)
        buffer = np.empty(shape, dtype=np.float32)
        mujoco.mjr_readPixels(None, buffer, self._rectangle, self._renderer)
        near, far = frustum.near, frustum.far
        # Reversed depth d = near (far - z) / (z (far - near)), solved for z.
        depth = near * far / (near + buffer.astype(np.float64) * (far - near))
        depth[buffer <= 0.0] = np.inf
        return np.flipud(depth).astype(np.float32)

    def close(self) -> None:
        """Release what OpenGL holds."""
        self._context.make_current()
        self._renderer.free()
        self._context.free()


@contextlib.contextmanager
def _quick_quality(model: mujoco.MjModel, width: int, height: int) -> Any:
    """Have a context made without shadows and multi-sampling: a sixth of the time per picture."""
    size, quality = model.vis.global_, model.vis.quality
    before = size.offwidth, size.offheight, quality.offsamples, quality.shadowsize
    size.offwidth, size.offheight, quality.offsamples, quality.shadowsize = width, height, 0, 0
    try:
        yield
    finally:
        size.offwidth, size.offheight, quality.offsamples, quality.shadowsize = before
