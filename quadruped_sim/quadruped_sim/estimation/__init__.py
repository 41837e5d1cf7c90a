# SPDX-License-Identifier: Apache-2.0
"""Which feet touch, by joint torques alone, the plane on which they stand, and their grip."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import (
    cross3,
    flatten,
    rotate,
    rotate_back,
    solve_in_place,
    Three,
    view_of,
)
from quadruped_sim.tuning import ContactParameters, GripParameters, GroundParameters

# Cosine between motion and force of a foot below which it slips: -1, but for what is not known.
_OPPOSED = -0.9


class Felt(NamedTuple):
    """
    State of the momentum observer, both (12,): its integral and J'f as far as it is seen.

    Of that follow the feet's forces (4, 3) [N], what they bear (4,) [N] and which touch (4,).
    The first step, before it `is_started`, takes the present momentum for all that is known.
    """

    integral: np.ndarray
    residual: np.ndarray
    forces: np.ndarray
    normal_forces: np.ndarray
    is_contact: np.ndarray
    is_started: np.ndarray


class TouchRule(NamedTuple):
    """Bandwidth of the observer [1/s]; touch ends below the force `off` and begins at `on` [N]."""

    bandwidth: float
    off: float
    on: float


class ContactDetector:
    """
    Estimates the force on each foot and whether it touches.

    The joint momentum p obeys dp/dt = tau + C'v - g + J'f. A residual driven by the part of p that
    the known terms do not explain is J'f low-passed at `bandwidth` [DeLuca2006].
    State: the observer, the forces (4, 3) [N] in base axes, contact flags with hysteresis.
    """

    def __init__(self, params: ContactParameters) -> None:
        self.params = params
        flags, flag = np.zeros(4, dtype=bool), np.zeros(1, dtype=bool)
        blank = Felt(np.zeros(12), np.zeros(12), np.zeros((4, 3)), np.zeros(4), flags, flag)
        self.flat = flatten(blank)
        self._felt: Felt = view_of(self.flat, blank)
        self.forces, self.normal_forces = self._felt.forces, self._felt.normal_forces
        self.is_contact = self._felt.is_contact
        self.reset()

    def reset(self) -> None:
        """Forget the past; the next step starts from zero force."""
        for part in self._felt:
            part[:] = 0

    @property
    def rule(self) -> TouchRule:
        """What forces are felt by."""
        params = self.params
        return TouchRule(params.bandwidth, params.force_off, params.force_on)


@jit
def feel_touch(
    flat_felt: np.ndarray, robot: np.ndarray, torque: np.ndarray, rule: TouchRule, dt: float
) -> None:
    """
    Advance a flat `Felt` by the joints' torques (12,) [N m] in a flat `RobotState`.

    What feet bear is left to be found: see `find_touch`.
    """
    felt, state = flat_felt[0], robot[0]
    integral, residual, forces = felt.integral, felt.residual, felt.forces
    drift, momentum = state.dynamics.momentum_drift, state.dynamics.momentum
    # Faster than the steps the observer would swing, and from twice that on without end.
    rate = min(rule.bandwidth, 1.0 / max(dt, 1e-9))
    for k in range(12):
        if not felt.is_started[0]:
            integral[k] = momentum[k]
        integral[k] += dt * (torque[k] + drift[k] + residual[k])
        residual[k] = rate * (momentum[k] - integral[k])
    felt.is_started[0] = True
    damped, pull = np.empty((3, 3)), np.empty((3, 1))
    for i in range(4):
        J = state.motion.jacobian[i]
        # On a nearly straight leg J is nearly singular along the leg; the pull stays bounded.
        for row in range(3):
            pull[row, 0] = 0.0
            for k in range(3):
                pull[row, 0] += J[row, k] * residual[3 * i + k]
                damped[row, k] = 1e-5 if row == k else 0.0
                for m in range(3):
                    damped[row, k] += J[row, m] * J[k, m]
        solve_in_place(damped, pull)
        for k in range(3):
            forces[i, k] = pull[k, 0]


@jit
def find_touch(flat_felt: np.ndarray, normal: Three, rule: TouchRule) -> None:
    """Write what the feet bear and which touch, with `normal` up in base axes."""
    felt = flat_felt[0]
    for i in range(4):
        bears = 0.0
        for k in range(3):
            bears += felt.forces[i, k] * normal[k]
        felt.normal_forces[i] = bears
        felt.is_contact[i] = bears > (rule.off if felt.is_contact[i] else rule.on)


class Plane(NamedTuple):
    """
    Where the feet stood last, (4, 3), and the plane's centre (2,), gradient (2,) and height there.

    Its unit `normal` (3,) points up, world axes; `frame` (3, 3) turns axes on the ground
    (z = normal, x nearly world x) into the world.
    """

    points: np.ndarray
    centre: np.ndarray
    gradient: np.ndarray
    normal: np.ndarray
    frame: np.ndarray
    height: float = 0.0


class PlaneFilter(NamedTuple):
    """How steep a slope is believed in, and the low-passes' shares of one tick."""

    steepest: float
    slope_share: float
    height_share: float


class Ground:
    """
    Plane z = height + gradient . (xy - centre), low-passed.

    Remembers where each foot stood last; a foot in the air does not move the plane. The slope
    follows slowly, so that boxes average out and a ramp is felt within a few steps. `flat` is the
    `Plane` in one block of memory.
    """

    def __init__(self, params: GroundParameters) -> None:
        self.params = params
        blank = Plane(np.zeros((4, 3)), np.zeros(2), np.zeros(2), np.zeros(3), np.zeros((3, 3)))
        self.flat = flatten(blank)
        self._plane: Plane = view_of(self.flat, blank)
        self.reset(np.zeros((4, 3)))

    def reset(self, feet: np.ndarray) -> None:
        """Take level ground at the mean height of the contact points `feet` (4, 3), world [m]."""
        plane = self._plane
        plane.points[:], plane.centre[:], plane.gradient[:] = feet, feet[:, :2].mean(axis=0), 0.0
        plane.normal[:], plane.frame[:] = (0.0, 0.0, 1.0), np.eye(3)
        self.flat['height'] = feet[:, 2].mean()

    @property
    def height(self) -> float:
        """Height of the plane at its centre [m]."""
        return float(self.flat['height'][0])

    def rule(self, dt: float) -> PlaneFilter:
        """Return how the plane is followed in ticks of `dt` [s]."""
        params = self.params
        return PlaneFilter(
            math.tan(params.slope_max),
            min(1.0, dt / params.slope_time),
            min(1.0, dt / params.height_time),
        )

    def normal(self) -> np.ndarray:
        """Unit normal in world axes, pointing up, shape (3,)."""
        return self._plane.normal

    def frame(self) -> np.ndarray:
        """Rotation (3, 3) from axes on the ground (z = normal, x nearly world x) to the world."""
        return self._plane.frame


@jit
def height_at(plane: Plane, x: float, y: float) -> float:
    """Ground height below one point [m]."""
    ahead, left = x - plane.centre[0], y - plane.centre[1]
    return float(plane.height + plane.gradient[0] * ahead + plane.gradient[1] * left)


@jit
def fit_plane(points: np.ndarray, steepest: float) -> tuple[np.ndarray, float, float]:
    """Return the middle (3,) of `points` (4, 3) and the gradient there, not above `steepest`."""
    mean = np.zeros(3)
    for i in range(4):
        for k in range(3):
            mean[k] += 0.25 * points[i, k]
    xx = xy = yy = xz = yz = 0.0
    for i in range(4):
        x, y, z = points[i, 0] - mean[0], points[i, 1] - mean[1], points[i, 2] - mean[2]
        xx += x * x
        xy += x * y
        yy += y * y
        xz += x * z
        yz += y * z
    determinant = xx * yy - xy * xy
    gx = gy = 0.0
    if determinant > 1e-5:  # else the feet stand in a line and say nothing about slope
        gx = (yy * xz - xy * yz) / determinant
        gy = (xx * yz - xy * xz) / determinant
    size = math.sqrt(gx * gx + gy * gy)
    if size > steepest:
        gx *= steepest / size
        gy *= steepest / size
    return mean, gx, gy


@jit
def follow_plane(
    ground: np.ndarray, contacts: np.ndarray, is_contact: np.ndarray, low_pass: PlaneFilter
) -> None:
    """Update a flat `Plane`."""
    plane = ground[0]
    points, centre, gradient = plane.points, plane.centre, plane.gradient
    steepest, slope_share, height_share = low_pass
    for i in range(4):
        for k in range(3):
            if is_contact[i]:
                points[i, k] = contacts[i, k]
    mean, gx, gy = fit_plane(points, steepest)
    gradient[0] += slope_share * (gx - gradient[0])
    gradient[1] += slope_share * (gy - gradient[1])
    # The centre jumps with each touchdown; the height is carried along the slope to it.
    moved = height_at(plane, mean[0], mean[1])
    centre[0], centre[1] = mean[0], mean[1]
    plane.height = moved + height_share * (mean[2] - moved)
    _raise_frame(plane)


@jit
def _raise_frame(plane: Plane) -> None:
    """Write normal and frame."""
    gradient, normal, frame = plane.gradient, plane.normal, plane.frame
    length = math.sqrt(gradient[0] ** 2 + gradient[1] ** 2 + 1.0)
    normal[0], normal[1], normal[2] = -gradient[0] / length, -gradient[1] / length, 1.0 / length
    along = np.zeros(3)
    size = math.sqrt(normal[2] ** 2 + normal[0] ** 2)
    along[0], along[2] = normal[2] / size, -normal[0] / size
    across = cross3(normal, along)
    for k in range(3):
        frame[k, 0], frame[k, 1], frame[k, 2] = along[k], across[k], normal[k]


class GripRule(NamedTuple):
    """See `GripParameters`; the share of a tick to fall by, how far it rises, and its ends."""

    slip_speed: float
    share: float
    fall: float
    rise: float
    least: float
    most: float


class Grip:
    """
    Friction coefficient that forces may use: a guess at first, then what is felt.

    A foot that slips feels the coefficient itself, as the ratio of its tangential to its normal
    force, and is not to be asked for more [Focchi2018]; one that bears as much as is believed in
    without slipping says that there is more. Friction opposes what slips: a foot that moves
    otherwise is only landing. State: that coefficient.
    """

    def __init__(self, params: GripParameters, guess: float) -> None:
        self.flat = np.empty(1)
        self.tune(params, guess)
        self.reset()

    def tune(self, params: GripParameters, guess: float) -> None:
        """Take other parameters and another guess."""
        self._params, self._guess = params, guess
        # A guess beyond what is believed in is what somebody knows better.
        self._least, self._most = min(params.least, guess), max(params.most, guess)

    def reset(self) -> None:
        """Believe the guess."""
        self.friction = self._guess

    @property
    def friction(self) -> float:
        """The coefficient."""
        return float(self.flat[0])

    @friction.setter
    def friction(self, friction: float) -> None:
        self.flat[0] = friction

    @property
    def share(self) -> float:
        """Share of the guess that is there, at most 1: what speeding up must keep to."""
        return min(1.0, self.friction / self._guess)

    def rule(self, dt: float) -> GripRule:
        """Return how friction is felt in ticks of `dt` [s]."""
        params = self._params
        fall, rise = min(1.0, dt / params.fall_time), dt * params.rise
        return GripRule(params.slip_speed, params.share, fall, rise, self._least, self._most)


@jit
def feel_grip(
    robot: np.ndarray, stands: np.ndarray, frame: np.ndarray, own: np.ndarray, rule: GripRule
) -> None:
    """
    Advance the coefficient `own` (1,) by a tick with the feet of the mask `stands` (4,).

    These bear load. `frame` (3, 3) turns ground axes, whose z is the normal, into the world.
    """
    slips, used = _feel(robot, stands, frame, rule.slip_speed)
    friction = own[0]
    if slips < math.inf:
        friction += rule.fall * min(rule.share * slips - friction, 0.0)
    elif used > rule.share * friction:
        friction += rule.rise
    own[0] = min(max(rule.least, friction), rule.most)


@jit
def _feel(
    robot: np.ndarray, stands: np.ndarray, frame: np.ndarray, slip_speed: float
) -> tuple[float, float]:
    """Least ratio of tangential to normal force on feet that slip, and the largest on any."""
    state = robot[0]
    base, contact = state.base, state.contact
    slips, used, relative = math.inf, 0.0, np.empty(3)
    for i in range(4):
        if not stands[i]:
            continue
        turned = cross3(base.omega, contact.position[i])
        swept = rotate(contact.jacobian[i], state.joint_velocity[3 * i : 3 * i + 3])
        for k in range(3):
            relative[k] = turned[k] + swept[k]
        slides = rotate(base.R, relative)
        for k in range(3):
            relative[k] = slides[k] + base.velocity[k]
        moves = rotate_back(frame, relative)
        force = rotate_back(frame, rotate(base.R, state.forces[i]))
        ratio = math.hypot(force[0], force[1]) / max(force[2], 1e-6)
        speed = math.hypot(moves[0], moves[1])
        power = force[0] * moves[0] + force[1] * moves[1]
        if speed > slip_speed and power < _OPPOSED * speed * ratio * force[2]:
            slips = min(slips, ratio)
        used = max(used, ratio)
    return slips, used
