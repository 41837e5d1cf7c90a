# SPDX-License-Identifier: Apache-2.0
"""What a session needs of the nodes that drive a robot, and which robot gets which."""

from typing import Protocol

from mujoco_sim.simulation import Schedule
from mujoco_sim.simulation import TickStatistics
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.world import World
from nav_msgs.msg import Odometry
from rclpy.node import Node
from robot_description.description import Description
from std_msgs.msg import String
from teleop_keyboard.dashboard import Status
from wasd_core.timing import Notice

from wasd_bringup.options import RunOptions
from wasd_bringup.report import Sample


class Stack(Protocol):
    """The nodes that drive one robot in lock-step."""

    estimator: str
    has_states: bool  # whether keys are more than velocities
    camera: CameraView
    nodes: list[Node]
    ticks: TickStatistics
    notice: Notice  # what is said to the driver; the session lets its time pass

    @property
    def stop_key(self) -> str:
        """The key that ends every motion that keys have set going."""

    @property
    def period(self) -> float:
        """The controller's period [s]."""

    @property
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""

    @property
    def first_keys(self) -> str:
        """The keys to press first."""

    @property
    def state(self) -> str:
        """The controller's state."""

    def press(self, message: String) -> None:
        """Take a key."""

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion that keys have set going."""

    def latches(self, key: str) -> bool:
        """Whether what a press of this key sets moving goes on when the key is let go."""

    def drive(self, velocity: tuple[float, float, float]) -> None:
        """Command a velocity [m/s], [m/s], [rad/s] through cmd_vel."""

    def schedule(self, schedule: Schedule) -> None:
        """Have the nodes stepped on simulated time."""

    def odometry(self) -> Odometry | None:
        """Return odom as it is published in this instant; None before there is any."""

    def sample(self) -> Sample:
        """Return this instant for the report."""

    def status(self) -> Status:
        """Return what a driver wants to see."""

    def takes(self, key: str) -> bool:
        """Return whether a key means something of its own to this robot."""

    def reset(self) -> None:
        """Forget the past."""

    def halt(self) -> None:
        """Command standstill, now and in the last word on cmd_vel, until the next key."""

    def close(self) -> None:
        """Leave the robot stopped."""


def make_stack(loaded: Description, world: World, options: RunOptions) -> Stack:
    """
    Return the nodes of the robot that the command names.

    Raises:
        UserError: the description is not such a robot.
    """
    # Here, because the controllers of the other robot take a second to load.
    if options.robot == 'go2':
        from wasd_bringup.go2_stack import Go2Stack

        return Go2Stack(loaded, world, options)
    from wasd_bringup.mbot_stack import MbotStack

    return MbotStack(loaded, world, options)
