# SPDX-License-Identifier: Apache-2.0
"""The simulator's parameters, at start and while it runs, and its way out as a process."""

import os
import signal

from mujoco_sim.parameters import Payload, Untold
from mujoco_sim.robot_setup import randomise, usual_setup
from mujoco_sim.simulation import Simulation
from mujoco_sim.simulator_node import main, SimulatorNode
from mujoco_sim.world import build_world
import pytest
from quadruped_sim.parameters import LegNodeParameters
from rclpy.parameter import Parameter
from robot_description.description import load_robot
from wasd_core.errors import UserError

from mujoco_sim import simulator_node

pytestmark = pytest.mark.slow


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
    assert refused.reason == 'Parameter speed out of range Min: 0.0, Max: 1000.0, value: -1.0'
    assert simulator.simulation.pacer.speed == 0.5
    assert 'read-only' in set_to('world', 'room').reason


@pytest.mark.parametrize(
    ('overrides', 'message'),
    [
        ({'world': 'moon'}, '^world moon: no such file'),
        ({'world': 'slope:x'}, '^world slope:x: wanted a number from -45 to 45'),
        ({'description': 'dog'}, '^dog: no such file'),
        ({'speed': -1.0}, 'speed must be 0, or >= 0.001 and <= 1000, got -1.0'),
        ({'seed': -1}, 'seed must be >= 0 and <= 9223372036854775807, got -1'),
        ({'friction': 0.0}, 'friction must be >= 0.01 and <= 2, or NaN: what the description'),
        ({'payload': 'heavy'}, "payload: got 'heavy', wanted KG or KG@X,Y,Z with KG > 0"),
        ({'randomise': 1.0}, '^randomise: a quadruped is wanted'),
        ({'randomise': 1.0, 'hoist': True}, '^randomise: a quadruped is wanted'),
        ({'clock_rate': 5000.0}, 'clock_rate must be >= 1 and <= 1000 Hz, got 5000.0'),
    ],
)
def test_what_cannot_be_is_refused_at_start(ros, overrides, message):
    with pytest.raises(UserError, match=message):
        SimulatorNode(parameter_overrides=[Parameter(k, value=v) for k, v in overrides.items()])


def test_what_the_controller_is_not_told_is_that_of_the_command(spawn):
    told = {'payload': '8@0,0.1,0', 'friction': 0.3, 'randomise': 1.0, 'imu_drift': 2.0}
    told |= {'description': 'go2', 'seed': 3}
    overrides = [Parameter(name, value=value) for name, value in told.items()]
    node = spawn(SimulatorNode(parameter_overrides=overrides))
    payload = Payload(8.0, (0.0, 0.1, 0.0))
    untold = Untold(friction=0.3, payload=payload, randomise=1.0, imu_drift=2.0)
    go2 = load_robot('go2')
    wanted = randomise(usual_setup(go2, True, untold), 3, go2)
    assert node.simulation.world.setup == wanted


def test_a_rate_between_physics_steps_is_refused(spawn, loaded):
    node = spawn(
        SimulatorNode(
            loaded,
            build_world(loaded),
            parameter_overrides=[Parameter('clock_rate', value=60.0)],
        )
    )
    with pytest.raises(UserError, match='^clock_rate: got 60 Hz, .* fit .*; 62.5 Hz does'):
        node.schedule_publishing()


def test_as_a_process_it_ends_on_ctrl_c_with_status_0(isolated_ros, monkeypatch):
    class Interrupted(SimulatorNode):
        """A simulator whose user presses Ctrl-C once it runs."""

        def publish_diagnostics(self, state):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(simulator_node, 'SimulatorNode', Interrupted)
    assert main([]) == 0


def test_as_a_process_it_says_what_is_wrong_in_one_line(isolated_ros, capsys):
    assert main(['--ros-args', '-p', 'world:=moon']) == 2
    said = capsys.readouterr().err
    assert said.startswith('error: ')
    assert said.count('\n') == 1


@pytest.mark.parametrize(
    ('overrides', 'rate'),
    [
        ({'description': 'go2'}, LegNodeParameters().update_rate),
        ({'description': 'mbot'}, 100.0),
        ({'description': 'go2', 'state_rate': 200.0}, 200.0),
    ],
)
def test_the_state_comes_as_often_as_the_robots_controller_needs(spawn, overrides, rate):
    given = [Parameter(name, value=value) for name, value in overrides.items()]
    count_states(spawn(SimulatorNode(parameter_overrides=given)), rate)


def test_in_a_simulation_that_it_is_given_the_state_comes_as_often_as_it_is_shown(
    spawn, loaded, world
):
    simulation = Simulation(world, 1.0)
    count_states(spawn(SimulatorNode(loaded, world, simulation=simulation)), 50.0)


def count_states(node, rate):
    """Check how often the state comes [Hz]."""
    node.schedule_publishing()
    seen = []
    node.truth.publish = lambda tell: seen.append(node.simulation.world.time)
    node.simulation.advance(200)
    assert len(seen) == round(0.2 * rate)
