# SPDX-License-Identifier: Apache-2.0
"""The nodes that drive one robot in lock-step: what all robots share of them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
import functools
import time
from typing import Any

from geometry_msgs.msg import Twist
from mujoco_sim.simulation import Schedule, TickStatistics
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.world import World
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import Description
from std_msgs.msg import String
from teleop_keyboard.dashboard import Status
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from wasd_core.robot_io import BaseOdometry
from wasd_core.timing import Notice, STOP_KEY
from wasd_core.topics import LoopbackSubscription, RELIABLE

from wasd_bringup.options import RunOptions
from wasd_bringup.report import Sample
from wasd_bringup.robots import load_class, ROBOTS

Velocity = tuple[float, float, float]


class ControlStack(ABC):
    """
    A robot's controller, and where keys are velocities the node that makes them so.

    `press` takes keys, `drive` takes velocities; `schedule` has all of it stepped on simulated
    time: keys, then the controller, then odometry.
    """

    has_states = False  # whether keys are more than velocities
    other_presets: tuple[str, ...] = ()  # those that are no keymaps
    # Where its feet reach as it stands, in the base frame (n, 2) [m]; none for who has none.
    feet = np.empty((0, 2))
    camera: CameraView
    notice: Notice  # what is said to the driver; the session lets its time pass

    def __init__(
        self, world: World, options: RunOptions, controller: Any, twist_type: type[Any] = Twist
    ) -> None:
        """Take a robot's world and the node of its controller, which has `cmd_vel.put`."""
        self._world = world
        self._controller = controller
        self.pad_preset = ROBOTS[options.robot].kind.pad_preset
        self.estimator = options.estimator
        self._teleop: KeysToTwistNode | None = None
        self.nodes: list[Node] = [controller]
        self.own_keys: frozenset[str] = frozenset()  # those that mean something to this robot
        if self._keys_are_velocities(options):
            self._teleop = _make_teleop(options, self.other_presets)
            self._teleop.receivers.append(controller.cmd_vel.put)
            self.nodes.append(self._teleop)
            self.own_keys = frozenset(self._teleop.logic.keymap.keys)
        self._is_mute = False
        self._twists = self.nodes[-1].create_publisher(twist_type, 'cmd_vel', RELIABLE)
        self.ticks = TickStatistics(self.period)

    @property
    @abstractmethod
    def period(self) -> float:
        """The controller's period [s]."""

    @property
    @abstractmethod
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""

    @property
    @abstractmethod
    def first_keys(self) -> str:
        """The keys to press first."""

    @property
    def refusal(self) -> str:
        """Why it follows no velocity now, with what is to be done; '' where it does."""
        return ''

    @property
    @abstractmethod
    def drive_limits(self) -> dict[str, float]:
        """How fast a navigator may drive it, by the names of its parameters `limits.*`."""

    @property
    def state(self) -> str:
        """The controller's state."""
        state: str = self._controller.controller.state
        return state

    @property
    def command_topic(self) -> str:
        """The topic of velocities, by its full name."""
        topic: str = self._twists.topic_name
        return topic

    @property
    def stop_key(self) -> str:
        """The key that ends every motion that keys have set going."""
        return STOP_KEY

    @property
    def stop_keys(self) -> tuple[str, ...]:
        """The keys that stop it for good, and end every motion."""
        return (self.stop_key,)

    def e_stop(self) -> None:  # noqa: B027  # keys are enough for most
        """Do what keys cannot do as fast."""

    def on_e_stop(self, stop: Callable[[], None]) -> None:  # noqa: B027  # not all have a service
        """Let the controller's own e-stop service stop the run."""

    def admit_topics(self, take: Callable[..., bool]) -> None:
        """Ask `take(topic, ...)` whether a key or a velocity of another process counts."""

        def admit_key(topic: str, message: String) -> bool:
            return take(topic, key=message.data)

        def admit_velocity(twist: Twist) -> bool:
            return take(
                self.command_topic, velocity=(twist.linear.x, twist.linear.y, twist.angular.z)
            )

        for subscription in self._key_inputs:
            subscription.admit = functools.partial(admit_key, subscription.topic)
        self._controller.cmd_vel.admit = admit_velocity

    @property
    def _key_inputs(self) -> list[LoopbackSubscription[String]]:
        return [] if self._teleop is None else [self._teleop.keys]

    @abstractmethod
    def press(self, key: str, is_pressed: bool = True) -> None:
        """Take a key; one that nobody has pressed, as of a page that is lost, is not answered."""

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion that keys have set going."""
        return self._teleop is not None and self._teleop.logic.stops(key)

    def latches(self, key: str) -> bool:
        """Whether what a press of this key sets moving goes on when the key is let go."""
        return self._teleop is not None and self._teleop.logic.latches(key)

    def drive(self, velocity: Velocity) -> None:
        """Command a velocity [m/s], [m/s], [rad/s] through cmd_vel, whoever drives."""
        message = self._to_twist(velocity)
        self._controller.cmd_vel.put(message)
        self._twists.publish(message)

    def say(self, words: str) -> None:
        """Tell the driver."""
        self.notice.say(words)

    def schedule(self, schedule: Schedule) -> None:
        """Have the nodes stepped on simulated time."""
        if self._teleop is not None:
            teleop, period = self._teleop, 1.0 / self._teleop.logic.rate
            schedule.every(period, lambda: self._step_keys(teleop, period))
        schedule.every(self.period, self._timed_control)
        self._schedule_publishing(schedule)

    def odometry(self) -> Odometry | None:
        """Return odom as it is published in this instant; None before there is any."""
        return self._controller.odometry()

    @property
    @abstractmethod
    def base_odometry(self) -> BaseOdometry | None:
        """Where the robot believes to be in this instant; None before it knows."""

    @property
    def frames(self) -> tuple[str, str]:
        """The frames of odometry and of the base."""
        frames: tuple[str, str] = self._controller.frames
        return frames

    @abstractmethod
    def sample(self) -> Sample:
        """Return this instant for the report."""

    @abstractmethod
    def status(self) -> Status:
        """Return what a driver wants to see."""

    def reset(self) -> None:
        """Forget the past: commands, ramps, estimates."""
        if self._teleop is not None:
            self._teleop.logic.reset()

    def mute(self, is_mute: bool) -> None:
        """Mute the keyboard while another source drives, or enable it again."""
        if is_mute and not self._is_mute and self._teleop is not None:
            self._teleop.stop()
        self._is_mute = is_mute

    def stop(self) -> None:
        """Command standstill, now and in the last word on cmd_vel, until the next key."""
        if self._teleop is not None:
            self._teleop.close()

    def close(self) -> None:
        """Leave the robot stopped: the last cmd_vel is zero."""
        if self._teleop is not None:
            self._teleop.close()
        self._controller.close()

    def _step_keys(self, teleop: KeysToTwistNode, dt: float) -> None:
        if not self._is_mute:
            teleop.step(dt)

    def _keys_are_velocities(self, options: RunOptions) -> bool:
        return True

    def _to_twist(self, velocity: Velocity) -> Any:
        message = Twist()
        message.linear.x, message.linear.y, message.angular.z = velocity
        return message

    @abstractmethod
    def _schedule_publishing(self, schedule: Schedule) -> None: ...

    @abstractmethod
    def _control(self) -> None:
        """Step the controller on the state of now, and hand its command to the world."""

    def _timed_control(self) -> None:
        started = time.perf_counter()
        self._control()
        self.ticks.add(time.perf_counter() - started)


def _make_teleop(options: RunOptions, other_presets: tuple[str, ...]) -> KeysToTwistNode:
    return KeysToTwistNode(
        KeysToTwist(load_preset(options.preset, options.layout, other_presets)),
        namespace=options.namespace,
        parameter_overrides=[
            Parameter('preset', value=options.preset),
            Parameter('layout', value=options.layout),
        ],
    )


def make_stack(loaded: Description, world: World, options: RunOptions) -> ControlStack:
    """
    Return the nodes of the robot that the command names.

    Raises:
        UserError: the description is not such a robot.
    """
    # Here, because the controllers of the other robots take a second to load.
    made: ControlStack = load_class(ROBOTS[options.robot].kind.stack)(loaded, world, options)
    return made
