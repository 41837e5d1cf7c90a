# SPDX-License-Identifier: Apache-2.0
"""Parameters of the teleoperation's nodes, under the names that the tutorials use."""

from dataclasses import dataclass

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

from teleop_keyboard.key_names import LAYOUTS
from teleop_keyboard.keymap import IDLE_POLICIES
from teleop_keyboard.keymap import MODES

# A preset's value is in force where a number is 0 or a word is this.
AS_PRESET = 'preset'

# Names for one quantity: what is set last counts.
SPEED_NAMES = ('speed', 'scale_linear', 'linear_scale')
TURN_NAMES = ('turn', 'scale_angular', 'angular_scale')


@dataclass(frozen=True, kw_only=True)
class KeyParameters(Parameters):
    """What the key publisher sends."""

    raw: bool = parameter(
        False, doc='One message for each character, as the tutorials.', read_only=True
    )
    help: str = parameter(
        '',
        doc="The keys in words, shown at start; with them, the robot's state is shown.",
        read_only=True,
    )


@dataclass(frozen=True, kw_only=True)
class MuxParameters(Parameters):
    """What the mux needs to know besides its tables."""

    frame_id: str = parameter('base_footprint', doc='Frame of stamped messages and markers.')


@dataclass(frozen=True, kw_only=True)
class TeleopParameters(Parameters):
    """What a user may set; 0 and `preset` mean: as the keymap says."""

    preset: str = parameter(
        'mbot', doc='Keymap: a name (see `wasd keys`) or the path of a YAML file.', read_only=True
    )
    layout: str = parameter(
        'qwerty',
        doc='Keyboard: a preset means positions of keys, as labelled on qwerty.',
        choices=LAYOUTS,
        read_only=True,
    )
    mode: str = parameter(
        AS_PRESET,
        doc='Motion keys count while down, until the next one, or add a step each.',
        choices=(AS_PRESET, *MODES),
    )
    key_timeout: float = parameter(
        0.0,
        doc='Longest time that a key counts without another word of it; 0: as learnt from the '
        'keyboard (hold), for ever (latch, step).',
        unit='s',
        minimum=0.0,
        maximum=60.0,
    )
    step_share: float = parameter(
        0.1, doc='What a press adds in mode step, of full speed.', above=0.0, maximum=1.0
    )
    speed: float = parameter(
        0.0, doc='Full speed; 0: as the preset says.', unit='m/s', minimum=0.0, maximum=100.0
    )
    turn: float = parameter(
        0.0, doc='Full turn rate; 0: as the preset says.', unit='rad/s', minimum=0.0, maximum=100.0
    )
    scale_linear: float = parameter(
        0.0, doc="mbot_teleop's name of speed.", unit='m/s', minimum=0.0, maximum=100.0
    )
    scale_angular: float = parameter(
        0.0, doc="mbot_teleop's name of turn.", unit='rad/s', minimum=0.0, maximum=100.0
    )
    linear_scale: float = parameter(
        0.0, doc="keys_to_twist's name of speed.", unit='m/s', minimum=0.0, maximum=100.0
    )
    angular_scale: float = parameter(
        0.0, doc="keys_to_twist's name of turn.", unit='rad/s', minimum=0.0, maximum=100.0
    )
    linear_accel: float = parameter(
        0.0, doc='Speeding up; 0: as the preset says.', unit='m/s^2', minimum=0.0, maximum=1000.0
    )
    angular_accel: float = parameter(
        0.0, doc='Turning up; 0: as the preset says.', unit='rad/s^2', minimum=0.0, maximum=1000.0
    )
    linear_decel: float = parameter(
        0.0, doc='Slowing down; 0: as speeding up.', unit='m/s^2', minimum=0.0, maximum=1000.0
    )
    angular_decel: float = parameter(
        0.0, doc='Turning down; 0: as turning up.', unit='rad/s^2', minimum=0.0, maximum=1000.0
    )
    linear_stop: float = parameter(
        0.0,
        doc='Slowing down to a stop with no key; 0: as slowing down.',
        unit='m/s^2',
        minimum=0.0,
        maximum=1000.0,
    )
    angular_stop: float = parameter(
        0.0,
        doc='Turning down to a stop with no key; 0: as turning down.',
        unit='rad/s^2',
        minimum=0.0,
        maximum=1000.0,
    )
    keep_direction: bool = parameter(
        False, doc='Ramp all axes at the pace of the slowest: the path of the robot stays.'
    )
    rate: float = parameter(
        0.0, doc='Messages a second; 0: as the preset says.', unit='Hz', minimum=0.0, maximum=500.0
    )
    idle: str = parameter(
        AS_PRESET,
        doc='While the robot stands: one zero and then silence, zeros, or the last command.',
        choices=(AS_PRESET, *IDLE_POLICIES),
    )
    frame_id: str = parameter('base_footprint', doc='Frame of stamped messages.')
