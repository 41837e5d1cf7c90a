# SPDX-License-Identifier: Apache-2.0
"""Maps as files: what Nav2's map_server would read of them, and refusals."""

import errno
import os
from pathlib import Path
import struct

from cases import for_all
import numpy as np
from PIL import Image
import pytest
from wasd_core.errors import UserError
from wasd_navigation.mapping import load_map, save_map
from wasd_navigation.records import Grid
import yaml


@pytest.fixture
def grid() -> Grid:
    cells = np.random.default_rng(0).choice((-1, 0, 100), size=(7, 5)).astype(np.int8)
    return Grid(cells, 0.05, (-1.25, 3.1000000000000001))


def read_as_map_server(path: Path) -> tuple[np.ndarray, float, list[float]]:
    """Return cells, resolution and origin by the rules of nav2_map_server's map_io, trinary."""
    said = yaml.safe_load(path.read_text())
    assert said['mode'] == 'trinary' and said['negate'] == 0
    pixels = np.array(Image.open(path.parent / said['image']))
    assert pixels.ndim == 2 and pixels.dtype == np.uint8
    rows, columns = pixels.shape
    cells = np.empty((rows, columns), dtype=np.int8)
    for y in range(rows):
        for x in range(columns):
            occupied = (255 - int(pixels[y, x])) / 255.0
            if occupied > said['occupied_thresh']:
                value = 100
            elif occupied < said['free_thresh']:
                value = 0
            else:
                value = -1
            cells[rows - y - 1, x] = value
    return cells, said['resolution'], said['origin']


def test_what_is_saved_is_what_map_server_reads(grid: Grid, tmp_path: Path) -> None:
    text, picture = save_map(grid, tmp_path / 'house')
    assert (text.name, picture.name) == ('house.yaml', 'house.pgm')
    cells, resolution, origin = read_as_map_server(text)
    assert np.array_equal(cells, grid.cells)
    assert (resolution, tuple(origin[:2])) == (grid.resolution, grid.origin)
    assert origin[2] == 0


def test_what_is_saved_is_loaded(grid: Grid, tmp_path: Path) -> None:
    loaded = load_map(save_map(grid, tmp_path / 'my.house.yaml')[0])
    assert (tmp_path / 'my.house.pgm').exists()
    assert np.array_equal(loaded.cells, grid.cells)
    assert (loaded.resolution, loaded.origin) == (grid.resolution, grid.origin)


def test_maps_of_others_are_loaded(tmp_path: Path) -> None:
    Image.fromarray(np.array(3 * [[0, 127, 255]], dtype=np.uint8)).save(tmp_path / 'm.png')
    said = 'image: m.png\nresolution: 0.1\norigin: [1, 2, 0]\nnegate: 0\n'
    said += 'occupied_thresh: 0.7\nfree_thresh: 0.2\n'
    for more, wanted in (
        ('', [100, -1, 0]),
        ('mode: scale\n', [100, 60, 0]),
    ):
        (tmp_path / 'm.yaml').write_text(said + more)
        grid = load_map(tmp_path / 'm.yaml')
        assert grid.cells.tolist() == 3 * [wanted]
        assert grid.origin == (1.0, 2.0)
    (tmp_path / 'm.yaml').write_text(said.replace('negate: 0', 'negate: 1'))
    assert load_map(tmp_path / 'm.yaml').cells.tolist() == 3 * [[0, -1, 100]]


GOOD = 'image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n'


def test_a_yaw_that_moves_no_cell_is_taken(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((3, 3), dtype=np.uint8)).save(tmp_path / 'm.pgm')
    (tmp_path / 'map.yaml').write_text(GOOD.replace('0, 0]', '0, 1.0e-9]'))
    assert load_map(tmp_path / 'map.yaml').origin == (0.0, 0.0)


@for_all(
    'text, said',
    [
        ('[1, 2', 'no YAML'),
        ('hello', 'wanted image, resolution and origin'),
        (GOOD.replace('0.05', '-1'), 'resolution: wanted 0.01 to 1 m, got -1'),
        (GOOD.replace('0.05', '1.0e-9'), 'resolution: wanted 0.01 to 1 m, got 1e-09'),
        (GOOD.replace('0.05', '1.0e+9'), 'resolution: wanted 0.01 to 1 m, got 1e+09'),
        (GOOD.replace('0.05', '1' + 400 * '0'), 'map.yaml:2: int too large to convert'),
        (GOOD.replace('0.05', '2020-99-99'), 'map.yaml:2: month must be in 1..12'),
        (GOOD.replace('0.05', '!!int ""'), "map.yaml:2: '' is no int"),
        (GOOD.replace('0.05', '!!timestamp x'), "map.yaml:2: 'x' is no timestamp"),
        (GOOD.replace('0.05', '!mine 0.05'), 'map.yaml:2: could not determine'),
        ('!mine\n' + GOOD, 'wanted image, resolution and origin'),
        (GOOD.replace('0.05', '&a [*a]'), 'no YAML: more than 10000 values'),
        (GOOD + 'resolution: 0.1\n', "map.yaml:4: 'resolution' is there twice"),
        (GOOD + 'negate: "no"\n', "negate: wanted 0 or 1, got 'no'"),
        (GOOD + 'negate: 5\n', 'negate: wanted 0 or 1, got 5'),
        (GOOD.replace('[0, 0, 0]', '[1.0e+30, 0, 0]'), 'origin: wanted at most 1e+06 m'),
        (GOOD.replace('m.pgm', 'long.pgm').replace('0.05', '1.0'), 'got 1001 m x 3 m'),
        (GOOD.replace('m.pgm', 'large.pgm'), 'got 8000 x 8000'),
        (GOOD + 100_000 * ' ', 'is too much'),
        (GOOD.replace('0.05', '.nan'), 'resolution: wanted a number, got nan'),
        (GOOD.replace('image: m.pgm', 'x: y'), 'image: wanted the name of a picture'),
        (GOOD.replace('[0, 0, 0]', '[0, 0]'), 'origin: wanted [x, y, yaw], got list of 2'),
        (GOOD.replace('[0, 0, 0]', '[0, 0, 2.0e-5]'), 'a map that is turned cannot be used'),
        (GOOD + 'mode: odd\n', "mode: wanted trinary or scale, got 'odd'"),
        (GOOD.replace('m.pgm', 'none.pgm'), 'map.yaml: image: '),
        (GOOD.replace('m.pgm', 'none.pgm'), 'none.pgm: no such file'),
        (GOOD.replace('m.pgm', 'map.yaml'), 'map.yaml: wanted a picture, PGM or PNG'),
        (GOOD.replace('m.pgm', 'empty.pgm'), 'empty.pgm: the file is empty'),
        (GOOD.replace('m.pgm', 'cut.pgm'), 'cut.pgm: no picture: image file is truncated'),
        (GOOD.replace('m.pgm', 'damaged.png'), 'damaged.png: no picture: broken PNG file'),
        (GOOD.replace('m.pgm', 'odd.dds'), 'odd.dds: no picture: Unknown pixel format flags 0'),
        (GOOD.replace('m.pgm', 'flat.pgm'), 'wanted at least 3 x 3 pixels, got 300 x 1'),
        (GOOD.replace('m.pgm', '"a\\nb"'), 'a b: no such file'),
        (GOOD + 'free_thresh: 0.9\n', 'free_thresh <= occupied_thresh <= 1, got 0.9 and 0.65'),
        (GOOD + 'occupied_thresh: -1\n', 'wanted 0 <= free_thresh'),
    ],
)
def test_what_is_no_map_is_refused_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    for name, shape in {'m': (3, 3), 'long': (3, 1001), 'flat': (1, 300)}.items():
        Image.fromarray(np.zeros(shape, dtype=np.uint8)).save(tmp_path / f'{name}.pgm')
    (tmp_path / 'empty.pgm').write_bytes(b'')
    (tmp_path / 'cut.pgm').write_bytes(b'P5 100 100 255\n' + bytes(50))
    (tmp_path / 'large.pgm').write_bytes(b'P5 8000 8000 255\n')
    Image.open(tmp_path / 'm.pgm').save(tmp_path / 'damaged.png')
    picture = bytearray((tmp_path / 'damaged.png').read_bytes())
    picture[picture.index(b'IDAT') - 1] = 1  # its length: what follows is no chunk
    (tmp_path / 'damaged.png').write_bytes(picture)
    header = struct.pack('<7I', 124, 0x1007, 4, 4, 0, 0, 0) + bytes(44)
    (tmp_path / 'odd.dds').write_bytes(b'DDS ' + header + struct.pack('<2I', 32, 0) + bytes(108))
    (tmp_path / 'map.yaml').write_text(text)
    with pytest.raises(UserError) as refused:
        load_map(tmp_path / 'map.yaml')
    assert said in str(refused.value)
    assert '\n' not in str(refused.value)


def test_a_resolution_with_an_exponent_is_a_number_as_to_map_server(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((3, 3), dtype=np.uint8)).save(tmp_path / 'm.pgm')
    (tmp_path / 'map.yaml').write_text(GOOD.replace('0.05', '5e-2'))
    assert load_map(tmp_path / 'map.yaml').resolution == 0.05


def test_a_map_in_another_encoding_is_told_without_the_words_of_codecs(tmp_path: Path) -> None:
    (tmp_path / 'map.yaml').write_text(GOOD, encoding='utf-16')
    with pytest.raises(UserError, match='map.yaml: no YAML: not UTF-8 text$'):
        load_map(tmp_path / 'map.yaml')


def test_a_picture_given_for_its_yaml_names_that(tmp_path: Path) -> None:
    Image.fromarray(np.full((3, 3), 254, dtype=np.uint8)).save(tmp_path / 'm.pgm')
    with pytest.raises(UserError, match='m.pgm: no YAML') as refused:
        load_map(tmp_path / 'm.pgm')
    assert 'did you mean' not in str(refused.value)
    (tmp_path / 'm.yaml').write_text(GOOD)
    with pytest.raises(UserError, match='did you mean .*m.yaml'):
        load_map(tmp_path / 'm.pgm')


def test_a_map_that_cannot_be_written_or_is_empty_is_refused(grid: Grid, tmp_path: Path) -> None:
    with pytest.raises(UserError, match='wanted a file in a folder that exists'):
        save_map(grid, tmp_path / 'nowhere' / 'house')
    with pytest.raises(UserError, match='the map is empty'):
        save_map(Grid(np.zeros((0, 0), dtype=np.int8), 0.05, (0.0, 0.0)), tmp_path / 'house')


def test_a_map_that_cannot_be_written_whole_leaves_the_old_one(
    grid: Grid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = [path.read_bytes() for path in save_map(grid, tmp_path / 'house')]

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(os, 'write', full)
    with pytest.raises(UserError, match=r'house.pgm: No space left on device'):
        save_map(grid, tmp_path / 'house')
    names = ('house.yaml', 'house.pgm')
    assert [(tmp_path / name).read_bytes() for name in names] == before
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)


@for_all('name', ['flat #2', 'a: b', '[x]', "it's", '"', 'yes', '- a', '1.0', 'ä ö'])
def test_a_map_of_any_name_is_loaded_again(grid: Grid, tmp_path: Path, name: str) -> None:
    loaded = load_map(save_map(grid, tmp_path / name)[0])
    assert np.array_equal(loaded.cells, grid.cells)


def test_a_picture_of_real_numbers_is_refused_as_nobody_knows_what_is_white(
    tmp_path: Path,
) -> None:
    Image.fromarray(np.full((5, 5), 0.99, dtype=np.float32)).save(tmp_path / 'a.tiff')
    text = 'image: a.tiff\nresolution: 0.05\norigin: [0, 0, 0]\n'
    (tmp_path / 'a.yaml').write_text(text)
    with pytest.raises(UserError, match='a.tiff: has real numbers, wanted whole ones'):
        load_map(tmp_path / 'a.yaml')


@for_all('suffix', ['png', 'pgm'])
def test_a_picture_of_16_bits_is_the_same_map(tmp_path: Path, suffix: str) -> None:
    greys = np.array([[0, 12, 127, 205, 255]] * 3, dtype=np.uint16)
    said = f'image: m.{suffix}\nresolution: 0.1\norigin: [0, 0, 0]\n'
    (tmp_path / 'm.yaml').write_text(said)
    cells = []
    for bits, values in ((8, greys.astype(np.uint8)), (16, 257 * greys)):
        if suffix == 'png':
            Image.fromarray(values).save(tmp_path / 'm.png')
        else:
            data = values.astype('>u2').tobytes() if bits == 16 else values.tobytes()
            head = f'P5\n5 3\n{2**bits - 1}\n'.encode()
            (tmp_path / 'm.pgm').write_bytes(head + data)
        cells.append(load_map(tmp_path / 'm.yaml').cells.tolist())
    assert cells[0] == cells[1]
    assert cells[0][0][0] == 100
    assert cells[0][0][2] == -1


def test_in_the_mode_scale_what_is_not_opaque_is_unknown(tmp_path: Path) -> None:
    pixels = np.zeros((3, 3, 4), dtype=np.uint8)
    pixels[:, 1] = 255
    pixels[:, 2] = 0, 0, 0, 0
    pixels[:, 0, 3] = 255
    Image.fromarray(pixels).save(tmp_path / 'm.png')
    said = 'image: m.png\nresolution: 0.1\norigin: [0, 0, 0]\nmode: scale\n'
    (tmp_path / 'm.yaml').write_text(said)
    assert load_map(tmp_path / 'm.yaml').cells.tolist() == 3 * [[100, 0, -1]]
