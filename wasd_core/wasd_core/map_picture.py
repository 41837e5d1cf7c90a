# SPDX-License-Identifier: Apache-2.0
"""
Reads maps as Nav2's map_server has them, a YAML file and a picture; and pictures with a scale.

The picture's first row is the grid's last. Trinary: black is occupied, nearly white free, grey
unknown.
"""

from io import BytesIO
import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, UnidentifiedImageError
import yaml

from wasd_core.errors import one_line, UserError
from wasd_core.parameter_file import children, compose_yaml, value_of
from wasd_core.parameters import InvalidParameter
from wasd_core.safe_files import read_file

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
# What map_saver writes, but for its threshold of 0.25: grey is 50/255 occupied, so that reads it
# as free.
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196
# Fewer rows or columns are no map: between the middles of two cells values are looked up.
FEWEST = 3
LARGEST_TEXT, LARGEST_PICTURE, MOST_PIXELS = 100_000, 100_000_000, 50_000_000  # [bytes]
# Finer or coarser cells [m], and more of them along a side, are no map of where a robot drives.
FINEST, COARSEST, LONGEST_SIDE = 0.01, 1.0, 1000.0  # the last in metres
FARTHEST, MOST, LONGEST_WORDS = 1e6, 1e300, 60  # [m], any, characters
TEXTS = ('.yaml', '.yml')
MAPPING = yaml.SafeLoader.DEFAULT_MAPPING_TAG


class MapFileError(UserError):
    """A map cannot be read, or there is no map to write; names the file and the reason."""


class MapPicture(NamedTuple):
    """
    What a map's files say: `cells`, int8, the `resolution` [m] and the `origin` (x, y) [m].

    Cells, shape (rows, columns), are -1 unknown, 0 free, to 100 occupied; row 0 has the lowest y,
    and `origin` is the corner with the lowest coordinates.
    """

    cells: np.ndarray
    resolution: float
    origin: tuple[float, float]


def is_plan(words: str) -> bool:
    """Whether words name a map: a YAML file, or a picture with its scale after a comma."""
    return Path(words).suffix.lower() in TEXTS or _scale(words) is not None


def yaml_beside(path: str | os.PathLike[str]) -> str:
    """Return ', did you mean FILE.yaml?' where that lies beside a picture or has its name."""
    name = os.path.splitext(path)[0] + TEXTS[0]
    return f', did you mean {name}?' if name != str(path) and os.path.isfile(name) else ''


def read_plan(words: str) -> MapPicture:
    """
    Return the map of a YAML file, or of `PICTURE,METRES_PER_PIXEL`.

    The middle of a picture without YAML is the origin.

    Raises:
        UserError: a file cannot be read, or does not say what it must.
    """
    scale = _scale(words)
    if scale is None:
        if Path(words).suffix.lower() not in TEXTS:
            wanted = 'wanted FILE.yaml, or PICTURE,METRES_PER_PIXEL as in plan.png,0.05'
            raise MapFileError(f'{words}: {wanted}{yaml_beside(words)}')
        return read_map(Path(words))
    path = Path(words.rpartition(',')[0])
    if not FINEST <= scale <= COARSEST:
        wanted = f'{FINEST:g} to {COARSEST:g} m a pixel'
        raise MapFileError(f'{path}: wanted {wanted}, got {scale:g}')
    cells = _cells(path, _read_shares(path, False), scale)
    rows, columns = cells.shape
    return MapPicture(cells, scale, (-0.5 * scale * columns, -0.5 * scale * rows))


def files_of(words: str) -> list[str]:
    """Return the files that are read for a plan, or the words as they are where it is none."""
    if _scale(words) is not None:
        return [words.rpartition(',')[0]]
    if Path(words).suffix.lower() not in TEXTS:
        return [words]
    try:
        image = _read_yaml(Path(words)).get('image')
    except UserError:  # which is said when it is used
        image = None
    return [words, str(Path(words).parent / image)] if isinstance(image, str) else [words]


def _scale(words: str) -> float | None:
    """Return the number after the last comma, where there is one."""
    path, comma, number = words.rpartition(',')
    try:
        scale = float(number)
    except ValueError:
        return None
    return scale if comma and path else None


def read_map(path: Path) -> MapPicture:
    """
    Return the map of a YAML file.

    Raises:
        UserError: a file cannot be read, or does not say what it must.
    """
    said = _read_yaml(path)
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
    negate = said.get('negate', 0)
    if negate not in (0, 1):
        raise MapFileError(f'{path}: negate: wanted 0 or 1, got {_shown(negate)}')
    try:
        shares = _read_shares(path.parent / image, bool(negate), mode)
    except UserError as error:
        raise MapFileError(f'{path}: image: {one_line(error)}') from error
    cells = _cells(path, shares, resolution, (free, occupied), mode)
    return MapPicture(cells, resolution, origin)


def _read_yaml(path: Path) -> dict[str, Any]:
    """Return what a map's YAML file says."""
    text = read_file(path, LARGEST_TEXT)
    try:
        root = compose_yaml(text.decode('utf-8-sig'))
        if isinstance(root, yaml.MappingNode) and root.tag == MAPPING:
            return {name: value_of(node) for name, node in children(root).items()}
    except InvalidParameter as error:  # it begins with the line
        raise MapFileError(f'{path}{error}') from error
    except UnicodeDecodeError:
        raise MapFileError(f'{path}: no YAML: not UTF-8 text{yaml_beside(path)}') from None
    except yaml.YAMLError as error:
        raise MapFileError(f'{path}: no YAML: {one_line(error)}{yaml_beside(path)}') from error
    wanted = 'wanted image, resolution and origin of a map'
    raise MapFileError(f'{path}: {wanted}{yaml_beside(path)}')


def _cells(
    path: Path,
    shares: np.ndarray,
    resolution: float,
    thresholds: tuple[float, float] = (FREE_THRESHOLD, OCCUPIED_THRESHOLD),
    mode: str = 'trinary',
) -> np.ndarray:
    """Return a map's cells from the occupied shares of its pixels, shape (rows, columns)."""
    free, occupied = thresholds
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
        cells = np.where(np.isnan(between), UNKNOWN, np.clip(between, 0, 99)).astype(np.int8)
    cells[shares > occupied] = OCCUPIED
    cells[shares < free] = FREE
    return np.ascontiguousarray(cells[::-1])


def _read_shares(path: Path, negate: bool, mode: str = 'trinary') -> np.ndarray:
    """
    Return how occupied the pixels of a picture are, 0 to 1, shape (rows, columns).

    In the mode scale it is NaN where a pixel is not opaque, as map_server has it.
    """
    data = read_file(path, LARGEST_PICTURE)
    opaque: np.ndarray | bool = True
    try:
        with Image.open(BytesIO(data)) as opened:
            picture: Image.Image = opened
            if math.prod(picture.size) > MOST_PIXELS:
                wanted = f'wanted at most {MOST_PIXELS} pixels'
                raise MapFileError(f'{path}: {wanted}, got {picture.width} x {picture.height}')
            if picture.mode == 'F':  # their white may be 1 or 255
                raise MapFileError(f'{path}: has real numbers, wanted whole ones, as in a PNG')
            if picture.has_transparency_data:  # it is seen on white
                picture = picture.convert('RGBA')
                opaque = np.asarray(picture.getchannel('A')) == 255
                paper = Image.new('RGBA', picture.size, 'white')
                picture = Image.alpha_composite(paper, picture)
            most = 65535 if picture.mode.startswith('I') else 255  # of 16 bits, or of 8
            grey = picture if most > 255 else picture.convert('L')
            pixels = np.asarray(grey, dtype=np.float32) / np.float32(most)
    except UnidentifiedImageError as error:
        why = 'wanted a picture, PGM or PNG' if data else 'the file is empty'
        raise MapFileError(f'{path}: {why}') from error
    except (
        OSError,
        ValueError,
        SyntaxError,  # of a PNG
        NotImplementedError,  # of a DDS
        Image.DecompressionBombError,
    ) as error:
        raise MapFileError(f'{path}: no picture: {one_line(error)}') from error
    shares = pixels if negate else 1.0 - pixels
    return np.where(opaque, shares, np.float32(np.nan)) if mode == 'scale' else shares


def _origin(path: Path, said: dict[Any, Any]) -> tuple[float, float]:
    """Return the corner of the map [m]."""
    origin = said.get('origin')
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapFileError(f'{path}: origin: wanted [x, y, yaw], got {_shown(origin)}')
    x, y, yaw = (_number(path, {'origin': value}, 'origin') for value in origin)
    if max(abs(x), abs(y)) > FARTHEST:
        raise MapFileError(f'{path}: origin: wanted at most {FARTHEST:g} m, got {x:g}, {y:g}')
    if abs(yaw) * LONGEST_SIDE >= FINEST:  # less moves no cell
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
    words += f' of {len(value)}' if isinstance(value, list) else ''
    return words if len(words) <= LONGEST_WORDS else f'{words[:LONGEST_WORDS]}...'
