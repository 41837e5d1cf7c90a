# SPDX-License-Identifier: Apache-2.0
"""The node that turns a gamepad into `joy`, velocities and keys; executable `gamepad`."""

from collections.abc import Callable
import sys
import threading
import time
from typing import NamedTuple

from geometry_msgs.msg import Twist
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from wasd_core.parameters import known_parameters
from wasd_core.ros_parameters import declare_parameters
from wasd_core.streams import visible
from wasd_core.timing import SHORTEST_ABSENCE, STOP_KEY
from wasd_core.topics import AbsenceWatch, EVENTS, LoopbackSubscription, RELIABLE, watch_types

from teleop_keyboard.gamepad import JoyState, JoyToTwist, JoyTwist, PadKeys, USUAL_CONTROLS
from teleop_keyboard.gamepad_device import Gamepad
from teleop_keyboard.parameters import gamepad, JoyParameters, PAD_PRESETS, PadParameters
from teleop_keyboard.twist_messages import TwistOutput

# The thread that waits for the pad goes on when nobody has looked for so long [s].
PATIENCE = 0.5
FRAME_ID = 'base_footprint'
# As the `joy` drivers call it.
JOY_FRAME = 'joy'
# What a pad's parameters are called; those that can be set at run time.
NAMES = known_parameters(JoyParameters)
CHANGEABLE = tuple(name for name, (field, _) in NAMES.items() if not field.metadata['read_only'])


class PadOutput(NamedTuple):
    """The receiver of velocities, keys and remarks of a pad."""

    drive: Callable[[JoyTwist], None]
    press: Callable[[str], None]
    say: Callable[[str], None]


class GamepadNode(Node):
    """
    Publishes a pad as `joy`, and from `joy` makes `cmd_vel` and `keys`.

    Messages on `joy` from other processes mean the same: the pad may be on another machine. Alone
    it looks when a thread, which does nothing else, sees that the pad has something to say. With
    an `output` somebody else calls `look` and takes velocities and keys; nothing but `joy` is
    published. `pad` replaces the defaults.

    Raises:
        InvalidParameter: a parameter has a value that it cannot have.
        UserError: the device can never be a pad.
    """

    def __init__(
        self,
        *,
        output: PadOutput | None = None,
        pad: PadParameters | None = None,
        parameter_overrides: list[Parameter] | None = None,
    ) -> None:
        super().__init__('gamepad', parameter_overrides=parameter_overrides or [])
        pad = declare_parameters(self, PadParameters, self._on_pad_parameters, pad)
        settings = declare_parameters(
            self, JoyParameters, self._on_parameters, PAD_PRESETS[pad.preset]
        )
        # What a driver has said goes before any preset.
        self._preset = pad.preset
        self._given = {n: settings.value(n) for n in NAMES if n in self._parameter_overrides}
        self.gamepad = Gamepad(pad.device, pad.deadzone, pad.autorepeat_rate)
        self.logic = JoyToTwist(settings)
        self._keys = PadKeys(settings.keys)
        self._absence = AbsenceWatch(self)
        self._joy = self.create_publisher(Joy, 'joy', RELIABLE)
        self.joy = LoopbackSubscription(
            self, Joy, 'joy', self._on_joy, is_stale=self._absence.is_stale
        )
        self._is_own = False  # the last state, not another machine's
        self._heard_at, self._moved = 0.0, True  # unknown pads may move
        self._is_known = self._was_disarmed = False
        self._problem = ''
        self._looked_at = time.monotonic()
        self._has_looked, self._is_closed = threading.Event(), False
        self._watcher: threading.Thread | None = None
        self._twists: TwistOutput | None = None
        self._output = self._publish_all(pad.stamped) if output is None else output

    @property
    def is_enabled(self) -> bool:
        """Whether a pad is there whose sticks drive now; one on another machine is not."""
        return self.gamepad.is_there and self._is_own and self.logic.is_driving

    def look(self) -> None:
        """Tell what the pad has said since the last look; a lost one is a zero."""
        now = time.monotonic()
        told = self.gamepad.step(now - self._looked_at)
        self._looked_at = now
        if told.states and not self._is_known:
            self._is_known = True
            self._keys.controls = self.gamepad.controls
            settings = self.logic.parameters
            hold = f': hold button {settings.enable_button} to drive'
            hold *= settings.require_enable_button
            self._output.say(f'gamepad {visible(self.gamepad.name)}{hold}')
        self._was_disarmed = False
        for state in told.states:
            # States from before a disarm do not drive.
            if not self._was_disarmed:
                self._tell(state)
        if told.is_lost:
            self._forget()
            self._output.say('gamepad lost: stopped')
        if self.gamepad.problem != self._problem:
            self._problem = self.gamepad.problem
            if self._problem:
                self._output.say(visible(self._problem))

    def take_preset(self, name: str) -> None:
        """Go on with a preset's meanings of what was not given, standing; parameters say so."""
        self.disarm()
        self._preset, given = name, self._given
        settings = PAD_PRESETS[name].changed(given)
        self._keys = PadKeys(settings.keys, self.gamepad.controls)
        self.set_parameters_atomically(
            [Parameter(key, value=settings.value(key)) for key in CHANGEABLE]
        )
        self._given = given
        self.logic.parameters = settings

    def disarm(self) -> None:
        """Stop, and ignore what is held, on whatever machine, until it is released."""
        self._was_disarmed = True
        # Axes that need no button are held by the logic, which must see when they are at rest.
        self.gamepad.pad.let_go(axes=self.logic.parameters.require_enable_button)
        velocity = self.logic.disarm()
        if velocity is not None:
            self._output.drive(velocity)
        if self.gamepad.is_there:
            # Its own buttons are let go now: the next press is a new one.
            self._tell(self.gamepad.pad.state)

    def close(self) -> None:
        """Leave the robot stopped, if it was us who drove it."""
        self._end_watch()
        self._stop()
        if self._twists is not None:
            self._twists.see_off()
        self.gamepad.close()

    def _publish_all(self, is_stamped: bool) -> PadOutput:
        """Make our own publishers, and the thread that calls us."""
        twists = TwistOutput(self, 'cmd_vel', is_stamped, lambda: FRAME_ID)
        watch_types(self, twists.type, 'cmd_vel')
        keys = self.create_publisher(String, 'keys', EVENTS)
        self._twists = twists
        self._call = self.create_guard_condition(self._look_when_called)
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()
        return PadOutput(
            lambda velocity: twists.publish(to_full_twist(velocity)),
            lambda key: keys.publish(String(data=key)),
            lambda words: self.get_logger().info(words),
        )

    def _watch(self) -> None:
        """Call for a look whenever there is something to see."""
        while not self._is_closed:
            self.gamepad.wait()
            self._has_looked.clear()
            self._call.trigger()
            self._has_looked.wait(PATIENCE)

    def _end_watch(self) -> None:
        self._is_closed = True
        if self._watcher is not None:
            self._has_looked.set()
            self._watcher.join(PATIENCE)

    def destroy_node(self) -> None:
        """End the thread first, which would call a node that is gone."""
        self._end_watch()
        super().destroy_node()

    def _look_when_called(self) -> None:
        if not self._is_closed:
            self.look()
        self._has_looked.set()

    def _tell(self, state: JoyState) -> None:
        message = Joy(axes=state.axes, buttons=state.buttons)
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = JOY_FRAME
        self.joy.expect(message)
        self._joy.publish(message)  # first: a key may disarm the pad, which publishes, too
        self._on_joy(message, is_own=True)

    def _on_joy(self, message: Joy, is_own: bool = False) -> None:
        silent, self._heard_at = time.monotonic() - self._heard_at, time.monotonic()
        if self._moved and silent > SHORTEST_ABSENCE and not is_own:
            self.disarm()  # a pad that has come, or comes again
            self._keys.reset()
        self._is_own = is_own
        state = from_joy(message)
        # Before the keys: a key that stops the robot comes last.
        velocity = self.logic.step(state)
        self._moved = any(velocity or ())
        if velocity is not None:
            self._output.drive(velocity)
        for key in self._keys.step(state):
            if key == STOP_KEY:
                self.disarm()
            self._output.press(key)

    def _forget(self) -> None:
        """Be without a pad."""
        self._is_known = False
        self._keys.reset()
        self._keys.controls = USUAL_CONTROLS
        self._stop()

    def _stop(self) -> None:
        velocity = self.logic.lose() if self.logic.is_driving else None
        if velocity is not None:
            self._output.drive(velocity)

    def _on_pad_parameters(self, parameters: PadParameters) -> None:
        self.gamepad.pad.deadzone = parameters.deadzone
        self.gamepad.rate = parameters.autorepeat_rate

    def _on_parameters(self, parameters: JoyParameters) -> None:
        before = self.logic.parameters
        pairs = ((name, parameters.value(name)) for name in CHANGEABLE)
        changes = {name: value for name, value in pairs if value != before.value(name)}
        self._given = {**self._given, **changes}
        self.logic.parameters = PAD_PRESETS[self._preset].changed(self._given)


def from_joy(message: Joy) -> JoyState:
    """Return the state of a message."""
    return JoyState(tuple(message.axes), tuple(message.buttons))


def to_full_twist(velocity: JoyTwist) -> Twist:
    """Return the message of a velocity with all its six components."""
    message = Twist()
    message.linear.x, message.linear.y, message.linear.z = velocity[:3]
    message.angular.x, message.angular.y, message.angular.z = velocity[3:]
    return message


if __name__ == '__main__':
    sys.exit(gamepad())
