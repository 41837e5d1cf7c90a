# SPDX-License-Identifier: Apache-2.0
"""All that is found of the feet in one compiled call is what the stages find one by one."""

import math

from cases import for_all
import leg_stages
import numpy as np
import pytest
from quadruped_sim.leg_controller import LegController
from quadruped_sim.locomotion.locomotion import Locomotion
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.tuning import GaitParameters
from wasd_core.robot_io import JointStates

pytestmark = pytest.mark.slow

PARAMETERS = LegControllerParameters(gait=GaitParameters(step_in_place=True))
COMMAND, DT = np.array((0.5, 0.1, 0.3)), 0.002


def test_one_call_does_what_the_stages_do_one_by_one(model, standing, rng):
    controller, alone = LegController(model, PARAMETERS), Locomotion(model, PARAMETERS)
    legs, ticks_in_air = controller.locomotion, 0
    for tick in range(90):
        if tick in (0, 30):
            controller.press('2' if tick == 0 else '4')
        # Torques that the ground would not give: feet touch and let go at any time.
        joints = JointStates(*standing.joints[:2], rng.normal(scale=8.0, size=12))
        controller.step(standing._replace(joints=joints), DT)
        if tick < 32:
            continue
        legs.schedule = legs.gait.state()
        for stage in ('ground', 'reference', 'grip', 'step_height'):
            getattr(alone, stage).flat[:] = getattr(legs, stage).flat
        wanted, targets = legs._step_feet(controller.robot, COMMAND, DT)
        expected = by_stages(alone, legs, controller.robot)
        for got, by_stage in zip((*wanted, *targets), expected, strict=True):
            np.testing.assert_array_equal(got, by_stage)
        assert alone.grip.friction == legs.grip.friction
        ticks_in_air += not legs.is_stance.all()
    assert ticks_in_air > 20


def by_stages(alone, legs, robot):
    """Return the reference and the targets by stages that are asked one by one."""
    feet, schedule, ground, by = legs._feet, legs.schedule, alone.ground, (alone.rules, DT)
    leg_stages.stand(ground, feet.points, feet.is_loaded, *by)
    place = ground, feet.points
    rise, nose = leg_stages.height(alone.step_height, robot, schedule, place, *by)
    leg_stages.grip(alone.grip, robot, feet.is_loaded, ground.frame(), *by)
    pose = legs._height, nose
    wanted = leg_stages.follow(alone.reference, robot, COMMAND, ground, pose, *by)
    tread = rise, max(schedule.pace, alone.step_height.roughness)
    schedule = schedule._replace(is_stance=legs.is_stance)
    by = alone.rules, feet.sought
    swing = leg_stages.swing(feet.lift_off, robot, schedule, wanted, ground, tread, *by)
    return *wanted, *swing


def in_the_air(model, standing, ticks):
    """Return a controller that trots for some ticks without a torque that ground would give."""
    controller = LegController(model, PARAMETERS)
    joints = standing.joints._replace(effort=np.zeros(12))
    for tick in range(ticks + 30):
        if tick in (0, 30):
            controller.press('2' if tick == 0 else '4')
        controller.step(standing._replace(joints=joints), DT)
    return controller


def test_a_foot_that_finds_no_ground_bears_nothing_and_goes_on_down(model, standing):
    """After 30 ms, at 1.5 m/s from where it is, as long as its schedule lets it stand."""
    controller = in_the_air(model, standing, 150)
    legs, sinking = controller.locomotion, 0
    for _ in range(120):
        legs.schedule = legs.gait.step(DT, 0.5, wants_steps=True)
        _, targets = legs._step_feet(controller.robot, COMMAND, DT)
        schedule, feet = legs.schedule, legs._feet
        waited = schedule.phase * schedule.stance_time - 0.03
        seeks = schedule.is_stance & (waited > 0.0)
        np.testing.assert_array_equal(feet.sought > 0.0, seeks)
        np.testing.assert_array_equal(feet.is_stance, schedule.is_stance & ~seeks)
        depth = legs._feet.lift_off - targets.position
        np.testing.assert_allclose(depth[seeks, 2], np.minimum(1.5 * waited[seeks], 0.12))
        np.testing.assert_allclose(depth[seeks, :2], 0.0, atol=1e-12)
        sinking += seeks.sum()
    assert sinking > 100


def test_a_foot_that_has_found_ground_stands_to_the_end_of_its_stance(model, standing):
    """Also where the force on it fades: a light foot is no foot in a hole."""
    controller = in_the_air(model, standing, 150)
    legs, robot = controller.locomotion, controller.robot
    while not legs._feet.sought.any():
        legs.schedule = legs.gait.step(DT, 0.5, wants_steps=True)
        legs._step_feet(robot, COMMAND, DT)
    (foot, *_) = np.flatnonzero(legs._feet.sought)
    robot.is_contact[foot] = True
    legs._step_feet(robot, COMMAND, DT)
    robot.is_contact[foot] = False
    while legs.schedule.is_stance[foot]:
        legs._step_feet(robot, COMMAND, DT)
        assert legs.is_stance[foot]
        legs.schedule = legs.gait.step(DT, 0.5, wants_steps=True)


@for_all(('rough', 'share'), [(0.0, 0.6), (0.5, 0.7), (1.0, 0.8)])
@for_all('phase', [0.1, 0.4, 0.6, 0.75])
def test_the_rougher_the_ground_the_later_a_foot_is_believed(model, standing, rough, share, phase):
    """With the fourth power of what is over of the share of its stance in which it settles."""
    controller = in_the_air(model, standing, 150)
    legs, robot = controller.locomotion, controller.robot
    robot.normal_forces[:] = 100.0
    legs.step_height.flat[0] = rough / math.exp(-DT / PARAMETERS.gait.terrain_time)
    still = np.ones(4, dtype=bool)
    legs._feet.has_touched[:], robot.is_contact[:] = True, True
    legs._feet.points[:, 2] = legs.ground.height
    legs.schedule = legs.schedule._replace(is_stance=still, phase=np.full(4, phase), pace=0.0)
    legs._step_feet(robot, COMMAND, DT)
    assert legs.step_height.roughness == pytest.approx(rough)
    assert legs.trust == pytest.approx(min(phase / share, 1.0) ** 4)
