# SPDX-License-Identifier: Apache-2.0
"""A world that is a stranger's MJCF or URDF file, checked before MuJoCo builds it."""

from collections.abc import Sequence
import contextlib
import itertools
import logging
import math
import os
from pathlib import Path
import re
import stat
import struct
from typing import Any
import warnings
from xml.etree import ElementTree

import mujoco
import numpy as np
from wasd_core.errors import one_line, SimulationError
from wasd_core.map_picture import yaml_beside

from mujoco_sim.parameters import WORLD_FILES, WORLD_KINDS, WORLD_NAMES

LOGGER = logging.getLogger(__name__)
# What a file may have, and its replicate, composite and flexcomp make, one within the other.
MOST_COPIES = 100_000
# Of so many files copies are counted; how large each may be [B], and a height field or a texture.
MOST_INCLUDED, LARGEST_INCLUDED, MOST_CELLS = 50, 20_000_000, 50_000_000
SIDES = {'hfield': ('nrow', 'ncol'), 'texture': ('width', 'height')}
PREFIX = 'world/'
# A robot that begins deeper in a shape, or higher above the ground, is told of [m]; feet of one
# that lies are in the floor by a centimetre or two.
DEEP, HIGH = 0.03, 0.5
_DOWN = np.array((0.0, 0.0, -1.0))


def attach_world_file(spec: mujoco.MjSpec, world: str) -> None:
    """
    Put what an MJCF or URDF file describes into a specification.

    Raises:
        SimulationError: it is missing, no such file, faulty, or too large to build.
    """
    path = Path(world)
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise SimulationError(
            f'--world {world}: no such file, and no world of that name; '
            f'worlds: {WORLD_NAMES}, {WORLD_KINDS}{yaml_beside(world)}'
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise SimulationError(f'--world {world}: {one_line(error)}') from None
    if not stat.S_ISREG(mode):
        found = 'a folder' if stat.S_ISDIR(mode) else 'a device or pipe'
        raise SimulationError(f'--world {world}: is {found}, wanted a file')
    if path.suffix.lower() not in WORLD_FILES:
        raise SimulationError(
            f'--world {world}: wanted an MJCF or URDF file, whose name ends in '
            + ' or '.join(WORLD_FILES)
            + ', or a floor plan: FILE.yaml, or PICTURE,METRES_PER_PIXEL as in plan.png,0.05'
            + yaml_beside(world)
        )
    copies = _count_copies(path, [])
    if copies > MOST_COPIES:
        wanted = f'wanted at most {MOST_COPIES} elements and copies'
        raise SimulationError(f'{world}: {wanted}, got {copies:.0f}')
    try:
        # Here, where its mistakes are known to be the file's.
        with warnings.catch_warnings(record=True, action='always') as said:
            surroundings = mujoco.MjSpec.from_file(str(path))
            model = surroundings.compile()
            model.names.decode()
        for warning in said:
            LOGGER.warning('%s: %s', world, ' '.join(str(warning.message).split()))
        for name in dir(model):
            # The boxes around shapes are MuJoCo's, not the file's.
            if not name.startswith('bvh_') and not _is_sound(name, getattr(model, name)):
                raise ValueError(f'got NaN or infinity for {name}')
        spec.attach(surroundings, prefix=PREFIX, frame=spec.worldbody.add_frame())
    except UnicodeDecodeError:  # MuJoCo takes no notice of an encoding that a file declares
        raise SimulationError(f'{world}: a name in it is not UTF-8 text') from None
    except ValueError as error:
        raise SimulationError(f'{world}: {_in_words(one_line(error))}') from None


def tell_of_start(world: str, model: mujoco.MjModel, data: mujoco.MjData, root: int) -> None:
    """Say where a robot that is at its start is inside what a file describes, or above nothing."""
    own = model.body_rootid[model.geom_bodyid] == root
    pairs, depths = data.contact.geom, -data.contact.dist
    # What is no geom, as cloth, has the number -1.
    is_of_both = (pairs >= 0).all(axis=1) & (own[pairs].sum(axis=1) == 1)
    depths = np.where(is_of_both, depths, 0.0)
    if depths.max(initial=0.0) > DEEP:
        deepest = int(depths.argmax())
        (other,) = (geom for geom in pairs[deepest].tolist() if not own[geom])
        kind = mujoco.mjtGeom(model.geom_type[other]).name.removeprefix('mjGEOM_').lower()
        body = model.geom_bodyid[other]
        name = model.geom(other).name or (model.body(body).name if body else f'a {kind}')
        hull = ', which is solid as its convex hull' if kind == 'mesh' else ''
        LOGGER.warning(
            '%s: the robot begins %.2f m deep in %r%s (on z = 0, at x %.1f, y %.1f)',
            *(world, depths[deepest], name.removeprefix(PREFIX), hull, *data.xpos[root, :2]),
        )
        return
    fall = 0.0 if model.nflex else _fall(model, data, own, data.subtree_com[root])
    if fall > HIGH:
        what = 'no ground' if math.isinf(fall) else f'the ground {fall:.2f} m'
        LOGGER.warning(
            "%s: there is %s below the robot's start (on z = 0, at x %.1f, y %.1f)",
            *(world, what, *data.xpos[root, :2]),
        )


def _fall(
    model: mujoco.MjModel, data: mujoco.MjData, own: np.ndarray, centre: np.ndarray
) -> float:
    """Return how far below z = 0 what bears a robot is [m], infinity where nothing does."""
    kinds, others = (
        int(np.bitwise_or.reduce(each[own], initial=0))
        for each in (model.geom_contype, model.geom_conaffinity)
    )
    bears = ~own & (((model.geom_contype & others) | (model.geom_conaffinity & kinds)) != 0)
    falls = [math.inf]
    # A plane has no end, but for rays.
    for plane in np.flatnonzero(bears & (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)):
        normal = data.geom_xmat[plane, 2::3]
        if normal[2] > 0.0:
            falls.append(-float(centre[2] - normal @ (centre - data.geom_xpos[plane]) / normal[2]))
    at, hit = centre.copy(), np.zeros(1, np.int32)
    for _ in range(2 * model.ngeom):
        way = mujoco.mj_ray(model, data, at, _DOWN, None, 1, -1, hit)
        if way < 0.0:
            break
        at[2] -= way
        if bears[hit[0]]:
            falls.append(-float(at[2]))
            break
        at[2] -= 1e-6  # from there on, through it
    return min(falls)


def _is_sound(name: str, value: Any) -> bool:
    if not isinstance(value, np.ndarray) or value.dtype.kind != 'f':
        return True
    # A range without an end is a legal one.
    wrong = np.isnan(value) if name.endswith(('range', 'cutoff')) else ~np.isfinite(value)
    return not wrong.any()


def _in_words(reason: str) -> str:
    """Return what MuJoCo says of a file, the codes of its XML reader in words."""
    words, broken = 'not well-formed XML in UTF-8, line', r"XML parse error .*?number=(\d+)[^']*"
    said = re.sub(broken, lambda found: f'{words} {max(1, int(found[1]))}', reason)
    cure = ': a world has no packages, give the path from its own folder'
    return said + cure * ("'package:" in said)


def _count_copies(path: Path, looked: list[Path]) -> float:
    """
    Return how many copies an MJCF file makes, with what it includes.

    Raises:
        SimulationError: `_read` refuses it or a file that it includes, or it is nested too deep.
    """
    looked.append(path)
    root = _read(path)

    def copies(element: ElementTree.Element) -> float:
        file = element.get('file', '')
        if file and element.tag in ('include', 'model') and len(looked) < MOST_INCLUDED:
            return _count_copies(path.parent / file, looked)
        own = 1.0
        if element.tag in ('replicate', 'composite', 'flexcomp'):
            for word in element.get('count', '').split():
                own *= float(word) if word.isdecimal() else 1.0
        return own * max(1.0, sum(map(copies, element)))

    try:
        return 1.0 if root is None else copies(root)
    except RecursionError:
        raise SimulationError(f'{path}: is nested too deep') from None


def _read(path: Path) -> ElementTree.Element | None:
    """
    Return what is in an MJCF file, None if it is no XML or missing: MuJoCo tells more.

    Raises:
        SimulationError: it or a picture is too large, or no file: MuJoCo would wait for ever.
    """
    try:
        size = _check_file(path)
        if size > LARGEST_INCLUDED:
            most = LARGEST_INCLUDED / 1e6
            raise SimulationError(f'{path}: got {size / 1e6:.0f} MB, wanted at most {most:g} MB')
        root = ElementTree.parse(path).getroot()
    except SimulationError:
        raise
    except (ElementTree.ParseError, OSError, ValueError):
        return None

    kinds = ('meshdir', 'texturedir', 'assetdir')
    folders = {''} | {each.get(kind, '') for each in root.iter('compiler') for kind in kinds}
    for element in root.iter():
        # A cube's texture has six: fileup, filedown ...
        files = [each for name, each in element.items() if name.startswith('file') and each]
        for folder, each in itertools.product(folders, files):
            with contextlib.suppress(OSError):  # MuJoCo tells more
                _check_picture(path.parent / folder / each)
        sides = [element.get(name, '') for name in SIDES.get(element.tag, ())]
        if all(map(str.isdecimal, sides)):
            _check_cells(f'{path}: {element.tag}', sides)
    return root


def _check_cells(what: str, sides: Sequence[float | str]) -> None:
    if math.prod(map(float, sides)) > MOST_CELLS:
        got = ' x '.join(map(str, sides))
        raise SimulationError(f'{what}: got {got}, wanted at most {MOST_CELLS} cells')


def _check_picture(path: Path) -> None:
    """Refuse a file that is none, and a PNG that unpacks to too much; see `_check_file`."""
    _check_file(path)
    with path.open('rb') as file:
        head = file.read(24)
    if head[12:16] == b'IHDR' and len(head) == 24:
        _check_cells(f'{path}', struct.unpack('>II', head[16:]))


def _check_file(path: Path) -> int:
    """
    Return the size of a file [B].

    Raises:
        SimulationError: it is no file.
        OSError: it is missing.
    """
    about = path.stat()
    if not stat.S_ISREG(about.st_mode):
        raise SimulationError(f'{path}: is no file')
    return about.st_size
