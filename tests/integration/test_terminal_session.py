# SPDX-License-Identifier: Apache-2.0
"""`wasd mbot` on a real pseudo-terminal: keys in, motion out, the terminal given back."""

from collections.abc import Callable
import itertools
import json
import os
from pathlib import Path
import re
import termios
from typing import Any

from geometry_msgs.msg import Twist
import programs
import pytest
from terminals import PATIENCE, wait_until

pytestmark = pytest.mark.slow

# The same command with a fault in the midst of the run.
FAULTY = """
import os, sys
from mujoco_sim.world import Physics
step = Physics.step
def faulty(self, count):
    if os.path.exists('fault'):
        raise RuntimeError('made for a test')
    step(self, count)
Physics.step = faulty
from wasd_bringup.cli import main
sys.exit(main(sys.argv[1:]))
"""

# A shell that pipes a key into it, once the test says so.
PIPE = 'trap : INT; (until [ -e key ]; do sleep 0.1; done; printf i) | "$0" "$@"'


def simulated(session: Any) -> float:
    """Return the time on the status line [s]."""
    session.read(0.01)
    return float(re.findall(r'  (\d+\.\d) s x', session.shown)[-1])


def test_holding_i_rolls_mbot_as_far_as_the_ramp_law_says_and_ctrl_c_is_the_way_out(
    start: Callable[..., Any], tmp_path: Path
) -> None:
    session = start('--report', 'report.json')
    session.wait_for('Ctrl-C quit')
    session.wait_for('stopped')
    held = session.hold('i', 3.0)
    session.read(0.1)
    session.shown = ''
    session.wait_for('stopped')
    until = simulated(session) + 1.0
    wait_until(lambda: simulated(session) >= until)
    session.type('\x03')
    assert session.end() == 0
    assert termios.tcgetattr(session.slave) == session.before
    assert 'report in report.json' in session.shown
    report = json.loads((tmp_path / 'report.json').read_text())
    x, y, _ = report['samples']['position'][-1]
    # Ramps of 0.6 m/s^2 to 0.2 m/s and back, also where a busy host repeats the key too late.
    speeds = [command[0] for command in report['samples']['command']]
    assert max(speeds) == pytest.approx(0.2)
    assert max(abs(b - a) for a, b in itertools.pairwise(speeds)) <= 0.6 * 0.02 + 1e-9
    # Equal ramps: speed x (hold + release delay), the delay being 0.12 s after the last press. On
    # a host that cannot keep pace less time is simulated than the key was held.
    assert x <= 1.03 * 0.2 * (held + 0.12)
    assert abs(y) < 0.001
    commanded = 0.02 * sum(speeds)
    assert x == pytest.approx(commanded, rel=0.03)
    assert report['samples']['velocity'][-1][0] == pytest.approx(0.0, abs=1e-6)


def test_an_exception_leaves_the_terminal_as_it_was_and_the_robot_stopped(
    start: Callable[..., Any], commands: Any, hold_until_it_drives: Any, tmp_path: Path
) -> None:
    session = start('--report', 'report.json', program=('-c', FAULTY))
    session.wait_for('stopped')
    hold_until_it_drives(session, commands)
    (tmp_path / 'fault').touch()
    assert session.end() == 1
    assert 'made for a test' in session.shown
    assert termios.tcgetattr(session.slave) == session.before
    wait_until(lambda: commands(0.05)[-1] == Twist())
    assert json.loads((tmp_path / 'report.json').read_text())['samples']['command'][-1][0] > 0.0


def test_it_shows_the_keys_and_a_status_line_and_a_closed_terminal_ends_it(
    start: Callable[..., Any],
) -> None:
    session = start()
    session.wait_for('drive with i , j l')
    session.wait_for('full 0.20 m/s')
    session.type('q')
    session.wait_for('full 0.22 m/s')
    session.type('?')
    session.wait_for('Control mbot!')
    os.close(session.master)
    session.master = os.dup(session.slave)
    assert session.process.wait(PATIENCE) in (128 + 1, -1)


def test_after_the_end_of_a_pipe_ctrl_c_is_a_signal_again(
    start: Callable[..., Any], tmp_path: Path
) -> None:
    program = (*programs.IN_SHELL, PIPE, '-m', 'wasd_bringup.cli')
    session = start('--no-ros', '--duration', '600', program=program)
    # The test is a terminal that tells releases.
    session.wait_for('\x1b[?u')
    session.type('\x1b[?0u')
    session.wait_for('\x1b[>27u')
    (tmp_path / 'key').touch()
    session.wait_for('\x1b[<u')
    session.type('\x03')
    assert session.end() == 0
    assert termios.tcgetattr(session.slave) == session.before
