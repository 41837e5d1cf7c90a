# SPDX-License-Identifier: Apache-2.0
"""What a state is, and the parts that states share."""

from abc import ABC
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from wasd_core.robot_io import JointCommand

from quadruped_sim.command_filter import CommandFilter
from quadruped_sim.keys import Sticks
from quadruped_sim.locomotion.feedback import base_acceleration
from quadruped_sim.locomotion.feedback import standing_forces
from quadruped_sim.locomotion.locomotion import Locomotion
from quadruped_sim.locomotion.swing import foot_velocities
from quadruped_sim.locomotion.whole_body import WholeBodyTask
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import NO_TORQUE
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState

# On the Go2: acceleration of a led foot per position error [1/s^2] and per velocity [1/s],
_FOOT_GAINS = (300.0, 30.0)
# and motor-side damping [N m s/rad].
_DAMPING = 0.5


@dataclass
class ControllerParts:
    """What states use of the controller; made once and shared. `params` may be replaced."""

    model: RobotModel
    params: LegControllerParameters
    locomotion: Locomotion
    command_filter: CommandFilter
    sticks: Sticks


class State(ABC):
    """
    One behaviour. `enter` starts it, `step` is one tick of it.

    `trust` (4,) in [0, 1] says how surely each foot stands, for the estimator.
    """

    def __init__(self, parts: ControllerParts) -> None:
        self._parts = parts
        self.trust = np.ones(4)

    @property
    def is_lying(self) -> bool:
        """Whether the robot lies, or rolls, so that feet do not tell how it moves."""
        return False

    @property
    def is_over(self) -> bool:
        """Whether it has done what it does and gives way to its successor, if it has one."""
        return False

    @property
    def failure(self) -> str | None:
        """Why it cannot do what it does, so that the robot goes passive; None while it can."""
        return None

    @abstractmethod
    def enter(self, robot: RobotState) -> None:
        """Start from where the robot is."""

    @abstractmethod
    def step(self, robot: RobotState, dt: float) -> JointCommand:
        """Command of this tick, `dt` [s] after the one before."""

    def _stand(
        self,
        robot: RobotState,
        position: np.ndarray,
        yaw: float,
        is_stance: np.ndarray,
        feet: np.ndarray,
    ) -> JointCommand:
        """
        Hold the base level at `position`, `yaw` on the feet of `is_stance` (4,).

        The other feet are led to `feet` (4, 3), world [m]. Level ground is taken.
        """
        scale = self._parts.model.scale
        acceleration = base_acceleration(
            self._parts.params.balance, robot.base, position, np.array((0.0, 0.0, yaw))
        )
        stiffness, damping = _FOOT_GAINS[0] * scale.of('1/s^2'), _FOOT_GAINS[1] * scale.of('1/s')
        led = stiffness * (feet - robot.feet) - damping * foot_velocities(robot)
        return self._by_forces(robot, acceleration, is_stance, led)

    def _by_forces(
        self,
        robot: RobotState,
        acceleration: np.ndarray,
        is_stance: np.ndarray,
        led: np.ndarray | None = None,
        *,
        spares_motors: bool = True,
    ) -> JointCommand:
        """
        Have the feet of `is_stance` (4,) give the base an `acceleration` (6,), world axes.

        `led` (4, 3) [m/s^2] are the accelerations of the other feet. Level ground is taken.
        `spares_motors` is as in `WholeBody.solve`.
        """
        model = self._parts.model
        forces = standing_forces(model.weight + model.mass * float(acceleration[2]), is_stance)
        led = np.zeros((4, 3)) if led is None else led
        task = WholeBodyTask(acceleration, is_stance, forces, led, np.eye(3))
        whole_body = self._parts.locomotion.whole_body
        result = whole_body.solve(task, robot, spares_motors=spares_motors)
        return NO_TORQUE._replace(
            position=robot.joint_position.copy(),
            effort=result.torque,
            kd=np.full(12, _DAMPING * model.scale.of('N m s/rad')),
        )


def smooth(share: float) -> float:
    """Return a share of a way that begins and ends at rest, of a share of its time."""
    share = min(share, 1.0)
    return share * share * (3.0 - 2.0 * share)


def approach(value: np.ndarray, target: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Move `value` toward `target` by at most `most`, per element."""
    return np.asarray(value + np.clip(target - value, -most, most))
