# SPDX-License-Identifier: Apache-2.0
"""The parameter `policy` of the leg controller: alone as a node, from a file, wrong."""

import pytest
from quadruped_sim.leg_controller_node import LegControllerNode
from rclpy.parameter import Parameter
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.errors import UserError

pytest.importorskip('onnxruntime')


def make_node(**values):
    """Return the leg controller as a node with these parameters."""
    given = [Parameter(name, value=value) for name, value in values.items()]
    return LegControllerNode(parameter_overrides=given)


def test_the_node_alone_plays_the_network_that_it_names(ros):
    node = make_node(policy='ours')
    assert node.controller.has_policy
    assert not make_node().controller.has_policy


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'policy': 'nowhere.onnx'}, 'nowhere.onnx'),
        ({'policy_config': 'legged_gym'}, 'policy_config: .* give it by policy'),
    ],
)
def test_a_wrong_one_is_said_in_a_line(ros, values, words):
    with pytest.raises(UserError, match=words) as error:
        make_node(**values)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('given', [{'controller': True}, {'policy': 'ours'}])
def test_a_run_plays_the_network_of_its_file_or_of_its_option(tmp_path, given):
    (tmp_path / 'legs.yaml').write_text('policy: ours\n')
    if 'controller' in given:
        given = {'controller': str(tmp_path / 'legs.yaml')}
    options = RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0, **given)
    run = Run(options)
    robot = run.robots[0]
    assert robot.legs.controller.has_policy
    assert robot.legs.settings.policy == 'ours'
    run.close()
