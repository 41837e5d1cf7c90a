# SPDX-License-Identifier: Apache-2.0
"""A floor plan as a world: its walls and no others, few boxes, a free place to start at."""

from cases import for_all
import mujoco
from mujoco_sim.floor_plan import find_start, make_floor_plan, merge
from mujoco_sim.scene import add_scene
import numpy as np
from PIL import Image
import pytest
from wasd_core.errors import SimulationError
from wasd_core.map_picture import FREE, MapPicture, OCCUPIED, UNKNOWN

from mujoco_sim import floor_plan

CELL = 0.05


def plan(cells, origin=(0.0, 0.0), cell=CELL):
    return MapPicture(np.asarray(cells, np.int8), cell, origin)


def hall(rows=100, columns=160):
    """Return an empty hall with walls of two cells."""
    cells = np.full((rows, columns), FREE, np.int8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    return cells


def drawn(boxes, shape, corner, cell=CELL):
    """Return which cells have their middle in one of the boxes, bool."""
    covered = np.zeros(shape, bool)
    ys, xs = (corner[axis] + (np.arange(shape[1 - axis]) + 0.5) * cell for axis in (1, 0))
    for x, y, half_length, half_width, *_ in boxes:
        covered |= (np.abs(ys - y) < half_width)[:, None] & (np.abs(xs - x) < half_length)
    return covered


@for_all('seed', range(8))
def test_rectangles_cover_the_walls_and_nothing_else(seed):
    random = np.random.default_rng(seed)
    walls = random.random((40, 50)) < random.uniform(0.1, 0.95)
    counts = np.zeros(walls.shape, int)
    for row, column, to_row, to_column in merge(walls, walls, 10_000):
        counts[row:to_row, column:to_column] += 1
    assert ((counts > 0) == walls).all()


@for_all('seed', range(4))
def test_a_ragged_wall_is_few_boxes_that_cover_no_free_cell(seed):
    random = np.random.default_rng(seed)
    cells = np.full((60, 200), FREE, np.int8)
    cells[30:] = UNKNOWN
    cells[29:31][random.random((2, 200)) < 0.6] = OCCUPIED
    picture = plan(cells, (-5.0, -0.7))
    boxes, cell = make_floor_plan(picture)
    covered = drawn(boxes, cells.shape, np.array(picture.origin) - find_start(picture))
    assert covered[cells == OCCUPIED].all()
    assert not covered[cells == FREE].any()
    near = np.pad(cells == OCCUPIED, 1)
    for row, column in np.argwhere(covered):
        assert near[row : row + 3, column : column + 3].any()
    assert len(boxes) < 0.8 * len(merge(cells == OCCUPIED, cells == OCCUPIED, 10_000))


def test_straight_walls_are_few_boxes():
    walls = hall() == OCCUPIED
    walls[40:42, 30:100] = True
    assert len(merge(walls, walls, 100)) <= 6
    diagonal = np.eye(50, dtype=bool)
    assert len(merge(diagonal, diagonal, 100)) == 50


def test_the_walls_lie_where_the_plan_has_them_as_seen_from_the_start():
    cells = hall()
    cells[60:, 100:104] = OCCUPIED
    picture = plan(cells, (-4.0, -2.5))
    boxes, cell = make_floor_plan(picture)
    start = find_start(picture)
    # The origin is free: nothing moves but for half a cell.
    assert np.abs(start).max() <= 0.5 * CELL + 1e-9
    corner = np.array(picture.origin) - start
    assert (drawn(boxes, cells.shape, corner) == (cells == OCCUPIED)).all()
    assert cell == CELL


@for_all('origin', [(-4.0, -2.5), (3.0, 2.0), (-20.0, 1.0)])
def test_the_start_is_the_free_place_nearest_to_the_origin(origin):
    cells = hall()
    cells[20:60, 60:100] = OCCUPIED
    picture = plan(cells, origin)
    start = find_start(picture)
    reach = round(floor_plan.AROUND[0] / CELL)
    rows, columns = np.indices(cells.shape)
    points = np.stack((columns, rows), axis=-1) * CELL + 0.5 * CELL + origin
    best = min(
        float(np.hypot(*points[row, column]))
        for row in range(reach, 100 - reach)
        for column in range(reach, 160 - reach)
        if (cells[row - reach : row + reach + 1, column - reach : column + reach + 1] == 0).all()
    )
    assert np.hypot(*start) == pytest.approx(best)


def test_where_little_is_free_the_robot_starts_with_less_room():
    cells = np.full((40, 40), UNKNOWN, np.int8)
    cells[10:27, 10:27] = FREE  # 0.85 m
    start = find_start(plan(cells))
    assert start == pytest.approx((18.5 * CELL, 18.5 * CELL))
    cells[:] = OCCUPIED
    with pytest.raises(SimulationError, match=r'no free place of 0.6 m'):
        make_floor_plan(plan(cells))


def test_unknown_cells_that_touch_no_wall_are_none():
    cells = hall()
    cells[30:50] = UNKNOWN
    picture = plan(cells)
    corner = -find_start(picture)
    covered = drawn(make_floor_plan(picture)[0], cells.shape, corner)
    assert covered[cells == OCCUPIED].all()
    assert not covered[:, 3:-3][cells[:, 3:-3] != OCCUPIED].any()


def test_too_many_boxes_become_coarser_ones_that_still_hold_every_wall():
    random = np.random.default_rng(0)
    cells = hall(600, 600)
    cells[100:500, 100:500][random.random((400, 400)) < 0.3] = OCCUPIED
    picture = plan(cells, (-2.0, -2.0))
    boxes, cell = make_floor_plan(picture)
    assert cell > CELL
    assert len(boxes) <= floor_plan.MOST_BOXES
    corner = np.array(picture.origin) - find_start(picture)
    covered = drawn(boxes, cells.shape, corner)
    assert covered[cells == OCCUPIED].all()


def test_what_no_merging_makes_few_is_refused_in_a_line(monkeypatch):
    monkeypatch.setattr(floor_plan, 'MOST_BOXES', 3)
    with pytest.raises(SimulationError, match='wanted a plan of at most 3 boxes') as caught:
        make_floor_plan(plan(hall()))
    assert '\n' not in str(caught.value)


def built_world(words):
    spec = mujoco.MjSpec()
    add_scene(spec, words)
    return spec.compile()


def test_a_picture_with_its_scale_is_a_world(tmp_path):
    pixels = np.where(hall()[::-1] == OCCUPIED, 0, 255).astype(np.uint8)
    clear = np.dstack((pixels, pixels, pixels, np.where(pixels == 0, 255, 0))).astype(np.uint8)
    for name, picture in (('plain.png', pixels), ('clear.png', clear), ('plain.pgm', pixels)):
        path = tmp_path / name
        Image.fromarray(picture).save(path)
        model = built_world(f'{path},0.05')
        walls = [model.geom(number) for number in range(model.ngeom)][1:]
        assert len(walls) == 4
        lows = np.min([wall.pos[:2] - wall.size[:2] for wall in walls], axis=0)
        highs = np.max([wall.pos[:2] + wall.size[:2] for wall in walls], axis=0)
        assert highs - lows == pytest.approx((8.0, 5.0))


def test_a_plan_that_is_none_is_refused_in_a_line(tmp_path):
    (tmp_path / 'no.yaml').write_text('hello: world\n')
    (tmp_path / 'no.png').write_text('hello')
    Image.fromarray(np.zeros((50, 50), np.uint8)).save(tmp_path / 'black.png')
    for words, wanted in (
        (f'{tmp_path}/no.yaml', 'resolution: wanted a number'),
        (f'{tmp_path}/no.png,0.05', 'wanted a picture, PGM or PNG'),
        (f'{tmp_path}/no.png', 'or a floor plan: FILE.yaml, or PICTURE,METRES_PER_PIXEL'),
        (f'{tmp_path}/black.png,0.05', 'no free place'),
        (f'{tmp_path}/black.png,nan', 'wanted 0.01 to 1 m a pixel, got nan'),
        (f'{tmp_path}/away.yaml', 'away.yaml'),
        (f'{tmp_path}/away.png,0.1', 'away.png'),
    ):
        with pytest.raises(SimulationError, match=wanted) as caught:
            built_world(words)
        assert str(caught.value).startswith('--world ')
        assert '\n' not in str(caught.value)
