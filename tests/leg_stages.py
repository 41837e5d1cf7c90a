# SPDX-License-Identifier: Apache-2.0
"""The stages of a tick one by one, by the compiled functions that `step_feet` calls."""

import numpy as np
from quadruped_sim.algebra import plain
from quadruped_sim.dynamics import find_dynamics
from quadruped_sim.estimation.grip import feel_grip
from quadruped_sim.estimation.ground import follow_plane
from quadruped_sim.locomotion.footwork import find_step_height
from quadruped_sim.locomotion.reference import advance, blank_reference
from quadruped_sim.locomotion.swing import arrival_of, blank_targets, find_landing, FootPaths, lead
from quadruped_sim.robot_state import place_base, RobotState

# How long feet have sought the ground that find it [s].
NEVER = np.zeros(4)


def dynamics_of(model, orientation, velocity, omega, angles, rates):
    """
    Return the equations of motion at a state.

    `orientation` is (w, x, y, z), `velocity` [m/s] and `omega` [rad/s] are those of the base in
    base axes.
    """
    robot = RobotState.blank()
    robot.orientation[:] = orientation
    robot.joint_position[:], robot.joint_velocity[:] = angles, rates
    place_base(robot.flat)
    robot.base.velocity[:], robot.base.omega[:] = robot.base.R @ velocity, omega
    find_dynamics(*model.rigid, robot.flat)
    return robot.dynamics


def stand(ground, contacts, is_contact, rules, dt):
    """Move the plane toward the contact points (4, 3) of the feet that stand, world [m]."""
    follow_plane(ground.flat, contacts, is_contact, rules, dt)


def grip(own, state, stands, frame, rules, dt):
    """Feel the friction with the feet of the mask `stands` (4,), on ground axes `frame` (3, 3)."""
    feel_grip(state.flat, stands, frame, own.flat, rules, dt)


def height(own, state, schedule, place, rules, dt):
    """
    Return the height of a step [m], and how far the nose of who walks ahead is to be up [rad].

    `place` is the ground and the points (4, 3) where feet are, world [m].
    """
    ground, points = place
    legs = schedule.is_stance, schedule.phase
    return find_step_height(state.flat, (ground.flat, points), legs, own.flat, rules, dt)


def follow(own, state, command, ground, pose, rules, dt):
    """Return the reference; `pose` is the base's height [m] and how far its nose is up [rad]."""
    wanted = blank_reference()._replace(yaw_rate=float(command[2]))
    asked = command, *pose, dt
    advance(own.flat, rules, state.flat, ground.flat[0], asked, plain(wanted))
    return wanted


def swing(lift_off, state, schedule, reference, ground, tread, rules, sought=NEVER):
    """
    Return the targets of feet that are lifted so high [m] and set so firmly: `tread`.

    They left the ground at `lift_off` (4, 3) [m], and have `sought` it for so long, (4,) [s].
    """
    landing, targets = lift_off.copy(), blank_targets(schedule.is_stance)
    asked = plain(schedule), plain(reference), tread[1]
    find_landing(rules, state.flat, ground.flat, asked, landing)
    heights = np.full(4, float(tread[0]))
    arrivals = np.full(4, float(arrival_of(tread[1])))
    paths = plain(FootPaths(lift_off, landing, heights, arrivals))
    lead(state.flat, paths, asked[0], (rules, sought), plain(targets))
    return targets
