# SPDX-License-Identifier: Apache-2.0
"""Where the base is and how fast it moves: a linear Kalman filter on IMU and leg kinematics."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.robot_io import GRAVITY

from quadruped_sim.algebra import cross3
from quadruped_sim.algebra import jit
from quadruped_sim.algebra import plain
from quadruped_sim.algebra import rotate
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.parameters import EstimatorParameters

# Variance added per second to the position of a foot that moves freely.
_SWING_VARIANCE = 100.0
# Share of the base's speed by which a standing leg may be off its velocity.
_DOUBT = 0.1
# How much less a leg in the air says about the base's velocity than one on the ground.
_SWING_FACTOR = 1e6


class ImuSample(NamedTuple):
    """R (3, 3) base to world; `omega` [rad/s] and `acceleration` [m/s^2] (3,) in base axes."""

    R: np.ndarray
    omega: np.ndarray
    acceleration: np.ndarray


class Footing(NamedTuple):
    """How surely each foot stands, (4,) in [0, 1], and the ground's normal (3,), world axes."""

    trust: np.ndarray
    normal: np.ndarray


class Gaussian(NamedTuple):
    """Mean x (6, 3) and covariance P (6, 6): rows are base position, base velocity, four feet."""

    x: np.ndarray
    P: np.ndarray


class SensorModel(NamedTuple):
    """
    Where the IMU is and how round the feet are [m], and the noises' standard deviations.

    Those are of acceleration, standing foot, foot position by joint angles, velocity by a leg.
    `slip` [m/s] is how far that may be off before the foot counts as slipping.
    """

    imu_offset: np.ndarray
    radius: float
    acceleration: float
    foot: float
    kinematics: float
    velocity: float
    slip: float


class KalmanEstimator:
    """
    18 states in world axes: base position, base velocity, four foot centres [Bloesch2012].

    Orientation is the IMU's, so everything left is linear. All noises are the same in x, y and z;
    hence the covariance is one 6 x 6 block (p, v, four feet) that serves the three axes.

    The foot is a ball that rolls: on the ground its centre moves at (calf's angular velocity) x
    (radius up). Taking it to rest, as is usual, reads 5 to 8 % slow on Unitree's feet.

    `trust` in [0, 1] per foot says how surely it stands; 0 means it moves freely.
    """

    def __init__(
        self, params: EstimatorParameters, foot_radius: float, imu_offset: np.ndarray
    ) -> None:
        self._radius = foot_radius
        self._imu_offset = imu_offset
        self.tune(params)
        self.reset(np.zeros(3), np.zeros((4, 3)))

    def tune(self, params: EstimatorParameters) -> None:
        """Take other noises; the estimate stays."""
        self._params = params
        self._sensors = SensorModel(
            self._imu_offset,
            self._radius,
            params.acceleration_noise,
            params.foot_noise,
            params.kinematics_noise,
            params.velocity_noise,
            params.slip_speed,
        )

    def reset(self, position: np.ndarray, feet: np.ndarray) -> None:
        """Start at rest at `position` (3,) with foot centres `feet` (4, 3), world [m]."""
        x = np.vstack((position, np.zeros(3), feet))
        self._estimate = Gaussian(x, np.diag((1e-6, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4)))

    def hold(self, position: np.ndarray, feet: np.ndarray) -> None:
        """Be at rest at `position` (3,) with foot centres `feet` (4, 3), world [m]; no surer."""
        x = self._estimate.x
        x[0], x[1], x[2:] = position, 0.0, feet

    @property
    def position(self) -> np.ndarray:
        """Base position in world (3,) [m]."""
        return np.asarray(self._estimate.x[0])

    @property
    def velocity(self) -> np.ndarray:
        """Base velocity in world axes (3,) [m/s]."""
        return np.asarray(self._estimate.x[1])

    @property
    def feet(self) -> np.ndarray:
        """Foot centres in world (4, 3) [m]."""
        return np.asarray(self._estimate.x[2:])

    @property
    def variances(self) -> tuple[float, float]:
        """Variance of position [m^2] and of velocity [m^2/s^2] per axis."""
        return float(self._estimate.P[0, 0]), float(self._estimate.P[1, 1])

    def step(
        self, imu: ImuSample, motion: LegMotion, trust: np.ndarray, normal: np.ndarray, dt: float
    ) -> None:
        """Predict by the accelerometer, correct by the legs; `normal` is the ground's, world."""
        footing = plain(Footing(trust, normal))
        _filter_step(
            plain(self._estimate), plain(imu), plain(motion), footing, plain(self._sensors), dt
        )
        self._anchor(trust, dt)

    def _anchor(self, trust: np.ndarray, dt: float) -> None:
        """
        Draw feet that stand near the start level to it, taking the robot with them.

        Leg odometry has no height reference and drifts. On level ground this removes the drift;
        beyond `level_band` the ground has really changed and nothing is done.
        """
        total = float(trust.sum())
        if total < 1.0:
            return
        level = float(trust @ self._estimate.x[2:, 2]) / total - self._radius
        if math.fabs(level) < self._params.level_band:
            self._estimate.x[0, 2] -= dt / self._params.level_time * level
            self._estimate.x[2:, 2] -= dt / self._params.level_time * level


@jit
def _filter_step(
    estimate: Gaussian,
    imu: ImuSample,
    motion: LegMotion,
    footing: Footing,
    sensors: SensorModel,
    dt: float,
) -> None:
    """Predict and correct `estimate` in place."""
    motion = LegMotion(*motion)
    footing = Footing(*footing)
    sensors = SensorModel(*sensors)
    x, P = estimate
    R, omega, _ = imu
    foot, trust = motion.position, footing.trust.copy()
    _predict_base(estimate, imu, sensors, dt)
    radius = np.empty(3)  # from a contact point to the centre of its foot, world axes
    for k in range(3):
        radius[k] = sensors.radius * footing.normal[k]
    velocity = np.empty((4, 3))
    calf = np.empty(3)
    for i in range(4):
        for k in range(3):
            calf[k] = motion.calf_rate[i, k] + omega[k]
        rolling = cross3(rotate(R, calf), radius)
        swept = cross3(omega, foot[i])
        for k in range(3):
            swept[k] += motion.velocity[i, k]
        swept = rotate(R, swept)
        for k in range(3):
            velocity[i, k] = rolling[k] - swept[k]
        if _slips(estimate, velocity[i], footing.normal, sensors.slip):
            trust[i] = 0.0
        for k in range(3):
            x[2 + i, k] += dt * trust[i] * rolling[k]
        P[2 + i, 2 + i] += (sensors.foot * sensors.foot + (1.0 - trust[i]) * _SWING_VARIANCE) * dt

    # Independent noises: measurements may be taken one after the other.
    h = np.empty(6)
    for i in range(4):
        h[:] = 0.0
        h[0], h[2 + i] = -1.0, 1.0
        _scalar_update(estimate, h, rotate(R, foot[i]), sensors.kinematics * sensors.kinematics)
    for i in range(4):
        h[:] = 0.0
        h[1] = 1.0
        noise = sensors.velocity * sensors.velocity * (1.0 + (1.0 - trust[i]) * _SWING_FACTOR)
        _scalar_update(estimate, h, velocity[i], noise)


@jit
def _slips(estimate: Gaussian, velocity: np.ndarray, normal: np.ndarray, limit: float) -> bool:
    """
    Whether a leg's word on the base's velocity is off along the ground by more than `limit` [m/s].

    A quick base is known less well, and so is one that three deviations of the filter leave open:
    feet that all slip cannot be doubted for ever.
    """
    x, P = estimate
    squared = speed = off = 0.0
    for k in range(3):
        difference = velocity[k] - x[1, k]
        squared += difference * difference
        off += normal[k] * difference
        speed += x[1, k] * x[1, k]
    limit += _DOUBT * math.sqrt(speed)
    return bool(squared - off * off > limit * limit + 9.0 * P[1, 1])


@jit
def _predict_base(estimate: Gaussian, imu: ImuSample, sensors: SensorModel, dt: float) -> None:
    """Move base position and velocity by the accelerometer."""
    x, P = estimate
    R, omega, acceleration = imu
    # The IMU does not sit at the base's origin: take its centripetal part off.
    whirl = cross3(omega, cross3(omega, sensors.imu_offset))
    for k in range(3):
        whirl[k] = acceleration[k] - whirl[k]
    force = rotate(R, whirl)
    force[2] -= GRAVITY
    for k in range(3):
        x[0, k] += dt * x[1, k] + 0.5 * dt * dt * force[k]
        x[1, k] += dt * force[k]
    for k in range(6):
        P[0, k] += dt * P[1, k]
    for k in range(6):
        P[k, 0] += dt * P[k, 1]
    q = sensors.acceleration * sensors.acceleration * dt
    P[0, 0] += q * dt * dt / 3.0
    P[0, 1] += q * dt / 2.0
    P[1, 0] += q * dt / 2.0
    P[1, 1] += q


@jit
def _scalar_update(estimate: Gaussian, h: np.ndarray, measured: np.ndarray, noise: float) -> None:
    """Take one measurement h x = `measured` (3,), of variance `noise` in each axis, in place."""
    x, P = estimate
    Ph = np.zeros(6)
    for i in range(6):
        for j in range(6):
            Ph[i] += P[i, j] * h[j]
    spread = noise
    for j in range(6):
        spread += h[j] * Ph[j]
    for k in range(3):
        innovation = measured[k]
        for j in range(6):
            innovation -= h[j] * x[j, k]
        for j in range(6):
            x[j, k] += Ph[j] / spread * innovation
    for i in range(6):
        for j in range(6):
            P[i, j] -= Ph[i] * Ph[j] / spread
