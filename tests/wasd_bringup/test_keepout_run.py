# SPDX-License-Identifier: Apache-2.0
"""`--keepout` in a run: paths, goals, exploring, a start inside, files that are none."""

import math

import numpy as np
from PIL import Image
import pytest
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.errors import UserError
from wasd_navigation.keepout import KEEPOUT

pytestmark = [pytest.mark.slow, pytest.mark.takes_up_to(240.0)]

MBOT = {'robot': 'mbot', 'description': 'mbot', 'preset': 'mbot', 'speed': 0.0, 'map': ''}


@pytest.fixture
def make(tmp_path):
    """Return a function that makes a run in the room of 6 m with areas (x, y, x, y) [m]."""
    runs = []

    def make(*areas, **more) -> Run:
        pixels = np.full((140, 140), 255, np.uint8)
        for area in areas:
            left, bottom, right, top = (round(70 + 20 * value) for value in area)
            pixels[140 - top : 140 - bottom, left:right] = 0
        path = tmp_path / 'mask.png'
        Image.fromarray(pixels).save(path)
        runs.append(Run(RunOptions(**MBOT, world='room', keepout=f'{path},0.05', **more)))
        return runs[-1]

    yield make
    for run in runs:
        run.close()


def drive(run, seconds, until=lambda: False):
    """Let time pass; return where the robot was, shape (n, 2)."""
    places = []
    end = run.world.time + seconds
    while run.world.time < end and not until():
        run.simulation.advance(50)
        places.append(run.world.base().position[:2].copy())
    return np.array(places)


def inside(places, area):
    x, y, far_x, far_y = area
    return (places > (x, y)).all(axis=1) & (places < (far_x, far_y)).all(axis=1)


def test_a_goal_in_an_area_is_refused_with_the_cure_and_a_path_goes_round_it(make):
    area = (0.6, -1.0, 1.0, 2.0)  # where nothing stands
    run = make(area, goals=((0.8, 0.0, 0.0), (1.6, 0.4, math.nan)))
    navigation = run.navigations[0]
    places = drive(run, 60.0, lambda: len(navigation.report()['goals']) == 2)
    refused, reached = navigation.report()['goals']
    assert refused['state'] == 'refused'
    assert refused['reason'] == '(0.80, 0.00) is in a keepout area: choose a place outside it'
    assert reached['state'] == 'arrived'
    assert (navigation.view().cells == KEEPOUT).any()
    radius = navigation.unit.settings.footprint.inscribed
    wide = (area[0] - radius, area[1] - radius + 0.02, area[2] + radius, area[3])
    near = places[inside(places, wide)]
    # No part of the robot came over it.
    for place in near:
        gap = np.maximum(np.maximum(np.array(area[:2]) - place, place - area[2:]), 0.0)
        assert np.hypot(*gap) > radius - 0.02, place


def test_a_robot_that_stands_inside_leaves_by_the_nearest_edge(make):
    run = make((-0.5, -2.5, 2.5, 2.5), goals=((-1.4, 0.0, math.nan), (0.8, 0.9, 0.0)))
    navigation = run.navigations[0]
    places = drive(run, 60.0, lambda: len(navigation.report()['goals']) == 2)
    left, again = navigation.report()['goals']
    assert left['state'] == 'arrived'
    assert places[:, 0].max() < 0.15
    assert again['state'] == 'refused'


def test_exploring_keeps_out(make):
    areas = ((0.5, -3.0, 3.0, 3.0), (-3.0, -3.0, 3.0, -1.0))
    run = make(*areas, explore=True)
    unit = run.navigations[0].unit
    drive(run, 1.0)
    places = drive(run, 150.0, lambda: not unit.is_exploring)
    assert not unit.is_exploring
    assert np.ptp(places, axis=0).max() > 0.5
    for area in areas:
        assert not inside(places, area).any()


def test_a_mask_that_is_none_is_refused_in_a_line(tmp_path):
    (tmp_path / 'bad.yaml').write_text('image: mask.png\n')
    (tmp_path / 'bad.png').write_text('no picture')
    for words, wanted in (
        ('nowhere.yaml', 'keepout: nowhere.yaml: '),
        (str(tmp_path / 'bad.yaml'), 'resolution: wanted a number'),
        (f'{tmp_path}/bad.png,0.05', 'wanted a picture, PGM or PNG'),
        (f'{tmp_path}/bad.png,7', r'wanted 0.01 to 1 m a pixel, got 7'),
        (f'{tmp_path}/bad.png', r'wanted FILE.yaml, or PICTURE,METRES_PER_PIXEL'),
    ):
        with pytest.raises(UserError, match=wanted) as caught:
            Run(RunOptions(**MBOT, keepout=words))
        assert '\n' not in str(caught.value)
