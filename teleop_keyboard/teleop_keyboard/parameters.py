# SPDX-License-Identifier: Apache-2.0
"""Parameters of the teleoperation's nodes, under the names that the tutorials use."""

from dataclasses import dataclass
from typing import Any

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

from teleop_keyboard.key_names import LAYOUTS
from teleop_keyboard.keymap import HIGHEST_ACCEL
from teleop_keyboard.keymap import HIGHEST_RATE
from teleop_keyboard.keymap import HIGHEST_SPEED
from teleop_keyboard.keymap import IDLE_POLICIES
from teleop_keyboard.keymap import MODES

# A preset's value is in force where a number is 0 or a word is this.
AS_PRESET = 'preset'

# Names for one quantity: what is set last counts.
SPEED_NAMES = ('speed', 'scale_linear', 'linear_scale')
TURN_NAMES = ('turn', 'scale_angular', 'angular_scale')


def _number(doc: str, unit: str, highest: float) -> Any:
    """Return the field of a number that 0 leaves to the preset, or to another parameter."""
    return parameter(0.0, doc=doc, unit=unit, minimum=0.0, maximum=highest)


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
    speed: float = _number('Full speed; 0: as the preset says.', 'm/s', HIGHEST_SPEED)
    turn: float = _number('Full turn rate; 0: as the preset says.', 'rad/s', HIGHEST_SPEED)
    scale_linear: float = _number("mbot_teleop's name of speed.", 'm/s', HIGHEST_SPEED)
    scale_angular: float = _number("mbot_teleop's name of turn.", 'rad/s', HIGHEST_SPEED)
    linear_scale: float = _number("keys_to_twist's name of speed.", 'm/s', HIGHEST_SPEED)
    angular_scale: float = _number("keys_to_twist's name of turn.", 'rad/s', HIGHEST_SPEED)
    linear_accel: float = _number('Speeding up; 0: as the preset says.', 'm/s^2', HIGHEST_ACCEL)
    angular_accel: float = _number('Turning up; 0: as the preset says.', 'rad/s^2', HIGHEST_ACCEL)
    linear_decel: float = _number('Slowing down; 0: as speeding up.', 'm/s^2', HIGHEST_ACCEL)
    angular_decel: float = _number('Turning down; 0: as turning up.', 'rad/s^2', HIGHEST_ACCEL)
    linear_stop: float = _number(
        'Slowing down to a stop with no key; 0: as slowing down.', 'm/s^2', HIGHEST_ACCEL
    )
    angular_stop: float = _number(
        'Turning down to a stop with no key; 0: as turning down.', 'rad/s^2', HIGHEST_ACCEL
    )
    keep_direction: bool = parameter(
        False, doc='Ramp all axes at the pace of the slowest: the path of the robot stays.'
    )
    rate: float = _number('Messages a second; 0: as the preset says.', 'Hz', HIGHEST_RATE)
    idle: str = parameter(
        AS_PRESET,
        doc='While the robot stands: one zero and then silence, zeros, or the last command.',
        choices=(AS_PRESET, *IDLE_POLICIES),
    )
    frame_id: str = parameter('base_footprint', doc='Frame of stamped messages.')
