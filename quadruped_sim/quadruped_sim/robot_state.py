# SPDX-License-Identifier: Apache-2.0
"""The state of the robot in one tick, and its odometry."""

from dataclasses import dataclass, field, fields
import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import BaseOdometry

from quadruped_sim.algebra import flatten, rotate, view_of, write_rotation
from quadruped_sim.dynamics import blank_dynamics, Dynamics
from quadruped_sim.leg_kinematics import ContactPoints, LegGeometry, LegMotion, move_legs


class BaseMotion(NamedTuple):
    """
    Where the base is and how it moves.

    `position` [m] and `velocity` [m/s] are in the world, `R` (3, 3) turns base axes into it,
    `rpy` says the same [rad]; `omega` [rad/s] is in base axes.
    """

    position: np.ndarray
    velocity: np.ndarray
    R: np.ndarray
    rpy: np.ndarray
    omega: np.ndarray


@dataclass(frozen=True)
class RobotState:
    """
    Estimated state of one tick; the next one overwrites the controller's.

    `orientation` (w, x, y, z) says what `base.R` says. `feet` (4, 3) are the foot centres in the
    world. `normal_forces` (4,) [N] are estimated from the joint torques, `is_contact` (4,) follows
    from them; `forces` (4, 3) [N] are all of each, in base axes.

    The arrays are views on one block of memory, `flat`, which is what compiled functions take. The
    flags are last in it: numbers behind them would lie across words.
    """

    joint_position: np.ndarray
    joint_velocity: np.ndarray
    orientation: np.ndarray
    base: BaseMotion
    motion: LegMotion
    contact: ContactPoints
    dynamics: Dynamics
    feet: np.ndarray
    normal_forces: np.ndarray
    forces: np.ndarray
    is_contact: np.ndarray
    flat: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Copy what was given into the block."""
        given = {part.name: getattr(self, part.name) for part in fields(self) if part.init}
        flat = flatten(given)
        for name, part in given.items():
            object.__setattr__(self, name, view_of(flat[name], part))
        object.__setattr__(self, 'flat', flat)

    def planar_velocity(self) -> np.ndarray:
        """Velocity of the base ahead and to the left (2,), base axes [m/s]."""
        return np.asarray(self.base.velocity @ self.base.R)[:2]

    @classmethod
    def blank(cls) -> 'RobotState':
        """Return a state of zeros, to be written into."""
        three, four = np.zeros(3), np.zeros((4, 3))
        jacobian = np.zeros((4, 3, 3))
        return cls(
            joint_position=np.zeros(12),
            joint_velocity=np.zeros(12),
            orientation=np.zeros(4),
            base=BaseMotion(three, three, np.zeros((3, 3)), three, three),
            motion=LegMotion(four, four, jacobian, four, four, four),
            contact=ContactPoints(four, jacobian),
            dynamics=blank_dynamics(),
            feet=four,
            normal_forces=np.zeros(4),
            forces=four,
            is_contact=np.zeros(4, dtype=bool),
        )

    @property
    def com(self) -> np.ndarray:
        """Centre of mass in base axes (3,) [m]."""
        return self.dynamics.com

    def height(self, radius: float) -> float:
        """Height of the base above the ground under its lowest foot, a ball of `radius` [m]."""
        return radius - lowest_foot(self.flat)

    @property
    def mass(self) -> float:
        """What the legs carry [kg], a load as it is felt among it."""
        return float(self.dynamics.mass[0, 0])


@jit
def lowest_foot(robot: np.ndarray) -> float:
    """Return the height of the lowest foot of a flat `RobotState` above its base [m]."""
    R, feet = robot[0].base.R, robot[0].motion.position
    lowest = math.inf
    for i in range(4):
        lowest = min(lowest, R[2, 0] * feet[i, 0] + R[2, 1] * feet[i, 1] + R[2, 2] * feet[i, 2])
    return lowest


@jit
def read_legs(
    leg: LegGeometry,
    robot: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    measured: np.ndarray,
    R: np.ndarray,
) -> None:
    """
    Write `position` and `velocity` (12,) of joints into a flat `RobotState`, and the feet's.

    `R` (3, 3) becomes the rotation matrix of the orientation `measured` (4,).
    """
    state = robot[0]
    write_rotation(measured, R)
    for i in range(12):
        state.joint_position[i], state.joint_velocity[i] = position[i], velocity[i]
    move_legs(LegGeometry(*leg), state.joint_position, state.joint_velocity, state.motion)


@jit
def turn_base(
    robot: np.ndarray, measured: np.ndarray, omega: np.ndarray, drift: tuple[float, float]
) -> None:
    """
    Write orientation (4,) and angular velocity (3,) into a flat `RobotState`, less their drift.

    That is how far the heading is off [rad], and how fast it goes on [rad/s].
    """
    state = robot[0]
    turned, R, rate = state.orientation, state.base.R, state.base.omega
    c, s = math.cos(0.5 * drift[0]), -math.sin(0.5 * drift[0])
    w, x, y, z = measured[0], measured[1], measured[2], measured[3]
    turned[0], turned[1] = c * w - s * z, c * x - s * y
    turned[2], turned[3] = c * y + s * x, c * z + s * w
    write_rotation(measured, R)
    for k in range(3):
        rate[k] = omega[k] - drift[1] * R[2, k]
    write_rotation(turned, R)


@jit
def place_base(robot: np.ndarray) -> None:
    """Write into a flat `RobotState` what follows from its orientation and position."""
    state = robot[0]
    base, R = state.base, state.base.R
    write_rotation(state.orientation, R)
    base.rpy[0] = math.atan2(R[2, 1], R[2, 2])
    base.rpy[1] = math.asin(max(-1.0, min(1.0, -R[2, 0])))
    base.rpy[2] = math.atan2(R[1, 0], R[0, 0])
    for i in range(4):
        arm = rotate(R, state.motion.position[i])
        for k in range(3):
            state.feet[i, k] = base.position[k] + arm[k]


# The IMU's tilt is taken as true up to this variance [rad^2]; its rate likewise.
_ROTATION_VARIANCE = 1e-5
_RATE_VARIANCE = 1e-4


def make_odometry(
    robot: RobotState, position_variance: float, velocity_variance: float, heading_variance: float
) -> BaseOdometry:
    """Odometry of the estimated state; variances per axis [m^2], [m^2/s^2], [rad^2]."""
    rotation = [_ROTATION_VARIANCE] * 2 + [_ROTATION_VARIANCE + heading_variance]
    return BaseOdometry(
        position=robot.base.position.copy(),
        orientation=robot.orientation.copy(),
        linear_velocity=robot.base.R.T @ robot.base.velocity,
        angular_velocity=robot.base.omega.copy(),
        pose_covariance=np.diag([position_variance] * 3 + rotation),
        twist_covariance=np.diag([velocity_variance] * 3 + [_RATE_VARIANCE] * 3),
    )


@jit
def sound_height(robot: np.ndarray) -> float:
    """
    Return how high the base of a flat `RobotState` is over its lowest foot [m].

    NaN unless all that it tells of base, feet and dynamics is below 1e150.
    """
    state = robot[0]
    base, dynamics = state.base, state.dynamics
    squares = 0.0
    for k in range(3):
        squares += base.position[k] ** 2 + base.velocity[k] ** 2 + base.omega[k] ** 2
        squares += base.rpy[k] ** 2 + dynamics.com[k] ** 2
        for i in range(4):
            squares += state.feet[i, k] ** 2 + state.forces[i, k] ** 2
    for i in range(4):
        squares += state.orientation[i] ** 2 + state.normal_forces[i] ** 2
    for i in range(18):
        squares += dynamics.bias[i] ** 2
        for k in range(18):
            squares += dynamics.mass[i, k] ** 2
    return -lowest_foot(robot) if math.isfinite(squares) else math.nan
