# SPDX-License-Identifier: Apache-2.0
"""What a simulated robot has beyond its description: start pose, motors, delays, noise."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import math


@dataclass(frozen=True)
class SensorNoise:
    """
    Standard deviations of what the sensors add to the truth, white at each reading.

    The accelerometer also has a constant bias of `acceleration_bias` in a random direction.
    Defaults: a consumer IMU and joint encoders as on the Go2.
    """

    joint_position: float = 0.001  # [rad]
    joint_velocity: float = 0.05  # [rad/s]
    orientation: float = 0.001  # [rad]
    angular_velocity: float = 0.01  # [rad/s]
    acceleration: float = 0.1  # [m/s^2]
    acceleration_bias: float = 0.05  # [m/s^2]


@dataclass(frozen=True)
class RobotSetup:
    """
    How a robot is put into a world.

    `joint_positions` [rad], `place` (x, y) and `height` [m] of the root are where it starts;
    `speed_limits` [rad/s] are the no-load speeds of its motors; a command takes effect
    `command_delay` [s] after it was given; without `noise` sensors tell the truth.

    A robot of which more than `sink` [m] would begin below z = 0 is raised out of the floor.
    `reflected_inertia` [kg m^2] is what rotors add to joints, instead of the usual. With `imu`
    the robot has one even when its description names none.
    """

    joint_positions: Mapping[str, float] = field(default_factory=dict)
    place: tuple[float, float] = (0.0, 0.0)
    height: float = 0.0
    speed_limits: Mapping[str, float] = field(default_factory=dict)
    command_delay: float = 0.0
    noise: SensorNoise | None = None
    sink: float = math.inf
    reflected_inertia: Mapping[str, float] = field(default_factory=dict)
    imu: bool = False
