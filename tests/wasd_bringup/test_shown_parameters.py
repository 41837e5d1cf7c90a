# SPDX-License-Identifier: Apache-2.0
"""The simulator of a run shows with which parameters the robot was built, and takes no others."""

from mujoco_sim.parameters import Payload, Untold
import pytest
import rclpy
from rclpy.parameter import Parameter
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions
from wasd_core.errors import UserError
from wasd_core.node import init_ros

pytestmark = pytest.mark.slow

UNTOLD = Untold(friction=0.3, payload=Payload(0.1, (0.05, 0.0, 0.02)))


@pytest.fixture
def run_with(request, isolated_ros):
    """Return a function that makes a run with parameters after --ros-args."""

    def make(robot='mbot', preset='mbot', untold=UNTOLD, **parameters):
        words = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
        init_ros(['--ros-args', *words])
        request.addfinalizer(rclpy.try_shutdown)
        run = make_ros_run(
            RunOptions(
                robot=robot,
                description=robot,
                preset=preset,
                speed=0.0,
                lidar='a1',
                untold=untold,
            )
        )
        request.addfinalizer(run.close)
        return run.face.faces[0].simulator

    return make


def test_what_is_shown_is_what_the_options_say(run_with):
    simulator = run_with()
    for name, value in (('lidar', 'a1'), ('friction', 0.3), ('payload', '0.1@0.05,0.0,0.02')):
        assert simulator.get_parameter(name).value == value


def test_who_says_the_same_or_nothing_in_particular_sees_it_too(run_with):
    simulator = run_with(lidar='honest', friction='.nan', payload="'0.1@0.05,0,0.02'")
    for name, value in (('lidar', 'a1'), ('friction', 0.3), ('imu_drift', 1.0)):
        assert simulator.get_parameter(name).value == value


@pytest.mark.parametrize(
    ('robot', 'name', 'value', 'cure'),
    [
        ('mbot', 'friction', 0.1, 'leave it out, or say --friction'),
        ('mbot', 'lidar', 'ideal', 'leave it out, or say --lidar'),
        ('go2', 'imu_drift', 2.0, 'leave it out, or say --imu-drift'),
        ('mbot', 'imu_drift', 2.0, 'leave it out'),
        ('g1', 'randomise', 0.5, 'leave it out'),
        ('both', 'imu_drift', 2.0, 'leave it out, or say --imu-drift'),
        ('both', 'payload', "'3'", 'leave it out'),
        ('mbot', 'hoist', 'true', 'leave it out'),
        ('mbot', 'payload', "'3'", 'leave it out, or say --payload'),
    ],
)
def test_what_would_be_without_effect_is_refused_with_the_option_that_the_command_has(
    run_with, robot, name, value, cure
):
    with pytest.raises(UserError, match=f'^simulator: {name} has no effect in a run: {cure}$'):
        run_with(robot, 'wasd', **{name: value})


def test_only_a_parameter_that_no_node_of_a_run_has_is_told_as_misspelt(run_with, capfd):
    run_with(speed=0.1, port='/dev/null', base_width=0.4, turnn=1.0)
    said = capfd.readouterr().err
    assert said.count('unknown parameter') == 1
    assert "unknown parameter 'turnn', did you mean turn?: ignored" in said


def test_parameters_that_the_options_overrule_are_told_in_one_line_and_change_nothing(
    run_with, capfd
):
    # Its nodes have these, but the run decides; the keys have a speed of theirs, and a turn.
    simulator = run_with(seed=7, world='room', speed=0.1, turn=0.5, friction='.nan')
    said = [line for line in capfd.readouterr().err.splitlines() if 'without effect' in line]
    assert len(said) == 1
    assert said[0].startswith('WARNING: without effect here: ')
    assert {'-p seed', '-p world'} <= set(said[0].rpartition(': ')[2].split(', '))
    assert '-p speed' not in said[0]
    assert '-p turn' not in said[0]
    assert simulator.get_parameter('seed').value == 0


def test_parameters_in_force_are_not_told_as_vain(run_with, capfd):
    run_with(seed=0, speed=0.1, world='flat', lidar='a1')
    assert 'without effect' not in capfd.readouterr().err


def test_a_run_is_the_clock_of_its_nodes_whatever_use_sim_time_is_set_to(run_with):
    simulator = run_with(use_sim_time='true')
    for value in (False, True, False):
        simulator.set_parameters([Parameter('use_sim_time', value=value)])
        assert simulator.get_clock().now().nanoseconds == 0
