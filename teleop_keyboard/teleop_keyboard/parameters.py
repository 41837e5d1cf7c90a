# SPDX-License-Identifier: Apache-2.0
"""Parameters of the nodes of teleoperation, and these as programs: --help loads no ROS."""

from typing import Any

from wasd_core.command_line import Executable
from wasd_core.parameters import fixed, group, parameter, Parameters

from teleop_keyboard.keymap import (
    HIGHEST_ACCEL,
    HIGHEST_RATE,
    HIGHEST_SPEED,
    IDLE_POLICIES,
    LAYOUTS,
    LOWEST_ACCEL,
    LOWEST_RATE,
    MODES,
)

# A preset's value is in force where a number is 0 or a word is this.
AS_PRESET = 'preset'

# Names for one quantity: what is set last counts.
SPEED_NAMES = ('speed', 'scale_linear', 'linear_scale')
TURN_NAMES = ('turn', 'scale_angular', 'angular_scale')
key_publisher = Executable(
    name='key_publisher',
    module='teleop_keyboard.key_publisher_node',
    about='Publishes each key of the terminal, or of a pipe, on the topic keys.',
    parameters=('teleop_keyboard.parameters:KeyParameters',),
    example='key_publisher --save-keys drive.keys',
    takes_keys=True,
)
keys_to_twist = Executable(
    name='keys_to_twist',
    module='teleop_keyboard.keys_to_twist_node',
    node='KeysToTwistNode',
    joins=True,
    about='Turns keys into velocities on cmd_vel, with a preset and its ramps.',
    parameters=('teleop_keyboard.parameters:TeleopParameters',),
    example='keys_to_twist --ros-args -p preset:=wasd -p speed:=0.3',
)
teleop = Executable(
    name='teleop',
    module='teleop_keyboard.teleop_node',
    about='Drives with the keyboard of one terminal: keys, cmd_vel and a dashboard.',
    parameters=('teleop_keyboard.parameters:TeleopParameters',),
    notes=('', 'keys: wasd keys, wasd keys NAME; `?` shows them while it runs'),
    example='teleop --ros-args -p preset:=wasd -r cmd_vel:=key_vel',
    takes_keys=True,
)
twist_mux = Executable(
    name='twist_mux',
    module='teleop_keyboard.twist_mux_node',
    node='TwistMuxNode',
    joins=True,
    about='Selects one of several velocity sources, by priority, time-out and locks.',
    parameters=('teleop_keyboard.parameters:MuxParameters',),
    notes=(
        '  topics.NAME.topic, .timeout [s], .priority; locks.NAME.topic, .timeout, .priority',
        '    The tables of sources and locks; see docs/parameters.md for those that are there',
    ),
    example='twist_mux --ros-args -r cmd_vel_out:=cmd_vel',
)
gamepad = Executable(
    name='gamepad',
    module='teleop_keyboard.gamepad_node',
    node='GamepadNode',
    joins=True,
    about='Publishes a gamepad as joy, and drives by it: cmd_vel and keys.',
    parameters=(
        'teleop_keyboard.parameters:PadParameters',
        'teleop_keyboard.parameters:JoyParameters',
    ),
    example='gamepad --ros-args -p preset:=go2 -r cmd_vel:=joy_vel',
)


def _speed(doc: str, unit: str) -> Any:
    """Return the field of a speed; the preset narrows its range."""
    return parameter(0.0, doc=doc, unit=unit, minimum=0.0, maximum=HIGHEST_SPEED)


def _ramp(doc: str, unit: str) -> Any:
    """Return the field of an acceleration that 0 leaves to the preset, or to another one."""
    return parameter(
        0.0, doc=doc, unit=unit, minimum=LOWEST_ACCEL, maximum=HIGHEST_ACCEL, or_zero=True
    )


def _stamped(doc: str = 'Publish TwistStamped, not Twist.') -> Any:
    return fixed(False, doc=doc)


class KeyParameters(Parameters):
    """What the key publisher sends."""

    raw: bool = fixed(False, doc='Publish one message for each character, like the tutorials.')
    help: str = fixed(
        '', doc="Help text of the keys, shown at start together with the robot's state."
    )


class MuxParameters(Parameters):
    """What the mux needs to know besides its tables."""

    frame_id: str = parameter('base_footprint', doc='Frame of stamped messages and markers.')
    stamped: bool = _stamped('Take and publish TwistStamped, not Twist.')


class TeleopParameters(Parameters):
    """What a user may set; 0 and `preset` mean: as the keymap says."""

    preset: str = fixed('mbot', doc='Keymap: a name (see `wasd keys`) or the path of a YAML file.')
    layout: str = fixed(
        'qwerty',
        doc='Keyboard: a preset means positions of keys, as labelled on qwerty.',
        choices=LAYOUTS,
    )
    mode: str = parameter(
        AS_PRESET,
        doc='Motion keys count while down, until the next one, or add a step each.',
        choices=(AS_PRESET, *MODES),
    )
    key_timeout: float = parameter(
        0.0,
        doc='Longest time that a key counts without a repeat; 0: as learnt from the '
        'keyboard (hold), for ever (latch, step).',
        unit='s',
        minimum=0.0,
        maximum=60.0,
    )
    step_share: float = parameter(
        0.1, minimum=0.001, maximum=1.0, doc='Share of full speed that a press adds in mode step.'
    )
    speed: float = _speed('Full speed; 0: as the preset says.', 'm/s')
    turn: float = _speed('Full turn rate; 0: as the preset says.', 'rad/s')
    scale_linear: float = _speed("mbot_teleop's name of speed.", 'm/s')
    scale_angular: float = _speed("mbot_teleop's name of turn.", 'rad/s')
    linear_scale: float = _speed("keys_to_twist's name of speed.", 'm/s')
    angular_scale: float = _speed("keys_to_twist's name of turn.", 'rad/s')
    linear_accel: float = _ramp('Speeding up; 0: as the preset says.', 'm/s^2')
    angular_accel: float = _ramp('Turning up; 0: as the preset says.', 'rad/s^2')
    linear_decel: float = _ramp('Slowing down; 0: as speeding up.', 'm/s^2')
    angular_decel: float = _ramp('Turning down; 0: as turning up.', 'rad/s^2')
    linear_stop: float = _ramp('Slowing down to a stop with no key; 0: as slowing down.', 'm/s^2')
    angular_stop: float = _ramp(
        'Turning down to a stop with no key; 0: as turning down.', 'rad/s^2'
    )
    keep_direction: bool = parameter(
        False, doc='Ramp all axes at the pace of the slowest, so that the path keeps its shape.'
    )
    rate: float = parameter(
        0.0,
        doc='Messages a second; 0: as the preset says.',
        unit='Hz',
        minimum=LOWEST_RATE,
        maximum=HIGHEST_RATE,
        or_zero=True,
    )
    idle: str = parameter(
        AS_PRESET,
        doc='While the robot stands: one zero and then silence, zeros, or the last command.',
        choices=(AS_PRESET, *IDLE_POLICIES),
    )
    frame_id: str = parameter('base_footprint', doc='Frame of stamped messages.')
    stamped: bool = _stamped()


# An event's number has eight bits.
HIGHEST = 255
# No robot is meant to be faster [m/s], [rad/s].
LARGEST_SCALE = 100.0


def _button(number: int, doc: str) -> Any:
    return parameter(number, doc=f'{doc}; -1: none.', minimum=-1, maximum=HIGHEST)


def _axis(number: int, doc: str) -> Any:
    return parameter(number, doc=f'Axis of {doc}; -1: none.', minimum=-1, maximum=HIGHEST)


def _scale(value: float, doc: str, unit: str) -> Any:
    return parameter(value, doc=doc, unit=unit, minimum=-LARGEST_SCALE, maximum=LARGEST_SCALE)


class LinearAxes(Parameters):
    """Which axes drive along."""

    x: int = _axis(1, 'driving ahead')
    y: int = _axis(-1, 'going left')
    z: int = _axis(-1, 'rising')


class AngularAxes(Parameters):
    """Which axes turn."""

    yaw: int = _axis(3, 'turning left')
    pitch: int = _axis(-1, 'pitching')
    roll: int = _axis(-1, 'rolling')


class LinearScales(Parameters):
    """Full speeds."""

    x: float = _scale(0.3, 'Full speed ahead.', 'm/s')
    y: float = _scale(0.0, 'Full speed to the left.', 'm/s')
    z: float = _scale(0.0, 'Full speed up.', 'm/s')


class LinearTurbo(Parameters):
    """Full speeds with the turbo button."""

    x: float = _scale(0.6, 'Full speed ahead with the turbo button.', 'm/s')
    y: float = _scale(0.0, 'Full speed to the left with the turbo button.', 'm/s')
    z: float = _scale(0.0, 'Full speed up with the turbo button.', 'm/s')


class AngularScales(Parameters):
    """Full turn rates."""

    yaw: float = _scale(1.0, 'Full turn rate.', 'rad/s')
    pitch: float = _scale(0.0, 'Full pitch rate.', 'rad/s')
    roll: float = _scale(0.0, 'Full roll rate.', 'rad/s')


class AngularTurbo(Parameters):
    """Full turn rates with the turbo button."""

    yaw: float = _scale(2.0, 'Full turn rate with the turbo button.', 'rad/s')
    pitch: float = _scale(0.0, 'Full pitch rate with the turbo button.', 'rad/s')
    roll: float = _scale(0.0, 'Full roll rate with the turbo button.', 'rad/s')


class JoyParameters(Parameters):
    """What sticks and buttons mean; as they stand here, the preset mbot."""

    require_enable_button: bool = parameter(
        True, doc='Drive only while enable_button is down: the dead-man button.'
    )
    enable_button: int = _button(4, 'While held, the sticks drive')
    enable_turbo_button: int = _button(5, 'While held, they drive at the turbo scales')
    inverted_reverse: bool = parameter(False, doc='Turn the other way while reversing.')
    keys: tuple[str, ...] = fixed(
        ('B=STOP', 'SELECT=TAB'),
        doc='Keys that buttons press: BUTTON=KEY, or BUTTON+BUTTON=KEY for both at once.',
    )
    axis_linear: LinearAxes = group(LinearAxes)
    axis_angular: AngularAxes = group(AngularAxes)
    scale_linear: LinearScales = group(LinearScales)
    scale_linear_turbo: LinearTurbo = group(LinearTurbo)
    scale_angular: AngularScales = group(AngularScales)
    scale_angular_turbo: AngularTurbo = group(AngularTurbo)


PAD_PRESETS = {
    'mbot': JoyParameters(),
    # Unitree's remote: the left stick goes, the right one turns, L2 with A stands and with B lets
    # go, START begins to walk. Its dead-man button is ours.
    'go2': JoyParameters(
        keys=('L2+A=2', 'L2+B=1', 'START=5', 'SELECT=TAB'),
        axis_linear=LinearAxes(y=0),
        scale_linear=LinearScales(x=0.6, y=0.3),
        scale_linear_turbo=LinearTurbo(x=1.5, y=0.6),
    ),
    # Its own defaults.
    'teleop_twist_joy': JoyParameters(
        enable_button=0,
        enable_turbo_button=-1,
        keys=(),
        axis_linear=LinearAxes(x=5),
        axis_angular=AngularAxes(yaw=2),
        scale_linear=LinearScales(x=0.5),
        scale_linear_turbo=LinearTurbo(x=1.0),
        scale_angular=AngularScales(yaw=0.5),
        scale_angular_turbo=AngularTurbo(yaw=1.0),
    ),
}

# What a driver must know to begin.
PAD_HELP = {
    'mbot': 'hold L1 to drive, R1 to drive faster; B stops, SELECT goes to the next robot',
    'go2': 'L2+A stands, START begins to walk; hold L1 to drive, R1 to drive faster; L2+B lets go',
    'teleop_twist_joy': 'hold A to drive',
}


class PadParameters(Parameters):
    """Which pad, and how it is told of."""

    device: str = fixed(
        '', doc="Device of the gamepad, like /dev/input/js0; '': the first that appears."
    )
    preset: str = fixed(
        'mbot',
        doc='Source of the parameters below that are not given.',
        choices=tuple(PAD_PRESETS),
    )
    deadzone: float = parameter(
        0.05, doc='Dead zone around the centre of an axis, as a share.', minimum=0.0, maximum=0.9
    )
    autorepeat_rate: float = parameter(
        20.0,
        doc='Rate of repeating an unchanged state; 0: never.',
        unit='Hz',
        minimum=0.1,
        or_zero=True,
        maximum=1000.0,
    )
    stamped: bool = _stamped()
