# SPDX-License-Identifier: Apache-2.0
"""What else the node offers: odometry to be set, diagnostics, names, limits, its parameters."""

import math
import re

from descriptions import robot_named
from diagnostic_msgs.msg import DiagnosticArray
from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from diff_drive_sim.drive import DiffDrive
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import load_robot
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from wasd_core.ros_parameters import misspelt_parameters

pytestmark = pytest.mark.slow

DT = 0.005


@pytest.fixture
def make(spawn, mbot):
    """Return a function that makes the face of a drive with parameters."""

    def make(robot=mbot, **parameters):
        overrides = [
            Parameter(name.replace('__', '.'), value=value) for name, value in parameters.items()
        ]
        return spawn(DiffDriveControllerNode(DiffDrive(robot), parameter_overrides=overrides))

    return make


@pytest.fixture
def peer(spawn):
    return spawn(Node('peer'))


def drive(node, linear, angular, duration, start=(0.0, 0.0)):
    """Command a velocity and let the wheels do as the controller wants; return their angles."""
    angles = np.array(start)
    for _ in range(round(duration / DT)):
        node.controller.command(linear, angular)
        node.unit.control(*angles, DT)
        angles += DT * np.array(node.controller.geometry.wheel_speeds(*node.controller.velocity))
    return angles


def pose(x, y, yaw, frame='odom'):
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z = math.sin(0.5 * yaw)
    message.pose.pose.orientation.w = math.cos(0.5 * yaw)
    message.pose.covariance[0] = 0.04
    return message


def test_odometry_is_reset_by_a_service_while_driving_without_a_spike(
    make, peer, spawn, spin_until
):
    node = make()
    client = peer.create_client(Trigger, 'diff_drive_controller/reset_odometry')
    spin_until(spawn.pump, client.service_is_ready)
    angles = drive(node, 0.5, 0.3, 1.5)
    before = node.controller.odometry_state
    assert before.x > 0.3
    future = client.call_async(Trigger.Request())
    spin_until(spawn.pump, future.done)
    assert future.result().success
    state = node.controller.odometry_state
    assert (state.x, state.y, state.yaw) == (0.0, 0.0, 0.0)
    assert (state.linear, state.angular) == (before.linear, before.angular)
    assert node.controller.covariance.xx == 0.0
    drive(node, 0.5, 0.3, 2 * DT, angles)
    state = node.controller.odometry_state
    assert state.linear == pytest.approx(0.5, rel=1e-6)
    assert state.x == pytest.approx(2 * 0.5 * DT, rel=1e-3)


def test_odometry_is_set_to_a_pose_and_goes_on_from_there(make, peer, spawn, spin_until):
    node = make()
    publisher = peer.create_publisher(
        PoseWithCovarianceStamped, 'diff_drive_controller/set_odometry', 10
    )
    spin_until(spawn.pump, publisher.get_subscription_count)
    publisher.publish(pose(2.0, -1.0, math.pi / 2))
    spin_until(spawn.pump, lambda: node.controller.odometry_state.x == 2.0)
    assert node.controller.covariance.xx == 0.04
    drive(node, 0.5, 0.0, 2.0)
    state = node.controller.odometry_state
    assert (state.x, state.yaw) == pytest.approx((2.0, math.pi / 2))
    assert state.y > -0.5


NO_ORIENTATION = pose(1.0, 0.0, 0.0)
NO_ORIENTATION.pose.pose.orientation.w = 0.0


@pytest.mark.parametrize(
    ('message', 'complaint'),
    [
        (pose(1.0, 0.0, 0.0, 'map'), "wanted a pose in frame 'odom', got one in 'map'"),
        (pose(math.nan, 0.0, 0.0), 'wanted a pose of finite numbers'),
        (NO_ORIENTATION, 'wanted a pose of finite numbers and an orientation that is not 0'),
    ],
)
def test_a_pose_that_is_none_is_refused(make, capfd, message, complaint):
    node = make()
    node._on_set_odometry(message)
    assert node.controller.odometry_state.x == 0.0
    assert f'set_odometry: {complaint}' in capfd.readouterr().err


def collect(peer, kind, topic):
    found = []
    peer.create_subscription(kind, topic, found.append, 10)
    return found


def test_diagnostics_have_the_keys_of_arbotix(make, peer, spawn, spin_until, tmp_path):
    path = tmp_path / 'c.yaml'
    path.write_text('controllers: {base_controller: {type: diff_controller}}')
    node = make(controller=str(path))
    found = collect(peer, DiagnosticArray, '/diagnostics')
    drive(node, 0.5, 0.0, 2.0)
    spin_until(spawn.pump, lambda: found, step=node.publish_diagnostics)
    (status,) = found[0].status
    values = {item.key: item.value for item in status.values}
    assert status.name == 'base_controller'
    assert status.message == 'driving'
    assert list(values) == ['Left', 'Right', 'dX', 'dR']
    state = node.controller.odometry_state
    assert int(values['Left']) == int(values['Right']) == pytest.approx(4100 * state.x, abs=1)
    assert float(values['dX']) == pytest.approx(0.5)


def test_odometry_has_frames_and_covariances_as_asked_for(make, peer, spawn, spin_until):
    node = make(
        odom_frame_id='world',
        pose_covariance_diagonal=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        twist_covariance_diagonal=[0.1, 0.0, 0.0, 0.0, 0.0, 0.2],
        twist_error=0.5,
        distance_variance=0.01,
    )
    found = collect(peer, Odometry, 'odom')
    spin_until(spawn.pump, lambda: node._odometry.get_subscription_count())
    drive(node, 0.5, 0.0, 2.0)
    spin_until(spawn.pump, lambda: found, step=node.publish)
    message = found[0]
    assert (message.header.frame_id, message.child_frame_id) == ('world', 'base_footprint')
    diagonal = np.diag(np.array(message.pose.covariance).reshape(6, 6))
    x = node.controller.odometry_state.x
    assert diagonal[0] == pytest.approx(1.0 + 0.01 * x)
    np.testing.assert_array_equal(diagonal[2:5], [3.0, 4.0, 5.0])
    # Half of 0.5 m/s is a standard deviation.
    assert message.twist.covariance[0] == pytest.approx(0.1 + 0.25**2)
    assert message.twist.covariance[35] == pytest.approx(0.2)


def test_the_limited_velocity_is_published_when_asked_for(make, peer, spawn, spin_until):
    node = make(publish_limited_velocity=True, linear__x__max_velocity=0.3)
    found = collect(peer, TwistStamped, 'diff_drive_controller/cmd_vel_out')
    drive(node, 5.0, 0.0, 1.0)
    spin_until(spawn.pump, lambda: found, step=node.publish)
    assert found[0].twist.linear.x == pytest.approx(0.3)
    assert found[0].header.frame_id == 'base_footprint'


def test_in_a_simulation_it_adds_the_names_of_arbotix(make, peer, spawn, spin_until):
    node = make(joint_names='both')
    found = collect(peer, JointState, 'joint_states')
    spin_until(spawn.pump, lambda: node._wheel_states.get_subscription_count())
    angles = drive(node, 0.5, 0.0, 2.0)
    spin_until(spawn.pump, lambda: found, step=node.publish)
    assert found[0].name == ['base_l_wheel_joint', 'base_r_wheel_joint']
    # The angle times the radius is the path; one step has been turned since.
    assert 0.06 * found[0].position[0] == pytest.approx(node.controller.odometry_state.x, rel=1e-9)
    assert found[0].position[0] == pytest.approx(angles[0], rel=0.01)
    assert list(found[0].velocity) == pytest.approx([0.5 / 0.06] * 2)


def test_a_width_that_contradicts_the_description_is_used_and_said_with_its_ratio(make, capfd):
    node = make(base_width=0.26)
    assert node.controller.geometry.wheel_separation == 0.26
    assert node.get_parameter('wheel_separation').value == 0.26
    said = capfd.readouterr().err
    assert (
        'wheel_separation is 0.26 m, but 0.38 m in the description: using 0.26 (ratio 0.684)'
        in said
    )
    assert said.count('(ratio') == 1


def test_what_is_given_to_ros_comes_before_the_file(make, tmp_path, capfd):
    path = tmp_path / 'c.yaml'
    path.write_text('Kp: 9\nKd: 8\ncmd_vel_timeout: 0.3\nport: /dev/x')
    node = make(controller=str(path), Kd=7.0, timeout=0.9)
    assert (node.settings.Kp, node.settings.Kd, node.settings.cmd_vel_timeout) == (9.0, 7.0, 0.9)
    assert 'parameters without a meaning here: port' in ''.join(capfd.readouterr())


def test_an_unknown_parameter_is_said_with_its_neighbour(make):
    said = "unknown parameter 'base_widht', did you mean base_width?: ignored"
    assert misspelt_parameters(make(base_widht=0.3, timeout=1.0, port='/dev/null')) == [said]


@pytest.mark.parametrize(
    ('frame', 'note'),
    [
        ('base_link', "base_frame_id 'base_link' has a parent already, it moves with"),
        ('chassis', "base_frame_id 'chassis' is no link of the description, it moves with"),
    ],
)
def test_a_base_frame_that_breaks_the_tree_is_said(make, capfd, frame, note):
    make(base_frame_id=frame)
    assert note in capfd.readouterr().err


@pytest.mark.parametrize(
    ('prefix', 'frame'),
    [
        ('robot1/', ''),
        ('robot1/', 'robot1/base_footprint'),
        ('a/b/', 'a/b/base_footprint'),
        ('', 'robot1/base_footprint'),
    ],
)
def test_a_prefix_of_links_or_of_frames_breaks_no_tree(make, mbot, tmp_path, capfd, prefix, frame):
    names = '|'.join(mbot.links)
    path = tmp_path / 'prefixed.urdf'
    path.write_text(re.sub(f'"({names})"', rf'"{prefix}\1"', robot_named('mbot').urdf))
    make(load_robot(str(path)).robot, base_frame_id=frame)
    assert '/tf is no tree' not in capfd.readouterr().err


def test_gains_and_limits_can_be_set_while_it_drives_and_signs_are_checked(make):
    node = make()
    drive(node, 0.2, 0.0, 0.2)

    def set_to(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0]

    assert set_to('linear.x.max_deceleration', -4.0).successful
    assert set_to('Kp', 20.0).successful
    assert node.unit._drive._loops[0].gains.Kp == 20.0
    assert node.controller.velocity.linear == pytest.approx(0.2)
    node.controller.command(0.0, 0.0)
    node.unit.control(0.0, 0.0, DT)
    assert node.controller.velocity.linear == pytest.approx(0.2 - 4.0 * DT)
    assert 'must be >= -1000 and <= -0.001' in set_to('linear.x.max_deceleration', 4.0).reason
    assert set_to('linear.x.max_velocity', math.nan).successful
    assert set_to('mode', 'fake').reason


def test_somebody_elses_joints_on_joint_states_are_no_news(spawn, capfd):
    node = spawn(DiffDriveControllerNode())
    node._on_joint_states(JointState(name=['arm_joint'], position=[1.0]))
    assert 'lacks' not in capfd.readouterr().err


def test_the_file_of_an_arbotix_drives(make, tmp_path):
    path = tmp_path / 'c.yaml'
    path.write_text(
        'controllers: {c: {type: diff_controller, ticks_meter: 4100, Kp: 12, Kd: 12, Ki: 0, '
        'Ko: 50, accel_limit: 1.0}}'
    )
    node = make(controller=str(path), mode='arbotix')
    assert node.unit.update_rate == 500.0
    node.cmd_vel.hear(_twist(0.5))
    wheels = [node.unit.control(0.0, 0.0, 0.002).velocity[0] for _ in range(500)]
    # A blocked wheel gets more and more, in steps of the board's PWM.
    assert wheels[-1] > wheels[100] > 0.0
    pwm = np.array(wheels) * 255.0 / 25.0
    np.testing.assert_allclose(pwm, np.round(pwm), atol=1e-9)


def _twist(linear):
    message = Twist()
    message.linear.x = linear
    return message
