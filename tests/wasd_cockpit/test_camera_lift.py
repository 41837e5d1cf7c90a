# SPDX-License-Identifier: Apache-2.0
"""A camera that follows a robot is as high as it takes to see it, and no higher."""

import math
from types import SimpleNamespace

from cases import for_all
import mujoco
import numpy as np
from wasd_cockpit.scene import HIGHER, lift_to_see, SEEN_ABOVE, SEEN_SHARE

# It stands in the origin, with parts around its middle that are before it from any side.
ROBOT = """
  <body name="robot" pos="0 0 0.3">
    <freejoint/><geom type="box" size=".2 .1 .05"/>
    <body pos="0 0 .1"><joint/><geom type="sphere" size=".08"/></body>
  </body>"""
DISTANCE, ELEVATION, SIZE = 2.0, -20.0, 0.4
PLACE = np.array((0.0, 0.0, 0.3))


def lift(things: str, azimuth: float = 0.0, yaw: float = 0.0, place: np.ndarray = PLACE) -> float:
    """Return the lift of a camera that looks along the x axis, turned by an azimuth [degrees]."""
    text = (
        f'<mujoco><worldbody><geom type="plane" size="9 9 1"/>{things}{ROBOT}</worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = SimpleNamespace(azimuth=azimuth, elevation=ELEVATION, distance=DISTANCE)
    cos, sin = math.cos(yaw), math.sin(yaw)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    marks = SimpleNamespace(place=place, rotation=rotation, size=SIZE, height=0.0)
    viewer = SimpleNamespace(model=model, data=data, camera=camera)
    return lift_to_see(viewer, SimpleNamespace(marks=marks, body=model.body('robot').id))


def wall(x: float, height: float) -> str:
    """Return a thin wall across the way from the camera to the robot, from the floor up."""
    return f'<geom type="box" pos="{x} 0 {height / 2}" size=".001 5 {height / 2}"/>'


def test_a_robot_whose_base_is_on_the_floor_or_in_it_is_seen():
    place = np.array((0.0, 0.0, -0.01))
    assert lift('', place=place) == 0.0
    assert lift(wall(-1.0, 0.8), place=place) > 0.0


@for_all('azimuth', range(-180, 180, 45))
def test_nothing_in_the_way_lifts_nothing(azimuth):
    assert lift('', azimuth) == 0.0
    # What is behind the robot hides nothing.
    assert lift(wall(0.8, 3.0)) == 0.0


@for_all('height', [0.6, 0.8, 1.3, 1.8])
def test_past_a_wall_it_is_the_first_step_that_clears_it(height):
    needed = math.degrees(math.atan2(height - SEEN_ABOVE * SIZE, 1.0)) + ELEVATION
    assert 0.0 < needed <= lift(wall(-1.0, height), yaw=math.pi / 2) < needed + HIGHER


def test_all_of_its_length_is_to_be_seen():
    # A post before one end of a robot that stands across.
    end = SEEN_SHARE * SIZE
    post = '<geom type="box" pos="-1 {} .4" size=".01 .02 .4"/>'
    for y in (0.5 * end, -0.5 * end):  # half way to the camera its lines are half as far apart
        assert lift(post.format(y), yaw=math.pi / 2) > 0.0
    assert lift(post.format(2.0 * end), yaw=math.pi / 2) == 0.0


def test_where_it_cannot_be_seen_at_all_the_camera_stays():
    lid = '<geom type="box" pos="0 0 .8" size="3 3 .01"/>'
    assert lift(wall(-0.5, 0.8) + lid) == 0.0


def test_what_moves_hides_it_too():
    assert lift('<body mocap="true" pos="-1 0 .5"><geom type="box" size=".1 1 .5"/></body>') > 0.0
