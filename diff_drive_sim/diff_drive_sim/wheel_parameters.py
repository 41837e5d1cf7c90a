# SPDX-License-Identifier: Apache-2.0
"""Which wheels, how large, and the loop that turns them; names of arbotix and ros2_controllers."""

from dataclasses import dataclass

from wasd_core.parameters import InvalidParameter
from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

MODES = ('float', 'arbotix', 'fake')


@dataclass(frozen=True, kw_only=True)
class WheelParameters(Parameters):
    """Wheels and their speed loop."""

    mode: str = parameter(
        'float',
        doc='What turns the wheels: a PID loop on encoder ticks, the integer loop of the ArbotiX '
        'firmware, or nothing but arithmetic, without physics and motors',
        choices=MODES,
        read_only=True,
    )
    legacy: bool = parameter(
        False,
        doc='Mode arbotix: also ramp, time-out and odometry as arbotix_driver had them, slips '
        'included',
        read_only=True,
    )
    left_wheel_names: tuple[str, ...] = parameter(
        (), doc='Joint of the left wheel; empty: found in the description', read_only=True
    )
    right_wheel_names: tuple[str, ...] = parameter(
        (), doc='Joint of the right wheel; empty: found in the description', read_only=True
    )
    wheel_separation: float = parameter(
        0.0,
        doc="Distance of the wheels; 0: the description's",
        unit='m',
        minimum=0.0,
        read_only=True,
    )
    wheel_radius: float = parameter(
        0.0,
        doc="Radius of the wheels; 0: the description's",
        unit='m',
        minimum=0.0,
        read_only=True,
    )
    wheel_separation_multiplier: float = parameter(
        1.0, doc='Calibration: corrects the distance of the wheels', above=0.0, read_only=True
    )
    left_wheel_radius_multiplier: float = parameter(
        1.0, doc='Calibration: corrects the radius of the left wheel', above=0.0, read_only=True
    )
    right_wheel_radius_multiplier: float = parameter(
        1.0, doc='Calibration: corrects the radius of the right wheel', above=0.0, read_only=True
    )
    ticks_meter: float = parameter(
        4100.0,
        doc='Encoder ticks per metre of wheel travel',
        unit='1/m',
        above=0.0,
        read_only=True,
    )
    Kp: float = parameter(
        5.0, doc='PWM steps, of 255, times Ko per tick that the wheel is behind', minimum=0.0
    )
    Kd: float = parameter(
        1.0, doc='PWM steps times Ko per tick in 1/30 s that it is too slow', minimum=0.0
    )
    Ki: float = parameter(
        0.0, doc='PWM steps times Ko per tick behind and 1/30 s that it stays so', minimum=0.0
    )
    Ko: float = parameter(50.0, doc='Divisor of the three gains', above=0.0)
    rate: float = parameter(
        10.0,
        doc='Legacy: rate of the loop of arbotix_driver, which slips',
        unit='Hz',
        above=0.0,
        maximum=100.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        """Check what needs more than one parameter, too."""
        super().__post_init__()
        for names, key in (
            (self.left_wheel_names, 'left_wheel_names'),
            (self.right_wheel_names, 'right_wheel_names'),
        ):
            if len(names) > 1:
                raise InvalidParameter(f'{key} must be one joint, got {len(names)}')
        if bool(self.left_wheel_names) != bool(self.right_wheel_names):
            raise InvalidParameter('left_wheel_names and right_wheel_names must be given both')
        if self.legacy and self.mode != 'arbotix':
            raise InvalidParameter(f"legacy needs mode 'arbotix', got mode {self.mode!r}")
        if self.mode == 'arbotix':
            for key in ('Kp', 'Kd', 'Ki', 'Ko'):
                gain = getattr(self, key)
                if not (gain.is_integer() and gain <= 255.0):
                    raise InvalidParameter(
                        f'{key} must be a whole number up to 255 in mode arbotix (the firmware '
                        f'gets one byte), got {gain:g}'
                    )
