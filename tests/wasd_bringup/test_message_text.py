# SPDX-License-Identifier: Apache-2.0
"""Messages as text in ros2cli's form, and requests from YAML."""

import math

from cases import for_all
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped
import pytest
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import ByteMultiArray
from std_srvs.srv import SetBool
from wasd_bringup.tools.graph.rate import RateMeter
from wasd_bringup.tools.graph.ros_graph import find_type, full_name
from wasd_bringup.tools.messages import field_of, fill, to_plain, to_yaml
from wasd_core.errors import UserError
import yaml


def find_message(name: str) -> type:
    return find_type(name, 'msg')


def test_a_message_reads_as_ros2_topic_echo_prints_it() -> None:
    message = JointState(name=['left', 'right'], position=[1.0, -0.5])
    message.header.stamp.sec = 3
    assert to_yaml(message) == (
        "header:\n  stamp:\n    sec: 3\n    nanosec: 0\n  frame_id: ''\n"
        'name:\n- left\n- right\nposition:\n- 1.0\n- -0.5\nvelocity: []\neffort: []\n'
    )


def test_a_byte_and_a_fixed_array_read_as_ros2_topic_echo_prints_them() -> None:
    assert to_yaml(DiagnosticStatus(level=b'\x02')).startswith('level: "\\x02"\n')
    assert to_plain(Imu())['orientation_covariance'] == [0.0] * 9


def test_long_arrays_and_texts_are_cut_unless_asked_for_whole() -> None:
    message = JointState(position=[0.0] * 200, name=['x' * 200])
    cut = to_plain(message, 128)
    assert (len(cut['position']), cut['position'][-1]) == (129, '...')
    assert cut['name'] == ['x' * 128 + '...']
    assert to_plain(message)['position'] == [0.0] * 200


@for_all(
    ('path', 'text'),
    [
        ('pose.position.x', '2.5\n'),
        ('header.frame_id', 'odom\n'),
        ('pose.position', 'x: 2.5\ny: 0.0\nz: 0.0\n'),
    ],
)
def test_a_field_is_found_by_its_path(path: str, text: str) -> None:
    message = PoseStamped()
    message.header.frame_id = 'odom'
    message.pose.position.x = 2.5
    assert to_yaml(field_of(message, path)) == text


def test_an_element_is_found_by_its_index() -> None:
    message = JointState(position=[1.0, 2.0])
    assert field_of(message, 'position[1]') == 2.0
    with pytest.raises(UserError, match='no element 2 of position'):
        field_of(message, 'position[2]')


@for_all('path', ['pose.positio', 'pose..x', 'position.x', '', 'pose.position.x.y'])
def test_a_wrong_path_is_refused(path: str) -> None:
    with pytest.raises(UserError, match='--field'):
        field_of(PoseStamped(), path)


@for_all('text', ['1e-1', '1E-1', '+1.e-1', '0.1', '1.0e-01'])
def test_a_number_may_have_an_exponent_as_people_write_it(text: str) -> None:
    pose = PoseStamped()
    fill(pose, yaml.safe_load(f'{{pose: {{position: {{x: {text}}}}}}}'), find_message)
    assert pose.pose.position.x == 0.1


def test_what_was_written_fills_the_same_message_again() -> None:
    message = PoseArray()
    message.header.frame_id = 'map'
    message.poses = [PoseStamped().pose, PoseStamped().pose]
    message.poses[1].position.y = -3.0
    again = PoseArray()
    fill(again, yaml.safe_load(to_yaml(message)), find_message)
    assert again == message
    covariance = Imu()
    fill(covariance, {'orientation_covariance': list(range(9))}, find_message)
    assert covariance.orientation_covariance.tolist() == list(range(9))


@for_all(
    ('message', 'values', 'said'),
    [
        (SetBool.Request(), {'dat': True}, 'did you mean data'),
        (SetBool.Request(), {'data': 1}, 'data: wanted boolean, got 1'),
        (SetBool.Request(), 'true', 'wanted fields as'),
        (PoseStamped(), {'pose': {'position': {'x': 'far'}}}, 'pose.position.x: wanted double'),
        (PoseArray(), {'poses': {'x': 1}}, 'poses: wanted sequence'),
        (Imu(), {'orientation_covariance': [1.0]}, 'orientation_covariance: wanted double'),
        (PoseStamped(), {'header': {'stamp': {'sec': 0.5}}}, 'header.stamp.sec: wanted int32'),
        (
            PoseStamped(),
            {'header': {'stamp': {'sec': math.inf}}},
            'header.stamp.sec: wanted int32',
        ),
        (
            PoseStamped(),
            {'header': {'stamp': {'sec': math.nan}}},
            'header.stamp.sec: wanted int32',
        ),
        (ByteMultiArray(), {'data': [300]}, 'wanted octet'),
        (PoseStamped(), {'header': {'stamp': {'sec': 2**31}}}, 'wanted int32, -2147483648 to 21'),
        (PoseStamped(), {'header': {'stamp': {'nanosec': -1}}}, 'wanted uint32, 0 to 4294967295'),
    ],
)
def test_what_does_not_fit_is_refused(message: object, values: object, said: str) -> None:
    with pytest.raises(UserError, match=said):
        fill(message, values, find_message)


def test_the_rate_is_the_closed_form_of_its_gaps() -> None:
    meter = RateMeter(window=3)
    assert meter.rate() == ''
    for time in (0.0, 10.0, 10.1, 10.3, 10.4):
        meter.add(time)
    assert pytest.approx(7.5) == 3 / 0.4
    assert pytest.approx(0.04714, abs=5e-6) == (2 / 9) ** 0.5 * 0.1
    assert meter.rate() == (
        'average rate: 7.500\n\tmin: 0.100s max: 0.200s std dev: 0.04714s window: 3'
    )


@for_all('name', ['', 'a b', '/a//b', '1st', 'a/'])
def test_what_is_no_name_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(UserError) as caught:
        full_name(name)
    assert '\n' not in str(caught.value)


@for_all('name', ['String', 'std_msgs/srv/String', 'no_msgs/msg/A', 'std_msgs/Strin'])
def test_what_is_no_type_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(UserError) as caught:
        find_type(name, 'msg')
    assert '\n' not in str(caught.value)
