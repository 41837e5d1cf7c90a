# SPDX-License-Identifier: Apache-2.0
"""Who may talk to a run: this machine, not the network; and of two runs each is for itself."""

from collections.abc import Iterator
import json
import math
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
# Slow, so that robots that wait for others take little of a processor.
MBOT = (*WASD, 'mbot', '--viewer', 'none', '--speed', '0.5')
# A range for benchmarks that no network uses (RFC 2544).
HOME, FOREIGN = '198.18.77.1', '198.18.77.2'
# What decides who may talk; the processes here start without, as a user's do.
DECIDES = re.compile('ROS_|FASTRTPS_|FASTDDS_|RMW_')
# Of a process that others name by its command.
NAMED = {'PYTHONHASHSEED': '0'}
# Says `cmd_vel` in so many domains, until 4 s after it is heard in those that are named; then how
# many have listened in each.
INTRUDER = """
import sys, time
from geometry_msgs.msg import Twist
import rclpy
ahead = Twist()
ahead.linear.x = 0.3
publishers = []
for domain in range(int(sys.argv[1])):
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('intruder', context=context)
    publishers.append(node.create_publisher(Twist, 'cmd_vel', 10))
most = [0] * len(publishers)
start = heard_at = time.monotonic()
while time.monotonic() < heard_at + 4.0:
    for domain, publisher in enumerate(publishers):
        publisher.publish(ahead)
        most[domain] = max(most[domain], publisher.get_subscription_count())
    if not all(most[int(domain)] for domain in sys.argv[2:]) and time.monotonic() < start + 60.0:
        heard_at = time.monotonic()
    time.sleep(0.05)
print(*most)
"""

# Says for each line where the robots of domains 0 and 1 are, once they say so: how far ahead [m],
# and the sine of half the angle by which they are turned.
SPY = """
import json, os, sys
from nav_msgs.msg import Odometry
import rclpy
from rclpy.executors import SingleThreadedExecutor
from wasd_core.network import keep_to_this_machine
keep_to_this_machine(os.environ, rclpy.get_rmw_implementation_identifier())
places, executors = [None, None], []
for domain in range(2):
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('spy', context=context)
    def see(message, domain=domain):
        pose = message.pose.pose
        places[domain] = (pose.position.x, pose.orientation.z)
    node.create_subscription(Odometry, 'odom', see, 1)
    executors.append(SingleThreadedExecutor(context=context))
    executors[-1].add_node(node)
for _ in sys.stdin:
    for executor in executors:
        executor.spin_once(timeout_sec=0.2)
    print(json.dumps(places), flush=True)
"""
Places = list[list[float] | None]


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


def test_another_machine_reaches_a_run_only_where_the_user_lets_it(
    home: Host, foreign: Host
) -> None:
    # Ros' own LOCALHOST, said by the user, keeps its meaning: who names this host gets through.
    choices: tuple[dict[str, str], ...] = (
        {},
        {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'ROS_DOMAIN_ID': '1'},
        {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_DOMAIN_ID': '2'},
    )
    reports = [home.folder / f'{number}.json' for number in range(len(choices))]
    robots = [
        home.start(*MBOT, '--duration', '900', '--report', str(report), **choice)
        for report, choice in zip(reports, choices, strict=True)
    ]
    home.wait_for(ROS_DOMAIN_ID='0')
    intruder = foreign.start(PYTHON, '-c', INTRUDER, '3', '1', '2', ROS_STATIC_PEERS=HOME)
    said, errors = intruder.communicate(timeout=PATIENCE)
    assert intruder.returncode == 0, errors
    distances = []
    for robot, report in zip(robots, reports, strict=True):
        robot.send_signal(signal.SIGINT)
        _, errors = robot.communicate(timeout=PATIENCE)
        assert robot.returncode == 0, errors
        x, y, _ = json.loads(report.read_text())['samples']['position'][-1]
        distances.append((x**2 + y**2) ** 0.5)
    listeners = list(map(int, said.split()))
    assert (listeners[0], distances[0]) == (0, pytest.approx(0.0, abs=1e-3))
    assert min(listeners[1:]) > 0
    assert min(distances[1:]) > 0.1


def test_runs_of_this_machine_are_each_for_itself_and_commands_and_nodes_find_them(
    home: Host,
) -> None:
    # Keyboards are pipes.
    runs = [home.start(*MBOT) for _ in range(2)]
    spy = home.start(PYTHON, '-c', SPY)
    ahead = check_that_each_drives_its_own_robot(spy, runs)
    check_that_a_domain_of_the_users_is_kept_with_a_warning(home)
    killed = check_that_a_command_says_which_of_several_it_takes(home, runs)
    # It finds the one that is left, wherever that is, and says nothing of it.
    killed.kill()
    _, errors = killed.communicate()  # on a busy machine it still lives for a moment
    done = home.wasd('echo', '--once', 'odom')
    assert (done.returncode, done.stderr) == (0, '')
    check_that_a_node_finds_the_run_and_nobody_leaves_this_machine(home, spy)
    (left,) = (run for run in runs if run is not killed)
    assert left.poll() is None
    _, errors = left.communicate(timeout=PATIENCE)
    assert left.returncode == 0, errors
    # That in domain 0 was killed.
    assert ahead == (0 if killed is runs[0] else 1)
    assert re.search(
        r'^wasd: domain 0 has another run, wasd mbot.* \(process \d+\): this one is in domain 1 '
        r'\(to talk to it: ROS_DOMAIN_ID=1 \./wasd topics\)$',
        errors,
        re.MULTILINE,
    )


def ask(spy: 'subprocess.Popen[str]') -> Places:
    """Return where the robots are."""
    assert spy.stdin is not None
    assert spy.stdout is not None
    spy.stdin.write('\n')
    spy.stdin.flush()
    places: Places = json.loads(spy.stdout.readline())
    return places


def check_that_each_drives_its_own_robot(
    spy: 'subprocess.Popen[str]', runs: list['subprocess.Popen[str]']
) -> int:
    """Drive the first ahead, turn the second; return in which domain the first is."""
    deadline = time.monotonic() + PATIENCE
    seen: list[list[float]] = []
    while len(seen) < 2 or max(x for x, _ in seen) < 0.02 or max(z for _, z in seen) < 0.02:
        assert time.monotonic() < deadline, 'the robots do not hear their keyboards'
        seen = [place for place in ask(spy) if place is not None]
        for run, key in zip(runs, 'ij', strict=True):
            assert run.stdin is not None
            run.stdin.write(key)
            run.stdin.flush()
    ahead = 0 if seen[0][0] > 0.02 else 1
    assert abs(seen[ahead][1]) < 1e-3
    assert abs(seen[1 - ahead][0]) < 1e-3
    return ahead


def check_that_a_domain_of_the_users_is_kept_with_a_warning(home: Host) -> None:
    """Start a short run in a domain that has one."""
    run = home.start(*MBOT, '--duration', '0.1', ROS_DOMAIN_ID='1')
    _, errors = run.communicate(timeout=PATIENCE)
    assert re.fullmatch(
        r'wasd: domain 1 has another run, wasd mbot.* \(process \d+\), too: each may get keys '
        r'and commands for the other\n',
        errors,
    )


def check_that_a_command_says_which_of_several_it_takes(
    home: Host, runs: list['subprocess.Popen[str]']
) -> 'subprocess.Popen[str]':
    """Look at a topic where several have it; return the run that was looked at."""
    said = home.wasd('echo', '--once', 'odom').stderr
    found = re.fullmatch(
        r'using wasd mbot.* \(process (\d+)\) in domain 0; '
        r'for others set ROS_DOMAIN_ID=1 for wasd mbot.* \(process \d+\)\n',
        said,
    )
    assert found is not None, said
    # nsenter becomes the command, so the process is the one that was started.
    (in_domain_0,) = (run for run in runs if run.pid == int(found[1]))
    return in_domain_0


def check_that_a_node_finds_the_run_and_nobody_leaves_this_machine(
    home: Host, spy: 'subprocess.Popen[str]'
) -> None:
    """Drive the robot that is left by a keyboard of its own."""
    sockets = home.start('cat', '/proc/net/udp').communicate()[0]
    addresses = {line.split()[1].partition(':')[0] for line in sockets.splitlines()[1:]}
    assert addresses == {'0100007F'}  # 127.0.0.1, as the kernel writes it
    teleop = home.start(PYTHON, '-m', 'teleop_keyboard.teleop_node')
    assert teleop.stdin is not None
    deadline = time.monotonic() + PATIENCE
    time.sleep(1.0)  # what its own keyboard asked for is over
    before = now = ask(spy)[1]
    assert before is not None
    while now is None or math.dist(now, before) < 0.02:
        assert time.monotonic() < deadline, 'the robot does not hear the keyboard'
        teleop.stdin.write('i')
        teleop.stdin.flush()
        now = ask(spy)[1]
