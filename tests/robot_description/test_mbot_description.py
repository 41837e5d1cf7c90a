# SPDX-License-Identifier: Apache-2.0
"""mbot against the published numbers: radius, track, masses; and left is left."""

import xml.etree.ElementTree as ElementTree

from cases import for_all
from descriptions import robot_named
import numpy as np
import pytest
from robot_description.urdf import parse_urdf
from wasd_core.rotations import rpy_matrix

WHEEL_RADIUS = 0.06
CASTER_RADIUS = 0.015


@pytest.fixture(scope='module')
def urdf():
    return robot_named('mbot').urdf


@pytest.fixture(scope='module')
def mbot(urdf):
    return parse_urdf(urdf)


def test_it_is_called_mbot_and_stands_on_its_footprint(mbot):
    assert (mbot.name, mbot.root) == ('mbot', 'base_footprint')


def test_without_sensors_it_has_the_links_and_joints_of_the_courses_robot():
    mbot = parse_urdf(robot_named('mbot_bare').urdf)
    sides = ('left_wheel', 'right_wheel', 'front_caster', 'back_caster')
    assert set(mbot.links) == {'base_footprint', 'base_link', *(f'{s}_link' for s in sides)}
    kinds = {joint.name: joint.kind for joint in mbot.joints.values()}
    assert kinds == {'base_footprint_joint': 'fixed'} | {f'{s}_joint': 'continuous' for s in sides}


@pytest.mark.slow
@pytest.mark.parametrize('variant', ['mbot', 'mbot_bare', 'mbot_kinect'])
def test_it_weighs_1_8_kg_whatever_it_carries(variant):
    mbot = parse_urdf(robot_named(variant).urdf)
    assert mbot.mass == pytest.approx(1.8, abs=1e-12)
    assert mbot.links['base_link'].mass == 1.0


def test_its_sensors_are_where_the_course_has_them(mbot):
    def place(link):
        return mbot.zero_poses[link].position - mbot.zero_poses['base_link'].position

    np.testing.assert_allclose(place('laser_link'), [0.0, 0.0, 0.105])
    np.testing.assert_allclose(place('camera_link'), [0.17, 0.0, 0.10])


@for_all('variant', ['mbot', 'mbot_kinect'])
def test_an_optical_frame_looks_along_z_with_y_down(variant):
    mbot = parse_urdf(robot_named(variant).urdf)
    (frame,) = (link for link in mbot.links if link.endswith('_optical_frame'))
    right, down, ahead = mbot.zero_poses[frame].rotation.T
    np.testing.assert_allclose(ahead, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(right, [0.0, -1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(down, [0.0, 0.0, -1.0], atol=1e-12)


def test_left_is_at_plus_y_and_front_at_plus_x(mbot):
    def place(link):
        return mbot.zero_poses[link].position

    np.testing.assert_allclose(place('left_wheel_link')[:2], [0.0, 0.19])
    np.testing.assert_allclose(place('right_wheel_link')[:2], [0.0, -0.19])
    np.testing.assert_allclose(place('front_caster_link')[:2], [0.18, 0.0])
    np.testing.assert_allclose(place('back_caster_link')[:2], [-0.18, 0.0])


def test_wheels_and_casters_touch_the_ground_together(mbot):
    lowest = {
        'left_wheel_link': WHEEL_RADIUS,
        'right_wheel_link': WHEEL_RADIUS,
        'front_caster_link': CASTER_RADIUS,
        'back_caster_link': CASTER_RADIUS,
    }
    for link, radius in lowest.items():
        assert mbot.links[link].collisions[0].size[0] == radius
        assert mbot.zero_poses[link].position[2] - radius == pytest.approx(0.0, abs=1e-15)


def test_the_body_is_a_drum_11_cm_above_the_ground(mbot):
    (drum,) = mbot.links['base_link'].collisions
    assert (drum.kind, drum.size) == ('cylinder', (0.20, 0.16))
    assert mbot.zero_poses['base_link'].position[2] == pytest.approx(0.11)


def test_every_wheel_turns_forward_about_y(mbot):
    for joint in mbot.movable_joints:
        np.testing.assert_array_equal(joint.axis, [0.0, 1.0, 0.0])


@pytest.mark.parametrize('side', ['left', 'right'])
def test_a_wheel_has_its_large_inertia_about_the_axle(urdf, side):
    link = ElementTree.fromstring(urdf).find(f'link[@name="{side}_wheel_link"]')
    tag = link.find('inertial/inertia')
    numbers = {key: float(value) for key, value in tag.attrib.items()}
    inertia = np.diag([numbers['ixx'], numbers['iyy'], numbers['izz']])
    rpy = map(float, link.find('inertial/origin').get('rpy').split())
    rotation = rpy_matrix(*rpy)
    in_link = rotation @ inertia @ rotation.T
    # m r^2 / 2 about the axle, m (3 r^2 + h^2) / 12 across.
    across = 0.2 * (3 * 0.06**2 + 0.025**2) / 12
    np.testing.assert_allclose(in_link, np.diag([across, 3.6e-4, across]), atol=1e-15)


def test_only_the_wheels_have_motors(mbot):
    driven = {joint.name for joint in mbot.movable_joints if joint.effort > 0.0}
    assert driven == {'left_wheel_joint', 'right_wheel_joint'}


def test_wheels_grip_and_casters_slide(mbot):
    assert mbot.friction == {
        'left_wheel_link': 1.0,
        'right_wheel_link': 1.0,
        'front_caster_link': 0.0,
        'back_caster_link': 0.0,
    }


def test_no_macro_call_was_left_unexpanded(urdf):
    tags = {element.tag for element in ElementTree.fromstring(urdf)}
    assert tags == {'link', 'joint', 'material', 'gazebo'}
