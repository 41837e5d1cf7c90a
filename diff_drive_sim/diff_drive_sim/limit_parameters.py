# SPDX-License-Identifier: Apache-2.0
"""How fast the robot may go and how fast that may change; names of ros2_controllers."""

from dataclasses import dataclass
from typing import Any

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

from diff_drive_sim.limits import AxisLimits


def _upper(
    axis: str, what: str, unit: str, doc: str, default: float, nan: str = 'no limit'
) -> Any:
    name = f'{axis}.{what}'
    return parameter(default, name=name, unit=unit, doc=doc, above=0.0, nan=nan)


def _lower(axis: str, what: str, unit: str, doc: str, nan: str) -> Any:
    name = f'{axis}.{what}'
    return parameter(float('nan'), name=name, unit=unit, doc=doc, below=0.0, nan=nan)


def _slowing_back(axis: str, unit: str, doc: str) -> Any:
    what, nan = 'max_deceleration_reverse', 'the negative of max_deceleration'
    return _upper(axis, what, unit, doc, float('nan'), nan)


@dataclass(frozen=True, kw_only=True)
class LimitParameters(Parameters):
    """Limits of the two axes; signs say the direction, as in ros2_controllers."""

    linear_max_velocity: float = _upper(
        'linear.x', 'max_velocity', 'm/s', 'Largest forward speed', 1.0
    )
    linear_min_velocity: float = _lower(
        'linear.x', 'min_velocity', 'm/s', 'Largest backward speed', '-max_velocity'
    )
    linear_max_acceleration: float = _upper(
        'linear.x', 'max_acceleration', 'm/s^2', 'Most that speeds it up forward', 1.0
    )
    linear_max_deceleration: float = _lower(
        'linear.x',
        'max_deceleration',
        'm/s^2',
        'Most that slows it down when it goes forward',
        '-max_acceleration',
    )
    linear_max_acceleration_reverse: float = _lower(
        'linear.x',
        'max_acceleration_reverse',
        'm/s^2',
        'Most that speeds it up backward',
        '-max_acceleration',
    )
    linear_max_deceleration_reverse: float = _slowing_back(
        'linear.x', 'm/s^2', 'Most that slows it down when it goes backward'
    )
    linear_max_jerk: float = _upper(
        'linear.x', 'max_jerk', 'm/s^3', 'Fastest growth of acceleration', float('nan')
    )
    linear_min_jerk: float = _lower(
        'linear.x', 'min_jerk', 'm/s^3', 'Fastest fall of acceleration', '-max_jerk'
    )
    angular_max_velocity: float = _upper(
        'angular.z', 'max_velocity', 'rad/s', 'Largest yaw rate to the left', 4.0
    )
    angular_min_velocity: float = _lower(
        'angular.z', 'min_velocity', 'rad/s', 'Largest yaw rate to the right', '-max_velocity'
    )
    angular_max_acceleration: float = _upper(
        'angular.z', 'max_acceleration', 'rad/s^2', 'Most that speeds a left turn up', 6.0
    )
    angular_max_deceleration: float = _lower(
        'angular.z',
        'max_deceleration',
        'rad/s^2',
        'Most that slows a left turn down',
        '-max_acceleration',
    )
    angular_max_acceleration_reverse: float = _lower(
        'angular.z',
        'max_acceleration_reverse',
        'rad/s^2',
        'Most that speeds a right turn up',
        '-max_acceleration',
    )
    angular_max_deceleration_reverse: float = _slowing_back(
        'angular.z', 'rad/s^2', 'Most that slows a right turn down'
    )
    angular_max_jerk: float = _upper(
        'angular.z', 'max_jerk', 'rad/s^3', 'Fastest growth of acceleration', float('nan')
    )
    angular_min_jerk: float = _lower(
        'angular.z', 'min_jerk', 'rad/s^3', 'Fastest fall of acceleration', '-max_jerk'
    )
    accel_limit: float = parameter(
        float('nan'),
        name='accel_limit',
        unit='m/s^2',
        doc='Largest change of the speed of a wheel: in place of the accelerations above',
        above=0.0,
        nan='not used',
    )

    def linear_limits(self) -> AxisLimits:
        """Return the limits of the forward speed [m/s]."""
        return self._limits('linear', self.accel_limit)

    def angular_limits(self, wheel_separation: float) -> AxisLimits:
        """Return the limits of the yaw rate [rad/s]; half a separation [m] is a wheel's lever."""
        return self._limits('angular', 2.0 * self.accel_limit / wheel_separation)

    def _limits(self, axis: str, accel_limit: float) -> AxisLimits:
        if accel_limit > 0.0:  # not NaN
            fastest, slowest = (getattr(self, f'{axis}_{end}_velocity') for end in ('max', 'min'))
            return AxisLimits.from_signed(fastest, slowest, accel_limit)
        names = (
            'max_velocity',
            'min_velocity',
            'max_acceleration',
            'max_deceleration',
            'max_acceleration_reverse',
            'max_deceleration_reverse',
            'max_jerk',
            'min_jerk',
        )
        return AxisLimits.from_signed(*(getattr(self, f'{axis}_{name}') for name in names))
