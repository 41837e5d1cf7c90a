# SPDX-License-Identifier: Apache-2.0
"""Read a sensor's tags from a URDF: its frame, its rate, its numbers, legal names."""

from dataclasses import dataclass
import re
from typing import Any
import xml.etree.ElementTree as ElementTree

import numpy as np
from wasd_core.rotations import Pose, rpy_matrix

from robot_description import sensor_tags

# No sensor measures less often [Hz].
SLOWEST = 0.001


@dataclass(frozen=True, kw_only=True)
class SensorTag:
    """
    A sensor: `pose` is its own frame, x ahead, in the link's; `frame` is what it stamps.

    That is its own, which is no link, where `has_own_frame`.
    """

    name: str
    link: str
    pose: Pose
    frame: str
    rate: float  # [Hz] of simulated time
    has_own_frame: bool = False


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
        # SDF writes a pose in the link as x y z roll pitch yaw.
        text = (self.tag.findtext('pose') or '').strip() or '0 0 0 0 0 0'
        x, y, z, *rpy = map(float, text.split())
        pose, named = Pose(np.array([x, y, z]), rpy_matrix(*rpy)), self.word(*frames)
        is_moved = bool(pose.position.any()) or not np.array_equal(pose.rotation, np.eye(3))
        has_own = is_moved and not named
        return {
            'name': self.name,
            'link': self.link,
            'pose': pose,
            'frame': named or (f'{self.link}/{self.name}' if has_own else self.link),
            'has_own_frame': has_own,
            # 0 is Gazebo's word for a sensor that names none.
            'rate': max(SLOWEST, self.number('update_rate', rate) or rate),
        }


def legal_topic(topic: str) -> str:
    """Return a topic of words that ROS allows: letters, digits and `_`, no digit first."""
    words = (re.sub(r'\W', '_', word, flags=re.ASCII) for word in topic.split('/') if word)
    return '/'.join(f'_{word}' if word[0].isdigit() else word for word in words)
