# SPDX-License-Identifier: Apache-2.0
"""Programs of Unitree's own SDK, in processes of their own, command the simulated Go2."""

from concurrent.futures import ThreadPoolExecutor
import functools
import importlib.util
import json
import os
from pathlib import Path
import shutil
import signal
import socket
import subprocess
import sys
import time

from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from terminals import PATIENCE

from unitree_bridge import bridge_command

pytestmark = [pytest.mark.long, pytest.mark.slow]
pytest.importorskip('cyclonedds', reason='needs the extra unitree')
if importlib.util.find_spec('unitree_sdk2py') is None:
    pytest.skip("needs Unitree's SDK, unitree-sdk2py-dimos", allow_module_level=True)

PROGRAMS = Path(__file__).parents[1] / 'unitree_sdk_programs.py'
# Said by the SDK, or by Cyclone, of a message that it cannot read.
COMPLAINTS = ('deserializ', '[Reader]', '[Writer]', 'raise exception', 'Traceback')
RUN = ('go2', '--interface', 'unitree', '--viewer', 'none', '--duration', '600')


@pytest.fixture
def domain():
    return os.environ['ROS_DOMAIN_ID']


class Simulated:
    """Simulated Go2s of one domain, of which each takes the place of the one before."""

    def __init__(self, domain):
        self._domain, self._process = domain, None

    def start(self, *options, module='unitree_bridge.bridge_command'):
        """Start one; return its process, once it says its interface."""
        self.end()
        command = [sys.executable, '-m', module, *options, '--domain', self._domain]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        for line in self._process.stdout:
            if line.startswith('Unitree '):
                return self._process
        raise AssertionError('it ended')

    def end(self):
        """End the last one."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait(PATIENCE)
            self._process.stdout.close()
            self._process = None


@pytest.fixture
def simulate(domain):
    """Start a simulated Go2 in place of the one before; it ends with the test."""
    robots = Simulated(domain)
    yield robots.start
    robots.end()


def run_program(domain, name, *words, timeout=180):
    """Run a program of the SDK to its end; return what it saw."""
    done = subprocess.run(
        [sys.executable, PROGRAMS, domain, name, *words],
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    # A reader of the SDK's that hears before it is made says so once; who cannot read, always.
    said = (done.stdout + done.stderr).replace('[Reader] take sample error\n', '', 1)
    assert done.returncode == 0, said
    assert not any(word in said for word in COMPLAINTS), said
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture
def program(domain):
    return functools.partial(run_program, domain)


def test_a_program_stands_the_robot_of_a_run_without_ros_by_its_motors(simulate, program):
    """In sync: a busy machine sends the next command too late, and the motors damp."""
    simulate(*RUN, '--no-ros', '--sync', module='wasd_bringup.cli')
    seen = program('stand_by_motors')
    assert seen['height'] > 0.3
    assert seen['aim'] < 0.12
    # Of LowStates a queue of the SDK's may lose some on a busy machine; the wire loses none.
    assert seen['heard'] > 0.95 * 500 * seen['seconds']


def test_in_sync_ros_and_the_interface_lose_no_message_and_a_busy_machine_changes_no_sample(
    simulate, program, spawn, spin_until
):
    """In sync, so that no reader of a busy machine is late: what is lost was lost on the way."""
    ear, stamps = spawn(Node('ear')), []

    def hear(odometry):
        stamps.append(Time.from_msg(odometry.header.stamp).nanoseconds)

    ear.create_subscription(Odometry, 'odom', hear, QoSProfile(depth=10_000))
    simulate(
        'go2', '--interface', 'unitree', '--sync', '--viewer', 'none', module='wasd_bringup.cli'
    )
    spin_until(spawn.pump, lambda: ear.count_publishers('odom') > 0)
    with ThreadPoolExecutor() as pool:
        told = pool.submit(program, 'in_sync', '500')
        spin_until(spawn.pump, told.done, timeout=180)
    quiet = told.result()['samples']
    ticks = sorted(map(int, quiet))
    assert set(np.diff(ticks)) == {2}
    assert ticks[-1] == 1000
    heard = [stamp for stamp in stamps if stamp <= 1_000_000_000]
    assert len(heard) > 30
    assert len(set(np.diff(heard))) == 1
    assert heard[-1] > 900_000_000
    # The bridge alone is the same robot; others have the processor, again and again.
    process = simulate('--sync')
    with ThreadPoolExecutor() as pool:
        told = pool.submit(program, 'in_sync', '400')
        while not told.done():
            process.send_signal(signal.SIGSTOP)
            time.sleep(0.05)
            process.send_signal(signal.SIGCONT)
            time.sleep(0.1)
        busy = told.result()['samples']
    assert len(busy) == 401
    assert busy == {tick: angles for tick, angles in quiet.items() if int(tick) <= 800}
    thighs = np.array(busy['800']).reshape(4, 3)[:, 1]
    assert np.abs(thighs - 0.9).max() < 0.4


def test_all_sockets_hear_the_loopback_alone(domain):
    look = f"""
import socket, os
from unitree_bridge.bridge import INTO, OUT
from unitree_bridge.connection import open_wire
from unitree_bridge.loopback import open_sockets
wire = open_wire({domain}, 'lo', OUT, INTO)
for number in open_sockets():
    with socket.socket(fileno=os.dup(number)) as one:
        device = one.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
        print(one.getsockname()[0], device.decode().strip(chr(0)))
wire.close()
"""
    done = subprocess.run(
        [sys.executable, '-c', look], capture_output=True, text=True, check=True, timeout=PATIENCE
    )
    lines = [line.split() for line in done.stdout.splitlines()]
    assert lines
    assert {device for _, device in lines} == {'lo'}


# Counts what goes out by an interface, other than questions for neighbours, until it shall end.
SNIFF = """
import select, socket, sys
sniffer = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
sniffer.bind(('wire0', 0))
sniffer.settimeout(0.2)
out = heard = 0
while not select.select([sys.stdin], [], [], 0)[0]:
    try:
        packet, (_, _, kind, *_) = sniffer.recvfrom(4096)
    except TimeoutError:
        continue
    is_udp = packet[12:14] == bytes((8, 0)) and packet[23] == 17
    out += is_udp and kind == socket.PACKET_OUTGOING
    heard += is_udp and kind != socket.PACKET_OUTGOING
print(out, heard)
"""


@pytest.fixture
def hosts():
    """Return two machines, by a process of each, that one wire joins: wire0 and wire1."""
    made = [
        subprocess.Popen(
            ['unshare', '--net', 'sh', '-c', 'ip link set lo up && echo up && exec sleep 300'],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        for _ in range(2)
    ]
    try:
        if any(host.stdout.readline() != 'up\n' for host in made):
            pytest.skip('no network namespaces here')
        pair = f'ip link add wire0 type veth peer name wire1 netns {made[1].pid}'
        on(made[0], *pair.split()).wait()
        for number, host in enumerate(made):
            on(host, *f'ip addr add 198.18.77.{number + 1}/30 dev wire{number}'.split()).wait()
            on(host, *f'ip link set wire{number} up'.split()).wait()
            on(host, *f'ip route add 224.0.0.0/4 dev wire{number}'.split()).wait()
        yield made
    finally:
        for host in made:
            host.kill()
            host.wait()
            host.stdout.close()


def on(host, *words, **options):
    """Start a program on a machine."""
    return subprocess.Popen(['nsenter', '--target', str(host.pid), '--net', *words], **options)


def test_nothing_leaves_the_loopback_and_nothing_is_heard_from_outside(hosts):
    here, there = hosts
    pipe = {'stdout': subprocess.PIPE, 'text': True}
    command = [sys.executable, '-m', 'unitree_bridge.bridge_command', '--duration', '600']
    with on(here, *command, **pipe) as robot:
        while 'Unitree interface' not in robot.stdout.readline():
            assert robot.poll() is None
        sniff = [sys.executable, '-c', SNIFF]
        with on(here, *sniff, stdin=subprocess.PIPE, **pipe) as sniffer:
            stranger = [sys.executable, PROGRAMS, '0', 'round_trip']
            far = {**os.environ, 'SDK_NETWORK': 'wire1'}
            outside = on(there, *stranger, '3', '0', env=far, **pipe)  # it hears nothing
            own = on(here, *stranger, '1', **pipe)
            heard = [json.loads(each.communicate()[0].splitlines()[-1]) for each in (outside, own)]
            out, came = map(int, sniffer.communicate('enough')[0].split())
        robot.terminate()
    assert (out, heard[0]['heard']) == (0, 0)
    # The stranger did ask, and a program of this machine is served meanwhile.
    assert came > 0
    assert heard[1]['heard'] > 100


def test_another_network_than_the_loopback_is_refused(capsys):
    other = next((name for _, name in socket.if_nameindex() if name != 'lo'), 'eth0')
    assert bridge_command.main(['--network', other]) == 2
    said = capsys.readouterr().err
    assert said.startswith('error: network: ')
    assert said.count('\n') == 1


@pytest.fixture(scope='module')
def running(ros_domains):
    """Yield domain and process of the run that programs of the tests below command."""
    domain = str(next(ros_domains))
    robots = Simulated(domain)
    yield domain, robots.start(*RUN, '--no-ros', module='wasd_bringup.cli')
    robots.end()


def test_a_program_stands_and_moves_the_robot_of_a_run_by_the_sport_service(running):
    seen = run_program(running[0], 'sport')
    assert seen['version'] == [0, '1.0.0.1']
    assert seen['code'] == 0
    assert seen['height'] > 0.3
    assert 0.3 < seen['moved'] < 1.2
    assert max(map(abs, seen['velocity'])) < 0.1


def test_every_call_of_the_sport_client_is_answered_and_programs_come_and_go(running):
    domain, process = running
    seen = run_program(domain, 'calls')
    assert set(seen['codes'].values()) == {0, 3203}
    assert len(seen['codes']) == 39
    assert seen['mode'] == [0, {'form': '0', 'name': 'mcf'}]
    assert (seen['switch'], seen['select']) == (0, 0)
    assert seen['avoid'] == [[0, False], 0]
    assert 'sport_mode' in seen['services']
    assert run_program(domain, 'round_trip', '1')['heard'] > 0
    assert process.poll() is None


# Examples of the SDK's package, and the last line of theirs that shows that all went well; one
# that goes round and round is ended there.
EXAMPLES = {
    'robot_service_client_example.py': 'service start sport_mode success. code: 0',
    'obstacles_avoid_client_example.py': 'switch set success. enable: False',
    'sport_client_example.py': 'get server api version: 1.0.0.1',
    'video_client_example.py': 'ImageName:',
}


def test_examples_of_the_sdk_s_package_run_unchanged_one_after_the_other(running, tmp_path):
    package = importlib.util.find_spec('unitree_sdk2py').submodule_search_locations[0]
    domain, process = running
    for name, last in EXAMPLES.items():
        # A copy: one writes a picture beside itself.
        path = shutil.copy(Path(package) / 'test/client' / name, tmp_path)
        command = [sys.executable, '-u', PROGRAMS, domain, 'example', path]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as one:
            said = ''
            for line in one.stdout:
                said += line
                if line.startswith(last):
                    break
                if 'get image sample error. code: 3202' in line:
                    pytest.skip('nothing renders here')
            one.kill()
        assert last in said, name
        assert process.poll() is None
        assert not any(word in said for word in COMPLAINTS), f'{name}: {said}'
