# SPDX-License-Identifier: Apache-2.0
"""A drive of mbot on a terminal, saved, and played again: the same robot, to the last digit."""

import json
import os
import re
import time

import programs
import pytest
from teleop_keyboard.key_script import parse_key_script
from terminals import wait_until

pytestmark = pytest.mark.slow

# The time on the status line.
CLOCK = re.compile(rb'  (\d+\.\d) s x')
WASD = ('-m', 'wasd_bringup.cli', 'mbot', '--viewer', 'none', '--report')


def test_a_replay_of_a_drive_is_the_drive(pty_process, ros_domain, tmp_path):
    saved, live, again = (tmp_path / name for name in ('drive.keys', 'live.json', 'again.json'))
    process = pty_process(*WASD, str(live), '--save-keys', str(saved))
    process.wait_for(b'stopped')
    typed = list('iiiiijjjjéuuqii')
    for key in typed:
        process.type(key.encode())
        time.sleep(0.04)

    def pressed():
        return [press.key for press in parse_key_script(saved.read_text())]

    def simulated():
        return float(CLOCK.findall(process.output)[-1])

    wait_until(lambda: pressed() == typed)
    until = simulated() + 1.2
    wait_until(lambda: simulated() >= until)
    process.type(b'\x03')
    assert process.wait() == 0
    assert pressed() == typed
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
