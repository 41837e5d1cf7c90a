# SPDX-License-Identifier: Apache-2.0
"""The lidar's topics of the Go2, from the one that its description has."""

from collections.abc import Callable
import contextlib
from typing import Any

from mujoco_sim.sensors.cloud import POINT
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.sensors.mount import Fields
from mujoco_sim.world import World
import numpy as np
from quadruped_sim.elevation import Elevation
from quadruped_sim.elevation_mapper import ElevationMapper
from wasd_core.errors import InvalidMessage
from wasd_core.pose_track import PoseTrack
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import Pose
from wasd_core.timing import Beat

from unitree_bridge import topics
from unitree_bridge.cdr import decode, encode
from unitree_bridge.legs_robot import LegsRobot
from unitree_bridge.shapes import HEIGHT_MAP, IMU, ODOMETRY, POINT_CLOUD, POSE_STAMPED, STRING
from unitree_bridge.topics import Topic
from unitree_bridge.wire import Wire

CLOUD_FRAME, ODOM_FRAME, BASE_FRAME, IMU_FRAME = (
    'utlidar_lidar',
    'odom',
    'base_link',
    'utlidar_imu',
)
# What is told of each cloud.
_OF_CLOUDS = (topics.CLOUD, topics.CLOUD_DESKEWED, topics.HEIGHT_MAP)
# The numbers of sensor_msgs/PointField.
_DATATYPES = {'<f4': 7, '<u2': 4}
# A cloud takes 67 ms, a turn of a planar lidar up to 200 ms [s].
_TRACKED = 0.5
# What a cell of the height map says of which nothing is known.
EMPTY = 1e9


class LidarTopics:
    """
    Tells clouds and heights of a lidar, pose, odometry and IMU, while somebody listens.

    `rt/utlidar/switch` with OFF ends all of it, with ON it goes on.
    """

    def __init__(self, robot: LegsRobot, mount: Pose) -> None:
        """Take a robot, and where the lidar's frame is in its base."""
        self._robot, self._mount = robot, mount
        self._track = PoseTrack(_TRACKED)
        self._mapper = ElevationMapper(mount)
        self.is_on = True
        self._wire: Wire | None = None
        # What is told beside the cloud, which comes as the lidar measures, and its rate [Hz].
        self._regular: list[tuple[Topic, Beat, float, Callable[[], bytes | None]]] = [
            (topics.LIDAR_IMU, Beat(), 250.0, self._imu),
            (topics.ROBOT_POSE, Beat(), 50.0, self._pose),
            (topics.ROBOT_ODOM, Beat(), 50.0, self._odometry),
        ]

    @property
    def wants_clouds(self) -> bool:
        """Whether a cloud would be told."""
        return any(map(self._is_wanted, _OF_CLOUDS))

    def take(self, time: float, seen: Fields) -> None:
        """Tell what a lidar has seen at a simulated time [s], points or a scan, as a cloud."""
        if self._wire is None or not self.wants_clouds:
            return
        points = seen['points'] if 'points' in seen else points_of(seen)
        if self._is_wanted(topics.CLOUD):
            self._wire.publish(topics.CLOUD, encode(POINT_CLOUD, cloud(time, points)))
        if self._is_wanted(topics.CLOUD_DESKEWED):
            placed = self._deskewed(time, points)
            if placed is not None:
                told = encode(POINT_CLOUD, cloud(time, placed, ODOM_FRAME))
                self._wire.publish(topics.CLOUD_DESKEWED, told)
        # A planar lidar sees no heights.
        is_mapped = 'points' in seen and self._is_wanted(topics.HEIGHT_MAP)
        if is_mapped and self._mapper.take_cloud(time, points):
            told = encode(HEIGHT_MAP, height_map(time, self._mapper.elevation))
            self._wire.publish(topics.HEIGHT_MAP, told)

    def _is_wanted(self, topic: Topic) -> bool:
        return self.is_on and self._wire is not None and self._wire.is_heard(topic)

    def _deskewed(self, time: float, points: np.ndarray) -> np.ndarray | None:
        """Return points in odometry's frame, each seen from where the robot then was."""
        places = np.stack([points[axis] for axis in 'xyz'], axis=1, dtype=float)
        found = self._track.place(places, time + points['time'], self._mount)
        if found is None:
            return None
        deskewed = points.copy()
        for axis, values in zip('xyz', found.T, strict=True):
            deskewed[axis] = values
        return deskewed

    def step(self, wire: Wire) -> None:
        """Tell what is due."""
        self._wire = wire
        self._follow_base()
        for topic, beat, rate, make in self._regular:
            if beat.is_due(self._robot.time, rate) and self.is_on and wire.is_heard(topic):
                told = make()
                if told is not None:
                    wire.publish(topic, told)

    def take_switch(self, wire: Wire) -> None:
        """Take what has come to the switch."""
        for raw in wire.take(topics.LIDAR_SWITCH):
            with contextlib.suppress(InvalidMessage):
                said = decode(STRING, raw)['data']
                if said in ('ON', 'OFF'):
                    self.is_on = said == 'ON'

    def _follow_base(self) -> None:
        """Note where the base is, for what is told of clouds."""
        is_tracked = self._is_wanted(topics.CLOUD_DESKEWED)
        is_mapped = self._is_wanted(topics.HEIGHT_MAP)
        if not (is_tracked or is_mapped):
            return
        odometry = self._robot.odometry
        if odometry is not None and is_tracked:
            self._track.add(self._robot.time, odometry.position, odometry.orientation)
        if odometry is not None and is_mapped:
            self._mapper.take_pose(self._robot.time, odometry.position, odometry.orientation)

    def _imu(self) -> bytes:
        imu = self._robot.senses().imu
        return encode(
            IMU,
            {
                'header': header(self._robot.time, IMU_FRAME),
                'orientation': _quaternion(imu.orientation),
                'angular_velocity': _vector(imu.angular_velocity),
                'linear_acceleration': _vector(imu.linear_acceleration),
            },
        )

    def _pose(self) -> bytes | None:
        odometry = self._robot.odometry
        if odometry is None:
            return None
        stamped = {'header': header(self._robot.time, ODOM_FRAME), 'pose': _pose_of(odometry)}
        return encode(POSE_STAMPED, stamped)

    def _odometry(self) -> bytes | None:
        odometry = self._robot.odometry
        if odometry is None:
            return None
        twist = {
            'linear': _vector(odometry.linear_velocity),
            'angular': _vector(odometry.angular_velocity),
        }
        return encode(
            ODOMETRY,
            {
                'header': header(self._robot.time, ODOM_FRAME),
                'child_frame_id': BASE_FRAME,
                'pose': {
                    'pose': _pose_of(odometry),
                    'covariance': odometry.pose_covariance.ravel(),
                },
                'twist': {'twist': twist, 'covariance': odometry.twist_covariance.ravel()},
            },
        )


def serve_lidar(robot: LegsRobot, sensors: Sensors, world: World) -> LidarTopics | None:
    """Return the topics of a robot's lidar: that of points, or else a planar one; None without."""
    kinds = {topic.kind: topic for topic in reversed(sensors.topics)}
    topic = kinds.get('PointCloud2') or kinds.get('LaserScan')
    if topic is None:
        return None
    lidar = LidarTopics(robot, topic.mount.in_base(world))
    topic.listen(lidar.take, lambda: lidar.wants_clouds)
    return lidar


def header(time: float, frame: str) -> dict[str, Any]:
    """Return a header with the stamp of a simulated time [s]."""
    nanoseconds = round(1e9 * time)
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return {'stamp': {'sec': sec, 'nanosec': nanosec}, 'frame_id': frame}


def points_of(scan: Fields) -> np.ndarray:
    """Return what a planar lidar has seen as an array of POINT; `scan` is as in LaserScan."""
    ranges = np.asarray(scan['ranges'])
    seen = np.flatnonzero(np.isfinite(ranges))
    angles, ranges = scan['angle_min'] + scan['angle_increment'] * seen, ranges[seen]
    points = np.zeros(len(seen), POINT)
    points['x'], points['y'] = ranges * np.cos(angles), ranges * np.sin(angles)
    points['time'] = scan['time_increment'] * seen
    return points


def cloud(time: float, points: np.ndarray, frame: str = CLOUD_FRAME) -> dict[str, Any]:
    """Return the fields of a PointCloud2 of an array of POINT at a simulated time [s]."""
    described = points.dtype.fields
    assert described is not None
    fields = [
        {'name': name, 'offset': at, 'datatype': _DATATYPES[kind.str], 'count': 1}
        for name, (kind, at, *_) in described.items()
    ]
    return {
        'header': header(time, frame),
        'height': 1,
        'width': len(points),
        'fields': fields,
        'point_step': points.dtype.itemsize,
        'row_step': points.dtype.itemsize * len(points),
        'data': points.tobytes(),
        'is_dense': True,
    }


def height_map(time: float, elevation: Elevation) -> dict[str, Any]:
    """Return the fields of a HeightMap: x is fastest, the origin the middle of the first cell."""
    return {
        'stamp': time,
        'frame_id': ODOM_FRAME,
        'resolution': elevation.resolution,
        'width': elevation.count,
        'height': elevation.count,
        'origin': elevation.corner + 0.5 * elevation.resolution,
        'data': np.nan_to_num(elevation.heights(), nan=EMPTY).astype('<f4').ravel(),
    }


def _pose_of(odometry: BaseOdometry) -> dict[str, dict[str, float]]:
    return {
        'position': _vector(odometry.position),
        'orientation': _quaternion(odometry.orientation),
    }


def _vector(numbers: np.ndarray) -> dict[str, float]:
    return dict(zip('xyz', numbers.tolist(), strict=True))


def _quaternion(numbers: np.ndarray) -> dict[str, float]:
    return dict(zip('wxyz', numbers.tolist(), strict=True))
