# SPDX-License-Identifier: Apache-2.0
"""Parameters of keys to twist, under the names that the tutorials use."""

from dataclasses import dataclass

from robot_description.parameters import parameter
from robot_description.parameters import Parameters

# A preset's value is in force where a number is 0 or a word is this.
AS_PRESET = 'preset'

# Names for one quantity: what is set last counts.
SPEED_NAMES = ('speed', 'scale_linear', 'linear_scale')
TURN_NAMES = ('turn', 'scale_angular', 'angular_scale')


@dataclass(frozen=True, kw_only=True)
class TeleopParameters(Parameters):
    """What a user may set; 0 and `preset` mean: as the keymap says."""

    preset: str = parameter(
        'mbot', doc='Keymap: mbot, ramps, or the path of a YAML file.', read_only=True
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
        0.0,
        doc='Change of the velocity while it ramps; 0: as the preset says.',
        unit='m/s^2',
        minimum=0.0,
        maximum=1000.0,
    )
    angular_accel: float = parameter(
        0.0,
        doc='Change of the turn rate while it ramps; 0: as the preset says.',
        unit='rad/s^2',
        minimum=0.0,
        maximum=1000.0,
    )
    rate: float = parameter(
        0.0, doc='Messages a second; 0: as the preset says.', unit='Hz', minimum=0.0, maximum=500.0
    )
    idle: str = parameter(
        AS_PRESET,
        doc='While the robot stands: one zero and then silence, or zeros all the time.',
        choices=(AS_PRESET, 'silent', 'repeat'),
    )
    stamped: bool = parameter(False, doc='Publish TwistStamped instead of Twist.', read_only=True)
    frame_id: str = parameter('base_footprint', doc='Frame of stamped messages.')
