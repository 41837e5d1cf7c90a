# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from quadruped_sim.leg_controller import LegController
from quadruped_sim.leg_kinematics import ContactPoints, find_contact_points, LegMotion
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rules import flat_rules
from robot_description.description import Description, parse_description
from wasd_core.robot_io import BaseState, ImuReading, JointStates, JointTargets, Reading, Senses
import xacro

_XACRO = Path(__file__).parents[2] / 'robot_description/robot_description/urdf/go2/go2.urdf.xacro'


@pytest.fixture(scope='session')
def urdf() -> str:
    return str(xacro.process_file(str(_XACRO), mappings={}).toxml())


@pytest.fixture(scope='session')
def go2(urdf: str) -> Description:
    return parse_description(urdf, Path('robot.urdf'))


@pytest.fixture(scope='session')
def model(go2: Description) -> RobotModel:
    return RobotModel(go2)


@pytest.fixture(scope='session')
def rules(model: RobotModel) -> np.ndarray:
    """What the stages of a tick go by."""
    return flat_rules(LegControllerParameters(), model)


class StandingWalker:
    """What holds its pose in the state policy."""

    ranges = None
    failure = ''

    def __init__(self, joints: tuple[str, ...]) -> None:
        self.joints, self.default = joints, np.tile((0.0, 0.8, -1.6), 4)

    def reset(self) -> None:
        pass

    def step(self, senses: Senses, command: np.ndarray, dt: float) -> JointTargets:
        return JointTargets(self.default, np.full(12, 60.0), np.full(12, 3.0))


@pytest.fixture(scope='session')
def walker(model: RobotModel) -> StandingWalker:
    return StandingWalker(model.quadruped.joint_names)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture
def angles(rng: np.random.Generator) -> np.ndarray:
    """Joint angles around a stand, (12,)."""
    return np.tile((0.0, 0.8, -1.6), 4) + rng.uniform(-0.4, 0.4, 12)


@pytest.fixture(scope='session')
def standing() -> Reading:
    """A reading of a robot at rest on level ground."""
    bent = np.tile((0.0, 0.8, -1.6), 4)
    level, specific_force = np.array((1.0, 0.0, 0.0, 0.0)), np.array((0.0, 0.0, 9.81))
    return Reading(
        JointStates(bent, np.zeros(12), np.zeros(12)),
        ImuReading(level, np.zeros(3), specific_force),
    )


@pytest.fixture(scope='session')
def contact_points() -> Callable[[LegMotion, np.ndarray, float], ContactPoints]:
    """Return what gives contact points of feet of a radius on ground of a normal, base axes."""

    def contact_points(motion: LegMotion, normal: np.ndarray, radius: float) -> ContactPoints:
        out = ContactPoints(np.zeros((4, 3)), np.zeros((4, 3, 3)))
        find_contact_points(motion, normal, radius, out)
        return out

    return contact_points


@pytest.fixture(scope='session')
def robot_state(model: RobotModel, standing: Reading) -> RobotState:
    """The estimate of a robot at rest on level ground."""
    controller = LegController(model)
    controller.step(standing, 0.002)
    assert controller.robot is not None
    return controller.robot


@pytest.fixture(scope='session')
def truth() -> BaseState:
    """Where that robot is."""
    level = np.array((1.0, 0.0, 0.0, 0.0))
    return BaseState(np.array((0.0, 0.0, 0.3)), level, np.zeros(3), np.zeros(3))
