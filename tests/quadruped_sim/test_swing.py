# SPDX-License-Identifier: Apache-2.0
import numpy as np
from quadruped_sim.locomotion.swing import swing_point

START = np.array((0.1, -0.1, 0.02))
END = np.array((0.3, 0.0, 0.07))
TIME = 0.2


def test_it_starts_and_ends_at_rest_at_the_given_points():
    for phase, point in ((0.0, START), (1.0, END)):
        position, velocity, acceleration = swing_point(START, END, 0.08, phase, TIME)
        np.testing.assert_allclose(position, point, atol=1e-12)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-9)
        np.testing.assert_allclose(acceleration, 0.0, atol=1e-9)


def test_it_passes_the_height_above_the_higher_end():
    position, velocity, _ = swing_point(START, END, 0.08, 0.5, TIME)
    assert abs(position[2] - 0.15) < 1e-12
    assert abs(velocity[2]) < 1e-9


def test_velocity_and_acceleration_are_the_derivatives():
    h = 1e-6
    for phase in np.linspace(0.05, 0.95, 19):
        ahead = swing_point(START, END, 0.08, phase + h, TIME)
        behind = swing_point(START, END, 0.08, phase - h, TIME)
        _, velocity, acceleration = swing_point(START, END, 0.08, phase, TIME)
        span = 2.0 * h * TIME
        np.testing.assert_allclose(velocity, (ahead[0] - behind[0]) / span, atol=1e-5)
        np.testing.assert_allclose(acceleration, (ahead[1] - behind[1]) / span, atol=1e-2)


def test_path_and_speed_have_no_jumps():
    points = [swing_point(START, END, 0.08, phase, TIME) for phase in np.linspace(0, 1, 401)]
    positions = np.array([point[0] for point in points])
    velocities = np.array([point[1] for point in points])
    assert np.abs(np.diff(positions, axis=0)).max() < 2e-3
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.05


def test_a_phase_outside_is_held_at_the_end():
    np.testing.assert_allclose(swing_point(START, END, 0.08, 1.7, TIME)[0], END)
