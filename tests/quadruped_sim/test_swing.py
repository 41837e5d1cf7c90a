# SPDX-License-Identifier: Apache-2.0
import leg_stages
import numpy as np
import pytest
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.swing import headroom, swing_point, swing_profile
from quadruped_sim.robot_state import BaseMotion, RobotState
from wasd_core.rotations import rpy_matrix

START = np.array((0.1, -0.1, 0.02))
END = np.array((0.3, 0.0, 0.07))
TIME = 0.2
FOOT = 0.022  # radius of the Go2's [m]


@pytest.fixture(params=[0.9, 1.0])
def swing(request):
    """A swing by its phase, which is above its end from the phase `arrival` on."""

    def swing(phase):
        return swing_point(START, END, 0.08, phase, TIME, request.param)

    swing.arrival = request.param
    return swing


def test_its_fastest_is_little_more_than_its_mean():
    slopes = [swing_profile(s)[1] for s in np.linspace(0.0, 1.0, 101)]
    assert max(slopes) == pytest.approx(1.0 / 0.7)


def test_it_starts_and_ends_at_rest_at_the_given_points(swing):
    for phase, point in ((0.0, START), (1.0, END)):
        position, velocity, acceleration = swing(phase)
        np.testing.assert_allclose(position, point, atol=1e-12)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-9)
        np.testing.assert_allclose(acceleration, 0.0, atol=1e-9)


def test_it_comes_down_without_sliding(swing):
    for phase in np.linspace(swing.arrival, 1.0, 5):
        position, velocity, _ = swing(phase)
        np.testing.assert_allclose(position[:2], END[:2], atol=1e-12)
        np.testing.assert_allclose(velocity[:2], 0.0, atol=1e-9)


def test_it_passes_the_height_above_the_higher_end(swing):
    position, velocity, _ = swing(0.5)
    assert abs(position[2] - 0.15) < 1e-12
    assert abs(velocity[2]) < 1e-9


def test_velocity_and_acceleration_are_the_derivatives(swing):
    h = 1e-6
    for phase in np.linspace(0.05, 0.95, 19):
        ahead, behind = swing(phase + h), swing(phase - h)
        _, velocity, acceleration = swing(phase)
        span = 2.0 * h * TIME
        np.testing.assert_allclose(velocity, (ahead[0] - behind[0]) / span, atol=1e-4)
        np.testing.assert_allclose(acceleration, (ahead[1] - behind[1]) / span, atol=1e-1)


def test_path_and_speed_have_no_jumps(swing):
    points = [swing(phase) for phase in np.linspace(0, 1, 401)]
    positions = np.array([point[0] for point in points])
    velocities = np.array([point[1] for point in points])
    assert np.abs(np.diff(positions, axis=0)).max() < 2e-3
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.05


def test_a_phase_outside_is_held_at_the_end(swing):
    np.testing.assert_allclose(swing(1.7)[0], END)


def test_the_headroom_is_below_the_hip_as_the_base_sees_it():
    R, hip = rpy_matrix(0.2, -0.4, 1.0), np.array((0.19, 0.05, 0.01))
    base = BaseMotion(np.array((1.0, 2.0, 0.5)), np.zeros(3), R, np.zeros(3), np.zeros(3))
    for x, y in ((1.1, 2.1), (1.3, 1.9)):
        z = headroom(base, hip, x, y, 0.12)
        assert (R.T @ (np.array((x, y, z)) - base.position))[2] == pytest.approx(0.01 - 0.12)


@pytest.mark.parametrize(
    ('height', 'lift'), [(0.30, 0.14), (0.20, 0.20 - 0.12 - 0.022), (0.1, 0.02)]
)
def test_a_low_robot_lifts_its_feet_less_than_it_is_told(rules, height, lift):
    """As far as is room below the hips, and a little at the least."""
    state = RobotState.blank()
    state.base.position[:], state.base.R[:] = (0.0, 0.0, height), np.eye(3)
    state.feet[:] = rules['nominal'][0] + (0.0, 0.0, FOOT)
    rest = BaseReference(np.zeros(3), np.zeros(3), np.zeros(3), 0.0)
    in_air = np.zeros(4, dtype=bool)
    schedule = GaitState(in_air, np.full(4, 0.5), TIME, TIME, pace=0.0)
    targets = leg_stages.swing(state.feet, state, schedule, rest, Ground(), (0.14, 1.0), rules)
    np.testing.assert_allclose(targets.position[:, 2] - FOOT, lift, atol=1e-9)
