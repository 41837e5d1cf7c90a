# SPDX-License-Identifier: Apache-2.0
"""What a state is, and the parts that states share."""

from abc import ABC
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from quadruped_sim.command_filter import CommandFilter
from quadruped_sim.locomotion import Locomotion
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.records import LegCommand
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.sticks import Sticks


@dataclass
class Parts:
    """Parts of the controller that states use; made once and shared. `params` may be replaced."""

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

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self.trust = np.ones(4)

    @abstractmethod
    def enter(self, robot: RobotState) -> None:
        """Start from where the robot is."""

    @abstractmethod
    def step(self, robot: RobotState, dt: float) -> LegCommand:
        """Command of this tick, `dt` [s] after the one before."""


def approach(value: np.ndarray, target: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Move `value` toward `target` by at most `most`, per element."""
    return np.asarray(value + np.clip(target - value, -most, most))
