# SPDX-License-Identifier: Apache-2.0
"""`key_publisher` as a process on a real pseudo-terminal, with real rclpy on both sides."""

import itertools
from pathlib import Path
import signal
import subprocess
import sys
import time

import programs
import pytest
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from teleop_keyboard.key_script import parse_key_script
from terminals import PATIENCE, wait_until
from wasd_core.topics import LATCHED

pytestmark = pytest.mark.slow

MODULE = ('-m', 'teleop_keyboard.key_publisher_node')
HELP = 'help:=2 stand   4 trot'
ALPHABET = 'abcdefghijklmnopqrstuvwxyz'

RAISE_ON_X = """
import sys
from teleop_keyboard import key_publisher_node as module
publish = module.KeyPublisherNode.publish_key
def publish_or_raise(self, key):
    if key == 'X':
        raise ValueError('as the test wishes')
    publish(self, key)
module.KeyPublisherNode.publish_key = publish_or_raise
sys.exit(module.main())
"""


def processor_time(pid):
    """Return the processor time that a process has used with all its threads [s]."""
    # Not counted in ticks of a clock: who wakes with the tick is charged for all of it.
    threads = Path(f'/proc/{pid}/task').glob('*/schedstat')
    return sum(int(thread.read_text().split()[0]) for thread in threads) / 1e9


def test_keys_arrive_complete_and_in_order_and_idle_costs_nothing(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)

    repeats = (ALPHABET * 4)[:90]
    for key in repeats:
        process.type(key.encode())
        time.sleep(1 / 30)
    listener.settle(len(repeats))
    assert ''.join(listener.keys) == repeats

    listener.keys.clear()
    burst = (ALPHABET * 77)[:2000]
    process.type(burst.encode())
    listener.settle(len(burst))
    assert ''.join(listener.keys) == burst

    listener.keys.clear()
    triples = (ALPHABET * 2)[:30]
    for index in range(0, 30, 3):
        for key in triples[index : index + 3]:
            process.type(key.encode())
            time.sleep(0.005)
        time.sleep(0.1)
    listener.settle(len(triples))
    assert ''.join(listener.keys) == triples

    listener.keys.clear()
    process.type(b'\x1b[A\x1bOB\x1b[C\x1b[D' * 5 + b'\xc3\xa9\x1b[1;2A\x1b')
    listener.settle(23)
    assert listener.keys == ['UP', 'DOWN', 'RIGHT', 'LEFT'] * 5 + ['é', 'SHIFT+UP', 'ESC']

    before, start = processor_time(process.process.pid), time.monotonic()
    time.sleep(3.0)
    used = processor_time(process.process.pid) - before
    assert used / (time.monotonic() - start) < 0.02


def test_raw_publishes_single_characters_as_the_tutorials(pty_process, listener):
    process = pty_process(*MODULE, '--ros-args', '-p', 'raw:=true')
    listener.probe(process)
    process.type(b'w\x1b[A\xc3\xa9\r')
    listener.settle(6)
    assert listener.keys == ['w', '\x1b', '[', 'A', 'é', '\r']


def test_keys_are_saved_as_a_script_and_ctrl_c_leaves_the_terminal_as_it_was(
    pty_process, listener, tmp_path
):
    path = tmp_path / 'saved.keys'
    process = pty_process(*MODULE, '--save-keys', str(path))
    listener.probe(process, 'i')
    process.type(b'w \x1b[A*')
    listener.settle(4)
    process.type(b'\x03')
    assert process.wait() == 0
    assert process.attributes == process.before
    assert b'Traceback' not in process.output
    presses = parse_key_script(path.read_text())
    assert [press.key for press in presses][-4:] == listener.keys == ['w', ' ', 'UP', '*']
    assert [press.time for press in presses] == sorted(press.time for press in presses)


def test_keys_are_saved_in_simulated_time_from_the_first_on(pty_process, listener, tmp_path):
    path, message = tmp_path / 'saved.keys', Clock()
    publisher = listener.node.create_publisher(Clock, '/clock', 10)
    began = time.monotonic() - 1000.0

    def tick():
        seconds = time.monotonic() - began
        message.clock.sec, message.clock.nanosec = int(seconds), int(seconds % 1 * 1e9)
        publisher.publish(message)

    listener.node.create_timer(0.005, tick)
    sim_time = ('--ros-args', '-p', 'use_sim_time:=true')
    process = pty_process(*MODULE, '--save-keys', str(path), *sim_time)
    listener.probe(process)
    for count, key in enumerate(b'ijijij', 1):
        process.type(bytes((key,)))
        listener.wait_for_keys(count)
        time.sleep(0.1)
    process.type(b'\x03')
    assert process.wait() == 0
    times = [press.time for press in parse_key_script(path.read_text())]
    assert times[0] == 0.0
    assert times[-1] < PATIENCE
    gaps = [after - before for before, after in itertools.pairwise(times[-6:])]
    # The largest: a machine that is busy may take in several keys, or no time of /clock, at once.
    assert max(gaps) > 0.03


def test_ctrl_z_tells_the_robot_to_stop(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)
    process.type(b'w')
    listener.wait_for_keys(1)
    process.type(b'\x1a')
    listener.wait_for_keys(2)
    assert listener.keys == ['w', 'STOP']


def test_keys_from_a_pipe_beside_a_terminal_wait_for_who_listens(pty_process, listener):
    process = pty_process(*programs.IN_SHELL, 'printf 24 | "$0" "$@"', *MODULE)
    assert process.wait() == 0
    listener.settle(2)
    assert listener.keys == ['2', '4']


def test_a_state_pressed_before_the_controller_listens_waits_and_a_movement_does_not(
    pty_process, late_listener
):
    process = pty_process(*MODULE, '--ros-args', '-p', HELP)
    process.wait_for(b'2 stand   4 trot')
    process.type(b'w2')
    process.wait_for(b'nobody listens to the keys yet: w waits')
    process.wait_for(b'nobody listens to the keys: w dropped')
    listener = late_listener()
    wait_until(lambda: listener.keys)
    process.type(b'4')
    wait_until(lambda: len(listener.keys) > 1)
    assert listener.keys == ['2', '4']


def test_with_its_keys_it_shows_the_robots_state(pty_process, late_listener):
    process = pty_process(*MODULE, '--ros-args', '-p', HELP)
    process.wait_for(b'2 stand   4 trot')
    publisher = late_listener().node.create_publisher(String, 'state', LATCHED)
    publisher.publish(String(data='fixed stand'))
    process.wait_for(b'state: fixed stand\r\n')
    publisher.publish(String(data='\x1b]0;title\x07'))
    process.wait_for(b'title')
    assert b'\x1b]' not in process.output


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--sav'], 'unrecognized arguments: --sav'),
        (['--save-keys', '/nowhere/a.keys'], '/nowhere/a.keys: wanted a file in a folder'),
    ],
)
def test_a_wrong_option_is_one_line(pty_process, ros_domain, options, message):
    process = pty_process(*MODULE, *options)
    assert process.wait() == 2
    process.wait_for(message.encode())
    assert process.output.startswith(b'error: ')
    assert process.output.count(b'\n') == 1


def test_a_start_that_is_refused_leaves_the_saved_keys(pty_process, ros_domain, tmp_path):
    path = tmp_path / 'saved.keys'
    path.write_text('0.1 w\n')
    process = pty_process(*MODULE, '--save-keys', str(path), '--ros-args', '-p', 'raw:=true')
    assert process.wait() == 2
    process.wait_for(b'error: --save-keys saves names of keys: leave out raw:=true')
    assert path.read_text() == '0.1 w\n'


def test_a_signal_leaves_the_terminal_as_it_was(pty_process, listener):
    process = pty_process(*MODULE)
    listener.probe(process)
    process.process.send_signal(signal.SIGTERM)
    assert process.wait() == 128 + signal.SIGTERM
    assert process.attributes == process.before
    assert b'Traceback' not in process.output


def test_an_exception_leaves_the_terminal_as_it_was(pty_process, listener):
    process = pty_process('-c', RAISE_ON_X)
    listener.probe(process)
    process.type(b'X')
    assert process.wait() == 1
    assert process.attributes == process.before
    assert b'as the test wishes' in process.output


def run_without_terminal(**arguments):
    return programs.run(
        [sys.executable, *MODULE],
        start_new_session=True,
        timeout=PATIENCE,
        **arguments,
    )


def test_keys_are_read_from_a_pipe_until_it_ends(listener):
    result = run_without_terminal(input='ij\x1b[Aé'.encode())
    assert result.returncode == 0
    listener.settle(4)
    assert listener.keys == ['i', 'j', 'UP', 'é']


@pytest.mark.parametrize(
    ('module', 'redirection'), [('key_publisher_node', '<&-'), ('teleop_node', '</dev/null')]
)
def test_without_a_terminal_it_says_so_in_one_line(ros_domain, module, redirection):
    result = subprocess.run(
        ['sh', '-c', f'exec "$0" -m teleop_keyboard.{module} {redirection}', sys.executable],
        capture_output=True,
        text=True,
        start_new_session=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 2
    assert result.stdout == ''
    (line,) = result.stderr.splitlines()
    assert line.startswith('error: no terminal')
