# SPDX-License-Identifier: Apache-2.0
"""
Numbers of a `<sensor>` tag of Gazebo: which there are, and what each of them may be.

A sensor whose tag breaks this is left out, which the simulator says, and `describe lint`, too. The
robot loads.
"""

from collections.abc import Callable
import math
from typing import NamedTuple

# Words for one thing in Gazebo Classic and in its successor.
LIDAR_TYPES = ('ray', 'gpu_ray', 'lidar', 'gpu_lidar')
COLOUR_TYPES = ('camera',)
DEPTH_TYPES = ('depth', 'depth_camera')
CAMERA_TYPES = (*COLOUR_TYPES, *DEPTH_TYPES, 'rgbd', 'rgbd_camera')
# What Gazebo has besides; another program may simulate it.
OTHER_TYPES = (
    *('imu', 'contact', 'force_torque', 'gps', 'navsat', 'altimeter', 'magnetometer', 'sonar'),
    *('multicamera', 'wideanglecamera', 'wideangle_camera', 'thermal', 'thermal_camera'),
    *('segmentation', 'segmentation_camera', 'boundingbox', 'boundingbox_camera', 'air_pressure'),
    *('air_speed', 'logical_camera', 'rfid', 'rfidtag', 'wireless_receiver', 'dvl', 'custom'),
    *('wireless_transmitter', 'transceiver', 'triggered_camera', 'environmental_sensor'),
)
NOISE_TYPES = ('none', 'gaussian', 'gaussian_quantized', 'custom')
# More than this is a typing error: rays, and pixels of an image's side.
MOST_RAYS, LARGEST_IMAGE = 100_000, 4096
# So are lengths [m], angles [rad] and rates [Hz] beyond these.
FARTHEST, WIDEST, FASTEST = 1e6, 100.0, 1e4


class Bounds(NamedTuple):
    """The least and the most that a number may be, both included."""

    least: float = -math.inf
    most: float = math.inf

    def why_not(self, text: str) -> str:
        """Return what is wrong with a number's text, in words after the number's name."""
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if math.isfinite(value) and self.least <= value <= self.most:
            return ''
        limits = [f'>= {self.least:g}'] if math.isfinite(self.least) else []
        limits += [f'<= {self.most:g}'] if math.isfinite(self.most) else []
        wanted = ' '.join(['a number', ' and '.join(limits)]).strip()
        return f'must be {wanted}, got {text!r}'


# By the path within `<ray>`, `<lidar>`, `<camera>`, or within the sensor itself.
BOUNDS = {
    'scan/vertical/samples': Bounds(0.0, MOST_RAYS),
    'scan/horizontal/samples': Bounds(1.0, MOST_RAYS),
    'scan/horizontal/min_angle': Bounds(-WIDEST, WIDEST),
    'scan/horizontal/max_angle': Bounds(-WIDEST, WIDEST),
    'range/min': Bounds(0.0, FARTHEST),
    'range/max': Bounds(0.0, FARTHEST),
    'range/resolution': Bounds(0.0, FARTHEST),
    'noise/stddev': Bounds(0.0, FARTHEST),
    'clip/near': Bounds(0.001, FARTHEST),
    'clip/far': Bounds(0.001, FARTHEST),
    'image/width': Bounds(1.0, LARGEST_IMAGE),
    'image/height': Bounds(1.0, LARGEST_IMAGE),
    'horizontal_fov': Bounds(0.01, 3.0),
    'update_rate': Bounds(0.0, FASTEST),
}
HOLDERS = {
    **dict.fromkeys(LIDAR_TYPES, ('ray', 'lidar')),
    **dict.fromkeys(CAMERA_TYPES, ('camera',)),
}
# Of each of these pairs the first is not above the second; else they were exchanged.
PAIRS = (
    ('scan/horizontal/min_angle', 'scan/horizontal/max_angle'),
    ('range/min', 'range/max'),
    ('clip/near', 'clip/far'),
)
# What finds the text of an element by its path in the sensor; None where there is none.
Find = Callable[[str], str | None]


def number(kind: str, tail: str, find: Find) -> float | None:
    """
    Return a number of a sensor's tag; None where the tag does not name it.

    Raises:
        ValueError: it is none, or out of its bounds; says which and what is wanted.
    """
    found = _first(kind, tail, find)
    if found is None:
        return None
    path, text = found
    wrong = BOUNDS[tail].why_not(text.strip())
    if wrong:
        raise ValueError(f'{path} {wrong}')
    return float(text)


def exchanged(kind: str, find: Find) -> list[str]:
    """
    Return a line for each pair of numbers whose lower one is above the upper one.

    Raises:
        ValueError: see `number`.
    """
    lines = []
    for low, high in PAIRS:
        below, above = (number(kind, tail, find) for tail in (low, high))
        if below is not None and above is not None and below > above:
            names = ' and '.join(tail.rpartition('/')[2] for tail in (low, high))
            lines.append(f'{low.rpartition("/")[0]}: {names} are exchanged ({below:g}, {above:g})')
    return lines


def why_broken(kind: str, find: Find) -> str:
    """Return what keeps a lidar or camera from being simulated, or nothing."""
    try:
        for tail in BOUNDS:
            number(kind, tail, find)
        noise = _first(kind, 'noise/type', find)
    except ValueError as error:
        return str(error)
    if noise is not None and noise[1].strip() not in NOISE_TYPES:
        return f'{noise[0]} must be one of {", ".join(NOISE_TYPES)}, got {noise[1].strip()!r}'
    pose = (find('pose') or '').strip()
    if pose and (len(pose.split()) != 6 or any(map(Bounds().why_not, pose.split()))):
        return f'pose must be 6 numbers, got {pose!r}'
    return ''


def _first(kind: str, tail: str, find: Find) -> tuple[str, str] | None:
    """Return the likeliest path of a number that the tag has, with its text."""
    paths = [f'{holder}/{tail}' for holder in HOLDERS.get(kind, ())]
    if tail in ('noise/stddev', 'noise/type', 'update_rate'):  # or in the sensor itself
        paths.append(tail)
    found = ((path, find(path)) for path in paths)
    return next(((path, text) for path, text in found if text is not None), None)
