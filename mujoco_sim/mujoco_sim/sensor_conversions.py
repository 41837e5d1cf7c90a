# SPDX-License-Identifier: Apache-2.0
"""What lidars and cameras measure, as messages."""

import array

from builtin_interfaces.msg import Time
import numpy as np
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image
from sensor_msgs.msg import LaserScan

from mujoco_sim.camera import Camera
from mujoco_sim.lidar import Lidar

# Of colours and of depths [m], by REP 118.
ENCODINGS = ('rgb8', '32FC1')


def to_laser_scan(lidar: Lidar, ranges: np.ndarray, stamp: Time) -> LaserScan:
    """Return sensor_msgs/LaserScan; all rays are of one instant."""
    tag = lidar.tag
    message = LaserScan()
    message.header.stamp = stamp
    message.header.frame_id = tag.frame
    message.angle_min = tag.min_angle
    message.angle_max = tag.max_angle
    message.angle_increment = lidar.angle_increment
    message.scan_time = 1.0 / tag.rate
    message.range_min = tag.min_range
    message.range_max = tag.max_range
    message.ranges = array.array('f', ranges.astype(np.float32).tobytes())
    return message


def to_image(pixels: np.ndarray, encoding: str, frame: str, stamp: Time) -> Image:
    """Return sensor_msgs/Image of pixels, shape (height, width) or (height, width, channels)."""
    message = Image()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding
    message.is_bigendian = 0
    message.step = pixels[0].nbytes
    message.data = array.array('B', pixels.tobytes())
    return message


def to_camera_info(camera: Camera, stamp: Time) -> CameraInfo:
    """Return sensor_msgs/CameraInfo of a pinhole without distortion."""
    focal, (x, y) = camera.focal_length, camera.centre
    message = CameraInfo()
    message.header.stamp = stamp
    message.header.frame_id = camera.tag.frame
    message.height, message.width = camera.height, camera.width
    message.distortion_model = 'plumb_bob'
    message.d = [0.0] * 5
    message.k = [focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [focal, 0.0, x, 0.0, 0.0, focal, y, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message
