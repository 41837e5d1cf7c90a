# SPDX-License-Identifier: Apache-2.0
"""Noise: as large as it says, the same for the same seed, and none where none is wanted."""

import math

from cases import for_all
from descriptions import robot_named
from mujoco_sim.compiled import add_noise, NoiseSizes
from mujoco_sim.noise import NoisySensors, SensorNoise
from mujoco_sim.robot_setup import RobotSetup, usual_setup
from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_core.robot_io import ImuReading, JointStates, Reading
from wasd_core.rotations import matrix_from_quaternion

NOISE = SensorNoise()
COUNT = 4000
JOINTS = JointStates(np.linspace(-1.0, 1.0, 12), np.linspace(5.0, -5.0, 12), np.arange(12.0))
IMU = ImuReading(
    np.array((0.5, 0.5, -0.5, 0.5)), np.array((0.1, -0.2, 0.3)), np.array((0.0, 0.0, 9.81))
)
TRUE = Reading(JOINTS, IMU)


@pytest.fixture(scope='module')
def readings():
    sensors = NoisySensors(NOISE, 3)
    return [sensors.measure(TRUE) for _ in range(COUNT)]


def turn_by(orientation, rotation):
    """Return a quaternion as an IMU reads it whose only noise is a rotation vector [rad]."""
    none = np.zeros(3)
    sizes = NoiseSizes(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, False)
    drawn = np.concatenate((np.zeros(24), rotation, np.zeros(12)))
    true, memory = ImuReading(orientation, none, none), np.array((*np.zeros(7), *sizes))
    return add_noise(JOINTS, true, memory, drawn, 0.0).imu.orientation


def angle_between(one, other):
    """Return the angle of the rotation between two quaternions [rad]."""
    return 2.0 * math.acos(min(1.0, abs(float(one @ other))))


def spread(values, deviation):
    """Return how far the deviation of values is from what was asked for, as a share of it."""
    return abs(np.std(values) / deviation - 1.0)


@pytest.mark.slow
def test_noise_has_the_deviation_that_was_asked_for(readings):
    # The deviation of n samples is off by 1/sqrt(2n) at one sigma; five of them here.
    for name, values, deviation in (
        ('position', [r.joints.position - JOINTS.position for r in readings], 0.001),
        ('velocity', [r.joints.velocity - JOINTS.velocity for r in readings], 0.05),
        ('rate', [r.imu.angular_velocity - IMU.angular_velocity for r in readings], 0.01),
    ):
        tolerance = 5.0 / math.sqrt(2.0 * np.size(values))
        assert spread(values, deviation) < tolerance, name
        assert abs(np.mean(values)) < 5.0 * deviation / math.sqrt(np.size(values)), name


@pytest.mark.slow
def test_the_accelerometer_has_a_constant_bias_besides(readings):
    errors = np.array([r.imu.linear_acceleration - IMU.linear_acceleration for r in readings])
    bias = errors.mean(axis=0)
    assert np.linalg.norm(bias) == pytest.approx(NOISE.acceleration_bias, rel=0.2)
    assert spread(errors - bias, NOISE.acceleration) < 0.05


def test_another_seed_has_another_bias():
    biases = [NoisySensors(NOISE, seed)._errors[3:6] for seed in range(5)]
    assert len({tuple(bias) for bias in biases}) == 5
    for bias in biases:
        assert np.linalg.norm(bias) == pytest.approx(NOISE.acceleration_bias)


@pytest.mark.slow
def test_orientation_stays_a_rotation_and_is_off_by_a_little(readings):
    angles = [angle_between(r.imu.orientation, IMU.orientation) for r in readings]
    for reading in readings[:100]:
        assert np.linalg.norm(reading.imu.orientation) == pytest.approx(1.0, abs=1e-12)
    # Three axes of one deviation each: the angle's root mean square is sqrt(3) of it.
    rms = math.sqrt(np.mean(np.square(angles)))
    assert rms == pytest.approx(math.sqrt(3.0) * NOISE.orientation, rel=0.05)


def test_effort_is_what_the_motor_gives(readings):
    np.testing.assert_array_equal(readings[0].joints.effort, JOINTS.effort)


def test_the_truth_is_left_as_it_is():
    position = JOINTS.position.copy()
    NoisySensors(NOISE, 0).measure(TRUE)
    np.testing.assert_array_equal(JOINTS.position, position)


def test_the_same_seed_gives_the_same_bits():
    def series(seed):
        sensors = NoisySensors(NOISE, seed)
        return np.array([sensors.measure(TRUE).joints.position for _ in range(5)])

    np.testing.assert_array_equal(series(4), series(4))
    assert (series(4) != series(5)).any()


@for_all('drift', [0.0, 1.0])
def test_with_and_without_drift_what_is_white_is_drawn_in_one_order(drift):
    random = np.random.default_rng(7)
    direction = random.normal(size=3)
    position, rates, tilt, gyro, force = (random.normal(size=n) for n in (12, 12, 3, 3, 3))
    reading = NoisySensors(NOISE.drifting(drift), 7).measure(TRUE)
    np.testing.assert_array_equal(reading.joints.position, JOINTS.position + 0.001 * position)
    np.testing.assert_array_equal(reading.joints.velocity, JOINTS.velocity + 0.05 * rates)
    np.testing.assert_array_equal(reading.imu.orientation, turn_by(IMU.orientation, 0.001 * tilt))
    bias = 0.05 * direction / np.linalg.norm(direction)
    felt = IMU.linear_acceleration + bias + 0.1 * force
    np.testing.assert_array_equal(reading.imu.linear_acceleration, felt)
    off = reading.imu.angular_velocity - (IMU.angular_velocity + 0.01 * gyro)
    assert np.linalg.norm(off) == pytest.approx(drift * NOISE.gyro_bias)


def test_the_heading_drifts_as_the_gyro_does_and_the_tilt_does_not():
    """A minute at 50 Hz, of ten times the usual drift."""
    sensors, turned = NoisySensors(NOISE.drifting(10.0), 2), 0.0
    up = matrix_from_quaternion(IMU.orientation)[2]
    tilts = []
    for tick in range(3000):
        imu = sensors.measure(TRUE, 0.02 * (tick > 0)).imu
        turned += 0.02 * float(up @ (imu.angular_velocity - IMU.angular_velocity)) * (tick > 0)
        tilts.append(matrix_from_quaternion(imu.orientation)[2] - up)
    assert abs(turned) > math.radians(3.0)
    off = matrix_from_quaternion(imu.orientation) @ matrix_from_quaternion(IMU.orientation).T
    assert math.atan2(off[1, 0], off[0, 0]) == pytest.approx(turned, abs=5 * NOISE.orientation)
    assert np.abs(tilts).max() < 6.0 * NOISE.orientation
    assert np.abs(np.mean(tilts, axis=0)).max() < 1e-4


def test_without_an_imu_there_is_none():
    assert NoisySensors(NOISE, 0).measure(Reading(JOINTS, None)).imu is None


@for_all('axis', [0, 1, 2])
def test_tilting_turns_about_the_axes_of_the_body(axis):
    rotation = np.zeros(3)
    rotation[axis] = 1e-4
    turned = turn_by(IMU.orientation, rotation)
    assert angle_between(turned, IMU.orientation) == pytest.approx(1e-4, rel=1e-3)
    # q times (1, r/2): the vector part of conj(q) q' is half the rotation, in the body's axes.
    w, xyz = IMU.orientation[0], IMU.orientation[1:]
    relative = w * turned[1:] - turned[0] * xyz - np.cross(xyz, turned[1:])
    np.testing.assert_allclose(relative, 0.5 * rotation, atol=1e-9)


@pytest.fixture(scope='module')
def go2():
    return robot_named('go2')


@pytest.mark.slow
def test_the_simulated_imu_feels_gravity_upward_and_no_turning_at_rest(go2):
    world = build_world(go2, setup=usual_setup(go2, noise=False))
    world.step(2000)
    imu = world.read().imu
    assert imu is not None
    np.testing.assert_allclose(np.linalg.norm(imu.linear_acceleration), 9.81, atol=0.05)
    assert imu.linear_acceleration[2] > 9.5
    np.testing.assert_allclose(imu.angular_velocity, 0.0, atol=0.02)


@pytest.mark.slow
def test_a_falling_imu_feels_nothing(go2):
    # Calves within their limits, which would push else.
    angles = {f'{leg}_calf_joint': -1.5 for leg in ('FL', 'FR', 'RL', 'RR')}
    world = build_world(go2, setup=RobotSetup(joint_positions=angles, height=5.0))
    world.step(50)
    np.testing.assert_allclose(world.read().imu.linear_acceleration, 0.0, atol=0.02)


@pytest.mark.slow
def test_the_imu_is_in_the_axes_of_the_trunk(go2):
    world = build_world(go2, setup=RobotSetup(height=5.0))
    # On its right side: turned by 90 degrees about x, and turning about its own z.
    world.data.qpos[3:7] = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
    world.data.qvel[3:6] = (0.0, 0.0, 1.0)
    world.step(1)
    imu = world.read().imu
    np.testing.assert_allclose(imu.angular_velocity, [0.0, 0.0, 1.0], atol=0.02)
    np.testing.assert_allclose(abs(imu.orientation[:2]), math.sqrt(0.5), atol=1e-3)


def test_asked_twice_in_one_instant_the_sensors_say_the_same(go2):
    world = build_world(go2, setup=usual_setup(go2))
    first, second = world.read(), world.read()
    np.testing.assert_array_equal(first.joints.position, second.joints.position)
    world.step(1)
    assert (world.read().joints.position != first.joints.position).all()


def test_a_world_that_is_reset_has_the_same_noise_again_bit_by_bit(go2):
    def measured():
        readings = [world.read()]
        for _ in range(20):
            world.step(2)
            readings.append(world.read())
        return np.array([(*one.joints.position, *one.imu.orientation) for one in readings])

    world = build_world(go2, setup=usual_setup(go2), seed=5)
    first = measured()
    for _ in range(3):
        world.reset()
        np.testing.assert_array_equal(measured(), first)
