# SPDX-License-Identifier: Apache-2.0
"""Publishers of `/tf` and `/tf_static` that do without where the message does not exist."""

from collections.abc import Iterable
import importlib
import os
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

from wasd_core.node import has_listener
from wasd_core.qos import TF
from wasd_core.qos import TF_STATIC
from wasd_core.ros_isolation import is_sourced


def tf_message_type() -> type[Any] | None:
    """Return tf2_msgs/TFMessage, or None where tf2_msgs is not installed (the wheels lack it)."""
    try:
        return importlib.import_module('tf2_msgs.msg').TFMessage  # type: ignore[no-any-return]
    except ImportError:
        return None


class TfBroadcaster:
    """Sends transforms on `/tf`, or latched on `/tf_static`; says once if it cannot."""

    _reported = False

    def __init__(self, node: Node, static: bool = False) -> None:
        self._type = tf_message_type()
        self._static = static
        if self._type is None:
            if not TfBroadcaster._reported:
                TfBroadcaster._reported = True
                cure = 'python -m robot_description.build_tf2_msgs makes it'
                if is_sourced(os.environ):
                    cure = f'sudo apt install ros-{os.environ["ROS_DISTRO"]}-tf2-msgs'
                node.get_logger().info(f'tf2_msgs is not installed: /tf is not published ({cure})')
            return
        if static:
            self._publisher = node.create_publisher(self._type, '/tf_static', TF_STATIC)
        else:
            self._publisher = node.create_publisher(self._type, '/tf', TF)

    @property
    def available(self) -> bool:
        """Whether transforms reach anybody, now or later; otherwise they need not be made."""
        return self._type is not None and (self._static or has_listener(self._publisher))

    def send(self, transforms: Iterable[TransformStamped]) -> None:
        """Publish the transforms in one message; a generator is not run where nobody listens."""
        if self._type is not None and self.available:
            self._publisher.publish(self._type(transforms=list(transforms)))
