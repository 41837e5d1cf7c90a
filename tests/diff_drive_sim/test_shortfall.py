# SPDX-License-Identifier: Apache-2.0
"""A robot that is slower than it is told is noticed, with the share, after a steady while."""

from cases import for_all
from diff_drive_sim.limits import Velocity
from diff_drive_sim.shortfall import MEASURED, SETTLED, Shortfall

DT = 0.02
STEPS = round((SETTLED + MEASURED) / DT)


def watch(asked, wheels, true, steps=STEPS + 2, half_track=0.2):
    """Return what is said in so many steps of constant speeds."""
    shortfall = Shortfall(half_track)
    speeds = (Velocity(*each) for each in (asked, wheels, true))
    asked, wheels, true = speeds
    return [line for _ in range(steps) if (line := shortfall.step(asked, wheels, true, DT))]


@for_all(
    ('asked', 'wheels', 'true', 'line'),
    [
        ((0.5, 0.0), (0.5, 0.0), (0.5, 0.0), ''),
        ((0.5, 0.0), (0.5, 0.0), (0.38, 0.0), ''),
        ((0.5, 0.0), (0.5, 0.0), (0.14, 0.0), 'wheels slip or hang in the air: 28 %'),
        ((-0.5, 0.0), (-0.5, 0.0), (0.03, 0.0), 'wheels slip or hang in the air: -6 %'),
        ((0.0, 0.5), (0.0, 0.5), (0.0, 0.16), 'wheels slip or hang in the air: 32 %'),
        # A wheel's speed counts: 0.3 * 0.3 of 0.3^2 + (0.2 * 2)^2.
        ((0.3, 2.0), (0.3, 2.0), (0.3, 0.0), 'wheels slip or hang in the air: 36 %'),
        ((0.5, 0.0), (0.1, 0.0), (0.1, 0.0), 'wheels turn too slowly, blocked or too weak: 20 %'),
        ((0.01, 0.0), (0.0, 0.0), (0.0, 0.0), ''),  # too slow to say anything of
    ],
)
def test_the_share_is_that_of_the_speed_asked_for(asked, wheels, true, line):
    assert watch(asked, wheels, true) == ([f'{line} of the speed asked for'] if line else [])


def test_nothing_is_said_before_a_command_was_steady_for_long_enough():
    assert not watch((0.5, 0.0), (0.5, 0.0), (0.0, 0.0), STEPS - 3)
    shortfall = Shortfall(0.2)
    for step in range(5 * STEPS):  # a ramp, which never settles
        asked = Velocity(0.1 * step * DT + 0.1, 0.0)
        assert not shortfall.step(asked, asked, Velocity(), DT)
