# SPDX-License-Identifier: Apache-2.0
"""
Maps as Nav2's map_server reads and writes them: a YAML file and a PGM picture.

The picture's first row is the grid's last. Trinary: black is occupied, nearly white free, grey
unknown.
"""

import json
from pathlib import Path

import numpy as np
from wasd_core.map_picture import FREE_THRESHOLD, MapFileError, OCCUPIED_THRESHOLD, read_map
from wasd_core.output_file import OutputError, OutputFile
import yaml

from wasd_navigation.records import FREE, Grid

BLACK, GREY, WHITE = 0, 205, 254


def map_outputs(path: Path, option: str = '') -> tuple[OutputFile, OutputFile]:
    """
    Return where a map's text and picture go; an ending .yaml may be there.

    Raises:
        OutputError: one of them cannot be written; names the `option` that asks for it.
    """
    if not path.name:
        raise OutputError(f'{option} {path}: wanted a name'.strip())
    base = without_ending(path)
    text, picture = (
        OutputFile(base.with_name(base.name + ending), option) for ending in ('.yaml', '.pgm')
    )
    return text, picture


def without_ending(path: Path) -> Path:
    """Return the common name of a map's files, of which one may be given."""
    return path.with_suffix('') if path.suffix in ('.yaml', '.yml', '.pgm') else path


def save_map(grid: Grid, path: Path) -> tuple[Path, Path]:
    """
    Write a grid as `path`.yaml and `path`.pgm and return both paths.

    Raises:
        MapFileError: there is nothing in the grid.
        OutputError: a file cannot be written; both are then as they were, or only the text is.
    """
    text, picture = map_outputs(path)
    if not grid.cells.size:
        raise MapFileError(f'{text}: the map is empty: let the robot see something first')
    pixels = np.full(grid.cells.shape, GREY, dtype=np.uint8)
    pixels[grid.cells == FREE] = WHITE
    pixels[grid.cells > 100 * OCCUPIED_THRESHOLD] = BLACK
    rows, columns = len(pixels), len(pixels[0])
    # Numbers as map_saver writes them; the third of the origin is a yaw.
    lines = (
        f'image: {_written(picture.path.name)}',
        'mode: trinary',
        f'resolution: {grid.resolution!r}',
        f'origin: [{grid.origin[0]!r}, {grid.origin[1]!r}, 0]',
        'negate: 0',
        f'occupied_thresh: {OCCUPIED_THRESHOLD}',
        f'free_thresh: {FREE_THRESHOLD}',
    )
    picture.write(f'P5\n{columns} {rows}\n255\n'.encode() + pixels[::-1].tobytes())
    text.write(('\n'.join(lines) + '\n').encode())
    return text.path, picture.path


def _written(name: str) -> str:
    """Return a name as YAML has it: in quotes where it would mean something else."""
    try:
        is_plain = yaml.safe_load(f'image: {name}') == {'image': name}
    except yaml.YAMLError:
        is_plain = False
    return name if is_plain else json.dumps(name, ensure_ascii=False)


def load_map(path: Path) -> Grid:
    """
    Return the grid of a map's YAML file.

    Raises:
        UserError: a file cannot be read, or does not say what it must.
    """
    return Grid(*read_map(path))
