# SPDX-License-Identifier: Apache-2.0
"""The simulator's parameters, at start and while it runs, and its way out as a process."""

import os
import signal
import threading

from mujoco_sim.simulator_node import main
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.world import build_world
import pytest
from rclpy.parameter import Parameter
from wasd_core.errors import UserError


@pytest.fixture
def simulator(spawn, loaded, world):
    return spawn(SimulatorNode(loaded, world))


def test_the_speed_can_be_changed_while_it_runs_and_the_world_cannot(simulator):
    def set_to(name, value):
        return simulator.set_parameters([Parameter(name, value=value)])[0]

    assert set_to('speed', 0.5).successful
    assert simulator.simulation.pacer.speed == 0.5
    refused = set_to('speed', -1.0)
    # In ROS' own words, which know the range that tools show.
    assert not refused.successful
    assert refused.reason == 'Parameter speed out of range Min: 0.0, Max: inf, value: -1.0'
    assert simulator.simulation.pacer.speed == 0.5
    assert 'read-only' in set_to('world', 'room').reason


@pytest.mark.parametrize(
    ('overrides', 'message'),
    [
        ({'world': 'moon'}, '^world moon: no such file'),
        ({'world': 'slope:x'}, '^world slope:x: wanted a number from -45 to 45'),
        ({'description': 'dog'}, '^dog: no such file'),
        ({'speed': -1.0}, 'speed must be >= 0, got -1.0'),
        ({'seed': -1}, 'seed must be >= 0, got -1'),
        ({'clock_rate': 5000.0}, 'clock_rate must be > 0 and <= 1000 Hz, got 5000.0'),
    ],
)
def test_what_cannot_be_is_refused_at_start(ros, overrides, message):
    with pytest.raises(UserError, match=message):
        SimulatorNode(parameter_overrides=[Parameter(k, value=v) for k, v in overrides.items()])


def test_a_rate_between_physics_steps_is_refused(spawn, loaded):
    node = spawn(
        SimulatorNode(
            loaded,
            build_world(loaded),
            parameter_overrides=[Parameter('clock_rate', value=60.0)],
        )
    )
    with pytest.raises(
        UserError, match='^clock_rate: 60 Hz does not fit .*nearest: 50 or 62.5 Hz'
    ):
        node.schedule_publishing()


def test_as_a_process_it_ends_on_ctrl_c_with_status_0(isolated_ros):
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    assert main([]) == 0


def test_as_a_process_it_says_what_is_wrong_in_one_line(isolated_ros, capsys):
    assert main(['--ros-args', '-p', 'world:=moon']) == 2
    said = capsys.readouterr().err
    assert said.startswith('error: ')
    assert said.count('\n') == 1
