# SPDX-License-Identifier: Apache-2.0
"""Which feet touch, by joint torques alone, and the plane on which they stand."""

import math
from typing import NamedTuple

import numpy as np

from quadruped_sim.algebra import jit
from quadruped_sim.algebra import plain
from quadruped_sim.algebra import solve_in_place
from quadruped_sim.dynamics import Dynamics
from quadruped_sim.leg_kinematics import LegMotion
from quadruped_sim.parameters import ContactParameters
from quadruped_sim.parameters import GroundParameters


class Observer(NamedTuple):
    """State of the momentum observer, both (12,): its integral and J'f as far as it is seen."""

    integral: np.ndarray
    residual: np.ndarray


class ContactDetector:
    """
    Estimates the force on each foot and whether it touches.

    The joint momentum p obeys dp/dt = tau + C'v - g + J'f. A residual driven by the part of p that
    the known terms do not explain is J'f low-passed at `bandwidth` [DeLuca2006].
    State: the observer, the forces (4, 3) [N] in base axes, contact flags with hysteresis.
    """

    def __init__(self, params: ContactParameters) -> None:
        self.params = params
        self.reset()

    def reset(self) -> None:
        """Forget the past; the next step starts from zero force."""
        self._observer: Observer | None = None
        self.forces = np.zeros((4, 3))
        self.normal_forces = np.zeros(4)
        self.is_contact = np.zeros(4, dtype=bool)

    def step(
        self,
        torque: np.ndarray,
        motion: LegMotion,
        dynamics: Dynamics,
        normal: np.ndarray,
        dt: float,
    ) -> None:
        """Update by the measured joint `torque` (12,) [N m]; `normal` (3,) is up in base axes."""
        if self._observer is None:
            self._observer = Observer(dynamics.momentum.copy(), np.zeros(12))
        moving = torque, dynamics.momentum_drift, dynamics.momentum, motion.jacobian
        _observe(plain(self._observer), moving, self.params.bandwidth, dt, self.forces)
        thresholds = self.params.force_off, self.params.force_on
        _touch(self.forces, normal, thresholds, self.normal_forces, self.is_contact)


@jit
def _observe(
    observer: Observer,
    moving: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    bandwidth: float,
    dt: float,
    forces: np.ndarray,
) -> None:
    """
    Advance the observer in place; writes the foot forces (4, 3) [N].

    `moving` are torque, momentum drift and momentum of the joints, and the feet's Jacobian.
    """
    integral, residual = observer
    torque, drift, momentum, jacobian = moving
    for k in range(12):
        integral[k] += dt * (torque[k] + drift[k] + residual[k])
        residual[k] = bandwidth * (momentum[k] - integral[k])
    damped = np.empty((3, 3))
    pull = np.empty((3, 1))
    for i in range(4):
        J = jacobian[i]
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
def _touch(
    forces: np.ndarray,
    normal: np.ndarray,
    thresholds: tuple[float, float],
    normal_forces: np.ndarray,
    is_contact: np.ndarray,
) -> None:
    """Write what the feet bear along `normal`, and which touch: more than one of (off, on) [N]."""
    off, on = thresholds
    for i in range(4):
        normal_forces[i] = 0.0
        for k in range(3):
            normal_forces[i] += forces[i, k] * normal[k]
        is_contact[i] = normal_forces[i] > (off if is_contact[i] else on)


class Plane(NamedTuple):
    """Where the feet stood last, (4, 3), and the plane's centre (2,) and gradient (2,) there."""

    points: np.ndarray
    centre: np.ndarray
    gradient: np.ndarray


class PlaneFilter(NamedTuple):
    """How steep a slope is believed in, and the low-passes' shares of one tick."""

    steepest: float
    slope_share: float
    height_share: float


class Ground:
    """
    Plane z = height + gradient . (xy - centre), low-passed.

    Remembers where each foot stood last; a foot in the air does not move the plane. The slope
    follows slowly, so that boxes average out and a ramp is felt within a few steps.
    """

    def __init__(self, params: GroundParameters) -> None:
        self.params = params
        self.reset(np.zeros((4, 3)))

    def reset(self, feet: np.ndarray) -> None:
        """Take level ground at the mean height of the contact points `feet` (4, 3), world [m]."""
        self._plane = Plane(feet.copy(), feet[:, :2].mean(axis=0), np.zeros(2))
        self.height = float(feet[:, 2].mean())

    @property
    def gradient(self) -> np.ndarray:
        """Slope along world x and y (2,)."""
        return self._plane.gradient

    def step(self, contacts: np.ndarray, is_contact: np.ndarray, dt: float) -> None:
        """Move the plane toward the contact points (4, 3) of the feet that stand, world [m]."""
        params = self.params
        low_pass = PlaneFilter(
            math.tan(params.slope_max),
            min(1.0, dt / params.slope_time),
            min(1.0, dt / params.height_time),
        )
        self.height = _follow_plane(
            plain(self._plane), self.height, contacts, is_contact, plain(low_pass)
        )

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Ground height below `points` (n, 2 or 3) [m], shape (n,)."""
        return np.asarray(self.height + (points[:, :2] - self._plane.centre) @ self.gradient)

    def height_at(self, point: np.ndarray) -> float:
        """Ground height below one point [m]."""
        return self.height + float((point[:2] - self._plane.centre) @ self.gradient)

    def normal(self) -> np.ndarray:
        """Unit normal in world axes, pointing up, shape (3,)."""
        normal = np.array((-self.gradient[0], -self.gradient[1], 1.0))
        return normal / math.sqrt(float(normal @ normal))

    def frame(self) -> np.ndarray:
        """Rotation (3, 3) from axes on the ground (z = normal, x nearly world x) to the world."""
        normal = self.normal()
        along = np.array((float(normal[2]), 0.0, -float(normal[0])))
        along /= math.sqrt(float(along @ along))
        nx, ny, nz = normal.tolist()
        ax, ay, az = along.tolist()
        across = (ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax)
        return np.column_stack((along, across, normal))


@jit
def _follow_plane(
    plane: Plane,
    height: float,
    contacts: np.ndarray,
    is_contact: np.ndarray,
    low_pass: PlaneFilter,
) -> float:
    """Update the plane in place; returns the new height at its centre."""
    points, centre, gradient = plane
    steepest, slope_share, height_share = low_pass
    for i in range(4):
        for k in range(3):
            if is_contact[i]:
                points[i, k] = contacts[i, k]
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
    gradient[0] += slope_share * (gx - gradient[0])
    gradient[1] += slope_share * (gy - gradient[1])
    # The centre jumps with each touchdown; the height is carried along the slope to it.
    moved = height + gradient[0] * (mean[0] - centre[0]) + gradient[1] * (mean[1] - centre[1])
    centre[0], centre[1] = mean[0], mean[1]
    return float(moved + height_share * (mean[2] - moved))
