# SPDX-License-Identifier: Apache-2.0
"""A saved session: read back as it was, gone on with where the robot finds itself, or refused."""

from io import BytesIO
import math

from cases import for_all
from lidar_room import circle, look
from navigation_stand_ins import odometry, scan, StandInLocator, StandInPilot
import numpy as np
import pytest
from wasd_core.errors import UserError
from wasd_navigation.mapping import load_session, save_session
from wasd_navigation.mapping.continued import ContinuedMapper
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.mapping.session import Session
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_parts
from wasd_navigation.robot_navigator import RobotNavigator
from wasd_navigation.se2 import compose, inverse

SURE = 1e-6 * np.eye(3)


@pytest.fixture(scope='module')
def mapped() -> Mapper:
    """Return what maps a room on two rounds."""
    mapper, random = Mapper(), np.random.default_rng(1)
    for number, pose in enumerate(circle(80)):
        mapper.step(look(pose, random), pose, (number + 1) * SURE)
    return mapper


@pytest.fixture
def saved(mapped, tmp_path) -> Session:
    save_session(mapped.session, tmp_path / 'room')
    return load_session(tmp_path / 'room.yaml')


def test_it_is_read_as_it_was_written(mapped, saved) -> None:
    before = mapped.session
    assert (saved.poses == before.poses).all()
    assert saved.resolution == before.resolution
    for kept, was in zip(saved.edges, before.edges, strict=True):
        assert (kept == was).all()
    for kept, was in zip(saved.scans, before.scans, strict=True):
        assert (kept.ends == was.ends).all()
        assert (kept.hits == was.hits).all()
        assert (kept.origin == was.origin).all()


def test_its_map_is_that_of_its_places(saved) -> None:
    grid = ContinuedMapper(saved).grid
    walls = grid.to_points(np.argwhere(grid.cells == 100))
    # The room of lidar_room, within a cell.
    assert walls.min(axis=0) == pytest.approx((-2.5, -2.0), abs=0.06)
    assert walls.max(axis=0) == pytest.approx((3.0, 2.5), abs=0.06)


def test_a_robot_finds_itself_in_it_and_maps_on(saved) -> None:
    again, random = ContinuedMapper(saved), np.random.default_rng(2)
    start = np.array((0.8, 0.3, 2.0))  # where odometry says 0 today
    places, revision = len(again.places), again.revision
    for number in range(200):
        turn = 0.02 * number
        true = compose(start, np.array((0.3 * math.sin(turn), 0.3 - 0.3 * math.cos(turn), turn)))
        said = compose(inverse(start), true)
        was_found = again.is_found
        again.step(look(true, random, with_box=number < 60), said, (number + 1) * SURE)
        if not again.is_found:
            assert again.revision == revision  # nothing is drawn meanwhile
            assert again.notice
        if was_found:
            off = compose(inverse(true), compose(again.correction, said))
            assert math.hypot(off[0], off[1]) < 0.03
    assert again.is_found
    assert again.notice == ''
    assert len(again.places) > places
    # The box has been taken away meanwhile: that is seen.
    middle = again.grid.to_cells(np.array(((1.2, 1.3),)))[0]
    assert again.grid.cells[tuple(middle)] < 65


def test_it_begins_with_the_session_again_when_it_is_reset(saved) -> None:
    again, random = ContinuedMapper(saved), np.random.default_rng(3)
    before = again.grid.cells.copy()
    for number, pose in enumerate(circle(40)):
        again.step(look(pose, random), pose, (number + 1) * SURE)
    assert again.is_found
    again.reset()
    assert not again.is_found
    assert (again.grid.cells == before).all()


def test_where_it_is_may_be_said(saved) -> None:
    again, random = ContinuedMapper(saved), np.random.default_rng(4)
    pose = np.array((0.5, -0.5, 1.0))
    again.start(pose + (0.1, -0.1, 0.1), np.diag((0.1, 0.1, 0.1)))
    for number in range(20):
        again.step(look(pose, random), np.zeros(3), (number + 1) * SURE)
    assert again.is_found
    assert again.pose == pytest.approx(pose, abs=0.03)


def arrays(session: Session) -> dict[str, np.ndarray]:
    """Return what is written, to change it."""
    data = {
        'poses': session.poses,
        'origins': np.array([scan.origin for scan in session.scans]),
        'counts': np.array([len(scan.ends) for scan in session.scans]),
        'rays': np.concatenate(
            [np.column_stack((scan.begins, scan.ends, scan.hits)) for scan in session.scans]
        ),
        'noise': np.array((session.resolution, session.share)),
        'pairs': session.edges.pairs,
        'links': session.edges.poses,
        'informations': session.edges.informations,
        'robust': session.edges.robust,
    }
    return {name: array.copy() for name, array in data.items()}


class Trap:
    """What would run if it were unpickled."""

    def __reduce__(self):
        """Say so."""
        return (pytest.fail, ('a file of a stranger has run code',))


def spoil(name, value):
    def change(data):
        data[name] = value(data[name])

    return change


@for_all(
    'change',
    [
        spoil('poses', lambda poses: poses * math.nan),
        spoil('poses', lambda poses: poses[:-1]),
        spoil('counts', lambda counts: counts + 1),
        spoil('counts', lambda counts: -counts),
        spoil('pairs', lambda pairs: pairs + 10**6),
        spoil('pairs', lambda pairs: pairs.astype(float)),
        spoil('links', lambda links: links[:, :2]),
        spoil('informations', lambda known: known * math.inf),
        spoil('robust', lambda robust: robust.astype(float)),
        spoil('noise', lambda noise: noise * -1.0),
        spoil('rays', lambda rays: np.array([Trap()], dtype=object)),
        lambda data: data.pop('origins'),
    ],
)
def test_what_is_no_session_is_refused_in_a_line(saved, tmp_path, change) -> None:
    data = arrays(saved)
    change(data)
    file = tmp_path / 'other.places.npz'
    np.savez(file, **data)
    with pytest.raises(UserError, match='no places of a map') as error:
        load_session(tmp_path / 'other.yaml')
    assert '\n' not in str(error.value)


@for_all(
    ('change', 'said'),
    [
        (lambda poses: poses.astype(np.float32), r'poses: wanted float64 .* got float32 of'),
        (lambda poses: poses + 1e300, 'poses: wanted numbers within 1e'),
    ],
)
def test_what_is_wrong_with_numbers_of_a_session_is_said(saved, tmp_path, change, said) -> None:
    data = arrays(saved)
    np.savez(tmp_path / 'other.places.npz', **data | {'poses': change(data['poses'])})
    with pytest.raises(UserError, match=said):
        load_session(tmp_path / 'other.yaml')


def test_what_would_grow_as_it_is_read_is_refused(saved, tmp_path) -> None:
    np.savez_compressed(tmp_path / 'other.places.npz', **arrays(saved))
    with pytest.raises(UserError, match='compressed'):
        load_session(tmp_path / 'other')


@for_all('data', [b'', b'PK\x03\x04', bytes(100)])
def test_a_file_of_something_else_is_refused(tmp_path, data) -> None:
    (tmp_path / 'other.places.npz').write_bytes(data)
    with pytest.raises(UserError, match='no places of a map'):
        load_session(tmp_path / 'other')


def test_a_cut_file_is_refused(saved, tmp_path) -> None:
    packed = BytesIO()
    np.savez(packed, **arrays(saved))
    (tmp_path / 'other.places.npz').write_bytes(packed.getvalue()[:-500])
    with pytest.raises(UserError, match='no places of a map'):
        load_session(tmp_path / 'other')


def test_places_stay_beside_their_own_map_alone(tmp_path) -> None:
    room, places = str(tmp_path / 'room.yaml'), tmp_path / 'room.places.npz'
    places.touch()

    def save(**values) -> str:
        """Save as `room` what a robot localises in."""
        settings = NavigatorParameters().changed(values)
        unit = RobotNavigator(settings, (StandInLocator(), StandInPilot()))
        unit.navigator.move(odometry())
        unit.navigator.see(scan(), odometry())
        return unit.save_map(room)

    assert save(map=room) == f'map in {room} and room.pgm'
    assert places.exists()
    assert save(map='elsewhere.yaml').endswith('room.pgm, without places: it cannot be continued')
    assert not places.exists()


def test_a_map_without_places_says_what_is_missing(tmp_path) -> None:
    with pytest.raises(UserError, match=r'none\.places\.npz: no such file'):
        load_session(tmp_path / 'none.yaml')


def test_to_go_on_a_map_is_needed() -> None:
    with pytest.raises(UserError, match='wanted a map to go on with'):
        make_parts(NavigatorParameters().changed({'continue_map': True}), lambda words: None)
