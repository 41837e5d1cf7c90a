# SPDX-License-Identifier: Apache-2.0
"""What the robot carries is felt by its feet, and its dynamics know of it."""

from dataclasses import replace

from leg_stages import dynamics_of
from mujoco_sim.parameters import Payload, Untold
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from quadruped_sim.estimation.load import feel_load, LoadObserver
from quadruped_sim.leg_controller import LegController
from quadruped_sim.robot_model import JointMap
from quadruped_sim.robot_state import RobotState
from robot_description.description import load_robot
from wasd_core.robot_io import GRAVITY

pytestmark = pytest.mark.slow

TIME, DT = 0.5, 0.002
LEVEL = np.array((0.0, 0.0, 1.0))


@pytest.fixture
def dynamics(model, angles):
    """Return a function that makes the dynamics of a level robot at rest."""
    level = np.array((1.0, 0.0, 0.0, 0.0))
    return lambda: dynamics_of(model, level, np.zeros(3), np.zeros(3), angles, np.zeros(12))


@pytest.fixture
def observer(rules):
    """Return an observer with the rules that it goes by."""
    observer = LoadObserver()
    observer.rules = rules
    return observer


POINTS = np.array(((0.2, 0.14, -0.3), (0.2, -0.14, -0.3), (-0.2, 0.14, -0.3), (-0.2, -0.14, -0.3)))


def balanced(mass, com):
    """Return the forces of feet (4, 3) that carry a mass with its centre above `com`."""
    rows = np.vstack((np.ones(4), POINTS[:, 0], POINTS[:, 1]))
    forces = np.zeros((4, 3))
    forces[:, 2] = np.linalg.lstsq(rows, mass * GRAVITY * np.array((1.0, *com[:2])), rcond=None)[0]
    return forces


def felt(observer, dynamics, mass, com, seconds=5.0):
    """Return the dynamics that a robot at rest believes in after so long [s]."""
    robot = resting(dynamics(), balanced(mass, com), np.zeros(3))
    found = robot.flat.copy()
    for _ in range(round(seconds / DT)):
        robot.flat[:] = found
        feel_load(observer.flat, robot.flat, observer.rules, DT)
    return robot.dynamics


def resting(dynamics, forces, velocity):
    """Return a level robot with these forces (4, 3) [N] on its feet."""
    robot = RobotState.blank()
    base = robot.base._replace(R=np.eye(3), velocity=velocity)
    contact = robot.contact._replace(position=POINTS)
    return replace(robot, base=base, contact=contact, dynamics=dynamics, forces=forces)


def test_a_robot_that_carries_nothing_is_what_its_model_says(model, observer, dynamics):
    plain = dynamics()
    found = felt(observer, dynamics, model.mass, plain.com)
    np.testing.assert_allclose(found.mass, plain.mass, atol=1e-6)
    np.testing.assert_allclose(found.bias, plain.bias, atol=1e-6)
    np.testing.assert_allclose(found.com, plain.com, atol=1e-9)


def test_a_load_is_felt_where_it_is(model, observer, dynamics):
    plain = dynamics()
    place = np.array((0.05, 0.1, 0.0))
    mass = model.mass + 5.0
    com = (model.mass * plain.com + 5.0 * place) / mass
    found = felt(observer, dynamics, mass, com)
    assert found.mass[0, 0] == pytest.approx(mass, rel=1e-3)
    np.testing.assert_allclose(found.com[:2], com[:2], atol=2e-4)
    # At rest the legs hold the weight, and its moment about the base's origin.
    np.testing.assert_allclose(found.bias[:3], mass * GRAVITY * LEVEL, rtol=1e-3, atol=1e-6)
    moment = np.cross(found.com, mass * GRAVITY * LEVEL)
    np.testing.assert_allclose(found.bias[3:6], moment, rtol=2e-3, atol=0.02)
    np.testing.assert_allclose(found.mass, found.mass.T, atol=1e-9)
    first = mass * found.com
    coupling = -np.array(
        ((0.0, -first[2], first[1]), (first[2], 0.0, -first[0]), (-first[1], first[0], 0.0))
    )
    np.testing.assert_allclose(found.mass[:3, 3:6], coupling, atol=0.02)


def test_it_takes_its_time_and_is_forgotten_by_a_reset(model, observer, dynamics):
    com = dynamics().com
    soon = felt(observer, dynamics, model.mass + 5.0, com, TIME)
    share = (float(soon.mass[0, 0]) - model.mass) / 5.0
    assert share == pytest.approx(1.0 - np.exp(-1.0), abs=0.01)
    observer.reset()
    fresh = felt(observer, dynamics, model.mass + 5.0, com, DT)
    assert float(fresh.mass[0, 0]) == pytest.approx(model.mass, abs=0.05)


def test_no_more_is_believed_than_a_robot_can_carry(model, observer, dynamics):
    com = dynamics().com
    found = felt(observer, dynamics, 4.0 * model.mass, com + (0.15, 0.0, 0.0))
    assert found.mass[0, 0] == pytest.approx(1.8 * model.mass)
    assert found.com[0] - com[0] == pytest.approx(0.06)


def test_a_robot_in_flight_carries_nothing(model, observer, dynamics):
    for step in range(200):
        falling = np.array((0.0, 0.0, -GRAVITY * DT * step))
        robot = resting(dynamics(), np.zeros((4, 3)), falling)
        feel_load(observer.flat, robot.flat, observer.rules, DT)
    assert robot.mass == pytest.approx(model.mass, rel=0.01)


def test_with_eight_kilograms_on_its_left_it_begins_to_walk_level(model):
    loaded = load_robot('go2')
    untold = Untold(payload=Payload(8.0, (0.0, 0.1, 0.0)))
    world = build_world(loaded, setup=replace(usual_setup(loaded), untold=untold))
    joints = JointMap(model.quadruped, world.joint_names, world.motor_names)
    controller, tilt = LegController(model), 0.0
    for tick in range(round(4.5 / DT)):
        if tick in (50, 1300):
            controller.press('2' if tick == 50 else '5')
        if tick > 1500:
            controller.set_velocity(0.5, 0.0, 0.0)
        world.apply(joints.command(controller.step(joints.reading(world.read()), DT)))
        world.step(2)
        tilt = max(tilt, float(np.abs(world.base().rpy[:2]).max()))
    # Without what the feet feel it rolls by 47 degrees before the first step.
    assert np.degrees(tilt) < 6.0
    assert world.base().position[0] > 0.3
