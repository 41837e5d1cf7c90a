# SPDX-License-Identifier: Apache-2.0
"""What a stranger meets in the first minutes: keys pressed on terminals of the usual widths."""

from collections.abc import Callable, Iterator
import fcntl
import os
from pathlib import Path
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from typing import Any

import numpy as np
import programs
import pytest
from teleop_keyboard.key_script import parse_key_script
from terminals import PATIENCE, Stopwatch, wait_until
from wasd_bringup.cli import main, run_command
from wasd_bringup.cli.run_command import show_page
from wasd_core.timing import brief

pytestmark = [pytest.mark.long, pytest.mark.slow]

CLOCK = re.compile(r'  \d+\.\d s (x\d+\.\d\d|paused)(  |$)')
CURE = 'press 2 to stand, then 4 to trot'
# The keys into each state, from the one before, and what `w` is answered with there.
TOUR = (
    ('', 'passive', f'{CURE} (w does nothing here)'),
    ('2', 'fixed stand', 'press 4 to trot (w does nothing here)'),
    ('3', 'free stand', 'w: nose down (to drive: 4 to trot)'),
    ('4', 'trotting', 'command +0.'),
    ('25', 'move base', f'{CURE} (w does nothing here)'),
    ('20', 'balance test', 'w: body forward (to drive: 2 to stand, then 4 to trot)'),
    ('29', 'swing test', 'w: front right foot forward (to drive: 2 to stand, then 4 to trot)'),
    ('28', 'step test', f'{CURE} (w does nothing here)'),
    ('1', 'passive', f'{CURE} (w does nothing here)'),
)


class Window:
    """A run of `wasd` on a pseudo-terminal of so many columns and lines."""

    def __init__(self, words: list[str], environment: dict[str, str], columns: int) -> None:
        self.master, self.slave = pty.openpty()
        size = struct.pack('HHHH', 24, columns, 0, 0)
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, size)
        self.shown = ''
        unset = ('COLUMNS', 'LINES')
        kept = {name: value for name, value in environment.items() if name not in unset}
        self.process = programs.start(
            [sys.executable, '-m', 'wasd_bringup.cli', *words],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            env=kept,
            start_new_session=True,
        )

    @property
    def lines(self) -> list[str]:
        """All that the status line has said, in its order; what is above it, too."""
        text = re.sub(r'\x1b\[\d*[A-Za-z]', '', self.shown.replace('\r\n', '\n'))
        # The last may be here in part only.
        return [line for line in re.split('[\r\n]', text) if line][:-1]

    @property
    def statuses(self) -> list[str]:
        """All texts of the status line."""
        return [line for line in self.lines if CLOCK.search(line)]

    def read(self, timeout: float) -> None:
        """Take in what is written within so many seconds."""
        if select.select([self.master], [], [], timeout)[0]:
            self.shown += os.read(self.master, 65536).decode(errors='replace')

    def wait_for(self, meets: Callable[[str], bool], seconds: float = PATIENCE) -> str:
        """Return the first status from now on that meets a condition."""
        deadline, seen = time.monotonic() + seconds, len(self.statuses)
        while True:
            for status in self.statuses[seen:]:
                if meets(status):
                    return status
            seen = len(self.statuses)
            assert time.monotonic() < deadline, self.shown[-2000:]
            assert self.process.poll() is None, self.shown[-2000:]
            self.read(0.1)

    def type(self, keys: str) -> None:
        """Type keys."""
        os.write(self.master, keys.encode())

    def end(self) -> int | None:
        """Read on until it has ended; return its exit status, None if it goes on for long."""
        deadline = time.monotonic() + PATIENCE
        while self.process.poll() is None and time.monotonic() < deadline:
            self.read(0.05)
        return self.process.returncode

    def close(self) -> None:
        """End it."""
        self.process.terminate()
        self.end()
        self.process.kill()
        self.process.wait()
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def window(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Window]]:
    """
    Return a function that opens a window; all are closed after the test.

    What a driver reads is the same without ROS, which costs a third of a start.
    """
    opened: list[Window] = []

    def open_window(*words: str, columns: int = 80, **variables: str) -> Window:
        viewer = () if '--viewer' in words else ('--viewer', 'none')
        own = {**environment, 'TERM': 'xterm', **variables}
        opened.append(Window([*words, '--no-ros', *viewer], own, columns))
        return opened[-1]

    yield open_window
    for each in opened:
        each.close()


def test_w_is_answered_in_every_state_its_text_goes_and_the_reset_key_says_what_it_did(
    window: Callable[..., Window],
) -> None:
    run = window('go2')
    run.wait_for(lambda line: line.startswith('passive'))
    see_w_in_every_state_say_what_to_press_and_hide_neither_state_nor_time(run)
    see_a_text_go_after_three_seconds_and_at_once_with_a_legal_key(run)
    see_the_reset_key_put_the_robot_back_and_say_so(run)


def see_w_in_every_state_say_what_to_press_and_hide_neither_state_nor_time(run: Window) -> None:
    for keys, state, answer in TOUR:
        for key in keys:
            run.type(key)
            run.wait_for(lambda line: 'press' not in line)
        run.wait_for(lambda line, state=state: line.startswith(state))
        run.type('w')
        wanted = brief(answer)
        line = run.wait_for(lambda line, wanted=wanted: wanted in line)
        assert line.startswith(state)
    assert max(map(len, run.statuses)) <= 79
    # A line alone; what a wider window has above it, another test says.
    assert all(CLOCK.search(line) for line in run.lines[run.lines.index(run.statuses[0]) :])


def see_a_text_go_after_three_seconds_and_at_once_with_a_legal_key(run: Window) -> None:
    run.type('1')
    run.wait_for(lambda line: line.startswith('passive') and 'press' not in line)
    typed_at = time.monotonic()
    run.type('4')
    run.wait_for(lambda line: CURE in line)
    run.wait_for(lambda line: CURE not in line)
    # Three seconds, see test_notice.py, of which less may be simulated.
    assert time.monotonic() - typed_at > 2.0

    run.type('14')
    run.wait_for(lambda line: CURE in line)
    stopwatch = Stopwatch(run.process.pid)
    run.type('2')
    assert CURE not in run.wait_for(lambda line: line.startswith('fixed stand'))
    assert stopwatch.took(time.time()) < 2.5


def see_the_reset_key_put_the_robot_back_and_say_so(run: Window) -> None:
    run.wait_for(lambda line: line.startswith('fixed stand'))
    run.type('\x7f')
    line = run.wait_for(lambda line: line.startswith('passive'))
    assert 'back at the start' in line


@pytest.mark.parametrize('robot', ['mbot', 'both'])
def test_keys_from_a_pipe_drive_the_state_is_told_in_plain_lines_and_the_run_ends(
    environment: dict[str, str], tmp_path: Path, robot: str
) -> None:
    words = (robot, '--viewer', 'none') + ('--no-ros',) * (robot == 'both')
    run = programs.start(
        [sys.executable, '-m', 'wasd_bringup.cli', *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        cwd=tmp_path,
        start_new_session=True,
    )
    told, _ = run.communicate(b'iii' if robot == 'mbot' else b'\tiii', timeout=PATIENCE)
    assert run.returncode == 0
    assert float(told.split(b'mbot at ')[1].split()[0]) > 0.02
    assert b'\x1b' not in told
    assert b'\r' not in told
    lines = told.decode().splitlines()
    states = [line for line in lines if 'driving' in line or 'stopped' in line]
    name = '[mbot] ' if robot == 'both' else ''
    assert states[-3:] == [f'{name}{state}' for state in ('stopped', 'driving', 'stopped')]


def test_on_a_dumb_terminal_state_and_answer_are_told_in_plain_lines(
    window: Callable[..., Window],
) -> None:
    run = window('mbot', TERM='dumb')
    lesson = 'stopped: drive with i , j l; w is speed +10 %'
    for keys, told in (('', 'stopped\r\n'), ('w', lesson), ('i', 'driving\r\n')):
        run.type(keys)
        deadline = time.monotonic() + PATIENCE
        while told not in run.shown:
            assert time.monotonic() < deadline, run.shown
            run.read(0.1)
    assert '\x1b' not in run.shown


def test_a_window_with_room_shows_a_dashboard_above_the_status_line(
    window: Callable[..., Window],
) -> None:
    run = window('go2', columns=120)
    run.wait_for(lambda line: line.startswith('passive'))
    run.type('w')
    run.wait_for(lambda line: f'{CURE} (w does nothing here)' in line)
    run.type('2')
    run.wait_for(lambda line: line.startswith('fixed stand'))
    run.type('4')
    run.wait_for(lambda line: line.startswith('trotting'))
    for _ in range(6):
        run.type('w')
    run.wait_for(lambda line: 'command +0.60' in line and ' 0.0' not in line)
    board = run.lines[-12:]
    rows = {words[0]: words for words in map(str.split, board) if words}
    assert {'forward', 'measured', 'left', 'turn', 'body', 'keys'} <= set(rows)
    assert rows['forward'][-2:] == ['+0.60', 'm/s']
    assert rows['body'][1] == 'height'
    assert 0.1 < float(rows['body'][2]) < 0.4
    assert 'press 2 to stand' in run.shown
    assert all(len(line) < 120 for line in board)


def test_w_on_mbot_says_which_keys_drive_and_after_two_lessons_only_what_w_does(
    window: Callable[..., Window],
) -> None:
    run = window('mbot', columns=120)
    run.wait_for(lambda line: line.startswith('stopped'))
    assert 'drive with i , j l' in run.shown
    assert '--preset wasd' in run.shown
    lesson = 'drive with i , j l; w is speed +10 %'
    for speed in ('0.22', '0.24'):
        run.type('w')
        run.wait_for(lambda line, speed=speed: lesson in line and f'full {speed} m/s' in line)
    run.type('w')
    run.wait_for(lambda line: 'w is speed +10 %' in line and lesson not in line)
    run.type('9')
    run.wait_for(lambda line: '9 stops' in line)
    run.type('i')
    run.wait_for(lambda line: line.startswith('driving') and '9 stops' not in line)


def test_both_leave_the_pages_address_in_sight_of_24_lines_and_tab_goes_from_one_to_the_other(
    window: Callable[..., Window],
) -> None:
    run = window('both', '--viewer', 'web')
    run.wait_for(lambda line: '[go2] passive' in line)
    for key, who in (('', '[go2]'), ('?', '[go2]'), ('\t', '[mbot]'), ('?', '[mbot]')):
        run.type(key)
        run.wait_for(lambda line, who=who: line.startswith(who))
        run.wait_for(lambda line, key=key: key != '?' or 'the keys stand above' in line)
        text = re.sub('\r[^\n]*\r', '\r', run.shown.replace('\r\n', '\n'))
        assert 'viewer: http://127.0.0.1:' in '\n'.join(text.split('\n')[-23:])
    assert 'Control mbot!' in run.shown
    assert 'TAB goes to the next robot' in run.shown
    run.type('i')
    run.wait_for(lambda line: line.startswith('[mbot]') and 'driving' in line)
    run.process.send_signal(signal.SIGINT)  # as Ctrl-C does
    assert run.end() == 0


# From here on without a terminal: the same keys in scripts and recordings.


def position(report: dict[str, Any], time: float) -> np.ndarray:
    samples = report['samples']
    return np.array(samples['position'][int(np.searchsorted(samples['t'], time))])


def test_a_script_knows_both_keys_and_a_saved_script_has_them(
    new_runner: Callable[[], Any],
) -> None:
    runner = new_runner()
    play = '0.2 i*30\n1.5 BACKSPACE ?\n1.7 i*15'
    saved = ('--save-keys', 'saved.keys')
    first = runner.report('mbot', '--duration', '3', *saved, play=play)
    assert position(first, 1.4)[0] > 0.15
    assert abs(position(first, 1.6)[0]) < 1e-3
    script = (runner.folder / 'saved.keys').read_text()
    keys = [press.key for press in parse_key_script(script)]
    assert keys.count('BACKSPACE') == keys.count('?') == 1
    again = runner.report('mbot', '--duration', '3', play=script)
    assert again['samples'] == first['samples']


def test_both_are_reset_together_and_to_their_own_places(new_runner: Callable[[], Any]) -> None:
    report = new_runner().report(
        'both', '--duration', '1.7', play='0.1 2 TAB\n0.2 i*30\n1.5 BACKSPACE'
    )
    robots = report['robots']
    for name, y in (('go2', 0.6), ('mbot', -0.6)):
        np.testing.assert_allclose(position(robots[name], 1.6)[:2], (0.0, y), atol=0.02)
    assert position(robots['mbot'], 1.4)[0] > 0.1


@pytest.mark.parametrize('keys', ['4.5 2', '5 BACKSPACE\n5.2 2'])
def test_a_fallen_go2_names_the_keys_that_raise_and_reset_it_and_they_do(
    new_runner: Callable[[], Any], keys: str
) -> None:
    runner = new_runner()
    play = f'0.1 2\n2.6 4\n4.4 w\n{keys}'
    push = ('--push', '3 600 0 0 0.2', '--duration', '8')  # head over heels, onto its back
    report = runner.report('go2', *push, play=play)
    assert report['falls'] == 1
    cure = 'press 2 to get up, or BACKSPACE to reset (the robot has fallen)'
    assert runner.said.count(cure) >= 1
    assert report['samples']['state'][-1] == 'fixed stand'
    assert position(report, 7.9)[2] > 0.25


@pytest.fixture
def asked(tmp_path: Path) -> Path:
    """Return where a desktop's `xdg-open`, beside it, writes what it is asked to open."""
    tools, asked = tmp_path / 'tools', tmp_path / 'asked'
    tools.mkdir()
    (tools / 'xdg-open').write_text(f'#!/bin/sh\necho "$@" >{asked}.new; mv {asked}.new {asked}\n')
    (tools / 'xdg-open').chmod(0o755)
    return asked


def test_the_page_opens_itself_where_somebody_sits_in_front_of_a_desktop(
    window: Callable[..., Window], asked: Path
) -> None:
    path = f'{asked.parent}/tools{os.pathsep}{os.environ["PATH"]}'
    run = window('mbot', '--viewer', 'web', columns=120, PATH=path, DISPLAY=':0')
    run.wait_for(lambda line: line.startswith('stopped'))
    # With the install's lines (tests/bootstrap) at most 15 until the address.
    before, found, _ = run.shown.partition('viewer: ')
    assert found
    assert before.count('\n') <= 9
    deadline = time.monotonic() + PATIENCE
    while not asked.exists() and time.monotonic() < deadline:
        run.read(0.05)
    assert f'viewer: {asked.read_text().strip()}' in run.shown


@pytest.mark.parametrize(('more', 'opens'), [((), True), (('--no-open',), False)])
def test_the_page_opens_unless_no_open_is_said(
    monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...], opens: bool
) -> None:
    # In this process: what opens a page runs by itself, so nobody could tell that it never will.
    shown: list[str] = []
    monkeypatch.setattr(run_command, '_is_interactive', lambda reader: True)
    monkeypatch.setattr(run_command, 'show_page', shown.append)
    monkeypatch.setattr('wasd_bringup.page.bridge.open_view', lambda run, viewer: 'the page')
    words = ('mbot', '--no-ros', '--viewer', 'web', '--duration', '0.02', '--speed', '0')
    assert main([*words, *more]) == 0
    assert shown == ['the page'] * opens


@pytest.mark.parametrize(
    'variables',
    [{'DISPLAY': 'localhost:10.0', 'SSH_CONNECTION': '192.0.2.1 5 192.0.2.2 22'}, {}],
)
def test_no_page_opens_where_nobody_sits_in_front_of_a_desktop(
    asked: Path, variables: dict[str, str]
) -> None:
    path = {'PATH': f'{asked.parent}/tools{os.pathsep}{os.environ["PATH"]}'}
    assert not show_page('http://127.0.0.1:8080/', {**path, **variables})
    # Where somebody does, it is asked for: else the desktop of this test is none.
    assert show_page('http://127.0.0.1:8080/', {**path, 'DISPLAY': ':0'})
    wait_until(asked.exists)
    assert asked.read_text() == 'http://127.0.0.1:8080/\n'
