# SPDX-License-Identifier: Apache-2.0
"""A camera for colour, depth or both, rendered off-screen: quickly, without shadows."""

import contextlib
import importlib
from statistics import NormalDist
from typing import Any, NamedTuple

import mujoco
import numpy as np
from robot_description.mujoco import find_renderer
from robot_description.mujoco import NO_RENDERER
from robot_description.robot import Robot
from wasd_core.errors import one_line
from wasd_core.rotations import Pose

from mujoco_sim.errors import SimulationError
from mujoco_sim.sensors.mount import find_mount
from mujoco_sim.sensors.mount import Snapshot
from mujoco_sim.sensors.tags import CameraTag
from mujoco_sim.world import World

MOST_GEOMS = 10_000

# The middles of 256 equally likely parts of a normal distribution: one for each random byte.
_NORMAL = np.array([NormalDist().inv_cdf((byte + 0.5) / 256.0) for byte in range(256)])
_NORMAL /= _NORMAL.std()


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


class Picture(NamedTuple):
    """What a camera has seen: colours (height, width, 3) of bytes, depths (height, width) [m]."""

    colours: np.ndarray | None
    depths: np.ndarray | None


class Camera:
    """
    Renders what a camera sees; `scale` makes its pictures smaller, not their angle.

    `focal_length` and `centre` are the pinhole's [pixels]: a point (x, y, z) in the optical frame
    is seen at `focal_length (x, y) / z + centre`, counted from the middle of the first pixel.
    """

    def __init__(
        self, tag: CameraTag, world: World, robot: Robot, snapshot: Snapshot, scale: float = 1.0
    ) -> None:
        self.tag = tag
        self._snapshot = snapshot
        self._mount = find_mount(world, robot, tag.link, tag.pose)
        self.resize(scale)

    def resize(self, scale: float) -> None:
        """Take pictures of so much of the size that the description has, from now on."""
        tag = self.tag
        self.width = max(1, round(scale * tag.width))
        self.height = max(1, round(scale * tag.height))
        self._frustum = Frustum(tag.field_of_view, self.width, self.height, tag.near, tag.far)
        self.focal_length = 0.5 * self.width / self._frustum.half_width
        self.centre = (0.5 * (self.width - 1), 0.5 * (self.height - 1))

    def take(
        self,
        offscreen: Offscreen,
        colour: bool,
        depth: bool,
        random: np.random.Generator | None,
    ) -> Picture:
        """Return a picture of now: colours, with noise if `random` is given, and true depths."""
        data = self._snapshot.take()
        view = (data, self._mount.in_world(data), self._frustum, (self.width, self.height))
        colours = depths = None
        if colour:
            offscreen.look(*view)
            colours = offscreen.colours()
            if random is not None and self.tag.noise > 0.0:
                colours = self._noisy(colours, random)
        if depth:
            offscreen.look(*view, sky=False)
            depths = offscreen.depths(self._frustum)
        return Picture(colours, depths)

    def _noisy(self, colours: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Add noise by table: a picture has millions of values, 30 times a second."""
        errors = np.round(255.0 * self.tag.noise * _NORMAL).astype(np.int16)
        added = errors[np.frombuffer(random.bytes(colours.size), dtype=np.uint8)]
        return np.clip(colours + added.reshape(colours.shape), 0, 255).astype(np.uint8)
