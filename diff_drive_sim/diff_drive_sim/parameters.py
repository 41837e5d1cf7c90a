# SPDX-License-Identifier: Apache-2.0
"""Parameters of the drive controller: wheels, limits, odometry; and it as a program."""

from dataclasses import fields
import math
from typing import Any, NamedTuple

from robot_description.morphology.wheels import WheelChoice
from wasd_core.command_line import Executable
from wasd_core.parameters import fixed, InvalidParameter, parameter, Parameters

from diff_drive_sim import MODES
from diff_drive_sim.limits import AxisLimits

diff_drive_controller = Executable(
    name='diff_drive_controller',
    module='diff_drive_sim.diff_drive_controller_node',
    node='DiffDriveControllerNode',
    about='Drives a robot of two wheels: cmd_vel in, wheel commands, odom and /tf out.',
    parameters=('diff_drive_sim.parameters:DiffDriveParameters',),
    example='diff_drive_controller --ros-args -p description:=mbot -p use_sim_time:=true',
)


# The least limit: what is less is a standstill.
LEAST = 1e-3


class _Axis(NamedTuple):
    """An axis by what users call it, and the unit of its velocity up to the second: `m/s`."""

    name: str
    unit: str

    def limit(self, what: str, doc: str, default: float = math.nan) -> Any:
        """Return the field of one limit; its sign, its unit and what NaN means go by its name."""
        power, most = next(limits for word, limits in _POWERS.items() if word in what)
        is_below = what.startswith('min_') or what in _BELOW
        return parameter(
            default,
            name=f'{self.name}.{what}',
            unit=f'{self.unit}{power}',
            doc=doc,
            minimum=-most if is_below else LEAST,
            maximum=-LEAST if is_below else most,
            nan=_OTHERWISE.get(what, 'no limit'),
        )


# Of each limit the power of its unit's second, and the largest: no robot is meant to do more.
_POWERS = {'velocity': ('', 100.0), 'celeration': ('^2', 1e3), 'jerk': ('^3', 1e5)}
_BELOW = ('max_deceleration', 'max_acceleration_reverse')
# What holds in place of a limit that is NaN.
_OTHERWISE = {
    'min_velocity': '-max_velocity',
    'max_deceleration': '-max_acceleration',
    'max_acceleration_reverse': '-max_acceleration',
    'max_deceleration_reverse': 'the negative of max_deceleration',
    'min_jerk': '-max_jerk',
}
X, Z = _Axis('linear.x', 'm/s'), _Axis('angular.z', 'rad/s')


class LimitParameters(Parameters):
    """Limits of the two axes; signs say the direction, as in ros2_controllers."""

    linear_max_velocity: float = X.limit('max_velocity', 'Largest forward speed', 1.0)
    linear_min_velocity: float = X.limit('min_velocity', 'Largest backward speed')
    linear_max_acceleration: float = X.limit(
        'max_acceleration', 'Largest acceleration forward', 1.0
    )
    linear_max_deceleration: float = X.limit(
        'max_deceleration', 'Largest deceleration in forward motion'
    )
    linear_max_acceleration_reverse: float = X.limit(
        'max_acceleration_reverse', 'Largest acceleration backward'
    )
    linear_max_deceleration_reverse: float = X.limit(
        'max_deceleration_reverse', 'Largest deceleration in backward motion'
    )
    linear_max_jerk: float = X.limit('max_jerk', 'Fastest growth of acceleration')
    linear_min_jerk: float = X.limit('min_jerk', 'Fastest fall of acceleration')
    angular_max_velocity: float = Z.limit('max_velocity', 'Largest yaw rate to the left', 4.0)
    angular_min_velocity: float = Z.limit('min_velocity', 'Largest yaw rate to the right')
    angular_max_acceleration: float = Z.limit(
        'max_acceleration', 'Largest acceleration of a left turn', 6.0
    )
    angular_max_deceleration: float = Z.limit(
        'max_deceleration', 'Largest deceleration of a left turn'
    )
    angular_max_acceleration_reverse: float = Z.limit(
        'max_acceleration_reverse', 'Largest acceleration of a right turn'
    )
    angular_max_deceleration_reverse: float = Z.limit(
        'max_deceleration_reverse', 'Largest deceleration of a right turn'
    )
    angular_max_jerk: float = Z.limit('max_jerk', 'Fastest growth of acceleration')
    angular_min_jerk: float = Z.limit('min_jerk', 'Fastest fall of acceleration')
    accel_limit: float = parameter(
        float('nan'),
        name='accel_limit',
        unit='m/s^2',
        doc='Largest change of the speed of a wheel by either axis, so twice that by both: in '
        'place of the accelerations above',
        minimum=LEAST,
        maximum=1e3,
        nan='not used',
    )

    def linear_limits(self) -> AxisLimits:
        """Return the limits of the forward speed [m/s]."""
        return self._limits('linear', self.accel_limit)

    def angular_limits(self, wheel_separation: float) -> AxisLimits:
        """Return the limits of the yaw rate [rad/s]; half a separation [m] is a wheel's lever."""
        return self._limits('angular', 2.0 * self.accel_limit / wheel_separation)

    def _limits(self, axis: str, accel_limit: float) -> AxisLimits:
        names = [field.name for field in fields(LimitParameters) if field.name.startswith(axis)]
        signed = {name.removeprefix(f'{axis}_'): getattr(self, name) for name in names}
        if accel_limit > 0.0:  # not NaN
            kept = {name: signed[name] for name in signed if 'celeration' not in name}
            return AxisLimits.from_signed(max_acceleration=accel_limit, **kept)
        return AxisLimits.from_signed(**signed)


# A planar robot knows nothing of z, roll and pitch: 1e6 tells a filter to look elsewhere.
UNKNOWN = 1e6


class OdometryParameters(Parameters):
    """Odometry, its frames and covariances."""

    odom_frame_id: str = fixed('odom', doc='Frame in which odometry is given')
    base_frame_id: str = fixed(
        '',
        doc="Frame of the robot that odometry follows; empty: the description's root, or what "
        'floats below its world',
    )
    enable_odom_tf: bool = fixed(True, doc='Publish odometry as a transform on /tf, too')
    odometry_feedback: str = fixed(
        'joint_states',
        doc='Input of odometry: exact wheel angles, or whole encoder ticks',
        choices=('joint_states', 'ticks'),
    )
    open_loop: bool = fixed(False, doc='Compute odometry from commands, not from the wheels')
    velocity_rolling_window_size: int = fixed(
        10,
        minimum=1,
        maximum=1000,
        doc='Number of steps over which the velocity of odometry is averaged',
    )
    pose_covariance_diagonal: tuple[float, ...] = fixed(
        (0.0, 0.0, UNKNOWN, UNKNOWN, UNKNOWN, 0.0),
        minimum=0.0,
        maximum=1000000000.0,
        doc='Variances of x, y, z, roll, pitch, yaw at the start, in m^2 and rad^2',
    )
    twist_covariance_diagonal: tuple[float, ...] = fixed(
        (1e-4, 1e-4, UNKNOWN, UNKNOWN, UNKNOWN, 1e-4),
        minimum=0.0,
        maximum=1000000000.0,
        doc='Variances of the twist at rest, in (m/s)^2 and (rad/s)^2',
    )
    distance_variance: float = parameter(
        2.5e-5,
        minimum=0.0,
        maximum=1.0,
        doc='Growth of the variance of a path with its length',
        unit='m^2/m',
    )
    turn_variance: float = parameter(
        1e-4,
        minimum=0.0,
        maximum=1.0,
        doc='Growth of the variance of the heading with turns',
        unit='rad^2/rad',
    )
    drift_variance: float = parameter(
        1e-5,
        minimum=0.0,
        maximum=1.0,
        doc='Growth of the variance of the heading with paths',
        unit='rad^2/m',
    )
    twist_error: float = parameter(
        0.02, minimum=0.0, maximum=1.0, doc='Standard deviation of a velocity as a share of it'
    )
    publish_rate: float = fixed(
        50.0, minimum=1.0, maximum=1000.0, doc='Rate of odom and /tf', unit='Hz'
    )
    joint_names: str = fixed(
        'urdf',
        doc="Names in joint_states: the description's, arbotix's base_l_wheel_joint and "
        "base_r_wheel_joint, or both; a simulator publishes the description's in any case",
        choices=('urdf', 'arbotix', 'both'),
    )

    def __post_init__(self) -> None:
        """Refuse frames that coincide, too."""
        super().__post_init__()
        if not self.odom_frame_id or self.odom_frame_id == self.base_frame_id:
            raise InvalidParameter(
                'odom_frame_id must be a frame other than base_frame_id, which is the root link '
                f'unless it is given, got {self.odom_frame_id!r} for both: rename one'
            )


class WheelParameters(Parameters):
    """Wheels and their speed loop."""

    mode: str = fixed(
        'float',
        doc='Drive of the wheels: a PID loop on encoder ticks, the integer loop of the ArbotiX '
        'firmware, or nothing but arithmetic, without physics and motors',
        choices=MODES,
    )
    legacy: bool = fixed(
        False,
        doc='Mode arbotix: also ramp, time-out and odometry as arbotix_driver had them, slips '
        'included',
    )
    left_wheel_names: tuple[str, ...] = fixed(
        (), doc='Joint of the left wheel; empty: found in the description'
    )
    right_wheel_names: tuple[str, ...] = fixed(
        (), doc='Joint of the right wheel; empty: found in the description'
    )
    wheel_separation: float = fixed(
        0.0,
        minimum=0.01,
        or_zero=True,
        maximum=10.0,
        doc="Distance of the wheels; 0: the description's",
        unit='m',
    )
    wheel_radius: float = fixed(
        0.0,
        minimum=0.002,
        or_zero=True,
        maximum=5.0,
        doc="Radius of the wheels; 0: the description's",
        unit='m',
    )
    wheel_separation_multiplier: float = fixed(
        1.0, minimum=0.1, maximum=10.0, doc='Calibration: corrects the distance of the wheels'
    )
    left_wheel_radius_multiplier: float = fixed(
        1.0, minimum=0.1, maximum=10.0, doc='Calibration: corrects the radius of the left wheel'
    )
    right_wheel_radius_multiplier: float = fixed(
        1.0, minimum=0.1, maximum=10.0, doc='Calibration: corrects the radius of the right wheel'
    )
    ticks_meter: float = fixed(
        4100.0,
        minimum=10.0,
        maximum=1000000.0,
        doc='Encoder ticks per metre of wheel travel',
        unit='1/m',
    )
    Kp: float = parameter(
        5.0,
        minimum=0.0,
        maximum=1000.0,
        doc='PWM steps, of 255, times Ko per tick that the wheel is behind',
    )
    Kd: float = parameter(
        1.0,
        minimum=0.0,
        maximum=1000.0,
        doc='PWM steps times Ko per tick in 1/30 s that it is too slow',
    )
    Ki: float = parameter(
        0.0,
        minimum=0.0,
        maximum=1000.0,
        doc='PWM steps times Ko per tick behind and 1/30 s that it stays so',
    )
    Ko: float = parameter(50.0, minimum=1.0, maximum=1000.0, doc='Divisor of the three gains')
    rate: float = fixed(
        10.0,
        minimum=1.0,
        maximum=100.0,
        doc='Legacy: rate of the loop of arbotix_driver, which slips',
        unit='Hz',
    )

    def wheel_choice(self) -> WheelChoice:
        """Return what is said of the wheels that a description may not say."""
        return WheelChoice((*self.left_wheel_names, *self.right_wheel_names), self.wheel_radius)

    def __post_init__(self) -> None:
        """Check what needs more than one parameter, too."""
        super().__post_init__()
        for names, key in (
            (self.left_wheel_names, 'left_wheel_names'),
            (self.right_wheel_names, 'right_wheel_names'),
        ):
            if len(names) > 1:
                raise InvalidParameter(f'{key} must be one joint, got {len(names)}')
        if bool(self.left_wheel_names) != bool(self.right_wheel_names):
            raise InvalidParameter('left_wheel_names and right_wheel_names must be given both')
        if self.legacy and self.mode != 'arbotix':
            raise InvalidParameter(f"legacy needs mode 'arbotix', got mode {self.mode!r}")
        if self.mode == 'arbotix':
            for key in ('Kp', 'Kd', 'Ki', 'Ko'):
                gain = getattr(self, key)
                if not (gain.is_integer() and gain <= 255.0):
                    raise InvalidParameter(
                        f'{key} must be a whole number up to 255 in mode arbotix (the firmware '
                        f'gets one byte), got {gain:g}'
                    )


class DiffDriveParameters(OdometryParameters, LimitParameters, WheelParameters):
    """Everything that can be set; the wheels' geometry comes from the robot's description."""

    description: str = fixed(
        'mbot',
        doc='Robot whose wheels are driven: a built-in name, or a xacro or URDF file; '
        'not used when the controller is composed with a simulator',
    )
    controller: str = fixed(
        '', doc="YAML file with parameters: arbotix's, ros2_controllers' or a ROS 2 parameter file"
    )
    cmd_vel_timeout: float = parameter(
        0.5,
        minimum=0.0,
        maximum=60.0,
        doc='Silence on cmd_vel after which the robot stops; 0: never',
        unit='s',
    )
    stamped: bool = fixed(False, doc='Take cmd_vel as TwistStamped, not Twist')
    publish_limited_velocity: bool = fixed(
        False, doc='Publish the velocity within the limits on ~/cmd_vel_out'
    )
    update_rate: float = fixed(
        200.0,
        minimum=20.0,
        maximum=1000.0,
        doc='Rate of the controller in lock-step and in mode fake; mode arbotix has 500',
        unit='Hz',
    )
    diagnostic_rate: float = fixed(
        1.0,
        minimum=0.01,
        or_zero=True,
        maximum=100.0,
        doc='Rate of diagnostics; 0: none',
        unit='Hz',
    )
