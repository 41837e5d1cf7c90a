# SPDX-License-Identifier: Apache-2.0
import xml.etree.ElementTree as ElementTree

from builtin_interfaces.msg import Time
import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_description.description import load_robot, read_description
from robot_description.meshes.files import opened_by_rviz
from robot_description.morphology.wheel_file import read_wheel_choice
from robot_description.packages import description_path, DESCRIPTIONS
from robot_description.parameters import state_publisher
from robot_description.state_publisher_node import StatePublisherNode
from robot_description.xacro.session import expand_document
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from wasd_core.node import init_ros
from wasd_core.topics import TfBroadcaster

pytestmark = pytest.mark.slow

WHEEL = 'left_wheel_joint'


@pytest.fixture
def mbot():
    return read_description(description_path('mbot'))


@pytest.fixture
def sent(monkeypatch):
    """Collect what would go on /tf and /tf_static, whether or not the message type exists."""
    transforms = []
    monkeypatch.setattr(TfBroadcaster, 'send', lambda self, these: transforms.append(list(these)))
    return transforms


def test_the_description_reaches_who_comes_late(spawn, spin_until):
    spawn(StatePublisherNode())
    for _ in range(5):
        spawn.pump.handle(0.02)
    late, received = spawn(Node('late')), []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    late.create_subscription(String, 'robot_description', received.append, latched)
    spin_until(spawn.pump, lambda: received)
    assert received[0].data == expand_document(description_path('mbot')).urdf


@pytest.mark.parametrize('name', DESCRIPTIONS)
def test_rviz_finds_every_mesh_of_what_is_published(name, spawn, spin_until):
    spawn(StatePublisherNode(read_description(description_path(name))))
    listener, received = spawn(Node('rviz')), []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    listener.create_subscription(String, 'robot_description', received.append, latched)
    spin_until(spawn.pump, lambda: received)
    meshes = [tag.get('filename') for tag in ElementTree.fromstring(received[0].data).iter('mesh')]
    assert bool(meshes) == (name == 'go2')
    assert [url for url in meshes if opened_by_rviz(url) is None] == []


def test_fixed_joints_are_sent_once_at_start(sent, spawn, mbot):
    spawn(StatePublisherNode(mbot))
    (fixed,) = sent
    places = {message.child_frame_id: message for message in fixed}
    assert set(places) == {'base_link', 'laser_link', 'camera_link', 'camera_optical_frame'}
    assert places['base_link'].header.frame_id == 'base_footprint'
    assert places['base_link'].transform.translation.z == pytest.approx(0.11)


def test_a_joint_turns_its_child_about_its_axis(sent, spawn, mbot):
    node = spawn(StatePublisherNode(mbot))
    stamp = Time(sec=7)
    node.publish((WHEEL,), np.array([np.pi / 2]), stamp)
    (wheel,) = sent[-1]
    assert wheel.header.stamp == stamp
    assert (wheel.header.frame_id, wheel.child_frame_id) == ('base_link', 'left_wheel_link')
    assert wheel.transform.translation.y == 0.19
    assert wheel.transform.rotation.y == pytest.approx(np.sqrt(0.5))


def test_with_a_robot_that_it_is_given_it_listens_to_no_joints(spawn, mbot):
    assert spawn(StatePublisherNode(mbot)).count_subscribers('joint_states') == 0


def test_joint_states_move_the_links(sent, spawn, spin_until):
    spawn(StatePublisherNode())
    robot = spawn(Node('robot'))
    publisher = robot.create_publisher(JointState, 'joint_states', 10)
    spin_until(spawn.pump, lambda: publisher.get_subscription_count() > 0)
    publisher.publish(JointState(name=[WHEEL], position=[0.5]))
    spin_until(spawn.pump, lambda: len(sent) == 2)
    assert [transform.child_frame_id for transform in sent[-1]] == ['left_wheel_link']


def test_fast_joint_states_become_a_few_transforms_at_the_instants_of_odometry(sent, spawn):
    node = spawn(StatePublisherNode())
    message = JointState(name=[WHEEL], position=[0.5])
    for tick in range(503, 1003):  # 500 Hz for 1 s, joined at some time
        nanoseconds = 2_000_000 * tick
        message.header.stamp = Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        node._on_joint_states(message)
    stamps = [moved[0].header.stamp for moved in sent[1:]]
    ticks = [stamp.sec * 10**9 + stamp.nanosec for stamp in stamps]
    assert len(ticks) in (50, 51)
    assert {tick % 20_000_000 for tick in ticks[1:]} == {0}
    node.set_parameters([Parameter('publish_frequency', value=10.0)])
    assert node.settings.publish_frequency == 10.0


def test_joint_states_without_positions_do_no_harm(sent, spawn, spin_until):
    spawn(StatePublisherNode())
    robot = spawn(Node('robot'))
    publisher = robot.create_publisher(JointState, 'joint_states', 10)
    spin_until(spawn.pump, lambda: publisher.get_subscription_count() > 0)
    publisher.publish(JointState(name=[WHEEL], velocity=[0.5]))
    publisher.publish(JointState(name=[WHEEL], position=[0.5]))
    spin_until(spawn.pump, lambda: len(sent) == 2)


def test_an_unknown_joint_is_reported_once_and_the_others_move(sent, spawn, mbot, capfd):
    node = spawn(StatePublisherNode(mbot))
    for _ in range(3):
        node.publish(('base_l_wheel_joint', WHEEL), np.zeros(2), Time())
        assert [transform.child_frame_id for transform in sent[-1]] == ['left_wheel_link']
    said = capfd.readouterr().err
    assert said.count("joint 'base_l_wheel_joint' of joint_states is not in the description") == 1
    assert "rename it to 'left_wheel_joint'" in said


def test_without_tf2_msgs_it_says_so_once_and_goes_on(spawn, mbot, capfd, monkeypatch):
    monkeypatch.setattr(TfBroadcaster, '_reported', False)
    monkeypatch.setattr('wasd_core.topics.tf_message_type', lambda: None)
    node = spawn(StatePublisherNode(mbot))
    node.publish((WHEEL,), np.zeros(1), Time())
    assert capfd.readouterr().err.count('tf2_msgs is not installed: /tf is not published') == 1


def test_in_a_sourced_ros_the_hint_is_the_package_of_apt(spawn, mbot, capfd, monkeypatch):
    monkeypatch.setattr(TfBroadcaster, '_reported', False)
    monkeypatch.setattr('wasd_core.topics.tf_message_type', lambda: None)
    monkeypatch.setenv('ROS_DISTRO', 'jazzy')
    spawn(StatePublisherNode(mbot))
    said = capfd.readouterr().err
    assert 'sudo apt install ros-jazzy-tf2-msgs' in said
    assert 'build_interfaces' not in said


SPRUNG_WHEEL = """
<link name="{side}_arm"/><joint name="{side}_spring" type="prismatic"><parent link="base"/>
<child link="{side}_arm"/><origin xyz="{x} {y} 0.1"/><axis xyz="0 0 1"/>
<limit lower="-0.01" upper="0.01" effort="0" velocity="1"/></joint>
<link name="{side}_wheel"><inertial><mass value="0.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin rpy="1.5707963 0 0"/><geometry><cylinder radius="0.1" length="0.04"/></geometry>
</collision></link><joint name="{side}_wheel" type="continuous"><parent link="{side}_arm"/>
<child link="{side}_wheel"/><axis xyz="0 1 0"/></joint>
"""


def sprung(folder, sides):
    """Write a robot whose wheels (side, x and y [m]) are sprung; return its file."""
    parts = ''.join(SPRUNG_WHEEL.format(side=side, x=x, y=y) for side, x, y in sides)
    file = folder / 'sprung.urdf'
    file.write_text(
        '<robot name="sprung"><link name="base"><inertial><mass value="5"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'</link>{parts}</robot>'
    )
    return file


def movable(holder):
    """Return the names of the joints that move."""
    robot = getattr(holder, 'robot', None) or holder._robot
    return tuple(joint.name for joint in robot.movable_joints)


def test_alone_it_places_every_link_of_a_robot_whose_wheels_are_sprung(
    sent, spawn, tmp_path, monkeypatch
):
    sides = (('left', 0.0, 0.15), ('right', 0.0, -0.15))
    file = sprung(tmp_path, sides)
    moving = ('left_wheel', 'right_wheel')
    monkeypatch.setattr('robot_description.state_publisher_node.description_path', lambda _: file)
    node = spawn(StatePublisherNode())
    assert movable(load_robot(str(file))) == moving  # what a simulator tells
    node.publish(moving, np.zeros(2), Time())
    placed = {message.child_frame_id: message for messages in sent for message in messages}
    assert set(placed) == {f'{side}_{part}' for side, *_ in sides for part in ('arm', 'wheel')}
    assert placed['left_arm'].transform.translation.y == pytest.approx(0.15)


def test_it_holds_the_springs_of_the_wheels_that_a_controller_s_file_names(isolated_ros, tmp_path):
    sides = [(f'{end}_{side}', x, y)
             for end, x in (('front', 0.2), ('rear', -0.2))
             for side, y in (('left', 0.15), ('right', -0.15))]  # fmt: skip
    file, wheels = sprung(tmp_path, sides), tmp_path / 'wheels.yaml'
    wheels.write_text(
        'left_wheel_names: [front_left_wheel]\nright_wheel_names: [front_right_wheel]\n'
    )
    init_ros(['--ros-args', '-p', f'description:={file}', '-p', f'controller:={wheels}'])
    node = StatePublisherNode()
    simulated = load_robot(str(file), wheels=read_wheel_choice(str(wheels)))
    assert 'front_left_spring' not in movable(simulated)
    assert movable(node) == movable(simulated)
    node.destroy_node()
    rclpy.try_shutdown()


def test_a_description_that_is_not_there_ends_with_one_line(isolated_ros, capsys):
    assert state_publisher(['--ros-args', '-p', 'description:=dog']) == 2
    said = capsys.readouterr().err
    assert said.startswith('error: dog: no such file')
    assert said.count('\n') == 1
