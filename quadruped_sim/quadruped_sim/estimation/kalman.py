# SPDX-License-Identifier: Apache-2.0
"""Where the base is and how fast it moves: a linear Kalman filter on IMU and leg kinematics."""

import math
from typing import Any, NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY, ImuReading

from quadruped_sim.algebra import cross3, flatten, plain, put, rotate, rotate_back, view_of
from quadruped_sim.estimation.ground import fit_plane, height_at
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.robot_state import turn_base
from quadruped_sim.tuning import EstimatorParameters

# Variance added per second to the position of a foot that moves freely.
_SWING_VARIANCE = 100.0
# Error of the acceleration per root second, by its size: readings miss a blow between them.
_SCALE = 0.01
# Share of its trust below which a foot is far off, beside one that fits: four times the expected.
_FAR = 1.0 / 17.0
# Speed of the base, over `slip_speed`, at which a leg that stands is off by twice as much.
_QUICK = 20.0
# Least share of belief in a foot that counts at all.
_LEAST = 1e-3
# A level of even ground so near to the start's is the same [m], in the long run [s].
_START, _RETURN = 0.02, 1.0
# Rise over way that ground has at most, and that on rough ground is missed at most.
_STEEPEST, _CREEP = 1.0, 0.015
# On rough ground feet are drawn to the level so much more slowly: what they say drifts less in
# 10 m than the sum of slopes between feet on boxes strays. A floor on which a tight turn rocks
# the robot feels half as rough as boxes: only ground that is rougher counts.
_SLOWER, _ROUGH, _SHARP = 60.0, 0.7, 6
# A robot is thrown that tilts beyond this cosine, or that is struck or is as fast as no leg makes
# it [m/s^2], [m/s]: a blow is a mean of so long [s].
_UPRIGHT, _BLOW, _FASTEST, _STRUCK = 0.9, 18.0, 4.0, 0.1
# For so long after that the ground's level is that of before, so much longer while it may skid,
# and feet are to stand far off it until it is theirs [s]. For so long after a blow what feels
# rough is how it skids, and what is remembered of that [s].
_HELD, _SKID, _STAY, _SHAKEN = 1.0, 1.0, 0.5, 4.0


class ImuSample(NamedTuple):
    """R (3, 3) base to world; `omega` [rad/s] and `acceleration` [m/s^2] (3,) in base axes."""

    R: np.ndarray
    omega: np.ndarray
    acceleration: np.ndarray


class Footing(NamedTuple):
    """
    What is known of where the feet stand.

    `trust` (4,) in [0, 1] says how surely each does; the ground has a unit `normal` (3,), world
    axes. A robot that `is_walking` stood last on `plane`, a flat `Plane`; one that jumps or stands
    `may_land` on other ground. It felt its ground to be rough by `roughness`, from 0 to 1, or sees
    that it `is_broken`: steps, no plane.
    """

    trust: np.ndarray
    normal: np.ndarray
    plane: np.ndarray
    is_walking: bool
    may_land: bool
    roughness: float
    is_broken: bool = False


class Gaussian(NamedTuple):
    """
    Mean x (7, 3) and covariance P (7, 7).

    Rows are position and velocity of the IMU, four feet, all in world axes, and the bias of the
    accelerometer, in base axes. `lever` (3,) is from the base's origin to the IMU and `whirl` (3,)
    what that moves by, of turning, world axes; `belief` (4,) says how far each foot was believed,
    `level` (1,) how high the ground is that the robot is on [m], above that at the start, and
    `strayed` (1,) for how long its feet have stood far off that, and `calm` (1,) since when it has
    not been thrown [s], below 0 while it may skid. `struck` (2,) is the mean of its acceleration
    of late, world x and y, and `shaken` (1,) for how long the ground's roughness is not known [s].
    Until it `is_placed` the first row is of the base: it is not known yet where the IMU is.
    """

    x: np.ndarray
    P: np.ndarray
    lever: np.ndarray
    whirl: np.ndarray
    belief: np.ndarray
    level: np.ndarray
    strayed: np.ndarray
    calm: np.ndarray
    struck: np.ndarray
    shaken: np.ndarray
    is_placed: np.ndarray


class KalmanEstimator:
    """
    21 states: IMU position and velocity, four foot centres, accelerometer bias [Bloesch2012].

    Orientation is taken as known, so everything left is linear, and one covariance (7, 7) serves
    the three axes. The foot is a ball that rolls [Li2026]: taken to rest, Unitree's read 5 to 8 %
    slow. `trust` in [0, 1] per foot says how surely it stands by schedule and force; 0 means it
    moves freely. How surely by its motion is found here (`belief`).
    """

    def __init__(
        self, params: EstimatorParameters, foot_radius: float, imu_offset: np.ndarray
    ) -> None:
        # Beside the parameters: the IMU in the base (3,) and the radius of the feet [m].
        self._robot = {'imu_offset': imu_offset, 'radius': foot_radius}
        blank = Gaussian(
            *(np.zeros(shape) for shape in ((7, 3), (7, 7), 3, 3, 4, 1, 1, 1, 2, 1, 1))
        )
        blank = blank._replace(is_placed=np.zeros(1, dtype=bool))
        self._flat = flatten(blank)
        self._estimate: Gaussian = view_of(self._flat, blank)
        self.tune(params)
        self.reset(np.zeros(3), np.zeros((4, 3)))

    def tune(self, params: EstimatorParameters) -> None:
        """Take other noises; the estimate stays."""
        self._params = params
        self._sensors = flatten(vars(params) | self._robot)

    def reset(self, position: np.ndarray, feet: np.ndarray, level: float = 0.0) -> None:
        """Start at rest at `position` (3,), feet (4, 3) on ground at a `level`, world [m]."""
        estimate, bias = self._estimate, self._params.bias**2
        estimate.x[:] = np.vstack((position, np.zeros(3), feet, np.zeros(3)))
        estimate.P[:] = np.diag((1e-6, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4, bias))
        estimate.lever[:], estimate.whirl[:], estimate.belief[:] = 0.0, 0.0, 1.0
        estimate.level[:], estimate.strayed[:], estimate.calm[:] = level, 0.0, _HELD
        estimate.struck[:], estimate.shaken[:] = 0.0, 0.0
        estimate.is_placed[:] = False

    def hold(self, position: np.ndarray, feet: np.ndarray) -> None:
        """Be at rest at `position` (3,) with foot centres `feet` (4, 3), world [m]; no surer."""
        x = self._estimate.x
        x[0], x[1], x[2:6] = position, 0.0, feet
        self._estimate.lever[:], self._estimate.whirl[:] = 0.0, 0.0
        self._estimate.strayed[:], self._estimate.is_placed[:] = 0.0, False

    @property
    def position(self) -> np.ndarray:
        """Base position in world (3,) [m]."""
        return np.asarray(self._estimate.x[0] - self._estimate.lever)

    @property
    def velocity(self) -> np.ndarray:
        """Base velocity in world axes (3,) [m/s]."""
        return np.asarray(self._estimate.x[1] - self._estimate.whirl)

    @property
    def level(self) -> float:
        """Height of the ground that it is on, above that at the start [m]."""
        return float(self._estimate.level[0])

    @property
    def variances(self) -> tuple[float, float]:
        """Variance of position [m^2] and of velocity [m^2/s^2] per axis."""
        return float(self._estimate.P[0, 0]), float(self._estimate.P[1, 1])

    def step(
        self,
        robot: np.ndarray,
        imu: ImuReading,
        drift: tuple[float, float],
        footing: Footing,
        dt: float,
    ) -> None:
        """
        Predict by the accelerometer, correct by the legs of a flat `RobotState`.

        Its base is written: orientation and angular velocity by `turn_base`, which takes `drift`,
        place and velocity by the estimate.
        """
        _follow(self._flat, robot, plain(imu), plain(footing), self._sensors, (*drift, dt))


@jit
def _anchor(
    estimate: Gaussian, footing: Footing, sensors: Any, dt: float, is_thrown: bool
) -> None:
    """
    Draw feet that stand on even ground to its level, and to where others stood before them.

    The robot is taken with them. Leg odometry has no height reference and drifts: at speed a foot
    lands hard, sinks in, and rises while it is believed. What feet stand off the plane of the
    steps before is such drift, as footfalls lie on one ground [Sun2026]; left alone it would raise
    the plane over the robot, whose feet, led there, would land the harder. Feet around the middle
    of the base tell, whatever the slope of that plane.
    """
    trust, plane, feet = footing.trust, footing.plane[0], estimate.x[2:6]
    total = height = off = ahead = left = 0.0
    for i in range(4):
        above = feet[i, 2] - sensors.radius
        total += trust[i]
        height += trust[i] * above
        off += trust[i] * (above - height_at(plane, feet[i, 0], feet[i, 1]))
        ahead += trust[i] * (feet[i, 0] - estimate.x[0, 0] + estimate.lever[0])
        left += trust[i] * (feet[i, 1] - estimate.x[0, 1] + estimate.lever[1])
    estimate.calm[0] = min(estimate.calm[0], 0.0) if is_thrown else estimate.calm[0] + dt
    estimate.shaken[0] -= dt
    even = _raise_level(estimate, footing, sensors, dt)
    if is_thrown or total < 1e-9:
        return
    height, off, ahead, left = height / total, off / total, ahead / total, left / total
    if footing.is_walking:  # on a slope the level is that below the base
        height -= plane.gradient[0] * ahead + plane.gradient[1] * left
        if footing.is_broken:  # each tread has its own: the feet carry the level along
            estimate.level[0], estimate.strayed[0] = height, 0.0
            return
    speed, known = math.hypot(estimate.x[1, 0], estimate.x[1, 1]), min(total, 1.0) * dt
    off_level = _level(estimate, footing, (height, even, speed), sensors, known)
    roughness = 0.0 if estimate.shaken[0] > 0.0 else footing.roughness
    rough = min(roughness / _ROUGH, 1.0) ** _SHARP
    time = sensors.level_time * (1.0 + _SLOWER * rough)
    shift = -known / time * off_level
    if footing.is_walking and abs(off) < sensors.step_band:
        aside = math.hypot(ahead, left) / sensors.step_middle
        draw = max(1.0 - aside, 0.0) * min(speed / sensors.step_speed, 1.0) ** 2
        shift -= dt / sensors.step_time * draw * off
    estimate.x[0, 2] += shift
    for i in range(4):
        feet[i, 2] += shift


@jit
def _raise_level(
    estimate: Gaussian, footing: Footing, sensors: EstimatorParameters, dt: float
) -> float:
    """
    Raise the level as the ground does on the way; return how even that is, from 0 to 1.

    Drift moves all feet alike, so that it does not show in the slope between them.
    """
    if not footing.is_walking or estimate.calm[0] < _HELD:
        return 1.0
    plane, velocity = footing.plane[0], estimate.x[1]
    slope = math.hypot(plane.gradient[0], plane.gradient[1]) / sensors.level_slope
    even = max(1.0 - slope * slope, 0.0)
    _, gx, gy = fit_plane(plane.points, _STEEPEST)
    estimate.level[0] += dt * (1.0 - even) * (gx * velocity[0] + gy * velocity[1])
    return even


@jit
def _level(
    estimate: Gaussian,
    footing: Footing,
    ground: tuple[float, float, float],
    sensors: EstimatorParameters,
    dt: float,
) -> float:
    """
    Follow the ground's level; return how far above it the feet are that are drawn to it [m].

    `ground` tells the height that the feet say [m], how even it is, from 0 to 1, and how fast the
    robot crosses it [m/s]. The slope between the feet has told what it rises by; where it is rough
    the level creeps toward the feet besides. A robot that walks comes onto other ground by no
    other way: if its feet are far off, it was thrown. One that jumps or stands may be on other
    ground: its level is that of the feet once they have stood there for a while.
    """
    height, even, speed = ground
    level, off = estimate.level[0], height - estimate.level[0]
    if footing.may_land and abs(off) > sensors.level_band:
        estimate.strayed[0] += dt
        if estimate.strayed[0] > _STAY:
            estimate.level[0] = height
        return 0.0
    estimate.strayed[0] = 0.0
    if estimate.calm[0] < _HELD:
        return float(off)
    most = footing.roughness * _CREEP * speed * dt
    level += min(max(off, -most), most)
    if abs(level) < _START:
        level -= dt / _RETURN * even * (1.0 - footing.roughness) * level
    estimate.level[0] = level
    return float(height - level)


@jit
def _follow(
    flat_estimate: np.ndarray,
    robot: np.ndarray,
    imu: ImuReading,
    footing: Footing,
    flat_sensors: np.ndarray,
    tick: tuple[float, float, float],
) -> None:
    """Advance a flat `Gaussian`, and write the base; `tick` is the heading's drift, and dt."""
    base, estimate, dt = robot[0].base, flat_estimate[0], tick[2]
    orientation, omega, acceleration = imu
    turn_base(robot, orientation, omega, tick[:2])
    sample = ImuSample(base.R, base.omega, acceleration)
    _filter_step(flat_estimate, sample, robot[0].motion, Footing(*footing), flat_sensors, dt)
    for k in range(3):
        base.position[k] = estimate.x[0, k] - estimate.lever[k]
        base.velocity[k] = estimate.x[1, k] - estimate.whirl[k]


@jit
def _filter_step(
    flat_estimate: np.ndarray,
    imu: ImuSample,
    motion: LegMotion,
    footing: Footing,
    flat_sensors: np.ndarray,
    dt: float,
) -> None:
    """Predict and correct a flat `Gaussian`."""
    estimate, sensors = flat_estimate[0], flat_sensors[0]
    x, P, R = estimate.x, estimate.P, imu.R
    put(estimate.lever, rotate(R, sensors.imu_offset))
    for k in range(3):
        if not estimate.is_placed[0]:  # the first of all readings
            x[0, k] += estimate.lever[k]
    estimate.is_placed[0] = True
    put(estimate.whirl, rotate(R, cross3(imu.omega, sensors.imu_offset)))
    put(x[6], rotate(R, x[6]))  # into world axes, and back in the end
    _predict_base(estimate, imu, sensors, dt)
    reach, velocity, rolling = _legs(imu, motion, footing.normal, sensors)
    _believe(estimate, footing.trust, velocity, sensors.slip_speed)
    belief = estimate.belief
    # Independent noises: measurements may be taken one after the other.
    for i in range(4):
        share = max(belief[i], _LEAST)
        for k in range(3):
            x[2 + i, k] += dt * belief[i] * rolling[i, k]
        P[2 + i, 2 + i] += dt * min((sensors.foot_noise / share) ** 2, _SWING_VARIANCE)
        h = np.zeros(7)
        h[0], h[2 + i] = -1.0, 1.0
        _scalar_update(estimate, h, reach[i], sensors.kinematics_noise**2)
    for i in range(4):
        if belief[i] > _LEAST:
            h = np.zeros(7)
            h[1] = 1.0
            noise = sensors.velocity_noise**2 / belief[i]
            _scalar_update(estimate, h, velocity[i], noise)
    put(x[6], rotate_back(R, x[6]))
    is_thrown = R[2, 2] < _UPRIGHT or math.hypot(imu.omega[0], imu.omega[1]) > sensors.level_rate
    struck = math.hypot(estimate.struck[0], estimate.struck[1]) > _BLOW
    if struck or math.hypot(x[1, 0], x[1, 1]) > _FASTEST:
        estimate.calm[0], estimate.shaken[0] = -_SKID, _SHAKEN
    _anchor(estimate, footing, sensors, dt, is_thrown)


@jit
def _legs(
    imu: ImuSample, motion: LegMotion, normal: np.ndarray, sensors: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return what each leg says, world axes, each (4, 3).

    That are the foot's centre as seen from the IMU [m], and the velocities [m/s] of the IMU if the
    foot stands, and of the foot's centre as it then rolls.
    """
    R, omega, _ = imu
    radius = np.empty(3)  # from a contact point to the centre of its foot
    for k in range(3):
        radius[k] = sensors.radius * normal[k]
    reach, velocity, rolling = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    arm, calf, relative = np.empty(3), np.empty(3), np.empty(3)
    for i in range(4):
        for k in range(3):
            arm[k] = motion.position[i, k] - sensors.imu_offset[k]
            calf[k] = motion.calf_rate[i, k] + omega[k]
        swept = cross3(omega, arm)
        for k in range(3):
            relative[k] = swept[k] + motion.velocity[i, k]
        put(reach[i], rotate(R, arm))
        put(rolling[i], cross3(rotate(R, calf), radius))
        moves = rotate(R, relative)
        for k in range(3):
            velocity[i, k] = rolling[i, k] - moves[k]
    return reach, velocity, rolling


@jit
def _believe(estimate: Gaussian, trust: np.ndarray, velocity: np.ndarray, slip: float) -> None:
    """
    Find how far each foot is believed: its trust, less where its velocity does not fit.

    The weight 1 / (1 + d^2) of a disagreement d times what is expected is Cauchy's: feet that all
    slip hardly pull, but they do pull, so that a prediction gone wrong (a hard landing between
    two readings) is found again. Beside a foot that fits, one that is far off is left out.
    """
    x, P, belief = estimate.x, estimate.P, estimate.belief
    # In a quick gait legs that stand are off as well, most of all up and down at landing.
    speed = (x[1, 0] ** 2 + x[1, 1] ** 2 + x[1, 2] ** 2) / (_QUICK * slip) ** 2
    expected = (slip * (1.0 + speed)) ** 2 + 3.0 * P[1, 1]
    best = 0.0
    for i in range(4):
        square = 0.0
        for k in range(3):
            square += (velocity[i, k] - x[1, k]) ** 2
        belief[i] = trust[i] / (1.0 + square / expected)
        best = max(best, belief[i])
    for i in range(4):
        if best > 0.5 and belief[i] < _FAR * trust[i]:
            belief[i] = 0.0


@jit
def _predict_base(
    estimate: Gaussian, imu: ImuSample, sensors: EstimatorParameters, dt: float
) -> None:
    """Move the IMU by what its accelerometer feels, less the bias."""
    x, P = estimate.x, estimate.P
    felt, force, square = rotate(imu.R, imu.acceleration), np.empty(3), 0.0
    for k in range(3):
        force[k] = (felt[k] - GRAVITY if k == 2 else felt[k]) - x[6, k]
        square += force[k] * force[k]
        if k < 2:
            estimate.struck[k] += min(dt / _STRUCK, 1.0) * (force[k] - estimate.struck[k])
        x[0, k] += dt * x[1, k] + 0.5 * dt * dt * force[k]
        x[1, k] += dt * force[k]
    for k in range(7):
        P[0, k] += dt * P[1, k] - 0.5 * dt * dt * P[6, k]
        P[1, k] -= dt * P[6, k]
    for k in range(7):
        P[k, 0] += dt * P[k, 1] - 0.5 * dt * dt * P[k, 6]
        P[k, 1] -= dt * P[k, 6]
    q = (sensors.acceleration_noise**2 + _SCALE * _SCALE * square) * dt
    P[0, 0] += q * dt * dt / 3.0
    P[0, 1] += q * dt / 2.0
    P[1, 0] += q * dt / 2.0
    P[1, 1] += q
    P[6, 6] += sensors.bias_noise**2 * dt


@jit
def _scalar_update(estimate: Gaussian, h: np.ndarray, measured: np.ndarray, noise: float) -> None:
    """Take one measurement h x = `measured` (3,), of variance `noise` in each axis, in place."""
    x, P = estimate.x, estimate.P
    size = len(h)
    Ph = np.zeros(size)
    for i in range(size):
        for j in range(size):
            Ph[i] += P[i, j] * h[j]
    spread = noise
    for j in range(size):
        spread += h[j] * Ph[j]
    for k in range(3):
        innovation = measured[k]
        for j in range(size):
            innovation -= h[j] * x[j, k]
        for j in range(size):
            x[j, k] += Ph[j] / spread * innovation
    for i in range(size):
        for j in range(size):
            P[i, j] -= Ph[i] * Ph[j] / spread
