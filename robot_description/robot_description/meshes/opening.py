# SPDX-License-Identifier: Apache-2.0
"""What is in the mesh files of a robot: whether it can be used, and whether its size can be."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from robot_description.meshes.load import extent, FARTHEST
from robot_description.meshes.resolver import (
    EXACT,
    GUESSED,
    mesh_shapes,
    MeshRecord,
    MeshReport,
    MISSING,
    SIZE,
    UNUSABLE,
)
from robot_description.robot import Link, Robot, Shape

# A mesh is too large beyond so many times the robot's reach, and beyond so many metres at least;
# the latter without a reach, as that of a single link.
TIMES, LEAST_LARGE, LARGE = 20.0, 10.0, 100.0
# One that was guessed is none beyond so many times the reach.
TIMES_GUESSED = 10.0
# One is too small below this [m], if the robot reaches so many times further.
SMALL, TIMES_SMALLER = 1e-3, 50.0
# What a mesh may be in for metres.
MILLIMETRE = 1e-3
# A surface of this share of its size squared is a line or a point.
LEAST_AREA = 1e-9


def open_meshes(robot: Robot, report: MeshReport) -> MeshReport:
    """Return what is known of a robot's meshes after a look into their files."""
    records = [
        _opened(record, shape, robot.reach)
        for record, (shape, _) in zip(report.records, mesh_shapes(robot), strict=True)
    ]
    whole = MeshReport(tuple(records))
    return MeshReport(
        tuple(_with_stand_in(record, robot.links[record.link], whole) for record in records)
    )


def _opened(record: MeshRecord, shape: Shape, reach: float) -> MeshRecord:
    if record.file is None:
        return record
    try:
        edges = _edges(shape, record.file)
    except (OSError, ValueError) as error:
        return replace(record, kind=UNUSABLE, file=None, note=str(error))
    odd = _odd_size(edges, shape, reach)
    if GUESSED & {*record.kind.split('+')} and (odd or edges.max() > TIMES_GUESSED * reach > 0.0):
        size = ' x '.join(f'{edge:.3g}' for edge in edges)
        note = f'it would be {size} m large, the rest of the robot is within {reach:.2g} m'
        candidates = (record.file,)
        return replace(
            record, kind=MISSING, file=None, candidates=candidates, note=note, better=None
        )
    kinds = [kind for kind in (record.kind, SIZE) if kind != EXACT]
    return replace(record, kind='+'.join(kinds), note=odd) if odd else record


def _edges(shape: Shape, file: Path) -> np.ndarray:
    """
    Return the edges of the box around a mesh, scaled, shape (3,) [m].

    Raises:
        OSError, ValueError: there is nothing to be seen of it; says why, and what to do.
    """
    if not all(shape.scale):
        scale = ' '.join(f'{factor:g}' for factor in shape.scale)
        raise ValueError(f'scale="{scale}" leaves nothing of it')
    low, high, area = extent(file)
    edges = (high - low).astype(float)
    if area <= LEAST_AREA * edges.max() ** 2:
        raise ValueError(f'{file}: its triangles have no area')
    scaled: np.ndarray = edges * np.abs(shape.scale)
    if scaled.max() > FARTHEST:
        raise ValueError(f'{file}: its scale makes it {scaled.max():.3g} m large')
    return scaled


def _odd_size(edges: np.ndarray, shape: Shape, reach: float) -> str:
    """Return what is odd about the size of a mesh in its robot, or nothing."""
    size = float(edges.max())
    factor = 0.0
    if size > (max(TIMES * reach, LEAST_LARGE) if reach else LARGE):
        looks, factor = 'millimetres', MILLIMETRE
    elif size < SMALL and size * TIMES_SMALLER < reach:
        looks, factor = 'scaled from millimetres twice', 1.0 / MILLIMETRE
    if not factor:
        return ''
    told = f'it is {" x ".join(f"{edge:.3g}" for edge in edges)} m large'
    if reach:
        told += f', the rest of the robot is within {reach:.2g} m'
        if size * factor > TIMES * reach:
            return f'{told}: check its unit and scale'
    scale = ' '.join(f'{factor * each:g}' for each in shape.scale)
    return f'{told}: looks like {looks}: scale="{scale}"'


def _with_stand_in(record: MeshRecord, link: Link, report: MeshReport) -> MeshRecord:
    """Say what becomes of a link that has lost what it collides with."""
    if record.file is not None or record.use == 'visual':
        return record
    if any(map(report.is_usable, link.collisions)):
        return record
    stands_in = bool(colliding(link, report.is_usable))
    instead = 'what is drawn collides instead' if stands_in else 'nothing collides there'
    return replace(record, instead=instead)


def with_stand_ins(robot: Robot, is_usable: Callable[[Shape], bool]) -> Robot:
    """Return the robot with what stands in for meshes that are not usable; see `colliding`."""
    links = {
        name: link
        if all(map(is_usable, link.collisions))
        else replace(link, shapes=(*link.visuals, *colliding(link, is_usable)))
        for name, link in robot.links.items()
    }
    return replace(robot, links=links)


def colliding(link: Link, is_usable: Callable[[Shape], bool]) -> tuple[Shape, ...]:
    """Return what a link collides with: what it can, else what is drawn of it, else nothing."""
    kept = tuple(shape for shape in link.collisions if is_usable(shape))
    if kept or not link.collisions:
        return kept
    return tuple(replace(shape, collides=True) for shape in link.visuals if is_usable(shape))
