# SPDX-License-Identifier: Apache-2.0
"""What the panels are made of, without a page: history, link, layout, runs of stance, stick."""

import math
from pathlib import Path
import random
import re

from cases import for_all
import numpy as np
import pytest
from wasd_cockpit.cockpit import Cockpit, load_settings, save_settings, usual_path
from wasd_cockpit.heights import (
    height_colours,
    height_scale,
    HEIGHTS,
    LEAST_SPAN,
    paint_heights,
    SCALE_STEP,
)
from wasd_cockpit.layout import Layout
from wasd_cockpit.link import (
    ATTENTION,
    History,
    Link,
    moved,
    Order,
    PlanarPose,
    Stick,
    STICK_PROOF,
)
from wasd_cockpit.panels.drive import DEAD_ZONE, deflection
from wasd_cockpit.panels.floor import FloorView, grid_step, LEAST_GAP
from wasd_cockpit.panels.map import FREE_GREY, paint_cells, REACHES
from wasd_cockpit.panels.plots import MOST_POINTS, runs, thin
from wasd_cockpit.scene import CAMERAS
from wasd_cockpit.style import TEXT
from wasd_cockpit.widgets import fold, Rect

KEYBOARD = Path(__file__).parents[2] / 'docs/keyboard.md'

SIZES = [(1280, 720), (1920, 1080), (390, 844), (844, 500), (1024, 768), (900, 600)]


@for_all('count', [0, 1, 4, 5, 6, 13])
def test_the_history_is_the_last_rows_in_order(count):
    history = History(length=5, width=2)
    rows = [np.array([number, -number]) for number in range(count)]
    for row in rows:
        history.add(row)
    assert history.last().tolist() == [row.tolist() for row in rows[-5:]]


def test_what_the_history_gave_does_not_change_later():
    history = History(length=3, width=1)
    history.add(np.array([1.0]))
    given = history.last()
    for _ in range(7):
        history.add(np.array([math.nan]))
    assert given.tolist() == [[1.0]]
    assert history.last().tolist() == 3 * [[0.0]]


def test_a_stick_that_nobody_renews_is_let_go():
    now = [0.0]
    link = Link(lambda: now[0])
    assert link.stick is None
    link.hold(Stick(1.0))
    now[0] += STICK_PROOF
    assert link.stick == Stick(1.0)
    now[0] += 0.001
    assert link.stick is None
    link.hold(Stick(0.5))
    assert link.stick == Stick(0.5)
    link.hold(None)
    assert link.stick is None


def test_a_stick_is_held_by_as_few_pictures_a_second_as_the_page_on_keys_says():
    page = ' '.join(KEYBOARD.read_text().split())
    (said,) = re.findall(r'held stick needs (\d+) pictures a second', page)
    assert 1.0 / int(said) < STICK_PROOF <= 1.0 / (int(said) - 1)


def test_orders_come_once_and_no_more_than_a_hand_can_give():
    link = Link()
    for number in range(1000):
        link.order(Order('key', str(number)))
    taken = link.take_orders()
    assert len(taken) <= 100
    assert taken[-1] == Order('key', '999')
    assert link.take_orders() == []


def test_a_stick_begins_at_the_edge_of_the_dead_zone_and_ends_at_the_rim():
    assert deflection(0.99 * DEAD_ZONE, 0.0) == (0.0, 0.0)
    assert math.hypot(*deflection(1.001 * DEAD_ZONE, 0.0)) < 0.01
    chance = random.Random(1)
    for _ in range(1000):
        x, y = chance.uniform(-3, 3), chance.uniform(-3, 3)
        left, up = deflection(x, y)
        assert math.hypot(left, up) <= 1.0 + 1e-12
        assert math.isclose(left * y, up * x, abs_tol=1e-12)
    assert deflection(0.0, 5.0) == (0.0, pytest.approx(1.0))
    assert deflection(math.nan, 1.0) == (0.0, 0.0)


def test_bars_of_stance_are_the_runs_of_the_flags():
    times = np.arange(7.0)
    flags = np.array([[0, 1, 1, 0, 0, 1, 1], np.zeros(7), np.ones(7)]).T
    assert runs(times, flags) == [(0, 1.0, 3.0), (0, 5.0, 6.0), (2, 0.0, 6.0)]
    assert runs(times, np.zeros((7, 2))) == []


@for_all('count', [1, 2, 125, 126, 500])
def test_lines_are_thinned_to_what_is_seen_and_end_with_the_last_sample(count):
    history = np.arange(float(count))[:, None]
    assert 1 <= len(thin(history)) <= MOST_POINTS
    assert thin(history)[-1] == count - 1


@pytest.mark.parametrize(
    ('width', 'lines'),
    [
        (40, ['page too slow: drive by keys', '', 'as it is']),
        (28, ['page too slow: drive by keys', '', 'as it is']),
        (27, ['page too slow: drive by', 'keys', '', 'as it is']),
        (8, ['page too', 'slow:', 'drive by', 'keys', '', 'as it is']),
        (1, ['page', 'too', 'slow:', 'drive', 'by', 'keys', '', 'as', 'it', 'is']),
    ],
)
def test_text_is_broken_between_words(width, lines):
    text = 'page too slow: drive by keys\n\nas it is'
    assert fold(text, width, len).split('\n') == lines


def test_many_points_are_on_the_page_where_each_is():
    view = FloorView(Rect(10.0, 20.0, 110.0, 220.0), PlanarPose(1.0, -2.0, 0.5), 4.0)
    points = np.array([[0.0, 0.0], [1.5, -2.5], [-3.0, 7.0]])
    np.testing.assert_allclose(view.all_to_page(points), [view.to_page(*p) for p in points])


@for_all('height', [40, 90, 400])
@for_all('reach', REACHES)
def test_the_map_has_lines_whatever_its_size_and_few_of_them(height, reach):
    view = FloorView(Rect(0.0, 0.0, 600.0, height), PlanarPose(), reach)
    step = grid_step(view.scale)
    assert step * view.scale > LEAST_GAP or step == REACHES[-1]
    assert step == 0.5 or 0.5 * step * view.scale <= LEAST_GAP
    assert 600.0 / (step * view.scale) <= 30.0


@for_all('size', SIZES)
def test_windows_are_on_the_page_and_cover_neither_each_other_nor_the_scene(size):
    layout = Layout()
    layout.resize(*size)
    layout.hides = False
    rects = [place.rect for place in layout.places] + [layout.scene]
    panels = [panel for place in layout.places for panel in place.panels]
    assert sorted(panels) == sorted(Cockpit(Link())._panels)
    for number, one in enumerate(rects):
        assert 0 <= one.left < one.right <= size[0]
        assert 0 <= one.top < one.bottom <= size[1]
        for other in rects[:number]:
            assert min(one.right, other.right) <= max(one.left, other.left) or min(
                one.bottom, other.bottom
            ) <= max(one.top, other.top)


@for_all('size', SIZES)
def test_each_panel_can_be_shown_and_is_shown_when_the_page_comes_again(size):
    layout = Layout()
    layout.resize(*size)
    layout.hides = False
    for panel in [panel for place in layout.places for panel in place.panels]:
        layout.choose(panel)
        assert layout.place_of(panel) is not None
        again = Layout(layout.chosen)
        again.resize(*size)
        again.hides = False
        assert again.place_of(panel) == layout.place_of(panel)


def test_what_was_chosen_on_another_page_is_no_reason_to_fail():
    layout = Layout({'drive': 'nonsense', 'nothing': 'robot'})
    layout.resize(1280, 720)
    assert layout.place_of('drive') is not None


def test_a_page_without_room_shows_the_scene_until_panels_are_asked_for():
    layout = Layout()
    for size in ((500, 400), (900, 600)):
        layout.resize(*size)
        assert layout.is_hidden
        assert layout.place_of('drive') is None
        assert (layout.scene.width, layout.scene.height) == size
    layout.hides = False
    assert layout.place_of('drive') is not None


def test_what_is_chosen_comes_again_and_a_broken_file_is_no_reason_to_fail(tmp_path):
    path = tmp_path / 'wasd' / 'cockpit.json'
    chosen = {'tabs': {'drive': 'keys'}, 'camera': 'free'}
    save_settings(path, chosen)
    assert load_settings(path) == chosen
    for text in ('', '[]', '{', '[' * 50_000, '1', '\x00', 200_000 * ' '):
        path.write_text(text)
        assert load_settings(path) == {}
    assert load_settings(tmp_path / 'nothing') == {}
    assert load_settings(None) == {}


def test_a_place_where_nothing_can_be_kept_is_told_and_no_reason_to_fail(tmp_path, caplog):
    (tmp_path / 'wasd').write_text('a file')
    save_settings(tmp_path / 'wasd' / 'cockpit.json', {})
    save_settings(None, {})
    assert caplog.text.count('forgets') == 1


@for_all(
    ('environment', 'path'),
    [
        ({'HOME': '/home/a'}, '/home/a/.config/wasd/cockpit.json'),
        ({'HOME': '/home/a', 'XDG_CONFIG_HOME': '/b'}, '/b/wasd/cockpit.json'),
        ({'HOME': '/home/a', 'XDG_CONFIG_HOME': 'b'}, '/home/a/.config/wasd/cockpit.json'),
        ({}, 'None'),
    ],
)
def test_settings_are_where_other_programs_have_theirs(environment, path):
    assert str(usual_path(environment)) == path


@for_all(
    'kept',
    [
        {'tabs': 1, 'shown': 2, 'share': 'x', 'camera': 3, 'plots': []},
        {'tabs': {'drive': 7}, 'shown': [1, 'trail'], 'share': 9.0, 'camera': 'free'},
        {},
    ],
)
def test_a_cockpit_begins_whatever_was_kept(kept, tmp_path):
    path = tmp_path / 'cockpit.json'
    save_settings(path, kept)
    cockpit = Cockpit(Link(), path)
    assert cockpit.scene.camera in CAMERAS
    assert 0.0 < cockpit._drive.share <= 1.0
    cockpit.close()
    assert load_settings(path) == kept  # no page has changed anything


def test_the_picture_of_a_map_has_its_first_row_at_the_bottom():
    cells = np.array([[100, 0], [-1, 0], [0, 0]], dtype=np.int8)
    picture = np.frombuffer(paint_cells(cells), dtype=np.uint8).reshape(3, 2, 4)
    assert tuple(picture[2, 0]) == (*TEXT, 255)  # occupied
    assert tuple(picture[2, 1]) == (*FREE_GREY, 255)
    assert picture[1, 0, 3] == 0  # nobody has seen it


def test_points_move_with_the_thing_whose_pose_they_are_known_by():
    points = np.array([[1.0, 0.0], [0.0, 2.0]])
    there = moved(points, PlanarPose(1.0, 0.0, 0.0), PlanarPose(3.0, 1.0, math.pi / 2.0))
    assert there == pytest.approx(np.array([[3.0, 1.0], [1.0, 0.0]]))


def test_an_elevation_is_looked_at_until_a_moment_after_the_page_said_so():
    now = [0.0]
    link = Link(lambda: now[0])
    assert not link.is_looked_at
    link.look()
    now[0] += ATTENTION
    assert link.is_looked_at
    now[0] += 0.001
    assert not link.is_looked_at


def test_an_elevation_is_painted_with_y_up_and_without_what_is_unknown():
    heights = np.array(((0.0, np.nan, 0.3), (0.5, 0.1, 0.2)))
    picture = np.frombuffer(paint_heights(heights, 0.0, 0.5), np.uint8).reshape(2, 3, 4)
    assert picture[..., 3].tolist() == [[255, 255, 255], [255, 0, 255]]
    assert picture[1, 0, :3].tolist() == list(HEIGHTS[0])
    assert picture[0, 0, :3].tolist() == list(HEIGHTS[-1])


def test_higher_ground_is_brighter():
    colours = height_colours(np.linspace(0.0, 1.0, 50), 0.0, 1.0)
    brightness = colours @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(brightness) >= 0.0).all()
    assert brightness[-1] > 3.0 * brightness[0]


@for_all('steps', [0, 1, 3, 6])
def test_the_scale_holds_all_heights_but_single_wrong_ones(steps):
    random = np.random.default_rng(steps)
    treads = 0.15 * random.integers(0, steps + 1, (100, 100))
    treads[0, 0] = 0.15 * steps
    heights = treads + random.normal(0.0, 0.005, treads.shape)
    heights[random.random(heights.shape) < 0.5] = np.nan
    heights[1, :5] = 7.0
    low, high = height_scale(heights)
    for end in (low, high):
        assert math.isclose(end / SCALE_STEP, round(end / SCALE_STEP), abs_tol=1e-9)
    assert -SCALE_STEP <= low <= 0.0 + 0.3 * SCALE_STEP
    assert high - low >= LEAST_SPAN - 1e-9
    assert 0.15 * steps - 0.3 * SCALE_STEP <= high <= max(0.15 * steps + SCALE_STEP, LEAST_SPAN)


def test_an_elevation_of_which_nothing_is_known_has_a_scale():
    low, high = height_scale(np.full((4, 4), np.nan))
    assert low < high
