# SPDX-License-Identifier: Apache-2.0
"""`wasd calibrate` on mbot: errors put into its controller are found again."""

import contextlib
import io
import math
from pathlib import Path
import shlex
from types import SimpleNamespace

from cases import for_all
from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.odometry import DiffDriveGeometry
import numpy as np
import pytest
from wasd_bringup.cli import main
from wasd_bringup.tools import calibrate
from wasd_bringup.tools.calibrate import SquareTest, to_yaml
from wasd_core.errors import UserError

pytestmark = pytest.mark.slow

WHEELS = Path(__file__).parents[1] / 'catalogue' / 'wheels'
TRUE_RADIUS, TRUE_SEPARATION = 0.06, 0.38


@pytest.fixture(scope='module')
def calibrated(tmp_path_factory):
    """Return the status, the output and the file of a calibration with 2 % and 0.26 m put in."""
    file = tmp_path_factory.mktemp('calibration') / 'my mbot.yaml'
    words = ['--wheel-separation', '0.26', '--right-radius', '0.0612', '--output', str(file)]
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        status = main(['calibrate', '--runs', '1', '--side', '0.3', *words])
    return status, said.getvalue(), file


def test_the_width_and_the_radius_are_found_within_a_fifth_of_a_percent(calibrated):
    status, _, file = calibrated
    values = read_controller_file(str(file)).values
    assert status == 0
    separation = values['wheel_separation'] * values['wheel_separation_multiplier']
    assert separation == pytest.approx(TRUE_SEPARATION, rel=0.002)
    for side in ('left', 'right'):
        radius = TRUE_RADIUS * values[f'{side}_wheel_radius_multiplier']
        assert radius == pytest.approx(TRUE_RADIUS, rel=0.002)


def test_it_shows_what_was_believed_and_both_estimates(calibrated):
    _, said, _ = calibrated
    rows = {line[:22].strip(): line[22:].split() for line in said.splitlines()}
    assert rows['right radius [mm]'][0] == '61.200'
    assert rows['wheel separation [mm]'][0] == '260.000'
    exact = [float(rows[f'E_{name}'][2]) for name in ('d, right over left', 'b, wheelbase')]
    np.testing.assert_allclose(exact, [1.0 / 1.02, 0.38 / 0.26], rtol=0.002)


def test_the_command_that_uses_the_file_can_be_pasted(calibrated):
    _, said, file = calibrated
    (line,) = (line for line in said.splitlines() if line.startswith('written to'))
    command = line.removeprefix(f'written to {file}: ')
    assert shlex.split(command) == ['wasd', 'mbot', '--controller', str(file)]


def test_the_corrected_robot_returns_to_where_it_began(calibrated):
    _, said, file = calibrated
    (line,) = (line for line in said.splitlines() if line.startswith('largest return error'))
    believed, corrected = (float(word) for word in line.split() if word.replace('.', '').isdigit())
    assert believed > 100.0
    assert corrected < 2.0
    assert f'{corrected:.2f} mm after' in file.read_text()


@for_all(
    ('limits', 'wheel_speed'),
    [
        ({'forward': 0.12, 'yaw': 0.3}, 25.0),
        ({'forward': 0.5, 'yaw': 1.5}, 1.0),
        ({'forward': 0.5, 'yaw': 1.5}, math.inf),
    ],
)
def test_no_leg_is_faster_than_the_controller_and_the_wheels_allow(limits, wheel_speed):
    wheels = DiffDriveGeometry('l', 'r', 0.06, 0.38, speed_limit=wheel_speed)
    robot = SimpleNamespace(
        geometry=wheels, drive_limits=limits, period=0.005, state='stopped', command=None
    )
    schedule = SimpleNamespace(at_rate=lambda *one: None, every=lambda *one: None)
    run = SimpleNamespace(world=None, robot=robot, simulation=SimpleNamespace(schedule=schedule))
    legs = np.array(list(calibrate._Square(run, SquareTest(), 0, None)._velocities))
    assert legs[:, 0].max() < limits['forward']
    assert legs[:, 2].max() < limits['yaw']
    assert max(max(wheels.wheel_speeds(v, w)) for v, _, w in legs) < wheel_speed
    ahead, _, turn = calibrate.TICK * legs.sum(axis=0)
    assert (ahead, turn) == pytest.approx((4.0, 2.0 * math.pi))


def test_the_file_keeps_what_the_controller_was_started_with(tmp_path):
    started = {'left_wheel_names': ['left_wheel_joint'], 'wheel_separation': 0.26, 'Kp': 12.0}
    started['right_wheel_names'] = ['right_wheel_joint']
    file = tmp_path / 'all.yaml'
    file.write_text(to_yaml(started | {'wheel_separation_multiplier': 0.38 / 0.26}, 'why'))
    values = read_controller_file(str(file)).values
    assert {key: values[key] for key in ('wheel_separation', 'Kp')} == {
        'wheel_separation': 0.26,
        'Kp': 12.0,
    }
    assert values['left_wheel_names'] == ('left_wheel_joint',)
    assert values['wheel_separation_multiplier'] == pytest.approx(0.38 / 0.26, abs=1e-6)


def test_a_radius_is_that_of_the_wheels_that_the_file_chooses(monkeypatch, capsys):
    believed = []

    def stop(test, parameters, *more):
        believed.append(parameters)
        raise UserError('enough')

    monkeypatch.setattr(calibrate, 'drive_squares', stop)
    words = ['--description', str(WHEELS / 'four_wheels.xacro')]
    words += ['--controller', str(WHEELS / 'front_wheels.yaml'), '--left-radius', '0.04']
    assert main(['calibrate', *words]) == 2
    assert capsys.readouterr().err == 'error: enough\n'
    assert believed[0]['left_wheel_radius_multiplier'] == pytest.approx(0.04 / 0.08)


@for_all(
    ('words', 'error'),
    [
        (['--side', '0'], '--side: got 0, wanted 0.2 to 10'),
        (['--runs', '0'], '--runs: got 0, wanted 1 to 100'),
        (['--right-radius', '-1'], '--right-radius: got -1, wanted metres from 0.001 to 10'),
        (['--wheel-separation', 'nan'], '--wheel-separation: got nan, wanted metres'),
        (['--description', 'moon'], 'moon: no such file, and no robot of that name'),
        (['--description', 'go2'], 'has no two driven wheels'),
        (['--controller', 'none.yaml'], 'none.yaml: No such file'),
        (['--output', 'no/such/folder.yaml'], '--output no/such/folder.yaml: wanted a file'),
        (['--output', '.'], '--output .: wanted a file'),
        (['--package-path', 'no/such'], '--package-path no/such: no such folder'),
    ],
)
def test_a_mistake_is_one_line(words, error, capsys):
    assert main(['calibrate', *words]) == 2
    said = capsys.readouterr().err
    assert error in said
    assert said.startswith('error: ')
    assert said.count('\n') == 1
