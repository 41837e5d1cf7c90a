# SPDX-License-Identifier: Apache-2.0
"""Closed-form kinematics of four legs at once: hip about x, thigh and calf about y."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import flatten, plain, Three, view_of

LEGS = ('FL', 'FR', 'RL', 'RR')
FL, FR, RL, RR = range(4)

# +1 for the left legs and -1 for the right; +1 front, -1 rear.
LEFT = (1.0, -1.0, 1.0, -1.0)
FRONT = (1.0, 1.0, -1.0, -1.0)


class LegGeometry(NamedTuple):
    """
    Dimensions of the four legs, in base axes [m].

    `hip` (4, 3) is where the hip axes pass the thigh's plane, `offset` (4,) the signed distance
    from the hip axis to the leg's plane, `drop` (4,) how far below that axis the thigh turns,
    `thigh` and `calf` (4,) the lengths of the two links, `foot_radius` that of the spherical foot.
    `bend` (4,) is 1 for a knee that points backward and -1 for one that points forward.
    """

    hip: np.ndarray
    offset: np.ndarray
    drop: np.ndarray
    thigh: np.ndarray
    calf: np.ndarray
    foot_radius: float
    bend: np.ndarray


class LegMotion(NamedTuple):
    """
    Feet as seen from the base, base axes.

    `position` (4, 3) [m], `velocity` (4, 3) [m/s] relative to the base, `jacobian` (4, 3, 3) from
    joint velocity to foot velocity, `bias` (4, 3) [m/s^2] the foot acceleration at zero joint
    acceleration, `calf_rate` (4, 3) [rad/s] the calves' angular velocity relative to the base,
    `axis` (4, 3) the axis of thigh and calf.
    """

    position: np.ndarray
    velocity: np.ndarray
    jacobian: np.ndarray
    bias: np.ndarray
    calf_rate: np.ndarray
    axis: np.ndarray


def leg_motion(leg: LegGeometry, angles: np.ndarray, rates: np.ndarray) -> LegMotion:
    """Feet at joint `angles` [rad] moving at `rates` [rad/s], both (12,)."""
    blank = LegMotion(*(np.zeros((4, 3, 3) if k == 2 else (4, 3)) for k in range(6)))
    flat = flatten(blank)
    write_leg_motion(plain(leg), angles, rates, flat)
    motion: LegMotion = view_of(flat, blank)
    return motion


@jit
def write_leg_motion(
    leg: LegGeometry, angles: np.ndarray, rates: np.ndarray, flat: np.ndarray
) -> None:
    """Compiled `leg_motion`, which writes into a flat one."""
    move_legs(LegGeometry(*leg), angles, rates, flat[0])


@jit
def move_legs(leg: LegGeometry, angles: np.ndarray, rates: np.ndarray, out: LegMotion) -> None:
    """Write what `leg_motion` says."""
    position, velocity, jacobian = out.position, out.velocity, out.jacobian
    bias, spin, axis = out.bias, out.calf_rate, out.axis
    for i in range(4):
        hip_rate, thigh_rate = rates[3 * i], rates[3 * i + 1]
        calf_rate = thigh_rate + rates[3 * i + 2]
        s1, c1 = np.sin(angles[3 * i]), np.cos(angles[3 * i])
        bent = angles[3 * i + 1] + angles[3 * i + 2]
        upper, lower = leg.thigh[i], leg.calf[i]
        ls2, lc2 = upper * np.sin(angles[3 * i + 1]), upper * np.cos(angles[3 * i + 1])
        ls3, lc3 = lower * np.sin(bent), lower * np.cos(bent)
        x, fall = -ls2 - ls3, -lc2 - lc3  # in the leg's plane, from where the thigh turns
        z = fall - leg.drop[i]
        y_base = leg.offset[i] * c1 - z * s1
        z_base = leg.offset[i] * s1 + z * c1
        position[i, 0] = leg.hip[i, 0] + x
        position[i, 1] = leg.hip[i, 1] + y_base
        position[i, 2] = leg.hip[i, 2] + z_base

        J = jacobian[i]
        J[1, 0], J[2, 0] = -z_base, y_base
        J[0, 1], J[1, 1], J[2, 1] = fall, x * s1, -x * c1
        J[0, 2], J[1, 2], J[2, 2] = -lc3, -ls3 * s1, ls3 * c1
        for row in range(3):
            velocity[i, row] = 0.0
            for joint in range(3):
                velocity[i, row] += J[row, joint] * rates[3 * i + joint]

        # Second derivatives of the closed form at zero joint acceleration.
        z_rate = -x * thigh_rate + ls3 * (calf_rate - thigh_rate)
        z_bias = lc2 * thigh_rate * thigh_rate + lc3 * calf_rate * calf_rate
        bias[i, 0] = ls2 * thigh_rate * thigh_rate + ls3 * calf_rate * calf_rate
        bias[i, 1] = -y_base * hip_rate**2 - z_bias * s1 - 2.0 * z_rate * hip_rate * c1
        bias[i, 2] = -z_base * hip_rate**2 + z_bias * c1 - 2.0 * z_rate * hip_rate * s1
        axis[i, 1], axis[i, 2] = c1, s1
        spin[i, 0], spin[i, 1], spin[i, 2] = hip_rate, calf_rate * c1, calf_rate * s1


class ContactPoints(NamedTuple):
    """
    Where the feet touch, in base axes.

    `position` (4, 3) [m]; `jacobian` (4, 3, 3) from joint velocity to the velocity of the calf's
    point that touches. The foot is a ball: it rolls, so that point, not its centre, is at rest.
    """

    position: np.ndarray
    jacobian: np.ndarray


@jit
def find_contact_points(
    motion: LegMotion, normal: np.ndarray | Three, foot_radius: float, out: ContactPoints
) -> None:
    """
    Write where balls of `foot_radius` [m] touch ground with `normal` (3,), base axes.

    The Jacobian has (joint axis) x (arm to the contact) more than that of the centre; the hip's
    axis is (1, 0, 0), the others' (0, c1, s1).
    """
    J = out.jacobian
    x, y, z = -foot_radius * normal[0], -foot_radius * normal[1], -foot_radius * normal[2]
    for i in range(4):
        for row in range(3):
            out.position[i, row] = motion.position[i, row] - foot_radius * normal[row]
            for joint in range(3):
                J[i, row, joint] = motion.jacobian[i, row, joint]
        c1, s1 = motion.axis[i, 1], motion.axis[i, 2]
        J[i, 1, 0] -= z
        J[i, 2, 0] += y
        for joint in (1, 2):
            J[i, 0, joint] += z * c1 - y * s1
            J[i, 1, joint] += x * s1
            J[i, 2, joint] -= x * c1


def foot_positions(leg: LegGeometry, angles: np.ndarray) -> np.ndarray:
    """Foot centres in base axes [m], shape (4, 3), at joint `angles` (12,) [rad]."""
    return leg_motion(leg, angles, np.zeros(12)).position


@jit
def solve_leg(leg: LegGeometry, index: int, foot: np.ndarray | Three) -> tuple[np.ndarray, bool]:
    """
    Joint angles (3,) [rad] that bring one foot to `foot` (3,) in base axes.

    A target out of reach is brought to the nearest radius the leg can have; the second value is
    False then.
    """
    leg = LegGeometry(*leg)
    offset, drop, bend = leg.offset[index], leg.drop[index], leg.bend[index]
    thigh, calf = leg.thigh[index], leg.calf[index]
    x = foot[0] - leg.hip[index, 0]
    y = foot[1] - leg.hip[index, 1]
    z = foot[2] - leg.hip[index, 2]
    squared = y * y + z * z - offset * offset
    reachable = squared > 1e-8
    plane_z = -math.sqrt(max(squared, 1e-8))
    hip = math.atan2(z, y) - math.atan2(plane_z, offset)
    hip = math.pi - (math.pi - hip) % (2.0 * math.pi)

    plane_z += drop
    distance = math.sqrt(x * x + plane_z * plane_z)
    shortest, longest = abs(thigh - calf) + 1e-4, thigh + calf - 1e-4
    reachable = reachable and shortest <= distance and distance <= longest
    distance = min(max(distance, shortest), longest)
    cosine = (distance * distance - thigh * thigh - calf * calf) / (2.0 * thigh * calf)
    knee = math.acos(max(-1.0, min(1.0, cosine)))
    lean = math.atan2(-x, -plane_z)
    inner = math.atan2(calf * math.sin(knee), thigh + calf * math.cos(knee))
    angles = np.empty(3)
    angles[0], angles[1], angles[2] = hip, lean + bend * inner, -bend * knee
    return angles, reachable


def all_leg_angles(leg: LegGeometry, feet: np.ndarray) -> np.ndarray:
    """Joint angles (12,) [rad] that bring all feet to `feet` (4, 3) in base axes."""
    return np.concatenate([solve_leg(plain(leg), index, feet[index])[0] for index in range(4)])
