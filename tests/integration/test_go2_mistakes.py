# SPDX-License-Identifier: Apache-2.0
"""A mistake with the Go2 gets one line that says what is wrong, and never a traceback."""

from collections.abc import Callable
from pathlib import Path
import subprocess

from cases import for_all
import pytest

pytestmark = pytest.mark.slow

Wasd = Callable[..., 'subprocess.CompletedProcess[str]']

SHORT = ('--duration', '1', '--speed', '0')
MISTAKES = [
    (['--estimator', 'guess'], "invalid choice: 'guess'"),
    (['--limits', 'none'], "invalid choice: 'none'"),
    ([*SHORT, '--world', 'slope:x'], '--world slope:x: wanted a number from -45 to 45'),
    ([*SHORT, '--world', 'slope:'], '--world slope:: wanted a number'),
    ([*SHORT, '--world', 'slope:nan'], '--world slope:nan: wanted a number'),
    ([*SHORT, '--world', 'stairs:9'], '--world stairs:9: wanted a number from 0.001 to 0.5'),
    ([*SHORT, '--world', 'boxes:-1'], '--world boxes:-1: wanted a number'),
    ([*SHORT, '--world', 'lava:1'], 'worlds: flat, room, office, slope:DEG'),
    (
        [*SHORT, '--description', 'mbot'],
        'found 4 limbs on base_footprint: left_wheel_joint (1 joint)',
    ),
    ([*SHORT, '--description', 'tripod.urdf'], 'tripod.urdf: a quadruped is wanted'),
    ([*SHORT, '--description', 'weak.urdf'], 'no motor on FL_calf_joint, FR_calf_joint'),
    ([*SHORT, '--preset', 'piano'], 'piano'),
    ([*SHORT, '--play', 'slip.keys'], 'slip.keys:2:'),
    ([*SHORT, '--push', '1 nan 0 0 1'], "wanted 't fx fy fz seconds [x y z]'"),
]


@pytest.fixture
def files(tmp_path: Path) -> None:
    """Write files that are wrong, each in its way."""
    from robot_description.packages import description_path
    from robot_description.xacro.session import expand_document

    urdf = expand_document(description_path('go2')).urdf
    held = urdf.replace('name="RR_hip_joint" type="revolute"', 'name="RR_hip_joint" type="fixed"')
    (tmp_path / 'tripod.urdf').write_text(held)
    (tmp_path / 'weak.urdf').write_text(urdf.replace('effort="35.55"', 'effort="0"'))
    (tmp_path / 'slip.keys').write_text('0.1 2\n1 NOWHERE\n')


@pytest.mark.usefixtures('files')
@for_all(('arguments', 'said'), MISTAKES)
def test_a_mistake_is_said_in_one_line(wasd: Wasd, arguments: list[str], said: str) -> None:
    done = wasd('go2', *arguments)
    assert done.returncode == 2, done.stderr
    lines = [line for line in done.stderr.splitlines() if not line.startswith('[')]
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith('error: ')
    assert said in lines[0]


def test_without_a_terminal_it_says_what_to_give_instead(wasd: Wasd) -> None:
    done = wasd('go2')
    assert done.returncode == 2
    assert done.stderr.startswith('error: no terminal for the keys: give --play FILE')


def test_mbot_has_no_estimator_to_choose(wasd: Wasd) -> None:
    done = wasd('mbot', '--estimator', 'truth')
    assert done.returncode == 2
    assert '--estimator' in done.stderr


def test_help_names_what_only_a_legged_robot_has(wasd: Wasd) -> None:
    done = wasd('go2', '--help')
    assert done.returncode == 0
    for option in ('--estimator', '--limits', '--world', '--push', '--preset'):
        assert option in done.stdout
    assert 'slope:DEG' in done.stdout
    assert 'unitree' in done.stdout
