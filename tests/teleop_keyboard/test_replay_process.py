# SPDX-License-Identifier: Apache-2.0
"""A drive of mbot on a terminal, saved, and played again: the same robot, to the last digit."""

import json
import os
import time

import programs
import pytest
from teleop_keyboard.key_script import parse_key_script
from terminals import PATIENCE

pytestmark = pytest.mark.slow

WASD = ('-m', 'wasd_bringup.cli', 'mbot', '--viewer', 'none', '--report')


def test_a_replay_of_a_drive_is_the_drive(pty_process, ros_domain, tmp_path):
    saved, live, again = (tmp_path / name for name in ('drive.keys', 'live.json', 'again.json'))
    process = pty_process(*WASD, str(live), '--save-keys', str(saved))
    deadline = time.monotonic() + PATIENCE
    while b'stopped' not in process.output:
        assert time.monotonic() < deadline, process.output
        time.sleep(0.05)
    for key in 'iiiiijjjjéuuqii':
        process.type(key.encode())
        time.sleep(0.04)
    time.sleep(1.5)  # a second of simulated time on a busy machine
    process.type(b'\x03')
    assert process.wait() == 0
    keys = [press.key for press in parse_key_script(saved.read_text())]
    assert keys == list('iiiiijjjjéuuqii')
    report = json.loads(live.read_text())
    end = report['samples']['t'][-1]
    words = (*WASD[2:], str(again), '--play', str(saved), '--duration', str(end))
    done = programs.run_wasd(words, tmp_path, dict(os.environ))
    assert done.returncode == 0, done.stderr
    replayed = json.loads(again.read_text())
    count = min(len(replayed['samples']['t']), len(report['samples']['t'])) - 1
    assert count > 50
    for series in ('t', 'command', 'position', 'velocity'):
        assert replayed['samples'][series][:count] == report['samples'][series][:count]
