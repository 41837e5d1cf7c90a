# SPDX-License-Identifier: Apache-2.0
"""Who may talk to a run: this machine, not the network; and of two runs each is for itself."""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import time

import programs
import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

PYTHON = sys.executable
WASD = (PYTHON, '-m', 'wasd_bringup.cli')
# A range for benchmarks that no network uses (RFC 2544).
HOME, FOREIGN = '198.18.77.1', '198.18.77.2'
# What decides who may talk; the processes here start without, as a user's do.
DECIDES = re.compile('ROS_|FASTRTPS_|FASTDDS_|RMW_')
# Of a process that others name by its command.
NAMED = {'PYTHONHASHSEED': '0'}
# Says `cmd_vel` for so long [s], or for 4 s to who listens; then how many have listened.
INTRUDER = """
import sys, time
from geometry_msgs.msg import Twist
import rclpy
rclpy.init()
node = rclpy.create_node('intruder')
publisher = node.create_publisher(Twist, 'cmd_vel', 10)
end, most = time.monotonic() + float(sys.argv[1]), 0
while time.monotonic() < end:
    twist = Twist()
    twist.linear.x = 0.3
    publisher.publish(twist)
    rclpy.spin_once(node, timeout_sec=0.05)
    if not most and publisher.get_subscription_count():
        end = time.monotonic() + 4.0
    most = max(most, publisher.get_subscription_count())
print(most)
"""


class Host:
    """A machine of its own as far as ROS can tell: interfaces, shared memory, names of sockets."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        # It all ends with this process: nothing has a name that could stay.
        self._holder = subprocess.Popen(
            ['unshare', '--net', '--mount', 'sh', '-c']
            + ['mount -t tmpfs tmpfs /dev/shm && ip link set lo up && echo up && exec sleep 900'],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self._holder.stdout is not None
        self.works = self._holder.stdout.readline() == 'up\n'
        self.processes: list[subprocess.Popen[str]] = []

    @property
    def number(self) -> str:
        """The process that the machine consists of."""
        return str(self._holder.pid)

    def start(self, *words: str, **environment: str) -> 'subprocess.Popen[str]':
        """Start a command on this machine."""
        kept = {k: v for k, v in os.environ.items() if not DECIDES.match(k)}
        kept['ROS_LOG_DIR'] = str(self.folder / 'log')
        # Of the interpreter of this environment: it must find its libraries.
        kept |= {k: v for k, v in os.environ.items() if k.startswith('_ROS')}
        process = programs.start(
            words,
            machine=self._holder.pid,
            env={**kept, **NAMED, **environment},  # never forked: all start as a user does
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.processes.append(process)
        return process

    def wasd(self, *words: str, **environment: str) -> 'subprocess.CompletedProcess[str]':
        """Run `wasd` to its end."""
        process = self.start(*WASD, *words, **environment)
        said, errors = process.communicate(timeout=PATIENCE)
        return subprocess.CompletedProcess(process.args, process.returncode, said, errors)

    def wait_for(self, topic: str = 'odom', **environment: str) -> None:
        """Wait until a topic comes."""
        deadline = time.monotonic() + PATIENCE
        while (done := self.wasd('echo', '--once', topic, **environment)).returncode:
            assert time.monotonic() < deadline, done.stderr

    def end(self) -> None:
        """End everything."""
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()
        self._holder.kill()
        self._holder.communicate()


@pytest.fixture
def home(tmp_path: Path) -> Iterator[Host]:
    """Yield a machine without a network."""
    if not all(map(shutil.which, ('unshare', 'nsenter', 'ip', 'mount'))):
        pytest.skip('no tools for network namespaces (Debian: apt install iproute2 util-linux)')
    host = Host(tmp_path)
    try:
        if not host.works:
            pytest.skip('network namespaces are not allowed here')
        yield host
    finally:
        host.end()


@pytest.fixture
def foreign(home: Host, tmp_path: Path) -> Iterator[Host]:
    """Yield another machine, on one network with `home`."""
    host = Host(tmp_path)
    inside = ('nsenter', '--net', '--target')
    try:
        for command in (
            f'{home.number} ip link add near type veth peer name far netns {host.number}',
            f'{home.number} ip addr add {HOME}/24 dev near',
            f'{home.number} ip link set near up',
            f'{host.number} ip addr add {FOREIGN}/24 dev far',
            f'{host.number} ip link set far up',
        ):
            if subprocess.run([*inside, *command.split()], check=False).returncode:
                pytest.skip('no pair of interfaces can be made here')
        yield host
    finally:
        host.end()


def attacked(home: Host, foreign: Host, seconds: float, **environment: str) -> tuple[int, float]:
    """Return how many heard an intruder, and how far mbot went."""
    report = home.folder / 'report.json'
    robot = home.start(
        *WASD, 'mbot', '--viewer', 'none', '--duration', '900', '--report', str(report),
        **environment,
    )  # fmt: skip
    home.wait_for(**environment)
    intruder = foreign.start(PYTHON, '-c', INTRUDER, str(seconds), ROS_STATIC_PEERS=HOME)
    said, errors = intruder.communicate(timeout=PATIENCE)
    assert intruder.returncode == 0, errors
    robot.send_signal(signal.SIGINT)
    _, errors = robot.communicate(timeout=PATIENCE)
    assert robot.returncode == 0, errors
    x, y, _ = json.loads(report.read_text())['samples']['position'][-1]
    return int(said), (x**2 + y**2) ** 0.5


def test_a_host_that_names_this_one_does_not_reach_a_run(home: Host, foreign: Host) -> None:
    assert attacked(home, foreign, 8.0) == (0, pytest.approx(0.0, abs=1e-3))


@pytest.mark.parametrize('choice', ['SUBNET', 'LOCALHOST'])
def test_what_the_user_says_of_the_network_holds(home: Host, foreign: Host, choice: str) -> None:
    # Ros' own LOCALHOST, said by the user, keeps its meaning: who names this host gets through.
    listeners, distance = attacked(home, foreign, 12.0, ROS_AUTOMATIC_DISCOVERY_RANGE=choice)
    assert listeners > 0
    assert distance > 0.1


def test_nodes_and_commands_of_this_machine_find_each_other(home: Host) -> None:
    robot = home.start(*WASD, 'mbot', '--viewer', 'none', '--duration', '900')
    home.wait_for()
    sockets = home.start('cat', '/proc/net/udp').communicate()[0]
    addresses = {line.split()[1].partition(':')[0] for line in sockets.splitlines()[1:]}
    assert addresses == {'0100007F'}  # 127.0.0.1, as the kernel writes it
    teleop = home.start(PYTHON, '-m', 'teleop_keyboard.teleop_node')
    assert teleop.stdin is not None
    deadline = time.monotonic() + PATIENCE
    moved = 0.0
    while moved < 0.02:
        assert time.monotonic() < deadline, 'the robot does not hear the keyboard'
        teleop.stdin.write('i')
        teleop.stdin.flush()
        done = home.wasd('echo', '--once', '--field', 'pose.pose.position.x', 'odom')
        moved = float(done.stdout.split()[0]) if done.returncode == 0 else moved
    assert robot.poll() is None


def start_two(home: Host) -> list['subprocess.Popen[str]']:
    """Start the Go2 twice at once, with a keyboard (a pipe) each."""
    reports = (str(home.folder / f'{name}.json') for name in ('one', 'two'))
    return [home.start(*WASD, 'go2', '--report', report, **NAMED) for report in reports]


def test_two_runs_at_once_drive_each_its_own_robot(home: Host, tmp_path: Path) -> None:
    first, second = start_two(home)
    home.wait_for('state', ROS_DOMAIN_ID='0')
    home.wait_for('state', ROS_DOMAIN_ID='1')
    for process, keys in ((first, '2' * 10), (second, '5' * 10)):
        assert process.stdin is not None
        process.stdin.write(keys)
        process.stdin.flush()
    states = []
    for process, name in ((first, 'one'), (second, 'two')):
        _, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, errors
        report = json.loads((tmp_path / f'{name}.json').read_text())
        states.append((set(report['samples']['state']), errors))
    (one, _), (two, _) = states
    assert 'fixed stand' in one
    assert two == {'passive'}  # 5 means nothing to who lies; a stray 2 would have raised it
    moved = [errors for _, errors in states if 'wasd: domain' in errors]
    assert len(moved) == 1
    assert re.search(
        r'^wasd: domain 0 has another run, wasd go2.* \(process \d+\): this one is in domain 1 '
        r'\(to talk to it: ROS_DOMAIN_ID=1 \./wasd topics\)$',
        moved[0],
        re.MULTILINE,
    )


def test_a_command_finds_the_one_run_wherever_it_is_and_says_so_of_several(home: Host) -> None:
    first, second = (
        home.start(*WASD, 'mbot', '--viewer', 'none', '--duration', '900', **NAMED)
        for _ in range(2)
    )
    home.wait_for(ROS_DOMAIN_ID='0')
    home.wait_for(ROS_DOMAIN_ID='1')
    said = home.wasd('echo', '--once', 'odom').stderr
    assert re.fullmatch(
        r'using wasd mbot.* \(process \d+\) in domain 0; '
        r'for others set ROS_DOMAIN_ID=1 for wasd mbot.* \(process \d+\)\n',
        said,
    )
    in_domain_0 = re.search(r'process (\d+)', said)
    assert in_domain_0 is not None
    # nsenter becomes the command, so the process is the one that was started.
    killed, left = (first, second) if first.pid == int(in_domain_0[1]) else (second, first)
    killed.kill()
    killed.wait()  # on a busy machine a process that was killed still lives for a moment
    done = home.wasd('echo', '--once', 'odom')
    assert (done.returncode, done.stderr) == (0, '')
    assert left.poll() is None


def test_a_domain_of_the_users_is_kept_with_a_warning(home: Host) -> None:
    words = (*WASD, 'mbot', '--viewer', 'none', '--duration')
    home.start(*words, '900', ROS_DOMAIN_ID='7', **NAMED)
    home.wait_for(ROS_DOMAIN_ID='7')
    _, errors = home.start(*words, '0.1', ROS_DOMAIN_ID='7').communicate(timeout=PATIENCE)
    assert re.fullmatch(
        r'wasd: domain 7 has another run, wasd mbot.* \(process \d+\), too: each may get keys '
        r'and commands for the other\n',
        errors,
    )
