# SPDX-License-Identifier: Apache-2.0
"""A controller of your own: stands the Go2 up. See docs/write_a_controller.md."""

import signal
import threading

import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GOAL = {'hip': 0.0, 'thigh': 0.8, 'calf': -1.6}  # joint angles of a standing dog [rad]
KP, KD = 60.0, 3.0  # stiffness [N m/rad] and damping [N m s/rad] of every joint
RISE = 2.0  # how long it takes to stand up [s]


class StandUp(Node):
    """Answers every joint_states with a joint_commands on the way to the goal."""

    def __init__(self):
        super().__init__('stand_up')
        self.start = None  # time and angles of the first message
        self.commands = self.create_publisher(JointTrajectory, 'joint_commands', 10)
        self.create_subscription(JointState, 'joint_states', self.answer, qos_profile_sensor_data)

    def answer(self, state):
        """Command every joint to where it is to be at the time of this state."""
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        self.start = self.start or (now, state.position)
        share = min((now - self.start[0]) / RISE, 1.0)
        goal = [GOAL[name.split('_')[1]] for name in state.name]
        angles = [(1.0 - share) * a + share * b for a, b in zip(self.start[1], goal, strict=True)]
        command = JointTrajectory(header=state.header, joint_names=state.name)
        gains = JointTrajectoryPoint(positions=[KP] * len(goal), velocities=[KD] * len(goal))
        command.points = [JointTrajectoryPoint(positions=angles), gains]
        self.commands.publish(command)


if __name__ == '__main__':
    # Ctrl-C is heard between two messages: within one, rclpy can make another error of it.
    is_over = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: is_over.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = StandUp()
    while not is_over.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
