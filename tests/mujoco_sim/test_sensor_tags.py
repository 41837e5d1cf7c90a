# SPDX-License-Identifier: Apache-2.0
import math

from descriptions import robot_named
from mujoco_sim.sensors.table import read_sensor_tags
import numpy as np
import pytest
from robot_description.urdf import parse_urdf
from wasd_core.errors import SimulationError

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
    ((lidar,), _), _ = mbot
    assert (lidar.topic, lidar.frame, lidar.rate, lidar.samples) == (
        'scan',
        'laser_link',
        5.5,
        360,
    )
    assert (lidar.min_angle, lidar.max_angle) == (-3.0, 3.0)
    assert (lidar.min_range, lidar.max_range) == (0.1, 6.0)
    assert (lidar.resolution, lidar.noise) == (0.01, 0.01)


def test_the_go2_has_a_lidar_that_looks_all_around():
    ((lidar,), _), notes = read_sensor_tags(robot_named('go2').robot)
    assert not notes
    assert (lidar.topic, lidar.frame, lidar.rate) == ('scan', 'laser_link', 10.0)
    step = (lidar.max_angle - lidar.min_angle) / (lidar.samples - 1)
    assert (lidar.samples, 360 * step) == (360, pytest.approx(2.0 * math.pi))
    assert (lidar.min_range, lidar.max_range, lidar.noise) == (0.1, 12.0, 0.01)


def test_mbots_camera_is_the_courses_with_depth_beside_it(mbot):
    (_, (colour, depth)), _ = mbot
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
    (_, (kinect,)), _ = read_sensor_tags(loaded.robot)
    assert kinect.colour_topic == 'kinect/rgb/image_raw'
    assert kinect.colour_info_topic == 'kinect/rgb/camera_info'
    assert kinect.depth_topic == 'kinect/depth/image_raw'


@pytest.mark.slow
def test_a_robot_without_sensors_has_none():
    loaded = robot_named('mbot_bare')
    assert read_sensor_tags(loaded.robot) == ([[], []], [])


@pytest.mark.parametrize(
    ('kind', 'word', 'plugin', 'topic', 'frame'),
    [
        ('ray', 'ray', '', 'scan', 'head'),
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
    ((found,), _), _ = read(lidar(kind, word, plugin, yaw=math.pi / 2))
    assert (found.topic, found.frame, found.samples) == (topic, frame, 3)
    np.testing.assert_allclose(found.pose.position, [0.0, 0.0, 0.1])
    np.testing.assert_allclose(found.pose.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)


def test_two_lidars_of_one_topic_are_kept_apart_by_their_names():
    (lidars, _), _ = read(lidar(name='left') + lidar(name='right'))
    assert [found.topic for found in lidars] == ['left/scan', 'right/scan']


def test_a_camera_without_a_plugin_is_called_as_its_sensor():
    (_, (found,)), _ = read('<sensor type="rgbd_camera" name="eye"><camera/></sensor>')
    assert (found.colour_topic, found.depth_topic) == ('eye/image_raw', 'eye/depth/image_raw')
    assert (found.colour_info_topic, found.depth_info_topic) == (
        'eye/camera_info',
        'eye/depth/camera_info',
    )


def test_other_sensors_are_left_to_others():
    assert read('<sensor type="imu" name="imu"/><sensor type="contact" name="c"/>') == (
        [[], []],
        [],
    )


@pytest.mark.parametrize(
    ('sensors', 'link', 'words'),
    [
        (
            lidar(samples='many'),
            'head',
            "'eye': ray/scan/horizontal/samples must be a number >= 1",
        ),
        (lidar(samples=0), 'head', "got '0'"),
        (lidar().replace('0 0 0.1', 'up'), 'head', "'eye': pose must be 6 numbers"),
        (
            '<sensor type="camera" name="c"><camera><image><width>99999</width></image></camera>'
            '</sensor>',
            'head',
            "'c': camera/image/width must be a number >= 1 and <= 4096, got '99999'",
        ),
    ],
)
def test_what_cannot_be_is_one_line_that_names_the_sensor(sensors, link, words):
    with pytest.raises(SimulationError) as caught:
        read(sensors, link)
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_sensor_on_no_link_is_left_out_and_said_so():
    assert read(lidar(), link='tail') == (
        [[], []],
        ["sensor 'eye' is on 'tail', which is no link: left out"],
    )


def test_of_a_lidar_with_many_rows_one_is_simulated_and_that_is_said():
    rows = '<vertical><samples>16</samples></vertical></scan>'
    (found, _), notes = read(lidar().replace('</scan>', rows))
    assert len(found) == 1
    assert notes == ["sensor 'eye': of its rows of rays, one is simulated"]


def test_topics_are_made_of_what_ros_allows():
    plugin = '<plugin><topicName>/2d lidar//front-left</topicName></plugin>'
    ((found,), _), _ = read(lidar(plugin=plugin))
    assert found.topic == '_2d_lidar/front_left'
    (_, (camera,)), _ = read('<sensor type="camera" name="front-camera"><camera/></sensor>')
    assert camera.colour_topic == 'front_camera/image_raw'
