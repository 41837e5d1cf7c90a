# SPDX-License-Identifier: Apache-2.0
"""A camera for colour, depth or both, rendered off-screen: quickly, without shadows."""

import array
from collections.abc import Collection, Iterator
import contextlib
from dataclasses import dataclass
import functools
import importlib
import math
from typing import Any, NamedTuple
import weakref

import mujoco
import numpy as np
from robot_description.mujoco import begin_drawing, find_renderer, why_no_renderer
from robot_description.sensor_tags import COLOUR_TYPES, DEPTH_TYPES
from wasd_core.errors import one_line, SimulationError
from wasd_core.rotations import Pose

from mujoco_sim.sensors.mount import Fields, Random, Site
from mujoco_sim.sensors.tags import legal_topic, SensorTag, TagReader
from mujoco_sim.world import World
from robot_description import sensor_tags

MOST_GEOMS = 10_000


@dataclass(frozen=True, kw_only=True)
class CameraTag(SensorTag):
    """A camera that looks along x of its frame; a topic is empty where it makes no such image."""

    colour_topic: str
    colour_info_topic: str
    depth_topic: str
    depth_info_topic: str
    width: int  # [pixels]
    height: int
    field_of_view: float  # horizontal [rad]
    near: float  # what is nearer is not seen [m]
    far: float
    noise: float  # standard deviation of colour, as a share of full brightness


def read_camera(reader: TagReader) -> CameraTag:
    """Return what a tag says of a camera."""
    kind = reader.kind
    name = reader.word('cameraName', 'camera_name') or reader.name
    colour = reader.word('imageTopicName')
    if kind not in DEPTH_TYPES:
        colour = colour or 'image_raw'
    depth = reader.word('depthImageTopicName') or 'depth/image_raw'
    if kind in COLOUR_TYPES:
        depth = ''

    def topic(image: str) -> str:
        return legal_topic(f'{name}/{image}') if image else ''

    def info(element: str, image: str) -> str:
        beside = image.rpartition('/')[0]
        return topic(reader.word(element) or f'{beside}/camera_info'.strip('/')) if image else ''

    near, far = reader.pair(*sensor_tags.PAIRS[2], (0.05, 100.0))
    return CameraTag(
        **reader.common(30.0),
        colour_topic=topic(colour),
        colour_info_topic=info('cameraInfoTopicName', colour),
        depth_topic=topic(depth),
        depth_info_topic=info('depthImageCameraInfoTopicName', depth),
        width=int(reader.number('image/width', 640)),
        height=int(reader.number('image/height', 480)),
        field_of_view=reader.number('horizontal_fov', math.pi / 3.0),
        near=near,
        far=max(far, 1.01 * near),
        noise=reader.number('noise/stddev', 0.0),
    )


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
            UserError: this process is a fork of one that has drawn.
        """
        name = find_renderer()
        if name is None:
            raise SimulationError(why_no_renderer())
        begin_drawing()
        try:
            self._context: Any = importlib.import_module(f'mujoco.{name}').GLContext(width, height)
            # Not when the interpreter has gone, where OSMesa's cannot go any more.
            weakref.finalize(self, self._context.free)
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
    """Make contexts without shadows and multi-sampling: a sixth of the time per picture."""
    size, quality = model.vis.global_, model.vis.quality
    before = size.offwidth, size.offheight, quality.offsamples, quality.shadowsize
    size.offwidth, size.offheight, quality.offsamples, quality.shadowsize = width, height, 0, 0
    try:
        yield
    finally:
        size.offwidth, size.offheight, quality.offsamples, quality.shadowsize = before


class SharedRenderer:
    """The one renderer of all cameras of a site, made when the first picture is wanted."""

    def __init__(self, site: Site) -> None:
        self._world, self._say = site.world, site.say
        self.width = self.height = 0  # of the largest picture [pixels]
        self._offscreen: Offscreen | None = None
        self._works = True

    def open(self) -> Offscreen | None:
        """Return the renderer; None, and one line in the log, where there cannot be one."""
        if self._offscreen is None and self._works:
            try:
                self._offscreen = Offscreen(self._world, self.width, self.height)
            except SimulationError as error:
                self._works = False
                self._say(f'cameras have no pictures: {error}')
        return self._offscreen

    def close(self) -> None:
        """Release it."""
        if self._offscreen is not None:
            self._offscreen.close()
            self._offscreen = None


class Picture(NamedTuple):
    """What a camera has seen: colours (height, width, 3) of bytes, depths (height, width) [m]."""

    colours: np.ndarray | None
    depths: np.ndarray | None


class Camera:
    """
    Renders what a camera sees; the site's `scale` makes its pictures smaller, not their angle.

    `focal_length` and `centre` are the pinhole's [pixels]: a point (x, y, z) in the optical frame
    is seen at `focal_length (x, y) / z + centre`, counted from the middle of the first pixel.
    """

    def __init__(self, tag: CameraTag, site: Site) -> None:
        self.tag = tag
        self._site = site
        self._mount = site.find_mount(tag.link, tag.pose)
        shared: SharedRenderer = site.renderer or SharedRenderer(site)
        shared.width, shared.height = max(shared.width, tag.width), max(shared.height, tag.height)
        self._renderer = site.renderer = shared

    @property
    def width(self) -> int:
        """Width of its pictures [pixels]."""
        return max(1, round(self._site.scale * self.tag.width))

    @property
    def height(self) -> int:
        """Height of its pictures [pixels]."""
        return max(1, round(self._site.scale * self.tag.height))

    @property
    def focal_length(self) -> float:
        """Focal length [pixels]."""
        return 0.5 * self.width / self._frustum.half_width

    @property
    def centre(self) -> tuple[float, float]:
        """Where the optical axis is in a picture [pixels]."""
        return 0.5 * (self.width - 1), 0.5 * (self.height - 1)

    @property
    def _frustum(self) -> Frustum:
        tag = self.tag
        return Frustum(tag.field_of_view, self.width, self.height, tag.near, tag.far)

    def take(
        self,
        offscreen: Offscreen,
        colour: bool,
        depth: bool,
        random: Random,
    ) -> Picture:
        """Return a picture of now: colours, with noise if `random` is given, and true depths."""
        data, frustum = self._site.snapshot.take_whole(), self._frustum
        view = (data, self._mount.in_world(data), frustum, (self.width, self.height))
        colours = depths = None
        if colour:
            offscreen.look(*view)
            colours = offscreen.colours()
            if random is not None and self.tag.noise > 0.0:
                colours = self._noisy(colours, random)
        if depth:
            offscreen.look(*view, sky=False)
            depths = offscreen.depths(frustum)
        return Picture(colours, depths)

    def measure(self, wanted: Collection[str], random: Random) -> Iterator[tuple[str, Fields]]:
        """Yield the tag's field of each `wanted` topic and its CameraInfo's or Image's fields."""
        for name in ('colour_info_topic', 'depth_info_topic'):
            if name in wanted:
                yield name, self._lens()
        colour, depth = 'colour_topic' in wanted, 'depth_topic' in wanted
        offscreen = self._renderer.open() if colour or depth else None
        if offscreen is not None:
            picture = self.take(offscreen, colour, depth, random)
            if picture.colours is not None:
                yield 'colour_topic', _image(picture.colours, 'rgb8')
            if picture.depths is not None:
                yield 'depth_topic', _image(picture.depths, '32FC1')  # [m], by REP 118

    def _lens(self) -> Fields:
        """Return the fields of a sensor_msgs/CameraInfo of a pinhole without distortion."""
        focal, (x, y) = self.focal_length, self.centre
        return {
            'height': self.height,
            'width': self.width,
            'distortion_model': 'plumb_bob',
            'd': [0.0] * 5,
            'k': [focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0],
            'r': [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            'p': [focal, 0.0, x, 0.0, 0.0, focal, y, 0.0, 0.0, 0.0, 1.0, 0.0],
        }

    def _noisy(self, colours: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Add noise by table: a picture has millions of values, 30 times a second."""
        errors = np.round(255.0 * self.tag.noise * _normal()).astype(np.int16)
        added = errors[np.frombuffer(random.bytes(colours.size), dtype=np.uint8)]
        return np.clip(colours + added.reshape(colours.shape), 0, 255).astype(np.uint8)


@functools.cache
def _normal() -> np.ndarray:
    """Return the middles of 256 equally likely parts of a normal distribution: one for a byte."""
    # Here, because few robots have a camera.
    from statistics import NormalDist

    middles = np.array([NormalDist().inv_cdf((byte + 0.5) / 256.0) for byte in range(256)])
    middles /= middles.std()
    return middles


def _image(pixels: np.ndarray, encoding: str) -> Fields:
    """Return the fields of a sensor_msgs/Image of (height, width[, channels]) pixels."""
    return {
        'height': pixels.shape[0],
        'width': pixels.shape[1],
        'encoding': encoding,
        'is_bigendian': 0,
        'step': pixels[0].nbytes,
        'data': array.array('B', pixels.tobytes()),
    }
