# SPDX-License-Identifier: Apache-2.0
"""On a slow host physics slows down, and nobody who sends on seems to have fallen silent."""

from collections.abc import Iterator
from itertools import pairwise
import subprocess
import sys
import time

from cases import for_all
import numpy as np
import pytest
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.inputs import LONGEST_PAUSE, MessageTimes, PERIOD
from wasd_bringup.run.options import RunOptions

# Sends 20 commands a second of wall time, and says when: it may be starved, too.
SENDER = """
import time, rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node('sender')
publisher = node.create_publisher(Twist, 'cmd_vel', 10)
message = Twist()
message.linear.x = 0.2
while True:
    publisher.publish(message)
    print(time.monotonic(), flush=True)
    time.sleep(0.05)
"""
BUSY = 'while True: pass'


@for_all('factor', [0.1, 1.0, 5.0])
@for_all('took', [0.001, 0.05, 0.3, 2.0])
def test_the_next_look_at_messages_is_near_in_simulated_time(took, factor):
    times, now, simulated = MessageTimes(), 0.0, 0.0
    longest, looked_at = 0.0, 0.0
    for _ in range(5000):
        if times.is_due(now, simulated):
            longest, looked_at = max(longest, simulated - looked_at), simulated
            now += took
            times.looked(now, took, simulated)
        now += 0.001
        simulated += 0.001 * factor
    assert 0.0 < longest <= max(LONGEST_PAUSE, PERIOD * factor) + 0.001 * factor + 1e-9


def test_looks_that_are_quick_have_no_more_than_their_share():
    times = MessageTimes()
    times.looked(1.0, 0.004, 1.0)
    assert not times.is_due(1.039, 1.039)
    assert times.is_due(1.041, 1.041)


@pytest.fixture
def sender(isolated_ros, loops) -> Iterator[subprocess.Popen]:
    """Start a sender of cmd_vel, then busy loops beside it; end them afterwards."""
    words = [sys.executable, '-c', SENDER]
    processes = [subprocess.Popen(words, stdout=subprocess.PIPE, text=True)]
    processes[0].stdout.readline()
    processes += [subprocess.Popen([sys.executable, '-c', BUSY]) for _ in range(loops)]
    yield processes[0]
    for process in processes:
        process.kill()
        process.wait()


def longest_silence(times):
    return max(after - before for before, after in pairwise(times))


@pytest.mark.slow
@pytest.mark.usefixtures('ros')
@pytest.mark.parametrize(
    ('physics', 'look', 'loops'), [(0.0, 0.0, 2), (0.0, 0.3, 0), (0.02, 0.05, 0)]
)
def test_cmd_vel_of_another_process_is_heard_as_often_as_it_is_sent(
    sender, monkeypatch, physics, look
):
    """
    Others have the processors, or it is slow itself.

    `physics` are seconds that each 10 ms of simulated time take on top, `look` each look.
    """
    session = make_ros_run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=1.0))
    simulation, pump, heard, clock = session.simulation, session.face._pump, [], []
    controller = session.robot.drive_unit.controller
    command, handle = controller.command, pump.handle

    def note(*values, **named):
        heard.append(session.world.time)
        return command(*values, **named)

    def look_slowly(timeout):
        time.sleep(look)
        handle(timeout)

    def slow_down():
        clock.append((time.monotonic(), session.world.time))
        time.sleep(physics)

    monkeypatch.setattr(controller, 'command', note)
    monkeypatch.setattr(pump, 'handle', look_slowly)
    simulation.schedule.every(0.01, slow_down)
    end = [np.inf]
    simulation.run(
        stop=lambda: session.world.time >= end[0],
        poll=session._poll,
        each_second=lambda: (
            end.__setitem__(0, min(end[0], session.world.time + 1.5)) if heard else None
        ),
    )
    sender.kill()
    sent = np.array([float(line) for line in sender.stdout if line.endswith('\n')])
    session.close()
    wall, simulated = np.array(clock).T
    times = np.interp(sent, wall, simulated)
    times = times[times > heard[0]]
    heard.append(session.world.time)
    factor = (simulated[-1] - simulated[0]) / (wall[-1] - wall[0])
    print(
        f'factor {factor:.2f}: {longest_silence(heard):.3f} s, sent {longest_silence(times):.3f}'
    )
    assert longest_silence(heard) < longest_silence(times) + 0.3
