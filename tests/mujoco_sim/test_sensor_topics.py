# SPDX-License-Identifier: Apache-2.0
from dataclasses import dataclass
import io
import math

from descriptions import robot_named
from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.sensors import camera
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.sensors.table import SensorKind, SENSORS
from mujoco_sim.sensors.tags import SensorTag
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.world import build_world
import numpy as np
import PIL.Image
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from robot_description.description import load_robot
from robot_description.mujoco import find_renderer
from robot_description.mujoco.geoms import VISUAL_GROUP
from robot_description.state_publisher_node import StatePublisherNode
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, LaserScan, Range
from wasd_core.errors import SimulationError
from wasd_core.rotations import matrix_from_quaternion
from wasd_core.topics import tf_message_type, TF_STATIC

pytestmark = pytest.mark.slow

SMALL = Parameter('camera_scale', value=0.25)


def seconds(message):
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


@pytest.fixture
def start(spawn, loaded):
    """Return a function that starts a simulator of mbot in a room."""

    def start(*parameters, seed=0):
        world = build_world(loaded, 'room', seed)
        overrides = [SMALL, *parameters]
        node = spawn(SimulatorNode(loaded, world, parameter_overrides=overrides))
        node.schedule_publishing()
        return node

    return start


@pytest.fixture
def listen(spawn, spin_until):
    """Return a function that subscribes to a topic and returns the list of what comes."""
    peer = spawn(Node('peer'))

    def listen(kind, topic):
        heard = []
        peer.create_subscription(kind, topic, heard.append, qos_profile_sensor_data)
        spin_until(spawn.pump, lambda: peer.count_publishers(topic) > 0)
        return heard

    return listen


@pytest.fixture
def run(spawn, spin_until):
    """Return a function that simulates for so many steps and handles messages meanwhile."""

    def run(node, steps, publisher_of=()):
        for topic in publisher_of:
            spin_until(spawn.pump, lambda topic=topic: is_heard(node, topic))
        for _ in range(steps // 10):
            node.simulation.advance(10)
            spawn.pump.handle(0.001)

    return run


def is_heard(node, topic):
    (publisher,) = (p for p in node.publishers if p.topic_name == f'/{topic}')
    return publisher.get_subscription_count() > 0


def test_a_scan_comes_5_5_times_a_second_and_sees_the_room(start, listen, run, spawn, spin_until):
    node = start(Parameter('sensor_noise', value=False))
    scans = listen(LaserScan, 'scan')
    run(node, 2000, ['scan'])
    spin_until(spawn.pump, lambda: len(scans) == 11)
    times = [seconds(scan) for scan in scans]
    np.testing.assert_allclose(times, np.arange(11) / 5.5, atol=1e-6)
    scan = scans[0]
    assert scan.header.frame_id == 'laser_link'
    assert (scan.angle_min, scan.angle_max, len(scan.ranges)) == (-3.0, 3.0, 360)
    assert scan.angle_increment == pytest.approx(6.0 / 359.0)
    assert scan.ranges[180] == pytest.approx(3.0, abs=0.01)
    assert scan.range_min == pytest.approx(0.1) and scan.range_max == 6.0


def test_a_scan_of_a_sensor_with_a_pose_has_a_frame_of_its_own_that_is_told(
    spawn, listen, run, spin_until, tmp_path
):
    turned = robot_named('mbot').urdf
    for old, new in (
        ('<frameName>laser_link</frameName>', ''),
        ('<update_rate>5.5</update_rate>',
         '<update_rate>5.5</update_rate><pose>0.1 0 0 0 0 1.5707963</pose>'),
    ):  # fmt: skip
        assert turned.count(old) == 1
        turned = turned.replace(old, new)
    file = tmp_path / 'turned.urdf'
    file.write_text(turned)
    robot = load_robot(str(file))
    world = build_world(robot, 'room')
    noiseless = Parameter('sensor_noise', value=False)
    node = spawn(SimulatorNode(robot, world, parameter_overrides=[SMALL, noiseless]))
    node.schedule_publishing()
    spawn(StatePublisherNode(robot))  # tells other frames after that
    scans, told = listen(LaserScan, 'scan'), []
    late = spawn(Node('late'))
    late.create_subscription(
        tf_message_type(), '/tf_static', lambda message: told.extend(message.transforms), TF_STATIC
    )
    run(node, 400, ['scan'])

    def own():
        return [one for one in told if one.child_frame_id == 'laser_link/lidar']

    spin_until(spawn.pump, lambda: scans and own() and len(told) > 1)
    (place,) = own()
    assert place.header.frame_id == 'laser_link'
    assert scans[0].header.frame_id == place.child_frame_id
    q, there = place.transform.rotation, place.transform.translation
    rotation = matrix_from_quaternion(np.array([q.w, q.x, q.y, q.z]))
    ray = -math.pi / 2  # of the sensor, which looks to the left: ahead of the robot
    number = round((ray - scans[0].angle_min) / scans[0].angle_increment)
    angle = scans[0].angle_min + number * scans[0].angle_increment
    seen = scans[0].ranges[number] * np.array([math.cos(angle), math.sin(angle), 0.0])
    in_link = np.array([there.x, there.y, there.z]) + rotation @ seen
    assert in_link[0] == pytest.approx(3.0, abs=0.01)
    assert in_link[1] == pytest.approx(0.0, abs=0.1)


def test_the_same_seed_gives_the_same_scans_whenever_one_begins_to_listen(
    start, listen, run, spawn, spin_until
):
    def scans_of(seed, silent):
        node = start(seed=seed)
        run(node, silent)
        scans = listen(LaserScan, 'scan')
        run(node, 1100 - silent, ['scan'])
        spin_until(spawn.pump, lambda: scans and seconds(scans[-1]) > 0.9)
        last = scans[-1].ranges
        node.destroy_node()
        return np.array(last)

    first = scans_of(3, 0)
    np.testing.assert_array_equal(first, scans_of(3, 500))
    assert (first != scans_of(4, 0)).any()


def test_a_reset_begins_the_noise_again(start, listen, run, spawn, spin_until):
    node = start()
    scans = listen(LaserScan, 'scan')
    run(node, 550, ['scan'])
    spin_until(spawn.pump, lambda: len(scans) == 3)
    node.simulation.reset()
    run(node, 550)
    spin_until(spawn.pump, lambda: len(scans) == 6)
    np.testing.assert_array_equal(scans[0].ranges, scans[3].ranges)
    np.testing.assert_array_equal(scans[2].ranges, scans[5].ranges)


def test_nothing_is_measured_or_rendered_while_nobody_listens(start, run, monkeypatch):
    def fail(*_):
        raise AssertionError('nobody has asked for that')

    monkeypatch.setattr(camera, 'Offscreen', fail)
    monkeypatch.setattr('mujoco_sim.sensors.lidar.Lidar._cast', fail)
    run(start(), 500)


def test_what_is_known_of_the_lens_needs_no_renderer(
    start, listen, run, spawn, spin_until, monkeypatch
):
    monkeypatch.setattr(camera, 'Offscreen', None)
    node = start()
    infos = listen(CameraInfo, 'camera/camera_info')
    run(node, 100, ['camera/camera_info'])
    spin_until(spawn.pump, lambda: infos)
    info = infos[0]
    assert (info.width, info.height, info.header.frame_id) == (320, 180, 'camera_optical_frame')
    focal = 160.0 / math.tan(0.5 * 1.3962634)
    np.testing.assert_allclose(info.k, [focal, 0, 159.5, 0, focal, 89.5, 0, 0, 1])
    np.testing.assert_allclose(np.reshape(info.p, (3, 4))[:, :3], np.reshape(info.k, (3, 3)))


def test_pictures_can_be_made_smaller_while_it_runs(start, listen, run, spawn, spin_until):
    node = start()
    infos = listen(CameraInfo, 'camera/camera_info')
    run(node, 100, ['camera/camera_info'])
    node.set_parameters([Parameter('camera_scale', value=0.5)])
    run(node, 100)
    spin_until(spawn.pump, lambda: infos and infos[-1].width == 640)
    assert infos[0].width == 320
    # The angle of view stays: a pixel is twice as fine.
    assert infos[-1].k[0] == pytest.approx(2.0 * infos[0].k[0])


@pytest.mark.skipif(find_renderer() is None, reason='no EGL or OSMesa')
def test_pictures_come_30_times_a_second_and_depth_is_in_metres(
    start, listen, run, spawn, spin_until
):
    node = start()
    colours = listen(Image, 'camera/image_raw')
    depths = listen(Image, 'camera/depth/image_raw')
    run(node, 500, ['camera/image_raw', 'camera/depth/image_raw'])
    spin_until(spawn.pump, lambda: len(colours) == 15 and len(depths) == 10)
    times = [seconds(image) for image in colours]
    np.testing.assert_allclose(times, np.arange(15) / 30.0, atol=0.0011)
    colour, depth = colours[0], depths[0]
    assert (colour.encoding, colour.width, colour.height, colour.step) == ('rgb8', 320, 180, 960)
    assert len(colour.data) == 960 * 180
    assert (depth.encoding, depth.width, depth.height, depth.step) == ('32FC1', 160, 120, 640)
    assert depth.header.frame_id == 'camera_optical_frame'
    metres = np.frombuffer(depth.data.tobytes(), dtype=np.float32).reshape(120, 160)
    assert metres[60, 80] == pytest.approx(3.0 - 0.17, abs=0.01)
    node.close()


@pytest.mark.skipif(find_renderer() is None, reason='no EGL, no OSMesa')
def test_colours_come_as_jpegs_too_and_are_the_same_picture(start, listen, run, spawn, spin_until):
    node = start(Parameter('sensor_noise', value=False))
    plain = listen(Image, 'camera/image_raw')
    packed = listen(CompressedImage, 'camera/image_raw/compressed')
    run(node, 100, ['camera/image_raw', 'camera/image_raw/compressed'])
    spin_until(spawn.pump, lambda: plain and packed)
    image, jpeg = plain[0], packed[0]
    assert (jpeg.header, jpeg.format) == (image.header, 'rgb8; jpeg compressed bgr8')
    pixels = np.asarray(PIL.Image.open(io.BytesIO(jpeg.data)), float)
    wanted = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    assert pixels.shape == wanted.shape
    assert np.abs(pixels - wanted).mean() < 3.0
    assert len(jpeg.data) < 0.2 * len(image.data)


def test_without_a_renderer_it_says_so_once_and_goes_on(start, listen, run, monkeypatch, capfd):
    def fail(*_):
        raise SimulationError('no EGL or OSMesa library')

    monkeypatch.setattr(camera, 'Offscreen', fail)
    node = start()
    listen(Image, 'camera/image_raw')
    run(node, 200, ['camera/image_raw'])
    said = capfd.readouterr().err
    assert said.count('cameras have no pictures: no EGL or OSMesa library') == 1
    assert node.simulation.world.tick == 200


BUOY = """<robot name="buoy"><link name="hull">
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<gazebo reference="hull"><sensor type="sonar" name="echo"><update_rate>20</update_rate>
<pose>0 0 -0.1 0 0 0</pose><topic>depth</topic></sensor></gazebo></robot>"""


@dataclass(frozen=True, kw_only=True)
class SonarTag(SensorTag):
    topic: str


def read_sonar(reader):
    return SonarTag(**reader.common(10.0), topic=reader.word('topic'))


class Sonar:
    def __init__(self, tag, site):
        self._site, self._mount = site, site.find_mount(tag.link, tag.pose)

    def measure(self, wanted, random):
        height = self._mount.in_world(self._site.snapshot.take()).position[2]
        yield 'topic', {'range': float(height), 'max_range': 9.0}


@pytest.fixture
def sonar_row():
    row = SensorKind(('sonar',), read_sonar, Sonar, {'topic': 'Range'})
    SENSORS.append(row)
    yield
    SENSORS.remove(row)


def test_a_sensor_is_a_file_and_a_row(sonar_row, spawn, listen, run, spin_until, tmp_path):
    (file := tmp_path / 'buoy.urdf').write_text(BUOY)
    path = Parameter('description', value=str(file))
    node = spawn(SimulatorNode(parameter_overrides=[path]))
    node.schedule_publishing()
    heard = listen(Range, 'depth')
    run(node, 200, ['depth'])
    spin_until(spawn.pump, lambda: len(heard) == 4)
    np.testing.assert_allclose([seconds(m) for m in heard], np.arange(4) / 20.0, atol=0.0011)
    assert heard[0].header.frame_id == 'hull/echo'  # it looks down
    assert heard[-1].range == pytest.approx(node._world.data.qpos[2] - 0.1, abs=1e-3)


@pytest.mark.parametrize(('robot', 'drawn'), [('mbot', True), ('mbot_bare', False)])
def test_a_robot_with_a_camera_is_there_to_be_looked_at(spawn, robot, drawn):
    node = spawn(SimulatorNode(parameter_overrides=[Parameter('description', value=robot)]))
    groups = node.simulation.world.model.geom_group
    assert (groups == VISUAL_GROUP).any() == drawn


def test_a_scan_is_handed_over_with_its_last_ray_without_a_listener(start):
    node, got = start(), []
    node.sensors.listen('scan', lambda now, _: got.append((now, node.simulation.world.time)))
    node.simulation.advance(1000)
    assert len(got) == 5
    last = 6.0 / (2.0 * np.pi) / 5.5
    assert [now - stamp for stamp, now in got] == pytest.approx([last] * 5, abs=0.011)


def test_without_a_node_the_same_scans_are_measured(start, listen, run, spawn, spin_until, loaded):
    node = start(seed=5)
    scans = listen(LaserScan, 'scan')
    run(node, 1000, ['scan'])
    spin_until(spawn.pump, lambda: len(scans) == 5)
    world = build_world(loaded, 'room', 5)
    measured, sensors = [], Sensors(loaded, world, SimulatorParameters())
    sensors.listen('scan', lambda now, fields: measured.append(fields['ranges']))
    for _ in range(1000):
        sensors.step()
        world.step(1)
    assert measured == [scan.ranges for scan in scans]
