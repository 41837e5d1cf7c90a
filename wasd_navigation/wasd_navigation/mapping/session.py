# SPDX-License-Identifier: Apache-2.0
"""
What a mapping robot knows, in a file beside its map: places, what it saw there, how they lie.

Arrays of numpy, not compressed, and no objects: nothing in such a file runs, or grows as it is
read.
"""

from io import BytesIO
from pathlib import Path
from typing import NamedTuple
import zipfile

import numpy as np
from wasd_core.errors import one_line, UserError
from wasd_core.map_picture import MapFileError
from wasd_core.output_file import OutputFile
from wasd_core.safe_files import read_file

from wasd_navigation.mapping.map_file import without_ending
from wasd_navigation.mapping.pose_graph import Edges
from wasd_navigation.records import MOST_RAYS, Scan

ENDING = '.places.npz'
LARGEST_SESSION, MOST_PLACES = 1_000_000_000, 1_000_000  # [bytes], places
FARTHEST = 1e6  # [m]


class Session(NamedTuple):
    """
    Places: poses in the map, shape (n, 3), a scan of each, and what is known of pairs of them.

    `resolution` is the length of the map's cells [m], `share` the noise of ranges as a share.
    """

    poses: np.ndarray
    scans: list[Scan]
    edges: Edges
    resolution: float
    share: float


def session_output(path: Path, option: str = '') -> OutputFile:
    """
    Return where the places of a map go; an ending .yaml may be there.

    Raises:
        OutputError: it cannot be written; names the `option` that asks for it.
    """
    base = without_ending(path)
    return OutputFile(base.with_name(base.name + ENDING), option)


def save_session(session: Session, path: Path) -> Path:
    """
    Write it beside the map `path`, and return where.

    Raises:
        OutputError: it cannot be written.
    """
    output = session_output(path)
    scans = session.scans
    rays = [np.column_stack((scan.begins, scan.ends, scan.hits)) for scan in scans]
    data = BytesIO()
    np.savez(
        data,
        poses=session.poses,
        origins=np.array([scan.origin for scan in scans]),
        counts=np.array([len(scan.ends) for scan in scans]),
        rays=np.concatenate(rays),
        noise=np.array((session.resolution, session.share)),
        pairs=session.edges.pairs,
        links=session.edges.poses,
        informations=session.edges.informations,
        robust=session.edges.robust,
    )
    output.write(data.getvalue())
    return output.path


def load_session(path: Path) -> Session:
    """
    Return what lies beside the map `path`.

    Raises:
        UserError: it cannot be read, or is none.
    """
    base = without_ending(path)
    file = base.with_name(base.name + ENDING)
    try:
        data = read_file(file, LARGEST_SESSION)
    except UserError as error:
        raise MapFileError(f'{one_line(error)}: a map goes on with the places beside it') from None
    try:
        with zipfile.ZipFile(BytesIO(data)) as packed:
            if any(info.compress_type != zipfile.ZIP_STORED for info in packed.infolist()):
                raise ValueError('it is compressed')
        with np.load(BytesIO(data), allow_pickle=False) as arrays:
            return _read({name: arrays[name] for name in arrays.files})
    # zipfile and numpy raise these if it is no archive, or holds no arrays.
    except (zipfile.BadZipFile, ValueError, KeyError, OSError, EOFError, TypeError) as error:
        raise MapFileError(f'{file}: no places of a map: {one_line(error)}') from None


def _read(arrays: dict[str, np.ndarray]) -> Session:
    """Return a session of arrays that may be anything; ValueError: they are none."""
    poses, counts = _floats(arrays, 'poses', (-1, 3)), arrays['counts']
    count = len(poses)
    is_counted = counts.shape == (count,) and counts.dtype.kind == 'i'
    if not 0 < count <= MOST_PLACES or not is_counted:
        raise ValueError('wanted one count of rays for each place')
    rays, origins = _floats(arrays, 'rays', (-1, 5)), _floats(arrays, 'origins', (count, 2))
    if (counts < 0).any() or (counts > MOST_RAYS).any() or counts.sum() != len(rays):
        raise ValueError('wanted as many rays as are counted')
    resolution, share = _floats(arrays, 'noise', (2,)).tolist()
    if not 0.001 <= resolution <= 10.0 or not 0.0 <= share <= 1.0:
        raise ValueError(f'wanted a resolution and a noise, got {resolution}, {share}')
    parts = np.split(rays, np.cumsum(counts)[:-1])
    scans = [
        Scan(origin, part[:, 2:4].copy(), part[:, 4] > 0.5, part[:, :2].copy())
        for origin, part in zip(origins, parts, strict=True)
    ]
    return Session(poses, scans, _read_edges(arrays, count), resolution, share)


def _read_edges(arrays: dict[str, np.ndarray], count: int) -> Edges:
    pairs, robust = arrays['pairs'], arrays['robust']
    if pairs.dtype.kind != 'i' or pairs.ndim != 2 or pairs.shape[1] != 2:
        raise ValueError('wanted pairs of places')
    if (pairs < 0).any() or (pairs >= count).any() or (pairs[:, 0] == pairs[:, 1]).any():
        raise ValueError('wanted pairs of places that there are')
    links = len(pairs)
    if robust.shape != (links,) or robust.dtype != np.bool_:
        raise ValueError('wanted to know of each pair whether it may be wrong')
    known = _floats(arrays, 'informations', (links, 3, 3))
    poses = _floats(arrays, 'links', (links, 3))
    return Edges(pairs.astype(np.int64), poses, known, robust)


def _floats(arrays: dict[str, np.ndarray], name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array of finite numbers of a shape; -1 stands for any size."""
    array = arrays[name]
    fits = array.dtype == np.float64 and array.ndim == len(shape)
    if not fits or any(w not in (-1, g) for w, g in zip(shape, array.shape, strict=True)):
        got = f'{array.dtype} of {array.shape}'
        raise ValueError(f'{name}: wanted float64 of shape {shape}, got {got}')
    most = FARTHEST if name != 'informations' else 1e12
    if not (np.abs(array) <= most).all():
        raise ValueError(f'{name}: wanted numbers within {most:g}')
    return array
