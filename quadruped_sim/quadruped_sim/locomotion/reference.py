# SPDX-License-Identifier: Apache-2.0
"""Desired motion of the base in trot, now and over the MPC's horizon."""

import math
from typing import NamedTuple

import numpy as np
from robot_description.morphology.quadruped import Scale
from wasd_core.rotations import wrap_angle

from quadruped_sim.estimation.contacts import Ground
from quadruped_sim.parameters import ReferenceParameters
from quadruped_sim.robot_state import RobotState

# Largest correction by the height integral [m], and the velocity error beyond which an error is
# a push, which does not wind the velocity integral faster [m/s]; both on the Go2.
_HEIGHT_INTEGRAL_LIMIT = 0.03
_STEADY_ERROR = 0.3
# Farthest the desired heading runs ahead of the real one [rad].
_YAW_LEASH = 0.3


class BaseReference(NamedTuple):
    """
    Where the base shall be now, world axes.

    `position` (3,), `rpy` (3,), `velocity` (3,) [m/s], `yaw_rate` [rad/s].
    """

    position: np.ndarray
    rpy: np.ndarray
    velocity: np.ndarray
    yaw_rate: float


class Reference:
    """
    Integrates the velocity command into a position and heading that stay near the real ones.

    State: desired x, y, yaw; integrals of velocity (2,), in the yaw frame, and of height, which
    remove the steady loss that rolling, slip and model error leave.
    """

    def __init__(self, params: ReferenceParameters, scale: Scale) -> None:
        self.params = params
        self._height_limit = _HEIGHT_INTEGRAL_LIMIT * scale.of('m')
        self._steady_error = _STEADY_ERROR * scale.of('m/s')
        self._xy = np.zeros(2)
        self._yaw = 0.0
        self._velocity_integral = np.zeros(2)
        self._height_integral = 0.0

    def reset(self, state: RobotState) -> None:
        """Desire the present place and heading, without integrals."""
        self._height: float | None = None
        self._xy = state.base.position[:2].copy()
        self._yaw = float(state.base.rpy[2])
        self._velocity_integral = np.zeros(2)
        self._height_integral = 0.0

    def step(
        self, state: RobotState, command: np.ndarray, ground: Ground, height: float, dt: float
    ) -> BaseReference:
        """
        Advance by `dt` [s] under `command` = (vx, vy, yaw rate), base axes.

        The base is kept `height` [m] above the ground plane, moves with it as it changes, and is
        parallel to the plane.
        """
        params = self.params
        yaw = float(state.base.rpy[2])
        c, s = math.cos(yaw), math.sin(yaw)
        to_world = np.array(((c, -s), (s, c)))
        self._integrate(state, command, to_world, dt)
        velocity = to_world @ (command[:2] + self._velocity_integral)

        self._xy = self._xy + dt * (to_world @ command[:2])
        ahead = self._xy - state.base.position[:2]
        distance = math.hypot(float(ahead[0]), float(ahead[1]))
        if distance > params.position_leash:
            self._xy = state.base.position[:2] + ahead * (params.position_leash / distance)
        yaw_rate = float(command[2])
        error = wrap_angle(self._yaw + dt * yaw_rate - yaw)
        self._yaw = yaw + min(max(error, -_YAW_LEASH), _YAW_LEASH)

        gradient = to_world.T @ ground.gradient
        level = ground.height_at(state.base.position) + height
        self._height_integral += (
            dt * params.height_integral * (level - float(state.base.position[2]))
        )
        self._height_integral = min(
            max(self._height_integral, -self._height_limit), self._height_limit
        )
        rpy = np.array((math.atan(float(gradient[1])), -math.atan(float(gradient[0])), self._yaw))
        position = np.array((*self._xy, level + self._height_integral))
        rise = 0.0 if self._height is None else (height - self._height) / dt
        self._height = height
        climb = float(ground.gradient @ velocity) + rise
        return BaseReference(position, rpy, np.array((*velocity, climb)), yaw_rate)

    def _integrate(
        self, state: RobotState, command: np.ndarray, to_world: np.ndarray, dt: float
    ) -> None:
        """Add the velocity error to its integral."""
        params = self.params
        error = command[:2] - to_world.T @ state.base.velocity[:2]
        limit, steady = params.velocity_integral_limit, self._steady_error
        for axis in (0, 1):
            part = min(max(float(error[axis]), -steady), steady)
            total = float(self._velocity_integral[axis]) + dt * params.velocity_integral * part
            self._velocity_integral[axis] = min(max(total, -limit), limit)


def horizon(
    reference: BaseReference, yaw: float, origin: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """
    Pose and rate references at `times` (N,) [s] from now, each (N, 6), in the base's yaw frame.

    The frame stands at `origin` (3,) in the world, turned by `yaw`. The commanded velocity turns
    with the commanded yaw rate.
    """
    heading = wrap_angle(float(reference.rpy[2]) - yaw)
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = (reference.position - origin).tolist()
    vx, vy, vz = reference.velocity.tolist()
    start = np.array((c * x + s * y, -s * x + c * y))

    rate = reference.yaw_rate
    velocity = np.array((c * vx + s * vy, -s * vx + c * vy))
    rates = np.zeros((len(times), 6))
    rates[:, 2] = rate
    rates[:, 3:5] = turned(velocity, rate * times)
    rates[:, 5] = vz
    pose = np.empty((len(times), 6))
    pose[:, 0], pose[:, 1] = float(reference.rpy[0]), float(reference.rpy[1])
    pose[:, 2] = heading + rate * times
    pose[:, 3:5] = start + travel(velocity, rate, times)
    pose[:, 5] = z + times * vz
    return pose, rates


def turned(vectors: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Vectors (..., 2) in the plane, turned left by `angles` (...) [rad]."""
    cosine, sine = np.cos(angles), np.sin(angles)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack((cosine * x - sine * y, sine * x + cosine * y), axis=-1)


def travel(velocity: np.ndarray, rate: float, times: np.ndarray) -> np.ndarray:
    """Way (N, 2) [m] in `times` (N,) [s] at a velocity (2,) that turns by `rate` [rad/s]."""
    half = 0.5 * rate * times
    # sin(x)/x stays good as the rate goes to zero.
    chord = times * np.sinc(half / math.pi)
    return np.asarray(chord[:, None] * turned(velocity, half))
