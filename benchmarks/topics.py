# SPDX-License-Identifier: Apache-2.0
"""
The leg controller as a process of its own: it and the simulator talk over topics.

Started as a script, so that this process has a ROS of its own; prints one line of JSON. Whoever
starts it says in its environment which domain: a robot in the same one would be driven.
"""

from collections.abc import Callable, Iterator
import contextlib
import json
import math
import subprocess
import sys
import time
from typing import Any

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

SPEED = 0.5  # [m/s]
WALK = 20.0  # [s]
SETTLE = 3.0  # from the first command until the speed counts [s]
PATIENCE = 60.0  # of wall time for each thing that is waited for [s]
# Truth comes 500 times a second; reading every tenth message leaves the cores to the robot.
EVERY = 10
PROCESSES = (
    ('mujoco_sim.simulator_node', '-p', 'description:=go2', '-p', 'state_rate:=500.0'),
    ('quadruped_sim.leg_controller_node',),
)


class Driver(Node):
    """Presses keys, commands velocities, and watches clock, state and truth."""

    def __init__(self) -> None:
        super().__init__('benchmark')
        self.now = 0.0
        self.state = ''
        self.track: list[tuple[float, float, float, float]] = []  # time [s], x, y, z [m]
        self.tilt = 0.0  # largest so far [rad]
        self._count = 0
        self._keys = self.create_publisher(String, 'keys', 10)
        self._twists = self.create_publisher(Twist, 'cmd_vel', 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'state', self._on_state, latched)
        self.create_subscription(Clock, '/clock', self._on_clock, 10)
        self.create_subscription(
            Odometry, 'ground_truth/odom', self._on_truth, qos_profile_sensor_data, raw=True
        )

    def wait_for(self, done: Callable[[], bool], what: str) -> None:
        """
        Handle messages until something has happened.

        Raises:
            TimeoutError: it has not happened.
        """
        deadline = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > deadline:
                raise TimeoutError(f'{what}: still waiting in state {self.state!r}')
            rclpy.spin_once(self, timeout_sec=0.05)

    def sleep(self, duration: float) -> None:
        """Handle messages for so long of simulated time [s]."""
        end = self.now + duration
        self.wait_for(lambda: self.now >= end, 'the clock')

    def press(self, key: str) -> None:
        """Press a key."""
        self._keys.publish(String(data=key))

    def drive(self, speed: float, duration: float) -> None:
        """Command a speed ahead [m/s] 20 times a simulated second, for so long [s]."""
        message = Twist()
        message.linear.x = speed
        end = self.now + duration
        while self.now < end:
            self._twists.publish(message)
            self.sleep(0.05)

    def _on_clock(self, message: Clock) -> None:
        self.now = message.clock.sec + 1e-9 * message.clock.nanosec

    def _on_state(self, message: String) -> None:
        self.state = message.data

    def _on_truth(self, serialized: bytes) -> None:
        self._count += 1
        if self._count % EVERY:
            return
        message = deserialize_message(serialized, Odometry)
        stamp, pose = message.header.stamp, message.pose.pose
        place = pose.position
        self.track.append((stamp.sec + 1e-9 * stamp.nanosec, place.x, place.y, place.z))
        x, y = pose.orientation.x, pose.orientation.y
        self.tilt = max(self.tilt, math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))


def walk(driver: Driver) -> dict[str, Any]:
    """Stand up, walk, and return what was seen."""
    driver.wait_for(lambda: driver.state == 'passive' and driver.now > 0.5, 'both processes')
    driver.press('2')
    driver.wait_for(lambda: driver.state == 'fixed stand', 'fixed stand')
    driver.sleep(2.5)
    driver.press('5')
    driver.wait_for(lambda: driver.state == 'move base', 'move base')
    began, started = driver.now, time.monotonic()
    driver.drive(SPEED, WALK)
    simulated, wall = driver.now - began, time.monotonic() - started
    steady = [row for row in driver.track if row[0] >= began + SETTLE]
    distance = math.dist(steady[0][1:3], steady[-1][1:3])
    return {
        'real_time_factor': simulated / wall,
        'simulated': simulated,
        'speed': distance / (steady[-1][0] - steady[0][0]),
        'height': steady[-1][3],
        'tilt_max_deg': math.degrees(driver.tilt),
        'state': driver.state,
    }


@contextlib.contextmanager
def started_processes() -> Iterator[None]:
    """Keep the simulator and the leg controller running."""
    children: list[subprocess.Popen[bytes]] = []
    try:
        for module, *parameters in PROCESSES:
            words = [sys.executable, '-m', module, '--ros-args', *parameters]
            quiet = subprocess.DEVNULL
            children.append(subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet))
        yield
    finally:
        for child in children:
            child.terminate()
        for child in children:
            try:
                child.wait(timeout=20.0)
            except subprocess.TimeoutExpired:
                child.kill()


def main() -> int:
    """Walk once; the line of JSON has `error` instead when it could not be."""
    with started_processes():
        rclpy.init()
        driver = Driver()
        try:
            print(json.dumps(walk(driver)), flush=True)
        except TimeoutError as error:
            print(json.dumps({'error': str(error)}), flush=True)
        finally:
            driver.destroy_node()
            rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
