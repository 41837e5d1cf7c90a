# SPDX-License-Identifier: Apache-2.0
"""
The catalogue: small descriptions as other people write them, and what becomes of each.

A folder holds descriptions of one sort and `expected.yaml`, a row for each:

    file       the description, beside the table; a file may have several rows
    kind       what `describe info` calls it; left out where it cannot be read at all
    verdict    `loads`, or `refused` with one line
    words      all of these are in that line; of one that loads, in what is said while it does
    info       all of these are in what `describe info` prints
    lint       all of these are in what `describe lint` prints
    drives     true: it goes where it is sent, by its own controller, in the real physics
    falls_short  it is slower than it is told, and says so once, in these words, with the share
    command    `go2` or `mbot`, where it is another than its kind's (its folder's, without one)
    arguments  of xacro
    controller YAML of the controller, beside the table
"""

from collections.abc import Callable
from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import Any

from cases import for_all
from mujoco_sim.world import build_world
import numpy as np
import pytest
from robot_description.description import read_description
from robot_description.info import print_info
from robot_description.lint.session import lint
from robot_description.packages import description_path, share_directory
from robot_description.xacro.session import XacroSession
import wasd
from wasd_bringup.run import worlds
from wasd_core.rotations import matrix_from_quaternion, yaw_of
import yaml

HERE = Path(__file__).parent
FOLDERS = ('wheels', 'legs', 'meshes', 'words')
SUFFIXES = ('.urdf', '.xacro', '.sdf', '.xml', '.html')


# The tables are long, and each worker reads them before its first test.
LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a table; see above."""

    folder: str
    file: str
    verdict: str
    kind: str = ''
    words: tuple[str, ...] = ()
    info: tuple[str, ...] = ()
    lint: tuple[str, ...] = ()
    drives: bool = False
    falls_short: str = ''
    command: str = ''
    arguments: dict[str, str] = field(default_factory=dict)
    controller: str = ''

    @property
    def path(self) -> Path:
        """The description."""
        return HERE / self.folder / self.file

    def load(self) -> Any:
        """Return the robot with its controller in its world, as `wasd --description` makes it."""
        legged = self.kind == 'quadruped' or (not self.kind and self.folder == 'legs')
        more = {'controller': self.path.with_name(self.controller)} if self.controller else {}
        make: Any = wasd.Go2 if (self.command or 'go2' * legged) == 'go2' else wasd.Mbot
        return make(description=str(self.path), xacro_arguments=self.arguments, **more)


def rows() -> list[Row]:
    """Return the rows of all tables."""
    return [
        Row(folder=folder, **{k: tuple(v) if isinstance(v, list) else v for k, v in row.items()})
        for folder in FOLDERS
        if (table := HERE / folder / 'expected.yaml').exists()
        for row in yaml.load(table.read_text(), LOADER)
    ]


ROWS = rows()

# Each loads a robot: with those of robot_description/ they are no quick tests.
pytestmark = [pytest.mark.long, pytest.mark.slow]


def by_itself(*chosen: Row) -> Any:
    """Return the mark that makes a test of each of these rows."""
    return pytest.mark.parametrize('row', chosen, ids=lambda row: f'{row.folder}/{row.file}')


def test_every_description_has_a_row_and_every_row_a_description() -> None:
    files = {p for name in FOLDERS for p in (HERE / name).iterdir() if p.suffix in SUFFIXES}
    assert files == {row.path for row in ROWS}


@pytest.fixture(scope='module')
def loaded() -> dict[str, Any]:
    """Return the robots that were loaded and are still to be driven, by their rows."""
    return {}


@for_all('row', [row for row in ROWS if row.verdict == 'loads'])
def test_it_loads_and_says_what_it_makes_of_it(
    row: Row, caplog: pytest.LogCaptureFixture, loaded: dict[str, Any]
) -> None:
    robot = row.load()
    if row.drives:
        loaded[repr(row)] = robot
    for word in row.words:
        assert word in caplog.text


@for_all('row', [row for row in ROWS if row.verdict == 'refused'])
def test_it_is_refused_in_one_line_with_the_reason(row: Row) -> None:
    assert row.words
    with pytest.raises(wasd.UserError) as refusal:
        row.load()
    line = str(refusal.value)
    assert '\n' not in line
    for word in row.words:
        assert word in line


@for_all('row', [row for row in ROWS if row.kind or row.info])
def test_info_calls_it_what_it_is(row: Row, capsys: pytest.CaptureFixture[str]) -> None:
    described = read_description(description_path(str(row.path)), (), row.arguments)
    assert described.kind == row.kind
    print_info(described)
    printed = ' '.join(capsys.readouterr().out.split())
    for word in row.info:
        assert word in printed


@for_all('row', [row for row in ROWS if row.lint])
def test_lint_says_it(row: Row) -> None:
    findings = '\n'.join(each.line() for each in lint(XacroSession(row.path, row.arguments)))
    for word in row.lint:
        assert word in findings


# What a robot drives, by its kind: so far [m] at a speed [m/s], a turn at a rate [rad/s], and how
# far off it may be, as a share and [rad].
WAY, SPEED, TURN, RATE, OFF, OFF_TURN = 0.7, 0.35, math.pi, 1.5, 0.01, 0.02
# What it is given to settle as it was put down, and at most to come to rest [s].
SETTLE, REST = 0.5, 1.0


def come_to_rest(robot: Any) -> None:
    """Stop; go on once it stands still, or after REST."""
    robot.drive(0.0)
    for _ in range(round(REST / 0.1)):
        robot.run(0.1)
        if np.abs(robot.truth.planar_velocity).max() < 2e-3:
            break


def drive_wheels(robot: Any) -> None:
    """Go WAY ahead, then turn by TURN on the spot; odometry knows."""
    robot.run(SETTLE)
    start, ahead = robot.truth.position.copy(), yaw_of(robot.truth.orientation)
    robot.drive(SPEED)
    robot.run(WAY / SPEED)
    come_to_rest(robot)
    went = robot.truth.position - start
    goal = WAY * np.array([math.cos(ahead), math.sin(ahead)])
    assert went[:2] == pytest.approx(goal, abs=OFF * WAY)
    believed = yaw_of(robot.odometry.orientation)
    robot.drive(0.0, RATE)
    yaws = [yaw_of(robot.truth.orientation)]
    for _ in range(4):  # in parts, in which the angle has but one meaning
        robot.run(TURN / RATE / 4)
        yaws.append(yaw_of(robot.truth.orientation))
    come_to_rest(robot)
    yaws.append(yaw_of(robot.truth.orientation))
    assert float(np.unwrap(yaws)[-1]) - yaws[0] == pytest.approx(TURN, abs=OFF_TURN)
    off = math.remainder(yaw_of(robot.odometry.orientation) - believed - TURN, 2.0 * math.pi)
    assert abs(off) <= OFF_TURN


# What a robot is told that falls short [m/s]; the share that it says may be off by so much.
STEADY, OFF_SHARE = 0.25, 0.05


@by_itself(*(row for row in ROWS if row.falls_short))
def test_it_says_once_by_how_much_it_falls_short(
    row: Row, caplog: pytest.LogCaptureFixture
) -> None:
    robot = row.load()
    robot.run(REST)
    robot.drive(STEADY)
    speeds = []
    for _ in range(50):
        robot.run(0.1)
        speeds.append(float(robot.truth.planar_velocity[0]))
    said = re.findall(f'{row.falls_short}.*: (-?\\d+) % of the speed asked for', caplog.text)
    assert len(said) == 1
    # It is measured in the second second, after a ramp of less than one.
    shares = [np.mean(speeds[start : start + 10]) / STEADY for start in range(10, 20)]
    assert min(shares) - OFF_SHARE <= int(said[0]) / 100.0 <= max(shares) + OFF_SHARE


# What a quadruped is told [m/s], [m/s], [rad/s], and how far off it may be, as a share.
WALKS, SLIP = (0.4, 0.3, 0.6), 0.1
# How long it gets up, and after a command gets into stride; then it is measured [s].
UP, STRIDE, MEASURED, PARTS = 1.1, 0.6, 0.8, 4


def velocity(robot: Any) -> np.ndarray:
    """Return the mean velocity (ahead, left, turn) [m/s], [m/s], [rad/s] over MEASURED."""
    way = np.zeros(3)
    for _ in range(PARTS):  # in parts, which are nearly straight
        place, yaw = robot.truth.position.copy(), yaw_of(robot.truth.orientation)
        robot.run(MEASURED / PARTS)
        turn = math.remainder(yaw_of(robot.truth.orientation) - yaw, 2.0 * math.pi)
        x, y, _ = (robot.truth.position - place).tolist()
        cosine, sine = math.cos(yaw + turn / 2), math.sin(yaw + turn / 2)
        way += (cosine * x + sine * y, cosine * y - sine * x, turn)
    return way / MEASURED


def walk(robot: Any) -> None:
    """
    Stand up, walk ahead, sideways and in a bend at once, as fast as told.

    One that cannot goes each way by itself, as fast as full stick is.
    """
    robot.press('2')
    robot.press('5')
    robot.run(UP)
    able = np.greater_equal(robot.full_stick, WALKS).all()
    for command in [np.array(WALKS)] if able else np.diag(np.minimum(WALKS, robot.full_stick)):
        robot.drive(*command.tolist())
        robot.run(STRIDE)
        told = command > 0.0
        assert velocity(robot)[told] == pytest.approx(command[told], rel=SLIP)
    assert robot.state == 'move base'
    assert matrix_from_quaternion(robot.truth.orientation)[2, 2] > math.cos(0.1)  # upright


DRIVES: dict[str, Callable[[Any], None]] = {'diff-drive': drive_wheels, 'quadruped': walk}


# All robots of example-robot-data that have four legs of three joints and masses; two have arms.
QUADRUPEDS = (
    'a1_description/urdf/a1',
    'anymal_b_simple_description/robots/anymal',
    'anymal_b_simple_description/robots/anymal-kinova',
    'anymal_c_simple_description/urdf/anymal',
    'b1_description/urdf/b1',
    'b1_description/urdf/b1-z1',
    'go1_description/urdf/go1',
    'go2_description/urdf/go2',
    'hyq_description/robots/hyq_no_sensors',
    'laikago_description/urdf/laikago',
    'solo_description/robots/solo12',
)


@pytest.mark.slow
@pytest.mark.parametrize('name', QUADRUPEDS)
def test_a_quadruped_of_example_robot_data_walks(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Reading what is drawn of it takes longer than its walk.
    monkeypatch.setattr(worlds, 'build_world', lambda *args: build_world(*args[:4]))
    robots = share_directory('example-robot-data') / 'robots'
    walk(wasd.Go2(description=str(robots / f'{name}.urdf')))


@by_itself(*(row for row in ROWS if row.drives))
def test_it_goes_where_it_is_sent_and_says_nothing_of_its_speed(
    row: Row, loaded: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    DRIVES.get(row.kind, drive_wheels)(loaded.pop(repr(row), None) or row.load())
    if not row.falls_short:
        assert 'of the speed asked for' not in caplog.text
