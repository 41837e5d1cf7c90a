# SPDX-License-Identifier: Apache-2.0
import math
from pathlib import Path
import re

from cases import for_all
from descriptions import robot_named
from mujoco_sim.sensors.table import read_sensor_tags
import numpy as np
import pytest
from robot_description.description import load_robot
from robot_description.urdf import parse_urdf

LIDAR = """
<sensor type="{kind}" name="{name}"><update_rate>10</update_rate><pose>0 0 0.1 0 0 {yaw}</pose>
<{word}><scan><horizontal><samples>{samples}</samples><min_angle>-1</min_angle>
<max_angle>1</max_angle></horizontal></scan><range><min>0.1</min><max>5</max></range></{word}>
{plugin}</sensor>
"""


def read(sensors, link='head'):
    """Return the lidars and cameras of a robot of one link with these sensors on it."""
    urdf = (
        f'<robot name="r"><link name="head"/><gazebo reference="{link}">{sensors}</gazebo></robot>'
    )
    return read_sensor_tags(parse_urdf(urdf))


def lidar(kind='ray', word='ray', plugin='', name='eye', samples=3, yaw=0):
    return LIDAR.format(kind=kind, word=word, plugin=plugin, name=name, samples=samples, yaw=yaw)


@pytest.fixture(scope='module')
def mbot():
    loaded = robot_named('mbot')
    return read_sensor_tags(loaded.robot)


@pytest.mark.slow
def test_mbots_lidar_is_the_courses(mbot):
    ((lidar,), *_), _ = mbot
    assert (lidar.topic, lidar.frame, lidar.rate, lidar.samples) == (
        'scan',
        'laser_link',
        5.5,
        360,
    )
    assert (lidar.min_angle, lidar.max_angle) == (-3.0, 3.0)
    assert (lidar.min_range, lidar.max_range) == (0.1, 6.0)
    assert (lidar.resolution, lidar.noise) == (0.01, 0.01)
    # It is an A1, as those numbers are.
    assert (lidar.turns, lidar.noise_share, lidar.dropouts) == (True, 0.01, 0.01)


def test_the_go2_has_a_lidar_that_looks_all_around():
    ((lidar,), *_), notes = read_sensor_tags(robot_named('go2').robot)
    assert not notes
    assert (lidar.topic, lidar.frame, lidar.rate) == ('scan', 'laser_link', 10.0)
    step = (lidar.max_angle - lidar.min_angle) / (lidar.samples - 1)
    assert (lidar.samples, 360 * step) == (360, pytest.approx(2.0 * math.pi))
    assert (lidar.min_range, lidar.max_range, lidar.noise) == (0.1, 12.0, 0.01)


def test_mbots_camera_is_the_courses_with_depth_beside_it(mbot):
    (_, (colour, depth), _), _ = mbot
    assert (colour.colour_topic, colour.colour_info_topic) == (
        'camera/image_raw',
        'camera/camera_info',
    )
    assert (colour.width, colour.height, colour.rate, colour.noise) == (1280, 720, 30.0, 0.007)
    assert (colour.field_of_view, colour.near, colour.far) == (1.3962634, 0.02, 300.0)
    assert (depth.depth_topic, depth.depth_info_topic) == (
        'camera/depth/image_raw',
        'camera/depth/camera_info',
    )
    assert (depth.width, depth.height) == (640, 480)
    assert depth.field_of_view == pytest.approx(math.radians(60.0))
    assert (colour.depth_topic, depth.colour_topic) == ('', '')
    assert {colour.frame, depth.frame} == {'camera_optical_frame'}


def test_a_kinect_has_colour_and_depth():
    loaded = robot_named('mbot_kinect')
    (_, (kinect,), _), _ = read_sensor_tags(loaded.robot)
    assert kinect.colour_topic == 'kinect/rgb/image_raw'
    assert kinect.colour_info_topic == 'kinect/rgb/camera_info'
    assert kinect.depth_topic == 'kinect/depth/image_raw'


@pytest.mark.slow
def test_a_robot_without_sensors_has_none():
    loaded = robot_named('mbot_bare')
    assert read_sensor_tags(loaded.robot) == ([[], [], []], [])


@for_all(
    ('kind', 'word', 'plugin', 'topic', 'frame'),
    [
        ('ray', 'ray', '', 'scan', 'head/eye'),
        (
            'ray',
            'ray',
            '<plugin><topicName>/laser/scan</topicName><frameName>f</frameName></plugin>',
            'laser/scan',
            'f',
        ),
        (
            'ray',
            'ray',
            '<plugin><ros><remapping>~/out:=front</remapping></ros><frame_name>f</frame_name>'
            '</plugin>',
            'front',
            'f',
        ),
        (
            'gpu_lidar',
            'lidar',
            '<topic>/points</topic><gz_frame_id>f</gz_frame_id>',
            'points',
            'f',
        ),
    ],
)
def test_a_lidar_is_read_in_gazebos_dialects(kind, word, plugin, topic, frame):
    ((found,), *_), _ = read(lidar(kind, word, plugin, yaw=math.pi / 2))
    assert (found.topic, found.frame, found.samples) == (topic, frame, 3)
    np.testing.assert_allclose(found.pose.position, [0.0, 0.0, 0.1])
    np.testing.assert_allclose(found.pose.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)


def test_two_lidars_of_one_topic_are_kept_apart_by_their_names():
    (lidars, *_), _ = read(lidar(name='left') + lidar(name='right'))
    assert [found.topic for found in lidars] == ['left/scan', 'right/scan']


def test_two_kinds_of_lidars_of_one_topic_are_kept_apart_by_their_names():
    cloud = lidar(name='up', plugin='<model>l1</model>')
    (scans, _, clouds), _ = read(lidar(name='low', plugin='<topic>points</topic>') + cloud)
    assert [found.topic for found in scans + clouds] == ['low/points', 'up/points']


PAGE = (Path(__file__).resolve().parents[2] / 'docs/topics.md').read_text()
ROWS = re.findall(r'^\| `/?([a-z_/]+)` \| `(\w+)/msg/(\w+)` \| ([^|]*) \|', PAGE, re.M)
OTHERS = [
    topic
    for topic, package, kind, source in ROWS
    if source != 'simulator' or package != 'sensor_msgs' or kind in ('Imu', 'JointState')
]


@for_all('topic', OTHERS)
def test_a_lidar_leaves_the_topics_of_other_parts_to_them(topic):
    ((found,), *_), _ = read(lidar(plugin=f'<plugin><topicName>/{topic}</topicName></plugin>'))
    assert found.topic == f'eye/{topic}'


def test_a_camera_without_a_plugin_is_called_as_its_sensor():
    (_, (found,), _), _ = read('<sensor type="rgbd_camera" name="eye"><camera/></sensor>')
    assert (found.colour_topic, found.depth_topic) == ('eye/image_raw', 'eye/depth/image_raw')
    assert (found.colour_info_topic, found.depth_info_topic) == (
        'eye/camera_info',
        'eye/depth/camera_info',
    )


def test_other_sensors_are_left_to_others():
    assert read('<sensor type="imu" name="imu"/><sensor type="contact" name="c"/>') == (
        [[], [], []],
        [],
    )


def scan(**changes):
    """Return a lidar with numbers of its tag replaced: `samples`, `min_angle`, `max`."""
    text = lidar()
    for name, value in changes.items():
        text = re.sub(f'<{name}>[^<]*</{name}>', f'<{name}>{value}</{name}>', text)
    return text


NOISE = '<noise><type>{}</type><stddev>{}</stddev></noise></ray>'
BROKEN = {
    "'eye' is broken, ray/scan/horizontal/samples must be a number >= 1 and <= 100000, "
    "got 'many'": scan(samples='many'),
    "got '0'": scan(samples=0),
    "got '1e308'": scan(samples='1e308'),
    "got '-5'": scan(samples=-5),
    "got ''": scan(samples=''),
    "range/min must be a number >= 0 and <= 1e+06, got '-0.1'": scan(min=-0.1),
    "range/max must be a number >= 0 and <= 1e+06, got 'inf'": scan(max='inf'),
    "min_angle must be a number >= -100 and <= 100, got 'nan'": scan(min_angle='nan'),
    "update_rate must be a number >= 0 and <= 10000, got 'NaN'": scan(update_rate='NaN'),
    "pose must be 6 numbers, got 'up 0 0 0'": scan(pose='up 0 0 0'),
    "pose must be 6 numbers, got '0 0 nan 0 0 0'": scan(pose='0 0 nan 0 0 0'),
    "ray/noise/type must be one of none, gaussian, gaussian_quantized, custom, got 'pink'": (
        lidar().replace('</ray>', NOISE.format('pink', 0.1))
    ),
    "ray/noise/stddev must be a number >= 0 and <= 1e+06, got '-1'": (
        lidar().replace('</ray>', NOISE.format('gaussian', -1))
    ),
    "camera/image/width must be a number >= 1 and <= 4096, got '99999'": (
        '<sensor type="camera" name="eye"><camera><image><width>99999</width></image></camera>'
        '</sensor>'
    ),
    "'eye' has the type 'sonic', which Gazebo does not know": lidar(kind='sonic'),
    "'' has the type '', which Gazebo does not know": '<sensor/>',
}


@for_all('words', BROKEN)
def test_a_broken_sensor_is_left_out_with_one_line_and_the_others_stay(words):
    (lidars, cameras, _), notes = read(BROKEN[words] + lidar(name='whole'))
    assert [found.name for found in lidars] == ['whole']
    assert not cameras
    (note,) = notes
    assert words in note
    assert note.endswith(': left out')
    assert '\n' not in note


def test_limits_that_are_exchanged_are_taken_the_other_way_round_and_said():
    ((found,), *_), notes = read(scan(min_angle=2.27, max_angle=-2.27, min=30, max=0.1))
    assert (found.min_angle, found.max_angle) == (-2.27, 2.27)
    assert (found.min_range, found.max_range) == (0.1, 30.0)
    assert notes == [
        "sensor 'eye': scan/horizontal: min_angle and max_angle are exchanged (2.27, -2.27): "
        'swapped',
        "sensor 'eye': range: min and max are exchanged (30, 0.1): swapped",
    ]


def test_a_rate_of_zero_is_that_of_a_sensor_which_names_none():
    ((found,), *_), notes = read(scan(update_rate=0))
    assert (found.rate, notes) == (10.0, [])


def test_a_sensor_on_no_link_is_left_out_and_said_so():
    assert read(lidar(), link='tail') == (
        [[], [], []],
        ["sensor 'eye' is on 'tail', which is no link: left out"],
    )


def test_of_a_lidar_with_many_rows_one_is_simulated_and_that_is_said():
    rows = '<vertical><samples>16</samples></vertical></scan>'
    (found, *_), notes = read(lidar().replace('</scan>', rows))
    assert len(found) == 1
    assert notes == ["sensor 'eye': only one of its rows of rays is simulated"]


def test_topics_are_made_of_what_ros_allows():
    plugin = '<plugin><topicName>/2d lidar//front-left</topicName></plugin>'
    ((found,), *_), _ = read(lidar(plugin=plugin))
    assert found.topic == '_2d_lidar/front_left'
    (_, (camera,), _), _ = read('<sensor type="camera" name="front-camera"><camera/></sensor>')
    assert camera.colour_topic == 'front_camera/image_raw'


@for_all('asked', [False, True])
def test_the_camera_in_the_go2s_head_is_there_where_it_is_asked_for(asked):
    robot = load_robot('go2', arguments={'camera': 'true'} if asked else {}).robot
    _, cameras, _ = read_sensor_tags(robot).kinds
    assert len(cameras) == asked
    for camera in cameras:
        assert (camera.width, camera.height, camera.rate) == (1280, 720, 15.0)
        assert camera.field_of_view == pytest.approx(math.radians(100.0))
        topics = 'camera/image_raw', 'camera/depth/image_raw'
        assert (camera.colour_topic, camera.depth_topic) == topics
        assert camera.frame == 'front_camera_optical_frame'
        optical = robot.joints['front_camera_optical_joint'].pose.rotation
        np.testing.assert_allclose(optical @ (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), atol=1e-9)
