# SPDX-License-Identifier: Apache-2.0
"""Topics `elevation` and `height_scan`, of a run and of a node alone, while somebody listens."""

import array

import numpy as np
import pytest
from quadruped_sim.elevation_publisher import CloudInput, ElevationPublisher, to_points
from rclpy.node import Node
from robot_description.description import load_robot
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions
from wasd_core.messages import to_cloud, to_stamp
from wasd_core.node import MessagePump
from wasd_core.robot_io import BaseOdometry

pytestmark = pytest.mark.slow


def layers(message):
    """Return a cloud's fields as arrays (rows, columns), all numbers of four bytes."""
    names = [field.name for field in message.fields]
    numbers = np.frombuffer(message.data, '<f4')
    shaped = numbers.reshape(message.height, message.width, len(names))
    return {name: shaped[..., at] for at, name in enumerate(names)}


def test_a_run_tells_heights_of_the_stairs_ahead_while_somebody_listens(ros):
    keys = tuple(parse_key_script('0.1 2', 'keys'))
    session = make_ros_run(
        RunOptions(
            robot='go2',
            description='go2',
            preset='unitree',
            world='stairs:0.13',
            keys=keys,
            speed=0.0,
        )
    )
    pump, peer, maps, scans = MessagePump(), Node('peer'), [], []
    try:
        pump.add_node(peer)
        sensors = session.robots[0].sensors
        cast = []
        topic = next(topic for topic in sensors.topics if topic.kind == 'PointCloud2')
        topic.listen(lambda now, fields: cast.append(now), lambda: False)
        session.simulation.advance(1300)
        lidar = next(one.sensor for one in sensors._sensors if topic in one.topics.values())
        assert not lidar.is_turning  # nobody listens: no ray is cast
        peer.create_subscription(PointCloud2, 'elevation', maps.append, 10)
        peer.create_subscription(PointCloud2, 'height_scan', scans.append, 10)
        for _ in range(200):
            session.simulation.advance(10)
            pump.handle(0.02 if not maps else 0.0)
        assert maps
        assert scans
        robot = session.robots[0]
        off = robot.odometry.position - robot.world.base().position
        told = layers(maps[-1])
        assert (maps[-1].header.frame_id, maps[-1].height, maps[-1].width) == ('odom', 100, 100)
        known = np.isfinite(told['z'])
        assert known.mean() > 0.1
        assert (told['variance'][known] > 0.0).all()
        assert np.allclose(np.diff(told['x'], axis=1), 0.04, atol=1e-5)
        assert np.allclose(np.diff(told['y'], axis=0), 0.04, atol=1e-5)
        x, z = told['x'][known] - off[0], told['z'][known] - off[2]
        assert abs(np.median(z[x < 0.7])) < 0.01
        assert abs(np.median(z[(x > 0.86) & (x < 1.0)]) - 0.13) < 0.015
        scan = layers(scans[-1])
        assert scan['scan'].shape == (11, 17)
        height = robot.odometry.position[2]
        assert np.allclose(scan['scan'], height - scan['z'] - 0.5, atol=0.01, equal_nan=True)
        assert np.isfinite(scan['z']).sum() > 20
        peer.destroy_node()
    finally:
        pump.shutdown(timeout_sec=0.0)
        session.close()


def odometry():
    """Return one that stands level, 30 cm high."""
    still = np.zeros(3)
    place, identity = np.array([0.0, 0.0, 0.3]), np.array([1.0, 0.0, 0.0, 0.0])
    return BaseOdometry(place, identity, still, still, np.eye(6), np.eye(6))


POINT = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('ring', '<u2'), ('time', '<f4')])


def cloud(frame='base'):
    """Return a cloud with one point on the floor, seen from the base."""
    points = np.zeros(1, POINT)
    points['x'], points['z'] = 0.5, -0.3
    header = Header(stamp=to_stamp(1.0), frame_id=frame)
    return to_cloud(points[None], header)


def test_a_node_of_its_own_takes_points_only_while_somebody_wants_heights(spawn, spin_until):
    node, peer = spawn(Node('legs')), spawn(Node('peer'))
    heights, heard, maps = ElevationPublisher(node), [], []
    robot = load_robot('go2').robot

    def tell(elevation, stamp):
        maps.append(elevation)
        heights.publish_map(elevation, 'odom', stamp)

    clouds = CloudInput(node, robot, lambda: heights.is_wanted, tell)
    points = peer.create_publisher(PointCloud2, 'points', 10)

    def step():
        heights.look()
        clouds.step(1.0, odometry())
        points.publish(cloud())

    step()
    assert 'points' not in {one.topic_name.strip('/') for one in node.subscriptions}
    subscription = peer.create_subscription(PointCloud2, 'elevation', heard.append, 10)
    spin_until(spawn.pump, lambda: heard, step=step)
    assert maps[-1].at(0.5, 0.0) == pytest.approx(0.0, abs=1e-6)
    peer.destroy_subscription(subscription)
    spin_until(spawn.pump, lambda: clouds._clouds is None, step=step)


def test_a_cloud_of_a_lidar_that_is_not_fixed_to_the_base_is_refused_in_a_line(spawn, capfd):
    robot, maps = load_robot('go2').robot, []
    clouds = CloudInput(spawn(Node('legs')), robot, lambda: True, lambda *told: maps.append(told))
    clouds.step(1.0, odometry())
    for _ in range(3):
        clouds._on_cloud(cloud('FL_calf'))
    assert not maps
    assert capfd.readouterr().err.count('points: FL_calf is no link fixed to the base') == 1


def test_a_cloud_that_is_none_is_not_taken():
    whole = cloud()
    assert to_points(whole)['x'] == np.float32(0.5)
    for change in ({'point_step': 4}, {'width': 9}, {'is_bigendian': True}, {'fields': []}):
        message = cloud()
        for name, value in change.items():
            setattr(message, name, value)
        assert to_points(message) is None
    message = cloud()
    message.data = array.array('B')
    assert to_points(message) is None
