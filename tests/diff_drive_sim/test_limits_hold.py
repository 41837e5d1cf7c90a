# SPDX-License-Identifier: Apache-2.0
"""No limit is broken: by any command, at any time, in steps of any length, by any wheels."""

import math
import random

from cases import for_all
from diff_drive_sim.drive import DiffDriveController
from diff_drive_sim.limits import AxisLimits, PlanarRamp
from diff_drive_sim.odometry import DiffDriveGeometry
from diff_drive_sim.parameters import DiffDriveParameters
import numpy as np
import pytest

pytestmark = pytest.mark.slow

# What a limit may be broken by, in its own unit.
TOLERANCE = 1e-9
INF = math.inf
STEPS_OF_A_ROBOT = 400


def broken(limits, velocity, dt):
    """Return what a velocity (n,), each `dt` (n,) [s] after the last, breaks: limit and value."""
    before = np.concatenate(((0.0,), velocity[:-1]))
    slope = (velocity - before) / dt
    slope_before = np.concatenate(((0.0,), slope[:-1]))
    ahead, behind = np.minimum(before, velocity) >= 0.0, np.maximum(before, velocity) <= 0.0
    # Through 0: first slowing down, then speeding up, and there is time for both.
    down = np.where(before < 0.0, limits.slow_down_backward, limits.slow_down)
    up = np.where(before < 0.0, limits.speed_up, limits.speed_up_backward)
    reversal = np.where(ahead | behind, 0.0, (abs(before) / down + abs(velocity) / up) / dt)
    lowest = np.where(ahead, -limits.slow_down, np.where(behind, -limits.speed_up_backward, -INF))
    highest = np.where(ahead, limits.speed_up, np.where(behind, limits.slow_down_backward, INF))
    # A velocity has 52 bits; its second difference in a short step shows the last of them.
    rounding = 4.0 * np.spacing(np.maximum(abs(velocity), abs(before))) / dt**2
    found = []
    for name, value, low, high in (
        ('velocity', velocity, -limits.backward, limits.forward),
        ('acceleration', slope, lowest, highest),
        ('reversal', reversal, 0.0, 1.0),
        ('jerk', (slope - slope_before) / dt, -limits.fall - rounding, limits.rise + rounding),
    ):
        beyond = ~((low - TOLERANCE <= value) & (value <= high + TOLERANCE))
        found += [(name, float(one)) for one in value[beyond]]
    return found


def random_limits(choose, largest):
    """Return parameters of one axis: each limit its own, jerk bounded or not."""
    values = {
        'max_velocity': choose.uniform(0.1, largest),
        'min_velocity': -choose.uniform(0.1, largest),
        'max_acceleration': choose.uniform(0.2, 5.0),
        'max_deceleration': -choose.uniform(0.2, 5.0),
        'max_acceleration_reverse': -choose.uniform(0.2, 5.0),
        'max_deceleration_reverse': choose.uniform(0.2, 5.0),
    }
    if choose.random() < 0.7:
        values['max_jerk'] = 10.0 ** choose.uniform(-0.5, 2.0)
        values['min_jerk'] = -(10.0 ** choose.uniform(-0.5, 2.0))
    return values


def random_controller(choose):
    """Return a controller of a robot that is like no other; half of them have slow wheels."""
    geometry = DiffDriveGeometry(
        'left',
        'right',
        wheel_radius=choose.uniform(0.02, 0.2),
        wheel_separation=choose.uniform(0.1, 1.0),
        left_direction=choose.choice((1, -1)),
        speed_limit=choose.choice((math.inf, 10.0 ** choose.uniform(-0.5, 1.0))),
        left_multiplier=choose.uniform(0.9, 1.1),
    )
    values = {
        f'{axis}_{name}': value
        for axis, largest in (('linear', 2.0), ('angular', 6.0))
        for name, value in random_limits(choose, largest).items()
    }
    timeout = choose.choice((0.0, 0.05, 0.5))
    parameters = DiffDriveParameters(
        open_loop=True, cmd_vel_timeout=timeout, velocity_rolling_window_size=1, **values
    )
    return DiffDriveController(geometry, parameters)


def random_steps(choose):
    """Yield periods: all alike, or each another, or mostly short with long ones between."""
    kind = choose.randrange(3)
    even = 10.0 ** choose.uniform(-4.0, -1.0)
    for _ in range(STEPS_OF_A_ROBOT):
        if kind == 1:
            yield 10.0 ** choose.uniform(-4.0, -1.0)
        elif kind == 2 and choose.random() < 0.1:
            yield 0.1
        else:
            yield even


def count_violations(seed, robots):
    """Drive so many random robots in random ways; return what was broken, and how often wheels."""
    choose = random.Random(seed)
    violations, saturated = [], 0
    for _ in range(robots):
        controller = random_controller(choose)
        parameters, geometry = controller.parameters, controller.geometry
        hurry = 10.0 ** choose.uniform(-2.5, 0.0)
        seen = []
        for dt in random_steps(choose):
            if choose.random() < hurry:
                controller.command(
                    choose.gauss(0.0, 1.5), choose.choice((0.0, 1.0)) * choose.gauss(0.0, 4.0)
                )
            seen.append((*controller.step(0.0, 0.0, dt), *controller.velocity, dt))
        left, right, linear, angular, dt = np.array(seen).T
        fastest = np.maximum(abs(left), abs(right))
        saturated += int((fastest > 0.999 * geometry.speed_limit).sum())
        too_fast = fastest[~(fastest <= geometry.speed_limit + TOLERANCE)]
        violations += [('wheel', float(one)) for one in too_fast]
        violations += broken(parameters.linear_limits(), linear, dt)
        violations += broken(parameters.angular_limits(geometry.wheel_separation), angular, dt)
    return violations, saturated


def test_no_limit_is_broken_in_eighty_thousand_steps():
    violations, saturated = count_violations(100, robots=200)
    assert violations == []
    assert saturated > 2000


@for_all('jerk', [math.inf, 20.0])
@for_all('seed', range(10))
def test_whatever_went_before_it_arrives_at_what_the_wheels_can_do(seed, jerk):
    choose = random.Random(seed)
    geometry = DiffDriveGeometry('l', 'r', 0.06, 0.38, speed_limit=10.0)
    ramp = PlanarRamp(geometry)
    for axis, acceleration in ((ramp.linear, 1.0), (ramp.angular, 3.0)):
        axis.limits = AxisLimits(*[math.inf] * 2, *[acceleration] * 4, jerk, jerk)
    edge = 10.0 * 0.06
    for _ in range(20):
        for _ in range(choose.randrange(300)):
            ramp.step(choose.uniform(-edge, edge), choose.uniform(-3.0, 3.0), 0.01)
        share = choose.uniform(-1.0, 1.0)
        target = (share * edge, choose.choice((1.0, -1.0)) * (1.0 - abs(share)) * edge / 0.19)
        for _ in range(400):
            if math.dist(ramp.step(*target, 0.01), target) < 1e-12:
                break
        for _ in range(10):  # and stays there
            reached = ramp.step(*target, 0.01)
        assert reached == pytest.approx(target, abs=1e-9)
