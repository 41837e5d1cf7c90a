# SPDX-License-Identifier: Apache-2.0
"""
Tuning of the leg controller, validated; docs/references.md resolves the papers' keys.

The numbers are the Go2's, also those that a user gives, and so are the spans that these keep to:
set to either end of one while it trots, the Go2 walks on (benchmarks/parameter_bounds.py).
`scale_parameters` gives the numbers of another robot, by the units that stand here; a number that
it lowers by what a description says of feet or motors has a bound besides.
"""

from wasd_core.parameters import InvalidParameter, parameter, Parameters

from quadruped_sim.presets import GAITS, LIMITS


class GaitParameters(Parameters):
    """Which foot steps when: period and duty run from the slow to the fast value over speed."""

    name: str = parameter('trot', name='gait', choices=GAITS, doc='Order in which the feet step')
    slow_period: float = parameter(
        0.45,
        unit='s',
        span=(0.3, 0.6),
        doc='Gait period up to slow_speed; unitree_guide trots at 0.45 s',
    )
    fast_period: float = parameter(
        0.26, unit='s', span=(0.2, 0.45), doc='Gait period from fast_speed on'
    )
    slow_duty: float = parameter(
        0.55, span=(0.45, 0.7), doc='Share of the period a foot stands, up to slow_speed'
    )
    fast_duty: float = parameter(
        0.27, span=(0.2, 0.6), doc='Share of the period a foot stands, from fast_speed on'
    )
    slow_speed: float = parameter(
        0.4,
        unit='m/s',
        span=(0.0, 1.0),
        doc='Commanded speed below which the gait is the slow one',
    )
    fast_speed: float = parameter(
        3.0,
        unit='m/s',
        span=(2.0, 6.0),
        doc='Commanded speed above which the gait is the fast one',
    )
    step_in_place: bool = parameter(
        False,
        name='step_in_place',
        doc='Trot on the spot at zero command; false stands on four feet until disturbed',
    )
    step_height: float = parameter(
        0.05,
        above=0.0,
        unit='m',
        span=(0.02, 0.1),
        doc='Height of the swing foot above flat ground',
    )
    rough_step_height: float = parameter(
        0.14,
        above=0.0,
        unit='m',
        span=(0.05, 0.2),
        doc='Height of the swing foot after a stumble, on rough ground',
    )
    terrain_time: float = parameter(
        2.0, unit='s', span=(0.1, 20.0), doc='Time constant of forgetting rough ground'
    )
    haste_error: float = parameter(
        0.35, unit='m/s', span=(0.1, 2.0), doc='Velocity error above which the gait speeds up'
    )
    haste_gain: float = parameter(
        3.0, span=(0.0, 6.0), doc='Gain of gait speed per velocity error above that'
    )
    haste_decay: float = parameter(
        2.0, unit='m/s^2', span=(0.2, 20.0), doc='Rate at which the gait slows to normal again'
    )
    early_contact_phase: float = parameter(
        0.6, span=(0.3, 1.0), doc='Share of the swing after which a touch ends it'
    )


class FootholdParameters(Parameters):
    """Where the feet land [Raibert1986]."""

    velocity_gain: float = parameter(
        0.04, unit='s', span=(0.0, 0.08), doc='Foothold shift per error of velocity (capture term)'
    )
    reach: float = parameter(
        0.35,
        unit='m',
        span=(0.2, 0.5),
        doc='Largest horizontal distance of a foothold from its hip',
    )


class MpcParameters(Parameters):
    """Single-rigid-body convex MPC [DiCarlo2018]."""

    steps: int = parameter(12, span=(8, 24), doc='Steps of the horizon')
    step: float = parameter(
        0.025, unit='s', span=(0.015, 0.04), doc='Duration of one horizon step'
    )
    period: float = parameter(
        0.02,
        unit='s',
        span=(0.004, 0.05),
        doc='Time between solutions; every contact switch adds one',
    )
    friction: float = parameter(
        0.4,
        above=0.0,
        span=(0.2, 0.8),
        doc='Friction coefficient that limits forces; a guess at first, then estimated: see grip',
    )
    force_min: float = parameter(
        5.0, unit='N', span=(0.0, 20.0), doc='Smallest normal force of a foot'
    )
    force_max: float = parameter(
        260.0, unit='N', span=(150.0, 600.0), doc='Largest normal force of a foot'
    )
    pose_weights: tuple[float, ...] = parameter(
        (80.0, 120.0, 60.0, 30.0, 30.0, 250.0),
        span=((27.0, 40.0, 20.0, 10.0, 10.0, 83.0), (240.0, 360.0, 180.0, 90.0, 90.0, 750.0)),
        doc='Cost of roll, pitch, yaw, x, y, z errors',
    )
    rate_weights: tuple[float, ...] = parameter(
        (1.0, 2.0, 2.0, 8.0, 8.0, 4.0),
        span=((0.33, 0.67, 0.67, 2.7, 2.7, 1.3), (3.0, 6.0, 6.0, 24.0, 24.0, 12.0)),
        doc='Cost of angular and linear velocity errors',
    )
    force_weight: float = parameter(4e-5, span=(1e-05, 0.0002), doc='Cost of force squared')

    def __post_init__(self) -> None:
        """Check each value, and that there is a force between the two limits."""
        super().__post_init__()
        if self.force_min >= self.force_max:
            raise InvalidParameter(
                f'mpc.force_min must be < mpc.force_max = {self.force_max:g} N, '
                f'got {self.force_min:g}'
            )


class WholeBodyParameters(Parameters):
    """Whole-body QP: weights and the base's feedback."""

    acceleration_weights: tuple[float, ...] = parameter(
        (1.0, 1.0, 1.0, 0.3, 0.3, 0.1),
        span=((0.33, 0.33, 0.33, 0.1, 0.1, 0.033), (3.0, 3.0, 3.0, 0.9, 0.9, 0.3)),
        doc='Cost of linear and angular base acceleration errors',
    )
    force_weight: float = parameter(
        1e-3, span=(0.0002, 0.005), doc='Cost of leaving the MPC forces'
    )
    position_gains: tuple[float, ...] = parameter(
        (0.0, 0.0, 30.0),
        unit='1/s^2',
        span=((0.0, 0.0, 10.0), (20.0, 20.0, 90.0)),
        doc='Base acceleration per position error, x y z',
    )
    velocity_gains: tuple[float, ...] = parameter(
        (2.0, 2.0, 6.0),
        unit='1/s',
        span=((0.0, 0.0, 2.0), (6.0, 6.0, 18.0)),
        doc='Base acceleration per velocity error, x y z',
    )
    rotation_gains: tuple[float, ...] = parameter(
        (80.0, 80.0, 20.0),
        unit='1/s^2',
        span=((27.0, 27.0, 6.7), (240.0, 240.0, 60.0)),
        doc='Angular acceleration per rotation error',
    )
    rate_gains: tuple[float, ...] = parameter(
        (12.0, 12.0, 6.0),
        unit='1/s',
        span=((4.0, 4.0, 2.0), (36.0, 36.0, 18.0)),
        doc='Angular acceleration per rate error',
    )
    swing_position_gain: float = parameter(
        900.0, unit='1/s^2', span=(300.0, 2700.0), doc='Swing foot acceleration per position error'
    )
    swing_velocity_gain: float = parameter(
        50.0, unit='1/s', span=(20.0, 150.0), doc='Swing foot acceleration per velocity error'
    )
    swing_kp: float = parameter(
        10.0, unit='N m/rad', span=(0.0, 30.0), doc='Joint stiffness of a swing leg in the motor'
    )
    swing_kd: float = parameter(
        0.5, unit='N m s/rad', span=(0.1, 1.5), doc='Joint damping of a swing leg in the motor'
    )
    stance_kd: float = parameter(
        0.3, unit='N m s/rad', span=(0.0, 1.0), doc='Joint damping of a stance leg in the motor'
    )


class BalanceParameters(Parameters):
    """Feedback of the base while it stands on feet that do not step."""

    position_gains: tuple[float, ...] = parameter(
        (60.0, 60.0, 80.0),
        unit='1/s^2',
        span=((1.0, 1.0, 1.0), (180.0, 180.0, 240.0)),
        doc='Base acceleration per position error, x y z',
    )
    velocity_gains: tuple[float, ...] = parameter(
        (12.0, 12.0, 14.0),
        unit='1/s',
        span=((4.0, 4.0, 4.7), (36.0, 36.0, 42.0)),
        doc='Base acceleration per velocity error, x y z',
    )
    rotation_gains: tuple[float, ...] = parameter(
        (120.0, 120.0, 80.0),
        unit='1/s^2',
        span=((40.0, 40.0, 27.0), (360.0, 360.0, 240.0)),
        doc='Angular acceleration per rotation error',
    )
    rate_gains: tuple[float, ...] = parameter(
        (16.0, 16.0, 14.0),
        unit='1/s',
        span=((5.3, 5.3, 4.7), (48.0, 48.0, 42.0)),
        doc='Angular acceleration per rate error',
    )
    acceleration_max: float = parameter(
        5.0, unit='m/s^2', span=(1.0, 20.0), doc='Largest desired linear acceleration, per axis'
    )
    rotation_max: float = parameter(
        40.0,
        unit='rad/s^2',
        span=(10.0, 160.0),
        doc='Largest desired angular acceleration, per axis',
    )


class ReferenceParameters(Parameters):
    """Desired motion of the base in trot."""

    height: float = parameter(
        0.30, unit='m', span=(0.22, 0.34), doc="Height of the hips above the feet's ground"
    )
    position_leash: float = parameter(
        0.10,
        unit='m',
        span=(0.02, 0.3),
        doc='Farthest the desired position runs ahead of the real one',
    )
    velocity_integral: float = parameter(
        0.6, unit='1/s', span=(0.0, 2.0), doc='Integral gain on velocity, against steady slip'
    )
    velocity_integral_limit: float = parameter(
        0.3, unit='m/s', span=(0.0, 1.0), doc='Largest correction by the velocity integral'
    )
    height_integral: float = parameter(
        1.5, unit='1/s', span=(0.0, 5.0), doc='Integral gain on height'
    )


class GroundParameters(Parameters):
    """Plane under the feet, from where they stood last."""

    slope_time: float = parameter(
        0.25, unit='s', span=(0.05, 2.0), doc='Time constant of the estimated slope'
    )
    height_time: float = parameter(
        0.1, unit='s', span=(0.03, 1.0), doc='Time constant of the estimated ground height'
    )
    slope_max: float = parameter(0.6, unit='rad', span=(0.0, 1.0), doc='Largest slope estimate')


class ContactParameters(Parameters):
    """Contact from joint torques: a momentum observer [DeLuca2006] with hysteresis."""

    bandwidth: float = parameter(
        120.0, unit='rad/s', span=(40.0, 400.0), doc='Bandwidth of the force estimate'
    )
    force_on: float = parameter(
        25.0, unit='N', span=(20.0, 50.0), doc='Normal force that makes a contact'
    )
    force_off: float = parameter(
        12.0, unit='N', span=(4.0, 18.0), doc='Normal force that ends a contact'
    )
    load_time: float = parameter(
        0.5, unit='s', span=(0.1, 5.0), doc='Time constant of the estimate of a load'
    )

    def __post_init__(self) -> None:
        """Check each value, and that a contact ends at less force than it begins with."""
        super().__post_init__()
        if self.force_off >= self.force_on:
            raise InvalidParameter(
                f'contact.force_off must be < contact.force_on = {self.force_on:g} N, '
                f'got {self.force_off:g}'
            )


class GripParameters(Parameters):
    """Friction by what feet feel [Focchi2018]; `mpc.friction` is the guess it starts from."""

    slip_speed: float = parameter(
        0.25, unit='m/s', span=(0.1, 1.0), doc='Speed above which a stance foot slips'
    )
    share: float = parameter(
        0.8, span=(0.4, 1.0), doc='Share of the estimated friction that forces may use'
    )
    fall_time: float = parameter(
        0.02, unit='s', span=(0.01, 0.2), doc='Time constant at which slipping feet lower it'
    )
    rise: float = parameter(
        0.5, unit='1/s', span=(0.0, 3.0), doc='Rate at which loaded feet without slip raise it'
    )
    least: float = parameter(0.1, span=(0.05, 0.3), doc='Smallest friction estimate')
    most: float = parameter(0.7, span=(0.4, 1.2), doc='Largest friction estimate')

    def __post_init__(self) -> None:
        """Check each value, and that there is a friction to believe in."""
        super().__post_init__()
        if self.least > self.most:
            raise InvalidParameter(
                f'grip.least must be <= grip.most = {self.most:g}, got {self.least:g}'
            )


class EstimatorParameters(Parameters):
    """Kalman filter of base position, velocity and the feet [Bloesch2012, linear form]."""

    acceleration_noise: float = parameter(
        0.04,
        unit='m/s^2',
        span=(0.01, 0.4),
        doc='Accelerometer, without its bias: velocity lost per root second',
    )
    bias: float = parameter(
        0.05,
        unit='m/s^2',
        span=(0.0, 0.5),
        doc="Standard deviation of the accelerometer's bias at the start",
    )
    bias_noise: float = parameter(
        0.005, unit='m/s^2', span=(0.0, 0.05), doc='Random walk of that bias per root second'
    )
    foot_noise: float = parameter(
        0.02, unit='m/s', span=(0.005, 0.1), doc='Slip of a standing foot, white, per root second'
    )
    kinematics_noise: float = parameter(
        0.004,
        unit='m',
        span=(0.001, 0.02),
        doc='Standard deviation of a foot position by joint angles',
    )
    velocity_noise: float = parameter(
        0.08,
        unit='m/s',
        span=(0.02, 0.3),
        doc='Standard deviation of base velocity by one standing leg',
    )
    slip_speed: float = parameter(
        0.05,
        unit='m/s',
        span=(0.02, 0.2),
        doc='Disagreement of a foot with the IMU that halves its weight',
    )
    gyro_noise: float = parameter(
        0.01, unit='rad/s', span=(0.002, 0.1), doc='Standard deviation of a reading of the gyro'
    )
    gyro_bias: float = parameter(
        2e-4,
        unit='rad/s',
        span=(0.0, 0.01),
        doc="Standard deviation of the gyro's bias at the start",
    )
    gyro_walk: float = parameter(
        5e-6, unit='rad/s', span=(0.0, 0.0001), doc='Random walk of that bias per root second'
    )
    level_band: float = parameter(
        0.05,
        unit='m',
        span=(0.0, 0.2),
        doc='Height above the estimated ground from which a foot stands on other ground',
    )
    level_time: float = parameter(
        0.2,
        unit='s',
        span=(0.05, 3.0),
        doc='Time constant of what draws feet on even ground to its level',
    )
    level_slope: float = parameter(
        0.02, span=(0.005, 0.2), doc='Slope above which ground counts as uneven'
    )
    level_rate: float = parameter(
        2.5,
        span=(1.5, 6.0),
        unit='rad/s',
        doc='Roll and pitch rate above which the robot is thrown and the level is not estimated',
    )
    step_band: float = parameter(
        0.03,
        unit='m',
        span=(0.0, 0.1),
        doc='Feet farther off the plane of the steps before are not drawn to it',
    )
    step_time: float = parameter(
        0.04, unit='s', span=(0.02, 1.0), doc='Time constant of that draw'
    )
    step_speed: float = parameter(
        2.0, unit='m/s', span=(0.5, 6.0), doc='Speed from which on that draw is whole'
    )
    step_middle: float = parameter(
        0.12,
        unit='m',
        span=(0.03, 0.4),
        doc="Feet whose middle is farther from the base's are not drawn to that plane",
    )
    phase_window: float = parameter(
        0.1, span=(0.0, 0.5), doc='Share of stance at both ends with less trust'
    )


class CommandParameters(Parameters):
    """What a velocity command may ask for; the limits are presets."""

    limits: str = parameter(
        'sport',
        name='limits',
        choices=LIMITS,
        doc='Full stick: good on any ground, as in unitree_guide, or all that a good floor allows',
    )
    forward_acceleration: float = parameter(
        2.0, above=0.0, unit='m/s^2', span=(0.2, 10.0), doc='Ramp of vx'
    )
    lateral_acceleration: float = parameter(
        1.5, above=0.0, unit='m/s^2', span=(0.2, 10.0), doc='Ramp of vy'
    )
    curve_acceleration: float = parameter(
        2.3,
        above=0.0,
        unit='m/s^2',
        span=(0.5, 4.0),
        doc='Largest speed times yaw rate; beyond, both are lowered',
    )
    yaw_acceleration: float = parameter(
        6.0, unit='rad/s^2', span=(0.5, 30.0), doc='Ramp of yaw rate'
    )
    leash: float = parameter(
        0.35,
        unit='m/s',
        span=(0.1, 2.0),
        doc='Lag of a Go2 that slows the growth of its command; twice this lag stops it',
    )
    timeout: float = parameter(
        0.5, unit='s', span=(0.1, 5.0), doc='Silence on cmd_vel after which the command is zero'
    )


class JumpParameters(Parameters):
    """
    How a robot jumps: within 2 cm of the height and 3 cm of the way, as far as its motors can.

    A flat jump is a short one: none goes farther than three times its height ahead, or half of
    that back.
    """

    height: float = parameter(
        0.18, unit='m', span=(0.05, 0.2), doc='Rise of the base after take-off'
    )
    distance: float = parameter(
        0.0,
        unit='m',
        span=(-0.25, 0.5),
        doc='Landing distance ahead, behind if negative; at most 3 times the height, 1.5 behind',
    )

    def __post_init__(self) -> None:
        """Check each value, and that the flight is long enough for the way."""
        super().__post_init__()
        low, high = -1.5 * self.height, 3.0 * self.height
        if not low - 1e-9 <= self.distance <= high + 1e-9:
            raise InvalidParameter(
                f'jump.distance must be {low:.3g} to {high:.3g} m with jump.height = '
                f'{self.height:g} m, got {self.distance:g}'
            )


class SafetyParameters(Parameters):
    """When the controller lets go."""

    tilt_max: float = parameter(
        1.0471975511965976,
        unit='rad',
        span=(0.6, 1.4),
        doc='Tilt above which it becomes passive: 60 deg',
    )
    joint_margin: float = parameter(
        0.3,
        unit='rad',
        span=(0.05, 1.0),
        doc='Largest plausible overshoot of a joint reading past its limit',
    )
    solver_failures: int = parameter(
        25, span=(5, 500), doc='Failed QPs in a row after which it becomes passive'
    )
