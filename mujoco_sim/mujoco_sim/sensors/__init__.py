# SPDX-License-Identifier: Apache-2.0
"""What sensors share: their tags in a URDF, where they are mounted, and the site they are on."""

from collections.abc import Callable
from dataclasses import dataclass
import re
from typing import Any, NamedTuple
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
from robot_description.robot import Robot
from wasd_core.rotations import Pose, rpy_matrix

from mujoco_sim.world import World
from robot_description import sensor_tags

# What noise is drawn with; None where sensors tell the truth.
Random = np.random.Generator | None
# What a message says, by the names of its fields; the header is the publisher's affair.
Fields = dict[str, Any]
# No sensor measures less often [Hz].
SLOWEST = 0.001


@dataclass(frozen=True, kw_only=True)
class SensorTag:
    """A sensor: `pose` is its own frame, x ahead, in the link's; `frame` is what it stamps."""

    name: str
    link: str
    pose: Pose
    frame: str
    rate: float  # [Hz] of simulated time


class TagReader:
    """Reads one `<sensor>` that is not broken: numbers, names of topics and frames."""

    def __init__(self, tag: ElementTree.Element, link: str, notes: list[str]) -> None:
        """Take the tag, its link, and where to say what of it is not simulated."""
        self.tag = tag
        self.kind = tag.get('type', '')
        self.notes = notes
        self.name = tag.get('name', '') or tag.get('type', '')
        self.link = link

    def number(self, tail: str, default: float) -> float:
        """
        Return a number by its path in sensor_tags.BOUNDS, or the default.

        Raises:
            ValueError: it is out of its bounds.
        """
        value = sensor_tags.number(self.kind, tail, self.tag.findtext)
        return default if value is None else value

    def pair(self, low: str, high: str, defaults: tuple[float, float]) -> tuple[float, float]:
        """Return two numbers as `number` does, the lower one first whichever the tag has so."""
        one, other = (self.number(t, d) for t, d in zip((low, high), defaults, strict=True))
        return min(one, other), max(one, other)

    def _pose(self) -> Pose:
        """Return the sensor's own `<pose>` in its link; SDF writes it as x y z roll pitch yaw."""
        text = (self.tag.findtext('pose') or '').strip() or '0 0 0 0 0 0'
        x, y, z, roll, pitch, yaw = (float(word) for word in text.split())
        return Pose(np.array([x, y, z]), rpy_matrix(roll, pitch, yaw))

    def word(self, *names: str) -> str:
        """Return the text of the first of some elements of the plugin or the sensor, or ''."""
        for name in names:
            for path in (f'plugin/{name}', name):
                text = self.tag.findtext(path)
                if text and text.strip():
                    return text.strip().strip('/')
        return ''

    def remapped(self) -> str:
        """Return where a ROS 2 plugin sends its output: `<remapping>~/out:=scan</remapping>`."""
        for tag in self.tag.iterfind('plugin/ros/remapping'):
            ours, _, theirs = (tag.text or '').strip().partition(':=')
            if ours.endswith('out'):
                return theirs.strip('/')
        return ''

    def common(self, rate: float) -> dict[str, Any]:
        """Return what every SensorTag has; `rate` [Hz] is for a sensor that names none."""
        frames = ('frameName', 'frame_name', 'gz_frame_id', 'ignition_frame_id')
        return {
            'name': self.name,
            'link': self.link,
            'pose': self._pose(),
            'frame': self.word(*frames) or self.link,
            # 0 is Gazebo's word for a sensor that names none.
            'rate': max(SLOWEST, self.number('update_rate', rate) or rate),
        }


def legal_topic(topic: str) -> str:
    """Return a topic of words that ROS allows: letters, digits and `_`, no digit first."""
    words = (re.sub(r'\W', '_', word, flags=re.ASCII) for word in topic.split('/') if word)
    return '/'.join(f'_{word}' if word[0].isdigit() else word for word in words)


class Mount(NamedTuple):
    """A frame that is fixed in a body: the body's number and the frame's pose in it."""

    body: int
    pose: Pose

    def in_world(self, data: mujoco.MjData) -> Pose:
        """Return the frame's pose in the world, by the bodies' poses in `data`."""
        rotation = data.xmat[self.body].reshape(3, 3)
        return Pose(data.xpos[self.body].copy(), rotation) @ self.pose


class Snapshot:
    """
    Poses and velocities of one instant, computed aside: what physics works on is left as it is.

    `take` is free when asked again in the same instant.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._state: tuple[bytes, ...] | None = None
        self._data: mujoco.MjData | None = None

    def take(self) -> mujoco.MjData:
        """Return data with bodies, geoms and lights as they are and move now."""
        model, now = self._world.model, self._world.data
        if self._data is None:
            self._data = mujoco.MjData(model)
        parts = (now.qpos, now.qvel, now.mocap_pos, now.mocap_quat)
        state = tuple(part.tobytes() for part in parts)
        if state != self._state:
            self._state = state
            self._data.qpos[:], self._data.qvel[:] = now.qpos, now.qvel
            self._data.mocap_pos[:], self._data.mocap_quat[:] = now.mocap_pos, now.mocap_quat
            mujoco.mj_kinematics(model, self._data)
            mujoco.mj_comPos(model, self._data)
            mujoco.mj_comVel(model, self._data)
            mujoco.mj_camlight(model, self._data)
        return self._data


class Site:
    """
    What the sensors of one robot share: its world, one snapshot an instant, one renderer.

    `scale` makes all pictures smaller, also while it runs. `say` is told what cannot be measured.
    """

    def __init__(
        self,
        world: World,
        robot: Robot,
        scale: float = 1.0,
        say: Callable[[str], Any] = lambda text: None,
    ) -> None:
        self.world = world
        self.snapshot = Snapshot(world)
        self.scale = scale
        self.say = say
        self.renderer: Any = None  # a SharedRenderer, where there is a camera
        self._robot = robot

    def find_mount(self, link: str, pose: Pose) -> Mount:
        """Return where a frame with this pose in a link is in the compiled model."""
        joints = {joint.child: joint for joint in self._robot.joints.values()}
        while True:
            body = self.world.parts.body(link)
            if body >= 0:
                return Mount(body, pose)
            pose = joints[link].pose @ pose
            link = joints[link].parent

    def close(self) -> None:
        """Release the renderer, if there is one."""
        if self.renderer is not None:
            self.renderer.close()
