# SPDX-License-Identifier: Apache-2.0
"""The node that turns keys into velocity commands, and the executable `keys_to_twist`."""

import sys
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String
from wasd_core.ros_parameters import declare_parameters
from wasd_core.topics import EVENTS, LoopbackSubscription, PublisherWatch, watch_types
from wasd_core.velocity_messages import to_twist

from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist, STANDSTILL, Velocity
from teleop_keyboard.parameters import keys_to_twist, TeleopParameters
from teleop_keyboard.twist_messages import TwistOutput

# The zero that ends it all is sent this often.
LAST_ZEROS = 3


class KeysToTwistNode(Node):
    """
    Subscribes to `keys` and publishes `cmd_vel`, with a preset and its ramps.

    Alone it makes its logic by the parameters, and steps itself with a timer on its own clock
    (simulated time, if so set). A given `logic` takes all parameters but preset and layout; its
    owner steps it, or calls `step`.

    Raises:
        InvalidParameter: when a parameter or the preset is not valid.
    """

    def __init__(
        self,
        logic: KeysToTwist | None = None,
        *,
        namespace: str = '',
        parameter_overrides: list[Parameter] | None = None,
    ) -> None:
        super().__init__(
            'keys_to_twist', namespace=namespace, parameter_overrides=parameter_overrides or []
        )
        self._settings = declare_parameters(self, TeleopParameters, self._on_parameters)
        self.logic = logic or KeysToTwist(
            load_preset(self._settings.preset, self._settings.layout)
        )
        self.logic.set_parameters(self._settings)
        self.output = TwistOutput(
            self, 'cmd_vel', self._settings.stamped, lambda: self._settings.frame_id
        )
        self._last_time = self.get_clock().now()
        self._timer = self._make_timer() if logic is None else None
        self.keys = LoopbackSubscription(self, String, 'keys', self._on_key, EVENTS)
        if logic is None:
            self._keyboard = PublisherWatch(self, 'keys', self._on_lost_keyboard)
            watch_types(self, self.output.type, 'cmd_vel')

    def step(self, dt: float) -> None:
        """Let `dt` [s] pass and publish what is due."""
        velocity = self.logic.step(dt)
        if velocity is not None:
            self._send(velocity)

    def close(self) -> None:
        """Leave the robot stopped: publish zeros and see them off."""
        self.logic.stop()
        for _ in range(LAST_ZEROS):
            self._send(STANDSTILL)
        self.output.see_off()

    def _on_key(self, message: String) -> None:
        if self._timer is None:
            self.logic.press(message.data)
            return
        # Alone, time passes up to the very moment of the press: gaps between keys are measured.
        self._on_timer()
        was_silent = self.logic.is_silent
        self.logic.press(message.data)
        # The first command of a motion leaves with the press: it holds for the period to come.
        is_start = was_silent and self.logic.is_moving
        if self._timer is not None and (is_start or self._timer.is_canceled()):
            self._timer.reset()
        self.step(1.0 / self.logic.rate if is_start else 0.0)

    def _on_lost_keyboard(self) -> None:
        """Stop the robot, whatever the mode."""
        if self.logic.is_moving:
            self.get_logger().warning('nobody publishes keys any more: stopping')
            self.logic.motion.forget()

    def _on_timer(self) -> None:
        now = self.get_clock().now()
        dt = (now - self._last_time).nanoseconds * 1e-9
        self._last_time = now
        self.step(max(dt, 0.0))
        if self._timer is not None and self.logic.is_silent:
            # Nothing will be due before a key, which starts it again.
            self._timer.cancel()

    def _on_parameters(self, parameters: TeleopParameters) -> None:
        rate = self.logic.rate
        self.logic.set_parameters(parameters)
        self._settings = parameters
        if self._timer is not None:
            self._timer.reset()
        if self._timer is not None and self.logic.rate != rate:
            self.destroy_timer(self._timer)
            self._timer = self._make_timer()

    def _make_timer(self) -> Any:
        return self.create_timer(1.0 / self.logic.rate, self._on_timer)

    def _send(self, velocity: Velocity) -> None:
        self.output.publish(to_twist(*velocity))


if __name__ == '__main__':
    sys.exit(keys_to_twist())
