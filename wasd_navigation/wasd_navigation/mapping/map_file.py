# SPDX-License-Identifier: Apache-2.0
"""
Maps as Nav2's map_server reads and writes them: a YAML file and a PGM picture.

The picture's first row is the grid's last. Trinary: black is occupied, nearly white free, grey
unknown.
"""

from io import BytesIO
import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError
from wasd_core.errors import one_line, UserError
from wasd_core.output_file import OutputError, OutputFile
from wasd_core.safe_files import read_file
import yaml

from wasd_navigation.records import FEWEST, FREE, Grid, OCCUPIED, UNKNOWN

# What map_saver writes, but for its threshold of 0.25: grey is 50/255 occupied, so that reads it
# as free.
BLACK, GREY, WHITE = 0, 205, 254
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196
LARGEST_TEXT, LARGEST_PICTURE, MOST_PIXELS = 100_000, 100_000_000, 50_000_000  # [bytes]
# Finer or coarser cells [m], and more of them along a side, are no map of where a robot drives.
FINEST, COARSEST, LONGEST_SIDE = 0.01, 1.0, 1000.0  # the last in metres
FARTHEST, MOST, LONGEST_WORDS = 1e6, 1e300, 60  # [m], any, characters


class MapFileError(UserError):
    """A map cannot be read, or there is no map to write; names the file and the reason."""


def map_outputs(path: Path, option: str = '') -> tuple[OutputFile, OutputFile]:
    """
    Return where a map's text and picture go; an ending .yaml may be there.

    Raises:
        OutputError: one of them cannot be written; names the `option` that asks for it.
    """
    if not path.name:
        raise OutputError(f'{option} {path}: wanted a name'.strip())
    base = path.with_suffix('') if path.suffix in ('.yaml', '.yml', '.pgm') else path
    text, picture = (
        OutputFile(base.with_name(base.name + ending), option) for ending in ('.yaml', '.pgm')
    )
    return text, picture


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
        f'image: {picture.path.name}',
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


def load_map(path: Path) -> Grid:
    """
    Return the grid of a map's YAML file.

    Raises:
        UserError: a file cannot be read, or does not say what it must.
    """
    try:
        said = yaml.safe_load(read_file(path, LARGEST_TEXT))
    # The others are what it raises for a word that is not of the kind that its tag says.
    except (yaml.YAMLError, ValueError, LookupError, AttributeError, RecursionError) as error:
        raise MapFileError(f'{path}: no YAML: {one_line(error)}') from error
    if not isinstance(said, dict):
        raise MapFileError(f'{path}: wanted image, resolution and origin of a map')
    resolution = _number(path, said, 'resolution')
    if not FINEST <= resolution <= COARSEST:
        wanted = f'{FINEST:g} to {COARSEST:g} m'
        raise MapFileError(f'{path}: resolution: wanted {wanted}, got {resolution:g}')
    image = said.get('image')
    if not isinstance(image, str) or not image:
        raise MapFileError(f'{path}: image: wanted the name of a picture, got {_shown(image)}')
    mode = said.get('mode', 'trinary')
    if mode not in ('trinary', 'scale'):
        raise MapFileError(f'{path}: mode: wanted trinary or scale, got {_shown(mode)}')
    occupied = _number(path, said, 'occupied_thresh', OCCUPIED_THRESHOLD)
    free = _number(path, said, 'free_thresh', FREE_THRESHOLD)
    if not 0.0 <= free <= occupied <= 1.0:
        wanted = 'wanted 0 <= free_thresh <= occupied_thresh <= 1'
        raise MapFileError(f'{path}: {wanted}, got {free:g} and {occupied:g}')
    origin = _origin(path, said)
    try:
        shares = _read_shares(path.parent / image, bool(said.get('negate', 0)))
    except UserError as error:
        raise MapFileError(f'{path}: image: {one_line(error)}') from error
    if min(shares.shape) < FEWEST:
        rows, columns = shares.shape
        wanted = f'wanted at least {FEWEST} x {FEWEST} pixels'
        raise MapFileError(f'{path}: {wanted}, got {columns} x {rows}')
    if not 0.0 < resolution * max(shares.shape) <= LONGEST_SIDE:
        rows, columns = shares.shape
        size = f'{resolution * columns:.0f} m x {resolution * rows:.0f} m'
        raise MapFileError(f'{path}: wanted sides of at most {LONGEST_SIDE:g} m, got {size}')
    cells = np.full(shares.shape, UNKNOWN, dtype=np.int8)
    if mode == 'scale':
        between = np.round(99.0 * (shares - free) / max(1e-9, occupied - free))
        cells = np.clip(between, 0, 99).astype(np.int8)
    cells[shares > occupied] = OCCUPIED
    cells[shares < free] = FREE
    return Grid(np.ascontiguousarray(cells[::-1]), resolution, origin)


def _read_shares(path: Path, negate: bool) -> np.ndarray:
    """Return how occupied the pixels of a picture are, 0 to 1, shape (rows, columns)."""
    data = read_file(path, LARGEST_PICTURE)
    try:
        with Image.open(BytesIO(data)) as picture:
            if math.prod(picture.size) > MOST_PIXELS:
                wanted = f'wanted at most {MOST_PIXELS} pixels'
                raise MapFileError(f'{path}: {wanted}, got {picture.width} x {picture.height}')
            pixels = np.asarray(picture.convert('L'), dtype=np.float32) / np.float32(255)
    except UnidentifiedImageError as error:
        why = 'wanted a picture, PGM or PNG' if data else 'the file is empty'
        raise MapFileError(f'{path}: {why}') from error
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise MapFileError(f'{path}: no picture: {one_line(error)}') from error
    return pixels if negate else 1.0 - pixels


def _origin(path: Path, said: dict[Any, Any]) -> tuple[float, float]:
    """Return the corner of the map [m]."""
    origin = said.get('origin')
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapFileError(f'{path}: origin: wanted [x, y, yaw], got {_shown(origin)}')
    x, y, yaw = (_number(path, {'origin': value}, 'origin') for value in origin)
    if max(abs(x), abs(y)) > FARTHEST:
        raise MapFileError(f'{path}: origin: wanted at most {FARTHEST:g} m, got {x:g}, {y:g}')
    if yaw != 0.0:
        raise MapFileError(f'{path}: origin: a map that is turned cannot be used, yaw {yaw:g}')
    return x, y


def _number(path: Path, said: dict[Any, Any], name: str, default: float | None = None) -> float:
    value = said.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MOST:
        raise MapFileError(f'{path}: {name}: wanted a number, got {_shown(value)}')
    return float(value)


def _shown(value: Any) -> str:
    """Return a value in a few words: what refers to itself would fill the memory."""
    words = repr(value) if isinstance(value, str | int | float | None) else type(value).__name__
    return words if len(words) <= LONGEST_WORDS else f'{words[:LONGEST_WORDS]}...'
