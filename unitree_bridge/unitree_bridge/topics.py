# SPDX-License-Identifier: Apache-2.0
"""The topics of the Go2 that there are here, in either direction."""

from typing import NamedTuple

from unitree_bridge import shapes
from unitree_bridge.shapes import Shape


class Topic(NamedTuple):
    """A topic: its name on the wire, its messages, and how many of them wait to be taken."""

    name: str
    shape: Shape
    depth: int = 1


LOW_STATE = Topic('rt/lowstate', shapes.LOW_STATE)
SPORT_MODE_STATE = Topic('rt/sportmodestate', shapes.SPORT_MODE_STATE)
# The same, seldom: what programs listen to over a radio link.
SLOW_LOW_STATE = Topic('rt/lf/lowstate', shapes.LOW_STATE)
SLOW_SPORT_STATE = Topic('rt/lf/sportmodestate', shapes.SPORT_MODE_STATE)
REMOTE = Topic('rt/wirelesscontroller', shapes.WIRELESS_CONTROLLER)
CLOUD = Topic('rt/utlidar/cloud', shapes.POINT_CLOUD)
CLOUD_DESKEWED = Topic('rt/utlidar/cloud_deskewed', shapes.POINT_CLOUD)
HEIGHT_MAP = Topic('rt/utlidar/height_map_array', shapes.HEIGHT_MAP)
LIDAR_IMU = Topic('rt/utlidar/imu', shapes.IMU)
ROBOT_POSE = Topic('rt/utlidar/robot_pose', shapes.POSE_STAMPED)
ROBOT_ODOM = Topic('rt/utlidar/robot_odom', shapes.ODOMETRY)
VIDEO = Topic('rt/frontvideostream', shapes.FRONT_VIDEO)
OUT = (LOW_STATE, SPORT_MODE_STATE, SLOW_LOW_STATE, SLOW_SPORT_STATE, REMOTE, VIDEO)
LIDAR_OUT = (CLOUD, CLOUD_DESKEWED, HEIGHT_MAP, LIDAR_IMU, ROBOT_POSE, ROBOT_ODOM)

LOW_CMD = Topic('rt/lowcmd', shapes.LOW_CMD)
LIDAR_SWITCH = Topic('rt/utlidar/switch', shapes.STRING)
IN = (LOW_CMD, REMOTE)

# Requests that wait: more than a client that waits for each answer ever has.
_REQUESTS = 64


def request(service: str) -> Topic:
    """Return where a service is asked."""
    return Topic(f'rt/api/{service}/request', shapes.REQUEST, _REQUESTS)


def response(service: str) -> Topic:
    """Return where a service answers."""
    return Topic(f'rt/api/{service}/response', shapes.RESPONSE)
