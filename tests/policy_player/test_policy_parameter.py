# SPDX-License-Identifier: Apache-2.0
"""The parameter `policy` of the leg controller: alone as a node, from a file, wrong."""

from cases import for_all
from descriptions import robot_named
from mujoco_sim.scene import AHEAD, EDGE
import numpy as np
from policy_player.onnx_writer import write_layers
import pytest
from quadruped_sim.leg_controller_node import LegControllerNode
from rclpy.parameter import Parameter
import wasd
from wasd.environment import WITH_HEIGHTS
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_core.errors import UserError

pytest.importorskip('onnxruntime')
pytest.importorskip('gymnasium')


def make_node(**values):
    """Return the leg controller as a node with these parameters."""
    given = [Parameter(name, value=value) for name, value in values.items()]
    return LegControllerNode(parameter_overrides=given)


def test_the_node_alone_plays_the_network_that_it_names(ros):
    node = make_node(policy='ours')
    assert node.legs.controller.has_policy
    assert not make_node().legs.controller.has_policy


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'policy': 'nowhere.onnx'}, 'nowhere.onnx'),
        ({'policy_config': 'legged_gym'}, 'policy_config needs a network: give one'),
    ],
)
def test_a_wrong_one_is_said_in_a_line(ros, values, words):
    with pytest.raises(UserError, match=words) as error:
        make_node(**values)
    assert '\n' not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize(('scan', 'most'), [('truth', 0.01), ('map', 0.03)])
def test_a_network_sees_the_step_ahead_as_it_is_or_as_the_robot_has_mapped_it(
    tmp_path, scan, most
):
    still = [(np.zeros((12, WITH_HEIGHTS.width)), np.zeros(12))]
    write_layers(tmp_path / 'a.onnx', WITH_HEIGHTS, still)
    dog = wasd.Go2('step:0.1', policy=tmp_path / 'a.onnx', height_scan=scan)
    dog.press('2')
    dog.run(1.3)
    dog.press('5')
    while dog.truth.position[0] < 0.45:
        dog.drive(0.3)
        dog.run(0.1)
    dog.drive(0.0)
    dog.run(1.0)
    dog.press('2')
    dog.run(1.0)
    dog.press('p')
    dog.run(1.2)
    assert dog.state == 'policy'
    assert dog._robot.legs.wants_map == (scan == 'map')  # nobody maps for nobody
    shown = dog._robot.legs._walker.observation[-187:].reshape(11, 17)
    x, _, z = dog.truth.position
    columns = x + np.linspace(-0.8, 0.8, 17)
    before, behind = columns < AHEAD - 0.05, columns > AHEAD + EDGE + 0.05
    assert behind.any()
    np.testing.assert_allclose(shown[:, before], z - 0.5, atol=most)
    np.testing.assert_allclose(shown[:, behind], z - 0.6, atol=most)


def test_without_a_lidar_a_network_that_sees_heights_is_refused_with_the_cure(tmp_path):
    still = [(np.zeros((12, WITH_HEIGHTS.width)), np.zeros(12))]
    write_layers(tmp_path / 'a.onnx', WITH_HEIGHTS, still)
    bare = robot_named('go2').urdf.replace('type="gpu_ray"', 'type="none"')
    (tmp_path / 'bare.urdf').write_text(bare)
    options = {'description': str(tmp_path / 'bare.urdf'), 'policy': tmp_path / 'a.onnx'}
    words = '--policy: go2 has no lidar of points.*--height-scan truth'
    with pytest.raises(UserError, match=words):
        wasd.Go2(**options)
    wasd.Go2(**options, height_scan='truth')


@for_all('given', [{'controller': True}, {'policy': 'ours'}])
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
