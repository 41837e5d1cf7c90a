# SPDX-License-Identifier: Apache-2.0
"""The feet in the air: where they land, on which path, and what accelerations take them there."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import cross3, rotate
from quadruped_sim.estimation.ground import height_at
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.robot_state import BaseMotion

# Share of a swing in which the foot gathers speed, and as much in which it loses it again.
_RAMP = 0.3
# Share of a swing after which a foot that is set down softly is above its foothold, so that it
# does not slide as it comes down; in a fast gait the knees have no speed to spare for that.
_ARRIVAL = 0.96


@jit
def arrival_of(firmness: float) -> float:
    """Share of a swing after which a foot that is set down so firmly is above its foothold."""
    return _ARRIVAL + firmness * (1.0 - _ARRIVAL)


@jit
def swing_profile(s: float) -> tuple[float, float, float]:
    """
    Way from 0 to 1 over s in [0, 1], and two derivatives; it rests at both ends.

    The speed follows half a cosine up and down again, and is constant between: its peak is
    1 / (1 - ramp) = 1.43 times the mean, which a minimum jerk has at 1.875, and it is the speed of
    the knees that ends a fast trot.
    """
    top = 1.0 / (1.0 - _RAMP)
    rest = min(s, 1.0 - s)  # of the nearer end
    if rest < _RAMP:
        angle = math.pi * rest / _RAMP
        way = 0.5 * top * (rest - _RAMP / math.pi * math.sin(angle))
        slope = 0.5 * top * (1.0 - math.cos(angle))
        curve = 0.5 * top * math.pi / _RAMP * math.sin(angle)
    else:
        way, slope, curve = top * (rest - 0.5 * _RAMP), top, 0.0
    if s > 0.5:
        return 1.0 - way, slope, -curve
    return way, slope, curve


@jit
def swing_point(
    start: np.ndarray,
    end: np.ndarray,
    height: float,
    phase: float,
    duration: float,
    arrival: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Foot on its way from `start` to `end`, both (3,) [m], at `phase` in [0, 1] of `duration` [s].

    Returns position [m], velocity [m/s] and acceleration [m/s^2], each (3,). The foot passes
    `height` [m] above the higher of the two ends at half time and lands at rest; it is above its
    end from the phase `arrival` on.
    """
    s = min(max(phase, 0.0), 1.0)
    rate = 1.0 / duration
    value, slope, curve = swing_profile(min(s / arrival, 1.0))
    slope, curve = slope / arrival, curve / arrival**2
    position, velocity, acceleration = np.empty(3), np.empty(3), np.empty(3)
    for k in range(2):
        travel = end[k] - start[k]
        position[k] = start[k] + value * travel
        velocity[k] = slope * rate * travel
        acceleration[k] = curve * rate * rate * travel

    low, high = start[2], end[2]
    top = max(low, high) + height
    if s < 0.5:
        value, slope, curve = swing_profile(2.0 * s)
        base, rise = low, top - low
    else:
        value, slope, curve = swing_profile(2.0 * s - 1.0)
        base, rise = top, high - top
    position[2] = base + value * rise
    velocity[2] = 2.0 * slope * rate * rise
    acceleration[2] = 4.0 * curve * rate * rate * rise
    return position, velocity, acceleration


@jit
def find_footholds(
    rules: np.ndarray, base: BaseMotion, reference: BaseReference, schedule: GaitState
) -> np.ndarray:
    """
    Landing points of the feet in world axes, shape (4, 3) [m], without their height.

    The shift from the place below the hip is v T/2 + gain (v - command) [Raibert1986], limited to
    `reach`, with T the time of stance; the yaw motion to come until the middle of the stance turns
    place and velocity with it. In a curve feet stand h/g v x yaw rate farther out, so that the
    force that bends the way does not topple the body.
    """
    position, velocity, command = base.position, base.velocity, reference.velocity
    own, rule, stance_time = rules[0], rules[0].foothold, schedule.stance_time
    length, width = schedule.footprint
    lean = own.fall_time**2 * reference.yaw_rate
    feet = np.zeros((4, 3))
    for leg in range(4):
        remaining = (1.0 - schedule.phase[leg]) * schedule.swing_time
        # The velocity turns, too: by half of each stretch on the way along it.
        angle = reference.yaw_rate * (remaining + 0.25 * stance_time)
        c, s = math.cos(angle), math.sin(angle)
        x = 0.5 * stance_time * (c * velocity[0] - s * velocity[1])
        y = 0.5 * stance_time * (s * velocity[0] + c * velocity[1])
        x += rule.velocity_gain * (velocity[0] - command[0])
        y += rule.velocity_gain * (velocity[1] - command[1])
        angle = reference.yaw_rate * (remaining + 0.5 * stance_time)
        c, s = lean * math.cos(angle), lean * math.sin(angle)
        x += s * velocity[0] + c * velocity[1]
        y += s * velocity[1] - c * velocity[0]
        share = min(1.0, rule.reach / max(math.sqrt(x * x + y * y), 1e-9))
        middle = base.rpy[2] + angle
        angle = 0.5 * reference.yaw_rate * remaining
        c, s = remaining * math.cos(angle), remaining * math.sin(angle)
        x = position[0] + c * velocity[0] - s * velocity[1] + share * x
        y = position[1] + s * velocity[0] + c * velocity[1] + share * y
        c, s = math.cos(middle), math.sin(middle)
        nx, ny = length * own.nominal[leg, 0], width * own.nominal[leg, 1]
        feet[leg, 0], feet[leg, 1] = x + c * nx - s * ny, y + s * nx + c * ny
    return feet


# A foot lands at least so far on its own side of the one across that stands, on the Go2 [m].
_APART = 0.08


@jit
def keep_apart(
    landing: np.ndarray, feet: np.ndarray, is_stance: np.ndarray, yaw: float, apart: float
) -> None:
    """
    Move landing points (4, 3) outward that are on the wrong side of a foot that stands, in place.

    A robot that is thrown sideways wants to step across its own foot, and trips over it.
    """
    x, y = -math.sin(yaw), math.cos(yaw)
    for leg in range(4):
        across = leg + 1 if leg % 2 == 0 else leg - 1
        if is_stance[leg] or not is_stance[across]:
            continue
        side = 1.0 if leg % 2 == 0 else -1.0
        gap = x * (landing[leg, 0] - feet[across, 0]) + y * (landing[leg, 1] - feet[across, 1])
        short = max(apart - side * gap, 0.0)
        landing[leg, 0] += side * short * x
        landing[leg, 1] += side * short * y


# Where a soft landing in place, one ahead and a firm one aim on the Go2, above the level of feet
# that bear load [m]. A foot without load touches a little above; one that aims below arrives even
# if it is lower there. The higher one is softer; in place the robot would stray by it.
_STILL, _SOFT, _FIRM = 0.003, 0.005, -0.004


# A foot is lifted up to so far below its hip, and always so far above its ends, on the Go2 [m]. A
# foot as near to the hip's axis as the thigh is beside it (0.0955) cannot be led sideways: on
# stairs, nose up, hip and thigh ran into their ends, which felt like ground in the air.
_ROOM, _LEAST = 0.12, 0.02
# A foot that finds no ground is led on down so fast [m/s] and so far [m], on the Go2.
_SEEKING = 1.5, 0.12


class SwingTargets(NamedTuple):
    """
    Targets of the swing feet in world axes; rows of the feet in `is_stance` (4,) mean nothing.

    `position`, `velocity`, `acceleration` (4, 3); the acceleration holds the feedback already.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    is_stance: np.ndarray


def blank_targets(is_stance: np.ndarray) -> SwingTargets:
    """Return targets to be written into."""
    return SwingTargets(np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3)), is_stance)


@jit
def find_landing(
    rules: np.ndarray,
    robot: np.ndarray,
    ground: np.ndarray,
    asked: tuple[GaitState, BaseReference, float],
    landing: np.ndarray,
) -> None:
    """
    Write where the foot centres land on the ground's plane, (4, 3), world axes [m].

    `asked` are the schedule, with the feet that do stand, the base's reference, and how firmly
    the feet are set.
    """
    own, state, plane = rules[0], robot[0], ground[0]
    schedule, reference, firmness = GaitState(*asked[0]), BaseReference(*asked[1]), asked[2]
    feet = find_footholds(rules, state.base, reference, schedule)
    speed = math.hypot(reference.velocity[0], reference.velocity[1])
    still, soft, firm = _STILL * own.length, _SOFT * own.length, _FIRM * own.length
    apart = _APART * own.length
    share = min(speed * own.fall_time / apart, 1.0)  # 1 from 0.45 m/s on, on the Go2
    soft = still + share * (soft - still)
    above = own.geometry.foot_radius + soft + firmness * (firm - soft)
    for leg in range(4):
        for k in range(2):
            landing[leg, k] = feet[leg, k]
        landing[leg, 2] = height_at(plane, feet[leg, 0], feet[leg, 1]) + above
    keep_apart(landing, state.feet, schedule.is_stance, state.base.rpy[2], apart)


@jit
def foot_velocities(robot: np.ndarray) -> np.ndarray:
    """Velocity of the foot centres of a flat `RobotState`, world axes (4, 3) [m/s]."""
    base, motion = robot[0].base, robot[0].motion
    velocity, relative = np.empty((4, 3)), np.empty(3)
    for i in range(4):
        swept = cross3(base.omega, motion.position[i])
        for k in range(3):
            relative[k] = swept[k] + motion.velocity[i, k]
        moves = rotate(base.R, relative)
        for k in range(3):
            velocity[i, k] = base.velocity[k] + moves[k]
    return velocity


class FootPaths(NamedTuple):
    """
    Where the feet left the ground and will land, both (4, 3), the heights of their steps (4,) [m].

    `arrivals` (4,) are the shares of a swing after which they are above where they land.
    """

    lift_off: np.ndarray
    landing: np.ndarray
    heights: np.ndarray
    arrivals: np.ndarray


@jit
def headroom(base: BaseMotion, hip: np.ndarray, x: float, y: float, room: float) -> float:
    """Height [m] at x, y in the world that is `room` [m] below a hip (3,), along the base's z."""
    R, arm = base.R, rotate(base.R, hip)
    dx, dy = x - base.position[0] - arm[0], y - base.position[1] - arm[1]
    below = (room + R[0, 2] * dx + R[1, 2] * dy) / max(R[2, 2], 0.1)
    return float(base.position[2] + arm[2] - below)


@jit
def lead(
    robot: np.ndarray,
    paths: FootPaths,
    schedule: GaitState,
    by: tuple[np.ndarray, np.ndarray],
    targets: SwingTargets,
) -> None:
    """
    Write the targets of the feet in the air; those that stand stay where they are.

    They are led `by` rules; those that have `sought` the ground for some time, (4,) [s], on down.
    """
    lift_off, landing, heights, arrivals = paths
    schedule, targets = GaitState(*schedule), SwingTargets(*targets)
    own, gains, sought = by[0][0], by[0][0].whole_body, by[1]
    room, seeking, deepest = _ROOM * own.length, _SEEKING[0] * own.speed, _SEEKING[1] * own.length
    position, velocity, acceleration = targets.position, targets.velocity, targets.acceleration
    moves, feet, base = foot_velocities(robot), robot[0].feet, robot[0].base
    for leg in range(4):
        for k in range(3):
            position[leg, k], velocity[leg, k], acceleration[leg, k] = feet[leg, k], 0.0, 0.0
        if targets.is_stance[leg]:
            continue
        phase = schedule.phase[leg]
        start, end = lift_off[leg], landing[leg]
        ends, x, y = max(start[2], end[2]), 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
        top = min(
            headroom(base, own.geometry.hip[leg], x, y, room),
            headroom(base, own.geometry.hip[leg], feet[leg, 0], feet[leg, 1], room),
        )
        rise = min(heights[leg], max(top - ends, _LEAST * own.length))
        p, v, a = swing_point(start, end, rise, phase, schedule.swing_time, arrivals[leg])
        if sought[leg] > 0.0:
            for k in range(3):
                p[k], v[k], a[k] = start[k], 0.0, 0.0
            depth = seeking * sought[leg]
            p[2] -= min(depth, deepest)
            v[2] = -seeking if depth < deepest else 0.0
        for k in range(3):
            position[leg, k], velocity[leg, k] = p[k], v[k]
            acceleration[leg, k] = (
                a[k]
                + gains.swing_position_gain * (p[k] - feet[leg, k])
                + gains.swing_velocity_gain * (v[k] - moves[leg, k])
            )
