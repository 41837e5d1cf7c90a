# SPDX-License-Identifier: Apache-2.0
import contextlib
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import threading
import time

import pytest
from teleop_keyboard.key_reader import KeyReader
from teleop_keyboard.terminal import Source, Terminal
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# A program that holds a raw terminal until something happens to it.
HOLDER = """
import os, sys, time
from teleop_keyboard.terminal import Terminal
with Terminal(0) as terminal:
    # A signal may come while the word before is still being written: `print` is not reentrant.
    terminal.before_suspend.append(lambda: os.write(1, b'suspended\\n'))
    terminal.after_resume.append(lambda: os.write(1, b'resumed\\n'))
    os.write(1, b'ready\\n')
    while True:
        time.sleep(0.01)
        data = terminal.read()
        if data == b'X':
            raise ValueError('as the test wishes')
        if data == b'Q':
            sys.exit(3)
        if terminal.closed:
            sys.exit(4)
"""

# A shell with one job: runs it in the foreground, and `fg`s it a moment after it was stopped.
SHELL = """
import os, signal, sys, termios, time
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpgrp())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.execv(sys.executable, [sys.executable, '-c', sys.argv[1]])
_, status = os.waitpid(job, os.WUNTRACED)
print('job stopped' if os.WIFSTOPPED(status) else 'job ended', flush=True)
os.tcsetpgrp(0, os.getpgrp())
print('cooked' if termios.tcgetattr(0)[3] & termios.ICANON else 'raw', flush=True)
time.sleep(0.3)
os.tcsetpgrp(0, job)
os.kill(job, signal.SIGCONT)
_, status = os.waitpid(job, 0)
os.tcsetpgrp(0, os.getpgrp())
print('job status', os.waitstatus_to_exitcode(status), flush=True)
"""


def wait_for(process, text, timeout=PATIENCE):
    deadline = time.monotonic() + timeout
    while text not in process.output:
        assert time.monotonic() < deadline, process.output.decode()
        time.sleep(0.01)


@pytest.fixture
def terminal_pair():
    master, slave = pty.openpty()
    yield master, slave
    for descriptor in (master, slave):
        with contextlib.suppress(OSError):
            os.close(descriptor)


def test_raw_mode_is_on_inside_and_gone_outside(terminal_pair):
    _, slave = terminal_pair
    before = termios.tcgetattr(slave)
    with Terminal(slave):
        flags = termios.tcgetattr(slave)[3]
        assert not flags & (termios.ICANON | termios.ECHO)
        assert flags & termios.ISIG
    assert termios.tcgetattr(slave) == before


def test_unusual_attributes_come_back_bit_for_bit(terminal_pair):
    _, slave = terminal_pair
    before = termios.tcgetattr(slave)
    before[0] ^= termios.IXON | termios.ICRNL | termios.ISTRIP
    before[3] ^= termios.ECHOE | termios.IEXTEN
    before[6][termios.VINTR] = b'\x07'
    before[6][termios.VTIME] = 3
    termios.tcsetattr(slave, termios.TCSANOW, before)
    before = termios.tcgetattr(slave)
    with Terminal(slave):
        assert termios.tcgetattr(slave) != before
    assert termios.tcgetattr(slave) == before


def test_a_terminal_that_hangs_up_while_we_are_behind_is_at_its_end(terminal_pair, monkeypatch):
    """Without a terminal nobody is behind: it looked as if the shell had put us in front."""
    master, slave = terminal_pair
    with monkeypatch.context() as behind:
        behind.setattr('teleop_keyboard.terminal._is_foreground', lambda _: False)
        terminal = Terminal(slave).__enter__()
        terminal.notice_front()
    os.close(master)
    terminal.notice_front()
    assert terminal.read() == b''
    assert terminal.closed
    terminal.__exit__()


def test_the_context_leaves_no_signal_handler_behind(terminal_pair):
    watched = (signal.SIGTSTP, signal.SIGCONT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    before = [signal.getsignal(number) for number in watched]
    with Terminal(terminal_pair[1]):
        assert signal.getsignal(signal.SIGTSTP) != before[0]
    assert [signal.getsignal(number) for number in watched] == before


def test_one_read_takes_all_that_was_typed_and_none_waits(terminal_pair):
    master, slave = terminal_pair
    with Terminal(slave) as terminal:
        assert terminal.read() == b''
        os.write(master, b'ijkl' * 100)
        assert terminal.read() == b'ijkl' * 100
        assert terminal.read() == b''
        assert not terminal.closed


def test_a_terminal_that_ctrl_z_empties_as_it_is_read_is_neither_waited_for_nor_closed(
    terminal_pair, monkeypatch
):
    """The key before Ctrl-Z makes it ready; a read of nothing held a robot up after `fg`."""
    master, slave = terminal_pair
    look = select.select

    def emptied(*asked):
        found = look(*asked)
        termios.tcflush(slave, termios.TCIFLUSH)
        return found

    with Terminal(slave) as terminal:
        os.write(master, b'i')
        monkeypatch.setattr(select, 'select', emptied)
        read = threading.Thread(target=terminal.read, daemon=True)
        read.start()
        read.join(PATIENCE)
        monkeypatch.undo()
        assert not read.is_alive()
        assert not terminal.closed
        os.write(master, b'j')
        assert terminal.read() == b'j'


def test_keys_typed_before_raw_mode_are_kept(terminal_pair):
    master, slave = terminal_pair
    os.write(master, b'i\n')
    with Terminal(slave) as terminal:
        assert terminal.read() == b'i\n'


def test_a_terminal_that_hangs_up_is_closed(terminal_pair):
    master, slave = terminal_pair
    with Terminal(slave) as terminal:
        os.close(master)
        assert terminal.read() == b''
        assert terminal.closed


def test_a_reader_notices_that_its_terminal_hung_up(terminal_pair):
    master, slave = terminal_pair
    with KeyReader(Terminal(slave)) as reader:
        assert reader.poll(0.0) == []
        assert not reader.closed
        os.close(master)
        assert reader.poll(0.0) == []
        assert reader.closed


def test_a_lone_escape_is_a_key_after_at_most_50_ms(terminal_pair):
    master, slave = terminal_pair
    waits = []
    with KeyReader(Terminal(slave)) as reader:
        for _ in range(5):
            os.write(master, b'\x1b')
            start = time.monotonic()
            keys = []
            while not keys:
                keys = reader.poll(1.0)
            assert keys == ['ESC']
            waits.append(time.monotonic() - start)
    # The best of five: a busy machine adds to a wait, but never takes from it.
    assert min(waits) <= 0.05


def test_a_sequence_in_two_reads_is_one_key(terminal_pair):
    master, slave = terminal_pair
    with KeyReader(Terminal(slave)) as reader:
        os.write(master, b'\x1b[')
        assert reader.poll(0.0) == []
        os.write(master, b'A')
        assert reader.poll(1.0) == ['UP']
        assert reader.poll(0.1) == []


def test_a_pipe_is_read_to_its_end_and_then_closed():
    read_end, write_end = os.pipe()
    with KeyReader(None, Source(read_end)) as reader:
        os.write(write_end, b'ij\x1b')
        os.close(write_end)
        keys = []
        while not reader.closed:
            keys += reader.poll(0.05)
    os.close(read_end)
    assert keys == ['i', 'j', 'ESC']


def test_an_empty_pipe_leaves_the_terminal_in_charge(terminal_pair):
    master, slave = terminal_pair
    read_end, write_end = os.pipe()
    os.close(write_end)
    with KeyReader(Terminal(slave), Source(read_end)) as reader:
        assert reader.poll(0.0) == []
        assert not reader.closed
        os.write(master, b'i')
        assert reader.poll(1.0) == ['i']
    os.close(read_end)


def test_ctrl_c_that_nobody_handles_ends_the_process_with_the_terminal_restored(pty_process):
    # As each other signal does, see test_every_signal.py.
    process = pty_process('-c', HOLDER)
    wait_for(process, b'ready')
    assert process.is_raw
    process.process.send_signal(signal.SIGINT)
    assert process.wait() == -signal.SIGINT
    assert process.attributes == process.before


@pytest.mark.parametrize(('data', 'status'), [(b'X', 1), (b'Q', 3)], ids=['exception', 'exit'])
def test_every_other_way_out_restores_the_terminal(pty_process, data, status):
    process = pty_process('-c', HOLDER)
    wait_for(process, b'ready')
    process.type(data)
    assert process.wait() == status
    assert process.attributes == process.before


def test_an_exit_without_the_end_of_the_context_restores_the_terminal(pty_process):
    program = HOLDER.replace('with Terminal(0) as terminal:', 'if True:').replace(
        'if True:', 'terminal = Terminal(0).__enter__()\nif True:', 1
    )
    process = pty_process('-c', program)
    wait_for(process, b'ready')
    process.type(b'Q')
    assert process.wait() == 3
    assert process.attributes == process.before


def test_ctrl_z_gives_the_terminal_back_and_fg_takes_it_again(pty_process):
    process = pty_process('-c', SHELL, HOLDER)
    wait_for(process, b'ready')
    assert process.is_raw
    process.type(b'\x1a')
    wait_for(process, b'job stopped')
    wait_for(process, b'cooked')
    wait_for(process, b'resumed')
    assert process.output.index(b'suspended') < process.output.index(b'job stopped')
    assert process.is_raw
    process.type(b'Q')
    wait_for(process, b'job status 3')
    assert process.attributes == process.before


def test_ctrl_z_waits_until_the_key_before_it_has_been_acted_upon(pty_process):
    """Else a robot would start after `fg`, by a key that was let go of long ago."""
    program = HOLDER.replace(
        'data = terminal.read()',
        f"""with terminal.undisturbed():
            data = terminal.read()
            if data == b'i':
                os.kill(os.getpid(), {int(signal.SIGTSTP)})
                time.sleep(0.1)
                print('acted', flush=True)""",
    )
    process = pty_process('-c', SHELL, program)
    wait_for(process, b'ready')
    process.type(b'i')
    wait_for(process, b'resumed')
    said = [process.output.index(word) for word in (b'acted', b'suspended', b'job stopped')]
    assert said == sorted(said)
    process.type(b'Q')
    wait_for(process, b'job status 3')


def test_without_a_terminal_the_error_is_one_line():
    program = (
        'from teleop_keyboard.terminal import NoTerminal, open_terminal\n'
        'try:\n    open_terminal()\nexcept NoTerminal as error:\n    print(error)\n'
    )
    result = subprocess.run(
        [sys.executable, '-c', program],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        start_new_session=True,
        check=True,
    )
    assert len(result.stdout.splitlines()) == 1
    assert 'no terminal' in result.stdout
