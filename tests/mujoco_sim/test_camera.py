# SPDX-License-Identifier: Apache-2.0
from collections.abc import Iterator
from dataclasses import replace
import math
import multiprocessing

from descriptions import robot_named
import mujoco
from mujoco_sim.pictures import take_picture, Viewpoint
from mujoco_sim.scene import add_scene
from mujoco_sim.sensors.camera import Camera, Offscreen
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.table import read_sensor_tags
from mujoco_sim.world import World
import numpy as np
import pytest
from robot_description.mujoco import find_renderer
from robot_description.mujoco.builder import to_mujoco
from terminals import PATIENCE
from wasd_core.errors import SimulationError, UserError

# Each renders.
pytestmark = pytest.mark.slow

WALL = 2.0  # from the origin to the wall [m]
PILLAR = (1.2, 0.3)
RED, GREEN = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)


@pytest.fixture(scope='module')
def kinect():
    return robot_named('mbot_kinect')


@pytest.fixture(scope='module')
def scene(kinect) -> World:
    """Return mbot before a green wall with a red pillar to its left."""
    spec = to_mujoco(kinect.robot)
    add_scene(spec, 'flat')
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, pos=[WALL + 0.1, 0, 1], size=[0.1, 3, 1], rgba=GREEN
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, pos=[*PILLAR, 0.5], size=[0.05, 0.5, 0], rgba=RED
    )
    return World(spec, kinect.robot.root)


@pytest.fixture(scope='module')
def offscreen(scene) -> Iterator[Offscreen]:
    if find_renderer() is None:
        pytest.skip('no EGL or OSMesa')
    offscreen = Offscreen(scene, 640, 480)
    yield offscreen
    offscreen.close()


@pytest.fixture
def make(kinect, scene):
    """Return a function that puts the Kinect, changed as wanted, on the robot."""

    def make(scale=1.0, **changes):
        (_, (tag,), _), _ = read_sensor_tags(kinect.robot)
        return Camera(replace(tag, **changes), Site(scene, kinect.robot, scale))

    return make


@pytest.mark.slow
def test_a_wall_is_as_far_as_it_is_over_the_whole_picture(make, offscreen):
    camera = make(field_of_view=0.4)  # narrow: nothing but the wall and some floor is in it
    depths = camera.take(offscreen, colour=False, depth=True, random=None).depths
    assert depths.shape == (480, 640)
    # 32-bit depth between 5 cm and 8 m is good for micrometres at 2 m.
    np.testing.assert_allclose(depths[:400], WALL - 0.15, atol=1e-4)


@pytest.mark.slow
def test_the_floor_is_where_the_pinhole_has_it(make, offscreen):
    camera = make(field_of_view=1.2)
    depths = camera.take(offscreen, colour=False, depth=True, random=None).depths
    height = 0.11 + 0.11
    rows = np.arange(460, 480)
    expected = height * camera.focal_length / (rows - camera.centre[1])
    np.testing.assert_allclose(depths[rows, 320], expected, rtol=1e-3)


def test_what_is_to_the_left_is_on_the_left_where_the_pinhole_has_it(make, offscreen):
    camera = make()
    colours = camera.take(offscreen, colour=True, depth=False, random=None).colours
    red = colours[240, :, 0].astype(int) - colours[240, :, 1] > 50
    x, y = PILLAR[0] - 0.15, PILLAR[1]
    # Its middle as seen from the lens: halfway, by angle, between its two edges.
    edge = math.asin(0.05 / math.hypot(x, y))
    columns = [
        camera.centre[0] - camera.focal_length * math.tan(math.atan2(y, x) + side * edge)
        for side in (1, -1)
    ]
    assert np.flatnonzero(red)[[0, -1]] == pytest.approx(columns, abs=1.0)


def test_colours_are_of_what_is_seen_and_not_upside_down(make, offscreen):
    colours = make(field_of_view=1.2).take(offscreen, True, False, None).colours.astype(int)
    wall, floor = colours[200, 500], colours[470, 320]
    assert wall[1] > wall[0] + 50 and wall[1] > wall[2] + 50
    assert floor[2] > floor[0]


def test_where_nothing_is_within_its_reach_depth_is_infinite(make, offscreen):
    far = make(far=1.5, field_of_view=0.4).take(offscreen, False, True, None).depths
    assert np.isposinf(far[:300]).all()


def test_a_smaller_picture_shows_the_same(make, offscreen):
    camera = make(scale=0.25)
    picture = camera.take(offscreen, colour=True, depth=True, random=None)
    assert picture.colours.shape == (120, 160, 3)
    assert picture.depths.shape == (120, 160)
    assert camera.focal_length == pytest.approx(make().focal_length / 4)
    assert picture.depths[60, 80] == pytest.approx(WALL - 0.15, abs=1e-4)


@pytest.mark.slow
def test_noise_has_its_spread_and_is_drawn_from_the_generator(make, offscreen):
    camera = make(noise=0.02, field_of_view=0.4)
    clean = camera.take(offscreen, True, False, None).colours.astype(int)
    noisy, again, other = (
        camera.take(offscreen, True, False, np.random.default_rng(seed)).colours
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(noisy, again)
    assert (noisy != other).any()
    middling = (clean > 30) & (clean < 225)
    errors = (noisy - clean)[middling]
    assert abs(errors.mean()) < 0.05
    assert errors.std() == pytest.approx(0.02 * 255.0, rel=0.03)


def test_no_renderer_is_one_line_that_says_what_to_install(scene, monkeypatch):
    monkeypatch.delenv('MUJOCO_GL', raising=False)
    monkeypatch.setattr('ctypes.util.find_library', lambda name: None)
    with pytest.raises(SimulationError, match='no EGL or OSMesa library .*apt install'):
        Offscreen(scene, 64, 48)


def test_who_switched_drawing_off_reads_that_and_no_library_to_install(
    scene, monkeypatch, tmp_path
):
    monkeypatch.setenv('MUJOCO_GL', 'off')
    with pytest.raises(SimulationError, match='^MUJOCO_GL=off: nothing draws$'):
        Offscreen(scene, 64, 48)
    with pytest.raises(UserError, match='^MUJOCO_GL=off: nothing draws$'):
        take_picture(scene, Viewpoint((0, 0, 0), 1, 0, 0), tmp_path / 'x.png')


def test_a_renderer_that_does_not_work_is_one_line(scene, monkeypatch):
    monkeypatch.setattr('mujoco_sim.sensors.camera.find_renderer', lambda: 'nothing_of_this_name')
    with pytest.raises(SimulationError, match='does not work here: ') as caught:
        Offscreen(scene, 64, 48)
    assert '\n' not in str(caught.value)


def test_a_fork_of_a_process_that_has_drawn_refuses_to_and_does_not_hang(
    scene, offscreen, tmp_path
):
    def draw():
        for act in (
            lambda: Offscreen(scene, 64, 48),
            lambda: take_picture(scene, Viewpoint((0, 0, 0), 1, 0, 0), tmp_path / 'x.png'),
        ):
            with pytest.raises(UserError, match='by the method spawn'):
                act()

    forked = multiprocessing.get_context('fork').Process(target=draw)
    forked.start()
    forked.join(PATIENCE)
    forked.kill()
    forked.join()
    assert forked.exitcode == 0
