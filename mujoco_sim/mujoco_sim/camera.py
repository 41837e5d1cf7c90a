# SPDX-License-Identifier: Apache-2.0
"""A camera for colour, depth or both."""

from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from robot_description.robot import Robot

from mujoco_sim.mount import find_mount
from mujoco_sim.mount import Snapshot
from mujoco_sim.offscreen import Frustum
from mujoco_sim.offscreen import Offscreen
from mujoco_sim.sensor_tags import CameraTag
from mujoco_sim.world import World

# The middles of 256 equally likely parts of a normal distribution: one for each random byte.
_NORMAL = np.array([NormalDist().inv_cdf((byte + 0.5) / 256.0) for byte in range(256)])
_NORMAL /= _NORMAL.std()


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
