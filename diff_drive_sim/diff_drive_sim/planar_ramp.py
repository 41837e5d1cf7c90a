# SPDX-License-Identifier: Apache-2.0
"""Both axes of a differential drive on their way to a target, within what its wheels can do."""

from diff_drive_sim.geometry import DiffDriveGeometry
from diff_drive_sim.limits import AxisLimits
from diff_drive_sim.limits import AxisRamp
from diff_drive_sim.limits import Motion

Span = tuple[float, float]


class PlanarRamp:
    """
    Forward speed and yaw rate, ramped each by its own limits; no wheel is sent too fast.

    The axes share the wheels. Scaling both after the ramp would break their limits, so the wheels
    bound the ramps: a step is taken only if both axes, easing off from it, would stay at what the
    wheels can do (see `limits`). Easing off can be kept up at any time, so this holds for every
    target and every length of steps. The axis that frees the wheels goes first, the other takes
    what that leaves.
    """

    def __init__(self, geometry: DiffDriveGeometry) -> None:
        self.linear, self.angular = AxisRamp(AxisLimits()), AxisRamp(AxisLimits())
        self._lever = 0.5 * geometry.wheel_separation
        self._left = geometry.speed_limit * geometry.left_radius  # [m/s] of the rim
        self._right = geometry.speed_limit * geometry.right_radius

    def reset(self) -> None:
        """Stand."""
        self.linear.take(Motion())
        self.angular.take(Motion())

    def step(self, linear: float, angular: float, dt: float) -> tuple[float, float]:
        """Return speed [m/s] and yaw rate [rad/s] `dt` [s] later; a `dt` of 0 keeps them."""
        if dt > 0.0:
            forward, turn = self.linear.toward(linear, dt), self.angular.toward(angular, dt)
            if not self._fits(self.linear.span(forward), self.angular.span(turn)):
                forward, turn = self._within_wheels(forward, turn, dt)
            self.linear.take(forward)
            self.angular.take(turn)
        return self.linear.velocity, self.angular.velocity

    def _fits(self, forward: Span, turn: Span) -> bool:
        """Whether both wheels can do all that is within two spans."""
        slowest, fastest = self._forward_bounds(turn)
        return slowest <= forward[0] and forward[1] <= fastest

    def _within_wheels(self, forward: Motion, turn: Motion, dt: float) -> tuple[Motion, Motion]:
        """Return what the wheels can do of two motions, each between it and easing off."""
        span = self.angular.span(self.angular.hold(dt))
        eased = self.linear.confined(forward, *self._forward_bounds(span), dt)
        turn = self.angular.confined(turn, *self._turn_bounds(self.linear.span(eased)), dt)
        # What the turn has given up, or freed, is there for the speed.
        bounds = self._forward_bounds(self.angular.span(turn))
        return self.linear.confined(forward, *bounds, dt), turn

    def _forward_bounds(self, turn: Span) -> Span:
        """Return the slowest and fastest speed [m/s] that the wheels can do with a turn."""
        low, high = self._lever * turn[0], self._lever * turn[1]
        slowest = max(-self._right - low, high - self._left)
        return slowest, min(self._right - high, self._left + low)

    def _turn_bounds(self, forward: Span) -> Span:
        """Return the least and largest yaw rate [rad/s] that the wheels can do with a speed."""
        low, high = forward
        least = max(-self._right - low, high - self._left)
        most = min(self._right - high, self._left + low)
        return least / self._lever, most / self._lever
