# SPDX-License-Identifier: Apache-2.0
"""However a teleoperation ends, or is cut off, the robot stands soon after."""

from pathlib import Path
import re
import signal
import sys
import time

from nav_msgs.msg import Odometry
import pytest
from terminals import wait_until

pytestmark = pytest.mark.slow

TELEOP = ('-m', 'teleop_keyboard.teleop_node')

# A shell with job control: it starts the program as its foreground job, waits until the job is
# stopped, says so, and has it go on behind (bg) and then in front (fg), each when a file is there.
# A job that runs it only puts in front, as bash does; others send it SIGCONT again.
SHELL = """
import os, signal, sys, time
def wait_for(name):
    while not os.path.exists(os.path.join(os.environ['FOLDER'], name)):
        time.sleep(0.01)
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpgrp())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
while True:
    _, status = os.waitpid(job, os.WUNTRACED)
    if not os.WIFSTOPPED(status):
        break
    os.tcsetpgrp(0, os.getpgrp())
    print('SUSPENDED', flush=True)
    wait_for('bg')
    os.kill(job, signal.SIGCONT)
    print('BEHIND', job, flush=True)
    wait_for('fg')
    os.tcsetpgrp(0, job)
    if 'SIGNALS' in os.environ:
        os.kill(job, signal.SIGCONT)
os.tcsetpgrp(0, os.getpgrp())
sys.exit(os.waitstatus_to_exitcode(status))
"""


def test_ctrl_backslash_stops_the_robot_and_restores_the_terminal(pty_process, listener):
    process = pty_process(*TELEOP)
    listener.probe(process)
    listener.drive(process)
    process.type(b'\x1c')
    assert process.wait() == -signal.SIGQUIT
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands
    assert process.attributes == process.before
    assert process.output.rstrip().endswith(b'\x1b[?1049l')


def test_a_closed_terminal_stops_the_robot(pty_process, listener):
    process = pty_process(*TELEOP)
    listener.probe(process)
    listener.drive(process)
    process.hang_up()
    assert process.wait() in (128 + signal.SIGHUP, 0, 1)
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands


@pytest.mark.parametrize('shell', [{}, {'SIGNALS': 'yes'}], ids=['bash', 'zsh'])
def test_ctrl_z_stops_the_robot_bg_leaves_the_screen_alone_and_fg_goes_on(
    pty_process, listener, tmp_path, shell
):
    process = pty_process(
        '-S', '-c', SHELL, *TELEOP, environment={'FOLDER': str(tmp_path), **shell}
    )
    listener.probe(process)
    listener.drive(process)
    process.type(b'\x1a')
    wait_until(lambda: b'SUSPENDED' in process.output)
    wait_until(lambda: listener.stands)
    listener.settle()
    assert listener.stands
    assert process.attributes == process.before
    assert b'\x1b[?1049l' in process.output[: process.output.index(b'SUSPENDED')]
    count = len(listener.twists)
    listener.settle()
    assert len(listener.twists) == count

    (tmp_path / 'bg').touch()
    wait_until(lambda: re.search(rb'BEHIND \d+\r\n', process.output))
    job = re.search(rb'BEHIND (\d+)', process.output)[1].decode()
    process.output = b''
    process.type(b'X\n')
    wait_until(lambda: process.output.endswith(b'X\r\n'))
    time.sleep(0.5)
    # It neither draws nor reads, which would stop it again: what is typed is the shell's.
    assert process.output == b'X\r\n'
    assert Path(f'/proc/{job}/stat').read_text().rsplit(')', 1)[1].split()[0] != 'T'
    assert listener.stands

    process.output = b''
    (tmp_path / 'fg').touch()
    wait_until(lambda: process.is_raw)
    wait_until(lambda: b'\x1b[?1049h' in process.output)
    assert listener.stands
    listener.twists.clear()
    listener.drive(process)
    process.type(b'\x03')
    assert process.wait() == 0
    wait_until(lambda: listener.stands)
    assert process.attributes == process.before


# A teleop for which Ctrl-Z comes as a frame has just been written, once a file is there.
IN_A_FRAME = """
import os, signal, sys
from teleop_keyboard import screen, teleop_node
offer, now = screen.offer, os.path.join(os.environ['FOLDER'], 'now')
def offer_and_suspend(*words):
    is_taken = offer(*words)
    if os.path.exists(now):
        os.remove(now)
        os.kill(os.getpid(), signal.SIGTSTP)
    return is_taken
screen.offer = offer_and_suspend
sys.exit(teleop_node.main())
"""


def test_after_ctrl_z_within_a_frame_the_screen_is_opened_again(pty_process, listener, tmp_path):
    words = ('-S', '-c', SHELL, '-c', IN_A_FRAME)
    process = pty_process(*words, environment={'FOLDER': str(tmp_path)})
    listener.probe(process)
    for name in ('bg', 'fg', 'now'):
        (tmp_path / name).touch()
    wait_until(lambda: process.type(b'P') or b'BEHIND' in process.output)
    wait_until(lambda: b'\x1b[?1049h' in process.output.rpartition(b'BEHIND')[2])
    assert b'\x1b[?1049l' in process.output.partition(b'SUSPENDED')[0]
    process.type(b'\x03')
    assert process.wait() == 0
    assert process.output.rstrip().endswith(b'\x1b[?1049l')


def test_begun_behind_it_leaves_the_terminal_alone_until_bash_has_it_in_front(
    pty_process, listener
):
    process = pty_process('-c', 'import os; os.execvp("bash", ["bash", "--norc", "-i"])')
    process.type(f'{sys.executable} {" ".join(TELEOP)} &\n'.encode())
    wait_until(lambda: listener.node.count_publishers('cmd_vel'))
    process.output = b''
    process.type(b"echo I''M\n")
    wait_until(lambda: b'IM' in process.output)
    time.sleep(0.5)
    assert b'\x1b[?1049h' not in process.output  # the screen is the shell's, and so are keys
    assert not listener.keys
    process.type(b'fg\n')
    wait_until(lambda: process.is_raw and b'\x1b[?1049h' in process.output)
    listener.drive(process)
    process.type(b'\x03')
    wait_until(lambda: listener.stands)
    process.type(b'exit\n')
    assert process.wait() == 0


class Mbot:
    """mbot in its simulator and under its drive controller, each in a process of its own."""

    def __init__(self, listener, background):
        self.speeds = []
        self._listener = listener
        listener.node.create_subscription(
            Odometry, 'ground_truth/odom', lambda m: self.speeds.append(m.twist.twist.linear.x), 10
        )
        background('mujoco_sim.simulator_node')
        background('diff_drive_sim.diff_drive_controller_node')
        wait_until(lambda: self.speeds)

    def drive(self, process):
        """Hold a key until the robot moves, and the listener hears why."""
        self._listener.twists.clear()

        def drives():
            process.type(b'i')
            time.sleep(1 / 30)
            return max(self.speeds[-10:]) > 0.1 and self._listener.twists

        wait_until(drives)

    def stops(self):
        """Wait until the robot stands, and see that it goes on standing."""
        wait_until(lambda: max(map(abs, self.speeds[-25:])) < 1e-3)
        count = len(self.speeds)
        wait_until(lambda: len(self.speeds) > count + 50)
        assert max(map(abs, self.speeds[count:])) < 1e-3


def test_the_robot_stops_when_keyboard_or_teleop_are_killed_outright(
    pty_process, listener, background
):
    robot = Mbot(listener, background)
    twist = background('teleop_keyboard.keys_to_twist_node')
    keyboard = pty_process('-m', 'teleop_keyboard.key_publisher_node')
    listener.probe(keyboard)
    robot.drive(keyboard)
    keyboard.process.send_signal(signal.SIGKILL)
    # The other process says stop.
    wait_until(lambda: listener.stands)
    robot.stops()

    # It hears the next keyboard, too, and would be the one to stop the robot.
    twist.kill()
    twist.wait()
    listener.keys.clear()
    # By a key that latches: it goes on until the test is there.
    process = pty_process(*TELEOP, '--ros-args', '-p', 'mode:=latch')
    listener.probe(process)
    robot.drive(process)
    process.process.send_signal(signal.SIGKILL)
    process.process.wait()
    # Nobody says stop: the last command is the one to drive, and the controller's watchdog acts.
    listener.settle()
    assert listener.velocities[-1].vx > 0.0
    robot.stops()


def test_without_a_terminal_on_its_input_it_takes_the_controlling_one(pty_process, listener):
    """As `ros2 launch` starts a node: standard input is a pipe, or nothing at all."""
    inner = (
        'import signal, subprocess, sys; signal.signal(signal.SIGINT, lambda *_: None);'
        'sys.exit(subprocess.call([sys.executable, *sys.argv[1:]], stdin=subprocess.DEVNULL))'
    )
    process = pty_process('-S', '-c', inner, *TELEOP)
    listener.probe(process)
    listener.drive(process, b'i')
    process.type(b'\x03')
    # The signal goes to both processes; the inner one may be the last to leave.
    process.wait()
    wait_until(lambda: listener.stands)
    wait_until(lambda: process.attributes == process.before)
