# SPDX-License-Identifier: Apache-2.0
"""`wasd describe policy FILE`: what it says of a file, and of a wrong joint order."""

import numpy as np
from policy_files import constant, exporter, MOTORS, ORDERS, rl_sar, torchscript, write
from policy_player.onnx_writer import write_layers
from policy_player.policy_file import read_policy
from policy_player.usual import orders
import pytest
from wasd_bringup.cli.main import main
from wasd_bringup.tools import describe_policy
from wasd_bringup.tools.describe_policy import out_of_range, Stand, suspicions

HOME = dict(zip(MOTORS, (0.0, 0.8, -1.6) * 4, strict=True))


def standing(folder, **changes):
    """Return files of a policy that holds its pose."""
    path = folder / 'policy.pt'
    path.write_bytes(torchscript(exporter(*constant(45, np.zeros(12)))))
    said = {'default_dof_pos': list(HOME.values()), 'action_scale': [0.25] * 12}
    said |= {'rl_kp': [40.0] * 12, 'rl_kd': [1.0] * 12, **changes}
    return path, write(folder, 'config.yaml', rl_sar(MOTORS, **said))


def test_it_says_what_the_file_says(tmp_path, capsys):
    path, _ = standing(tmp_path)
    assert main(['describe', 'policy', str(path), '--no-trial']) == 0
    told = capsys.readouterr().out
    for words in (
        'network      45 numbers to 12',
        'step         20 ms',
        'joints       FR FL RR RL, leg by leg',
        'stiffness    40 N m/rad',
        'default      0 0.8 -1.6 0 0.8',
        'observation  command x 2 2 0.25',
        'assumed      dt 0.005: neither config.yaml nor base.yaml says it',
        'assumed      decimation 4: neither',
    ):
        assert words in told


def test_what_is_odd_is_told_and_makes_the_status_1(tmp_path, capsys):
    path, _ = standing(tmp_path, rl_kd=[0.0] * 12)
    assert main(['describe', 'policy', str(path), '--no-trial']) == 1
    assert 'odd          damping 0' in capsys.readouterr().out


def test_a_file_that_cannot_be_read_is_one_line(tmp_path, capsys):
    path = tmp_path / 'walk.onnx'
    path.write_bytes(b'no network')
    assert main(['describe', 'policy', str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert 'is no ONNX or TorchScript file' in said


def test_the_first_observation_out_of_range_is_named(tmp_path):
    spec = read_policy(*standing(tmp_path)).spec
    shown = np.zeros((2, 45))
    assert out_of_range(spec, shown) == ''
    shown[1, 40] = 11.0
    shown[1, 10] = 12.0
    assert out_of_range(spec, shown).startswith('joint_position[1]: 0 to 12')


@pytest.mark.slow
def test_a_network_whose_output_is_no_number_is_told_and_nothing_else_is_tried(tmp_path, capsys):
    path, _ = standing(tmp_path)
    path.write_bytes(torchscript(exporter(*constant(45, np.full(12, np.nan)))))
    assert main(['describe', 'policy', str(path)]) == 1
    told = capsys.readouterr().out
    assert 'trial        the output of the network is not a number\n' in told
    assert 'suspect' not in told


@pytest.mark.slow
def test_a_network_that_sees_heights_is_tried_with_them(tmp_path, monkeypatch, capsys):
    pytest.importorskip('onnxruntime')
    for name in ('STILL', 'AHEAD', 'TURN'):
        monkeypatch.setattr(describe_policy, name, 0.6)
    monkeypatch.setattr(describe_policy, 'variants', lambda spec: [('', spec)])
    spec = pytest.importorskip('wasd.environment', exc_type=ImportError).WITH_HEIGHTS
    path = tmp_path / 'walk.onnx'
    write_layers(path, spec, [(np.zeros((12, spec.width)), np.zeros(12))])
    main(['describe', 'policy', str(path)])
    told = capsys.readouterr().out
    assert 'trial        at zero command it drifts at' in told
    assert 'no heights' not in told


@pytest.mark.slow
def test_a_wrong_joint_order_is_told_by_trying_others(tmp_path, monkeypatch):
    by_kind = ORDERS['by kind']
    # The numbers are joint by joint, their names leg by leg: it tips over.
    pose = [HOME[name] for name in by_kind]
    policy = read_policy(*standing(tmp_path, default_dof_pos=pose))
    for name in ('STILL', 'AHEAD', 'TURN'):
        monkeypatch.setattr(describe_policy, name, 0.6)
    # Orders are among what is tried, see test_usual.py.
    monkeypatch.setattr(describe_policy, 'variants', orders)
    stand = Stand(policy.spec.joints)
    trial = stand.try_policy(policy)
    assert trial.fell_at is not None
    assert any('by kind, not as told' in words for words in suspicions(stand, policy, trial))
