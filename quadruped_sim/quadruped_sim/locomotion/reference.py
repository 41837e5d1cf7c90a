# SPDX-License-Identifier: Apache-2.0
"""Desired motion of the base in trot, now and over the MPC's horizon."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import flatten, plain
from quadruped_sim.estimation.ground import height_at, Plane
from quadruped_sim.robot_state import RobotState

# Largest correction by the height integral [m], and the velocity error beyond which an error is
# a push, which does not wind the velocity integral faster [m/s]; both on the Go2.
_HEIGHT_INTEGRAL_LIMIT = 0.03
_STEADY_ERROR = 0.3
# Farthest the desired heading runs ahead of the real one [rad].
_YAW_LEASH = 0.3
# Slope on which trunk and nose are no higher than the slope has them [rad]: more would tip the
# robot over.
STEEP = 0.35


class BaseReference(NamedTuple):
    """
    The desired state of the base now, world axes.

    `position` (3,), `rpy` (3,), `velocity` (3,) [m/s], `yaw_rate` [rad/s].
    """

    position: np.ndarray
    rpy: np.ndarray
    velocity: np.ndarray
    yaw_rate: float


def blank_reference() -> BaseReference:
    """Return a reference to be written into."""
    return BaseReference(np.empty(3), np.empty(3), np.empty(3), 0.0)


class ReferenceState(NamedTuple):
    """What `Reference` keeps: see there. Its `height` is NaN before the first step."""

    xy: np.ndarray
    velocity_integral: np.ndarray
    yaw: float = 0.0
    height_integral: float = 0.0
    height: float = math.nan


class Reference:
    """
    Integrates the velocity command into a position and heading that stay near the real ones.

    State: desired x, y, yaw; integrals of velocity (2,), in the yaw frame, and of height, which
    remove the steady loss that rolling, slip and model error leave.
    """

    def __init__(self) -> None:
        self.flat = flatten(ReferenceState(np.zeros(2), np.zeros(2)))

    def reset(self, state: RobotState) -> None:
        """Desire the present place and heading, without integrals."""
        here, yaw = state.base.position[:2], float(state.base.rpy[2])
        self.flat[:] = flatten(ReferenceState(here, np.zeros(2), yaw))

    def stay(self, state: RobotState) -> None:
        """Desire to be here: a trunk that has come to rest is not to be drawn back."""
        self.flat['xy'] = state.base.position[:2]


@jit
def advance(
    flat_own: np.ndarray,
    rules: np.ndarray,
    robot: np.ndarray,
    plane: Plane,
    asked: tuple[np.ndarray, float, float, float],
    wanted: BaseReference,
) -> None:
    """
    Advance a flat `ReferenceState`, and write the reference.

    `asked` are (vx, vy, yaw rate), base axes, how high the base is kept above the plane [m], to
    which it is parallel but for its nose, how far that is up going ahead [rad], and dt [s].
    """
    own, rule, base = flat_own[0], rules[0].reference, robot[0].base
    command, height, nose, dt = asked
    wanted = BaseReference(*wanted)
    position, velocity = wanted.position, wanted.velocity
    yaw = base.rpy[2]
    c, s = math.cos(yaw), math.sin(yaw)
    vx, vy = base.velocity[0], base.velocity[1]
    error = command[0] - c * vx - s * vy, command[1] + s * vx - c * vy
    steady, limit = _STEADY_ERROR * rules[0].speed, rule.velocity_integral_limit
    for axis in range(2):
        part = min(max(error[axis], -steady), steady)
        total = own.velocity_integral[axis] + dt * rule.velocity_integral * part
        own.velocity_integral[axis] = min(max(total, -limit), limit)
    vx, vy = command[0] + own.velocity_integral[0], command[1] + own.velocity_integral[1]
    velocity[0], velocity[1] = c * vx - s * vy, s * vx + c * vy

    own.xy[0] += dt * (c * command[0] - s * command[1])
    own.xy[1] += dt * (s * command[0] + c * command[1])
    x, y = own.xy[0] - base.position[0], own.xy[1] - base.position[1]
    distance = math.hypot(x, y)
    if distance > rule.position_leash:
        own.xy[0] = base.position[0] + x * (rule.position_leash / distance)
        own.xy[1] = base.position[1] + y * (rule.position_leash / distance)
    ahead = own.yaw + dt * command[2] - yaw
    ahead = math.pi - (math.pi - ahead) % (2.0 * math.pi)
    own.yaw = yaw + min(max(ahead, -_YAW_LEASH), _YAW_LEASH)

    level = height_at(plane, base.position[0], base.position[1]) + height
    total = own.height_integral + dt * rule.height_integral * (level - base.position[2])
    limit = _HEIGHT_INTEGRAL_LIMIT * rules[0].length
    own.height_integral = min(max(total, -limit), limit)
    gx, gy = plane.gradient[0], plane.gradient[1]
    wanted.rpy[0], wanted.rpy[1] = math.atan(c * gy - s * gx), -math.atan(c * gx + s * gy)
    if command[0] > 0.0:
        wanted.rpy[1] -= nose * max(1.0 - abs(wanted.rpy[1]) / STEEP, 0.0)
    wanted.rpy[2] = own.yaw
    position[0], position[1], position[2] = own.xy[0], own.xy[1], level + own.height_integral
    rise = 0.0 if math.isnan(own.height) else (height - own.height) / dt
    own.height = height
    velocity[2] = gx * velocity[0] + gy * velocity[1] + rise


def horizon(
    reference: BaseReference, yaw: float, origin: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """
    Pose and rate references at `times` (N,) [s] from now, each (N, 6), in the base's yaw frame.

    The frame stands at `origin` (3,) in the world, turned by `yaw`. The commanded velocity turns
    with the commanded yaw rate.
    """
    pose, rates = np.empty((len(times), 6)), np.empty((len(times), 6))
    _look_ahead(plain(reference), yaw, origin, times, (pose, rates))
    return pose, rates


@jit
def _look_ahead(
    reference: BaseReference,
    yaw: float,
    origin: np.ndarray,
    times: np.ndarray,
    out: tuple[np.ndarray, np.ndarray],
) -> None:
    reference = BaseReference(*reference)
    pose, rates = out
    rpy, rate, height = reference.rpy, reference.yaw_rate, reference.position[2] - origin[2]
    ahead, left = reference.position[0] - origin[0], reference.position[1] - origin[1]
    x, y = turned(ahead, left, -yaw)
    vx, vy = turned(reference.velocity[0], reference.velocity[1], -yaw)
    heading = math.pi - (math.pi - (rpy[2] - yaw)) % (2.0 * math.pi)
    for n in range(len(times)):
        t = times[n]
        dx, dy = travel(vx, vy, rate, t)
        pose[n, 0], pose[n, 1], pose[n, 2] = rpy[0], rpy[1], heading + rate * t
        pose[n, 3], pose[n, 4], pose[n, 5] = x + dx, y + dy, height + t * reference.velocity[2]
        rates[n, 0], rates[n, 1], rates[n, 2] = 0.0, 0.0, rate
        rates[n, 3], rates[n, 4] = turned(vx, vy, rate * t)
        rates[n, 5] = reference.velocity[2]


@jit
def turned(x: float, y: float, angle: float) -> tuple[float, float]:
    """Return a vector in the plane turned left by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return c * x - s * y, s * x + c * y


@jit
def travel(vx: float, vy: float, rate: float, time: float) -> tuple[float, float]:
    """Way [m] in a time [s] at a velocity that turns by `rate` [rad/s]."""
    half = 0.5 * rate * time
    # sin(x)/x stays good as the rate goes to zero.
    chord = time * (math.sin(half) / half if abs(half) > 1e-12 else 1.0)
    return turned(chord * vx, chord * vy, half)
