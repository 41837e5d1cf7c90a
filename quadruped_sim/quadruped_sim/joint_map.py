# SPDX-License-Identifier: Apache-2.0
"""Between joints as a robot's description has them and leg angles as the controller has them."""

from collections.abc import Sequence

import numpy as np
from robot_description.morphology.quadruped import Quadruped
from wasd_core.robot_io import BaseState as TrueBase
from wasd_core.robot_io import JointCommand
from wasd_core.robot_io import Reading

from quadruped_sim.records import BaseState
from quadruped_sim.records import LegCommand
from quadruped_sim.records import Sensors


class JointMap:
    """
    Turns joint readings into leg angles and leg commands into motor commands.

    `joint_names` are the joints of a reading and `motor_names` those of a command, in their
    order; both hold the twelve leg joints.
    """

    def __init__(
        self, quadruped: Quadruped, joint_names: Sequence[str], motor_names: Sequence[str]
    ) -> None:
        names = quadruped.joint_names
        self._joints = np.array([joint_names.index(name) for name in names])
        self._motors = np.array([names.index(name) for name in motor_names])
        self._sign, self._zero = quadruped.sign, quadruped.zero
        self._is_plain = quadruped.is_plain

    def angles(self, positions: np.ndarray) -> np.ndarray:
        """Leg angles (12,) [rad] of joint positions."""
        positions = positions[self._joints]
        return positions if self._is_plain else self._sign * positions + self._zero

    def rates(self, velocities: np.ndarray) -> np.ndarray:
        """Leg rates (12,) [rad/s] of joint velocities; torques [N m] turn in the same way."""
        velocities = velocities[self._joints]
        return velocities if self._is_plain else self._sign * velocities

    def command(self, command: LegCommand) -> LegCommand:
        """Return a command of leg angles as one of motors."""
        position, velocity, effort = command.position, command.velocity, command.effort
        if not self._is_plain:
            position = self._sign * (position - self._zero)
            velocity, effort = self._sign * velocity, self._sign * effort
        motors = self._motors
        return LegCommand(
            position[motors],
            velocity[motors],
            effort[motors],
            command.kp[motors],
            command.kd[motors],
        )


def to_sensors(reading: Reading, joints: JointMap, truth: TrueBase | None) -> Sensors:
    """Return a reading as the controller has it, in leg angles."""
    assert reading.imu is not None  # the node refuses a robot without one
    states, imu = reading.joints, reading.imu
    return Sensors(
        joint_position=joints.angles(states.position),
        joint_velocity=joints.rates(states.velocity),
        joint_effort=joints.rates(states.effort),
        imu_orientation=imu.orientation,
        imu_angular_velocity=imu.angular_velocity,
        imu_linear_acceleration=imu.linear_acceleration,
        truth=to_base(truth) if truth is not None else None,
    )


def to_base(truth: TrueBase) -> BaseState:
    """Return the simulator's base state as the controller's record."""
    return BaseState(
        truth.position, truth.orientation, truth.linear_velocity, truth.angular_velocity
    )


def to_joint_command(command: LegCommand, joints: JointMap) -> JointCommand:
    """Return a command as the simulator's motors take it."""
    motors = joints.command(command)
    return JointCommand(motors.position, motors.velocity, motors.effort, motors.kp, motors.kd)
