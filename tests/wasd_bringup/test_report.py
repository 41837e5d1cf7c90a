# SPDX-License-Identifier: Apache-2.0
"""The report: samples, falls counted once each, a file that is whole or not there."""

import json
import math
import os
import stat

from descriptions import robot_named
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.simulation import TickSummary
from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_bringup.run.report import build_report, Recorder, Sample, to_json, TrunkWatch, UP_AGAIN
from wasd_core.output_file import OutputFile

pytestmark = pytest.mark.slow

NOW = Sample('trotting', (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), (1, 0, 0, 1))
DOWN = NOW._replace(is_down=True)
TICKS = TickSummary(1.0, 2.0, 3.0, 0)


@pytest.fixture
def world():
    return build_world(robot_named('mbot'), setup=RobotSetup(height=1.0))


@pytest.fixture
def recorder(world):
    return Recorder(world)


def tilt(world, degrees):
    half = math.radians(degrees) / 2.0
    world.data.qpos[3:7] = (math.cos(half), math.sin(half), 0.0, 0.0)


def test_a_sample_is_what_the_controller_and_physics_say(world, recorder):
    world.data.qpos[:3] = (1.0, -2.0, 0.5)
    world.data.qvel[:3] = (0.3, 0.0, 0.0)
    recorder.sample(NOW)
    columns = recorder.samples
    assert columns['t'] == [0.0]
    assert columns['state'] == ['trotting']
    assert columns['command'] == [[0.1, 0.2, 0.3]]
    assert columns['odom'] == [[1.0, 2.0, 3.0]]
    assert columns['contacts'] == [[1, 0, 0, 1]]
    assert columns['position'] == [[1.0, -2.0, 0.5]]
    np.testing.assert_allclose(columns['velocity'], [[0.3, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(columns['rpy'], [[0.0, 0.0, 0.0]], atol=1e-12)


def test_velocity_is_in_the_yaw_aligned_frame_of_the_base(world, recorder):
    world.data.qpos[3:7] = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # looks along y
    world.data.qvel[:3] = (0.0, 0.4, 0.0)
    recorder.sample(NOW)
    np.testing.assert_allclose(recorder.samples['velocity'], [[0.4, 0.0, 0.0]], atol=1e-12)


def test_the_yaw_of_odometry_is_between_minus_pi_and_pi(recorder):
    recorder.sample(NOW._replace(odometry=(0.0, 0.0, 4.0)))
    assert recorder.samples['odom'][0][2] == pytest.approx(4.0 - 2.0 * math.pi)
    recorder.sample(NOW._replace(odometry=(0.0, 0.0, -7.0)))
    assert recorder.samples['odom'][1][2] == pytest.approx(-7.0 + 2.0 * math.pi)


def test_59_degrees_is_no_fall_and_61_is(world, recorder):
    tilt(world, 59.0)
    recorder.sample(NOW)
    assert (recorder.falls, recorder.fell_at) == (0, None)
    world.step(20)
    tilt(world, 61.0)
    recorder.sample(NOW)
    assert (recorder.falls, recorder.fell_at) == (1, pytest.approx(0.02))


def test_lying_on_is_one_fall_and_falling_again_another(world, recorder):
    for angle in (0.0, 70.0, 90.0, 120.0):
        tilt(world, angle)
        recorder.sample(NOW)
    assert recorder.falls == 1
    first = recorder.fell_at
    for angle in (*[10.0] * UP_AGAIN, 100.0):
        world.step(20)
        tilt(world, angle)
        recorder.sample(NOW)
    assert recorder.falls == 2
    assert recorder.fell_at == first


def test_a_trunk_on_the_ground_is_a_fall_too(recorder):
    for sample in (NOW, DOWN, DOWN, *[NOW] * UP_AGAIN, DOWN):
        recorder.sample(sample)
    assert recorder.falls == 2
    assert recorder.fell_at == 0.0


def test_a_trunk_that_bounces_has_fallen_once(recorder):
    for sample in (DOWN, *[NOW] * (UP_AGAIN - 1), DOWN, NOW, DOWN):
        recorder.sample(sample)
    assert recorder.falls == 1


def watched(*seen):
    """Return whether each of some (touches, state, event) is a fall."""
    watch = TrunkWatch()
    return [watch.is_down(*now) for now in seen]


def test_a_trunk_that_bounces_as_the_robot_rises_is_no_fall():
    rises = [(touches, 'fixed stand', None) for touches in (True, False, True, False, True)]
    assert not any(watched((True, 'passive', None), *rises))


@pytest.mark.parametrize('last', [(True, 'fixed stand', None), (True, 'passive', 'tilt')])
def test_a_trunk_that_comes_down_after_the_robot_was_up_is_a_fall(last):
    up = [(False, 'fixed stand', None)] * UP_AGAIN
    assert watched(*up, last, last)[-2:] == [True, True]
    assert not watched(*up, (True, 'passive', None))[-1]  # let go of by key


def test_falling_over_and_onto_the_trunk_is_one_fall(world, recorder):
    tilt(world, 70.0)
    recorder.sample(NOW)
    tilt(world, 0.0)
    recorder.sample(DOWN)
    assert recorder.falls == 1


def report_of(recorder, wall_time=0.5):
    run = {'robot': 'mbot', 'world': 'flat', 'seed': 0, 'estimator': 'odometry'}
    return build_report(recorder, run, 1.0000000001, wall_time, TICKS)


def test_the_report_has_the_fields_of_the_contract(recorder):
    recorder.sample(NOW)
    report = report_of(recorder)
    assert list(report) == [
        'schema', 'robot', 'world', 'seed', 'estimator', 'sim_time', 'wall_time',
        'real_time_factor', 'tick', 'falls', 'fell_at', 'samples',
    ]  # fmt: skip
    assert list(report['samples']) == [
        't', 'state', 'command', 'position', 'rpy', 'velocity', 'odom', 'contacts', 'torque_max',
    ]  # fmt: skip
    assert report['sim_time'] == 1.0
    assert report['real_time_factor'] == 2.0
    assert report['tick'] == {'median_us': 1.0, 'p99_us': 2.0, 'max_us': 3.0, 'overruns': 0}


def test_a_run_of_no_length_has_a_report(recorder):
    assert report_of(recorder, wall_time=0.0)['real_time_factor'] == 0.0


def write_report(report, path):
    """Write a report as a run does."""
    OutputFile(path, '--report').write(to_json(report))


def test_a_report_can_be_read_back_by_everybody(recorder, tmp_path):
    recorder.sample(NOW)
    path = tmp_path / 'report.json'
    write_report(report_of(recorder), path)
    assert json.loads(path.read_text()) == report_of(recorder)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    assert os.listdir(tmp_path) == ['report.json']


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path):
    path = tmp_path / 'report.json'
    path.write_text('old')
    with pytest.raises(TypeError):
        write_report({'samples': object()}, path)
    assert path.read_text() == 'old'
    assert os.listdir(tmp_path) == ['report.json']


def test_a_report_replaces_the_one_before(recorder, tmp_path):
    path = tmp_path / 'report.json'
    path.write_text('x' * 100_000)
    write_report(report_of(recorder), path)
    assert json.loads(path.read_text())['schema'] == 1
