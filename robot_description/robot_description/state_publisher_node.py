# SPDX-License-Identifier: Apache-2.0
"""Publishes the robot's description and where its links are, as robot_state_publisher does."""

from dataclasses import replace
import sys

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from wasd_core.messages import to_seconds, to_transform
from wasd_core.ros_parameters import declare_parameters
from wasd_core.rotations import Pose
from wasd_core.streams import visible
from wasd_core.timing import Beat
from wasd_core.topics import LATCHED, SENSOR_DATA, TfBroadcaster

from robot_description.description import Description, equip, read_description
from robot_description.meshes.files import published_urdf
from robot_description.morphology.names import unknown_joint_warning
from robot_description.morphology.wheel_file import read_wheel_choice
from robot_description.packages import description_path
from robot_description.parameters import state_publisher, StatePublisherParameters
from robot_description.robot import Joint


class StatePublisherNode(Node):
    """
    Latches `robot_description` and sends `/tf_static` once, `/tf` from `joint_states`.

    Who gives it a robot calls `publish`, with the joints of an instant. Of several robots each has
    a `prefix` such as `go2/`: before its frames, and its namespace.
    """

    def __init__(self, robot: Description | None = None, *, prefix: str = '') -> None:
        """
        Take a robot, or read the description that the parameter names.

        Raises:
            InvalidParameter, DescriptionError: what is wrong, in one line.
        """
        super().__init__('state_publisher', namespace=prefix.rstrip('/'))
        self.settings = declare_parameters(self, StatePublisherParameters, self._on_change)
        self._beat = Beat()
        loaded = robot or self._load()
        self._robot = loaded.robot
        self._prefix = prefix
        self._unknown: set[str] = set()
        self._description = self.create_publisher(String, 'robot_description', LATCHED)
        self._description.publish(String(data=published_urdf(loaded.urdf, loaded.meshes.files)))
        self._static = TfBroadcaster(self, static=True)
        self._moving = TfBroadcaster(self)
        # Stamp 0: true at any time, whichever clock a listener goes by.
        self._static.send(
            self._transform(joint, joint.pose, Time())
            for joint in self._robot.joints.values()
            if joint.kind == 'fixed'
        )
        if robot is None:
            joints = self._on_joint_states
            self.create_subscription(JointState, 'joint_states', joints, SENSOR_DATA)

    def _load(self) -> Description:
        """Read the robot with the joints held that simulator and controller hold."""
        read = read_description(description_path(self.settings.description))
        return equip(replace(read, wheels=read_wheel_choice(self.settings.controller)))[0]

    @property
    def is_heard(self) -> bool:
        """Whether `publish` reaches anybody."""
        return self._moving.available

    def publish(self, names: tuple[str, ...], positions: np.ndarray, stamp: Time) -> None:
        """Send where the children of the named joints are at positions [rad] or [m]."""
        joints = self._robot.joints
        for name in names:
            if name not in joints:
                self._report_unknown(name)
        moved = zip(names, positions, strict=True)
        known = [(joints[name], float(position)) for name, position in moved if name in joints]
        self._moving.send(
            self._transform(joint, joint.transform(position), stamp) for joint, position in known
        )

    def close(self) -> None:
        """Nothing to stop."""

    def _on_joint_states(self, message: JointState) -> None:
        if len(message.position) != len(message.name):
            self.get_logger().warning(
                f'joint_states has {len(message.name)} names but {len(message.position)} '
                'positions: ignored',
                throttle_duration_sec=5.0,
            )
            return
        stamp = message.header.stamp
        # The instants of odom, where that has the same rate: a look-up finds both.
        if self._beat.is_due(to_seconds(stamp), self.settings.publish_frequency):
            self.publish(tuple(message.name), np.array(message.position), stamp)

    def _on_change(self, changed: StatePublisherParameters) -> None:
        self.settings = changed

    def _transform(self, joint: Joint, pose: Pose, stamp: Time) -> TransformStamped:
        parent, child = self._prefix + joint.parent, self._prefix + joint.child
        return to_transform(pose, parent, child, stamp)

    def _report_unknown(self, name: str) -> None:
        if name not in self._unknown:
            self._unknown.add(name)
            known = [joint.name for joint in self._robot.movable_joints]
            self.get_logger().warning(visible(unknown_joint_warning(name, known)))


if __name__ == '__main__':
    sys.exit(state_publisher())
