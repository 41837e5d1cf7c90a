# SPDX-License-Identifier: Apache-2.0
"""Files of strangers: nothing of them runs, and what is wrong is said in one line."""

import pickle
import signal
import subprocess
import sys
import zipfile

from cases import for_all
import numpy as np
from policy_files import (
    chain,
    constant,
    deploy,
    exporter,
    FORWARD,
    layers,
    mjlab,
    MOTORS,
    onnx,
    rl_sar,
    run,
    sparse_file,
    TorchModule,
    torchscript,
    write,
)
from policy_player.policy_file import read_policy
from policy_player.spec import PolicyError
import pytest
from wasd_core.errors import Stopped
from wasd_core.signals import StopSignals
import yaml

from policy_player import first_look, policy_file

pytest.importorskip('onnxruntime')
ZERO = constant(45, np.zeros(12))


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def refusal(path, config=None) -> str:
    with pytest.raises(PolicyError) as caught:
        read_policy(path, config)
    text = str(caught.value)
    assert '\n' not in text
    return text


@pytest.fixture
def policy(tmp_path):
    """A network that fits 45 numbers, without metadata."""
    path = tmp_path / 'policy.pt'
    path.write_bytes(torchscript(exporter(*ZERO)))
    return path


turned = {'base_velocity': {'ranges': {'lin_vel_x': [1, -1], 'lin_vel_y': 0, 'ang_vel_z': 0}}}
crossed = {'scale': 0.25, 'offset': 0.0, 'clip': [[1, -1]] * 12}


@for_all(
    ('change', 'words'),
    [
        (
            {'observations': {'motion_anchor': None}},
            "'motion_anchor': this robot does not measure it",
        ),
        ({'observations': {'joint_pos': None}}, 'observations.joint_pos: in doubt'),
        ({'observations': {'base_ang_vel': {'scale': [1, 2]}}}, 'base_ang_vel.scale: got 2'),
        ({'observations': {'base_ang_vel': {'history_length': -1}}}, 'history_length: got -1'),
        ({'observations': {}}, 'observations: there are none'),
        (
            {'observations': {'base_ang_vel': {'scal': [1]}}},
            'scal: not known, did you mean scale?',
        ),
        ({'observations': {'last_action': {'history_lenght': 5}}}, 'did you mean history_length?'),
        ({'actions': {'JointPositionAction': {'scale': 1.0}}}, 'Action.offset: it is missing'),
        ({'joint_ids_map': [0, 0, 1]}, 'joint_ids_map: got'),
        ({'joint_ids_map': list(range(11))}, 'the order of 11 motors is not known'),
        ({'stiffness': [20.0] * 11}, 'stiffness: got 11 numbers, wanted 12'),
        ({'damping': [float('nan')] * 12}, 'damping: got'),
        ({'stiffness': [0.0] * 12}, 'stiffness: all are zero'),
        ({'stiffness': [-1.0] * 12}, 'a negative gain'),
        ({'default_joint_pos': None}, 'default_joint_pos: it is missing'),
        ({'step_dt': 5.0}, 'period: got 5 s'),
        ({'step_dt': '0.02'}, "step_dt: got '0.02', wanted numbers"),
        ({'stiffness': [1e308] * 12}, 'stiffness: got [1e+308'),
        ({'default_joint_pos': 10**300}, 'default_joint_pos: got 1000'),
        ({'commands': turned}, 'ranges of the command: got ((1.0, -1.0)'),
        ({'actions': {'JointPositionAction': crossed}}, 'target clip: wanted low < high'),
        ({'observations': {'use_gym_history': 'false'}}, "use_gym_history: got 'false'"),
        ({'observations': {'y' * 9000: None}}, 'y...: this robot does not measure it'),
        ({'actions': {'JointTorqueAction': {}}}, 'only JointPositionAction is played'),
        ({'actions': 3}, 'actions: wanted names with values'),
    ],
)
def test_a_configuration_in_doubt_is_refused_by_the_name_of_the_term(
    tmp_path, policy, change, words
):
    path = write(tmp_path, 'deploy.yaml', deploy(MOTORS) | change)
    text = refusal(policy, path)
    assert words in text
    assert text.startswith(str(path))


@for_all(
    ('change', 'words'),
    [
        ({'observations': ['ang_vel', 'g1_phase']}, "'g1_phase': this robot does not measure it"),
        ({'observations_history_priority': 'both'}, "got 'both', wanted time or term"),
        ({'wheel_indices': [3]}, 'wheels are not played'),
        ({'commands_scale': [1.0]}, 'commands_scale: got 1 numbers, wanted 3'),
        ({'joint_mapping': [0] * 12}, 'wanted each of 0 to 11 once'),
        ({'num_of_dofs': 'twelve'}, 'num_of_dofs'),
        ({'rl_kd': None}, 'rl_kd: it is missing'),
        ({'clip_obs': 0}, 'observation clip: got 0, wanted more than 0'),
        ({'clip_actions_lower': 3.0}, 'action clip: wanted low < high'),
    ],
)
def test_so_is_one_of_rl_sar(tmp_path, policy, change, words):
    assert words in refusal(policy, write(tmp_path, 'config.yaml', rl_sar(MOTORS, **change)))


@for_all(
    ('change', 'words'),
    [
        ({'joint_stiffness': 'a,b'}, 'metadata joint_stiffness'),
        ({'observation_names': 'base_ang_vel,motion_anchor_pos_b'}, 'motion_anchor_pos_b'),
        ({'observation_terms_scale': '1,2'}, 'observation_terms_scale'),
        ({'observation_terms_clip': '1'}, 'observation_terms_clip'),
        ({'observation_terms_history_length': '1e9,0,0,0,0,0'}, 'history_length'),
        ({'observation_terms_history_length': '-5,0,0,0,0,0'}, 'wanted whole numbers up to 200'),
        ({'observation_terms_history_length': '1.7,0,0,0,0,0'}, 'wanted whole numbers up to 200'),
        ({'observation_terms_scale': '1e308,1,1,1,1,1'}, 'angular_velocity: scale: got (1e+308'),
        ({'command_ranges': 'nan;nan,0;0,0;0'}, 'ranges of the command: got ((nan, nan)'),
        ({'phase_period': '1e-320'}, 'phase_period: got 9.99989e-321 s, wanted 0.001 to'),
        ({'action_scale': '1,2'}, 'metadata action_scale: got 2 numbers, wanted 12'),
        ({'joint_names': ','.join([MOTORS[0]] * 12)}, 'wanted 1 to 100 different names'),
    ],
)
def test_so_is_metadata(tmp_path, change, words):
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(*ZERO, mjlab(MOTORS, **change)))
    assert words in refusal(path)


def test_whole_numbers_may_be_written_as_others(tmp_path, policy):
    shown = {name: {'history_length': 1.0} for name in deploy(MOTORS)['observations']}
    path = write(tmp_path, 'deploy.yaml', deploy(MOTORS, observations=shown))
    assert read_policy(policy, path).spec.terms[0].ages == (0,)
    path = write(tmp_path, 'config.yaml', rl_sar(MOTORS, num_of_dofs=12.0))
    assert len(read_policy(policy, path).spec.joints) == 12


def test_of_rl_sars_step_only_what_no_file_says_is_assumed(tmp_path, policy):
    path = write(tmp_path, 'config.yaml', rl_sar(MOTORS, dt=0.002))
    spec = read_policy(policy, path).spec
    assert spec.period == pytest.approx(0.008)
    assert 'decimation 4: neither config.yaml nor base.yaml says it' in spec.assumed
    assert not any(words.startswith('dt') for words in spec.assumed)


def test_values_merged_into_others_are_refused_not_lost(tmp_path, policy):
    path = write(tmp_path, 'deploy.yaml', deploy(MOTORS))
    text = path.read_text()
    path.write_text(text.replace('base_ang_vel:', 'base_ang_vel:\n    <<: {scale: 0.7}', 1))
    line = 2 + text.splitlines().index('  base_ang_vel:')
    assert refusal(policy, path) == f'{path}:{line}: "<<" is not read: write its values out'


def test_a_name_that_is_there_twice_is_told_with_its_line(tmp_path, policy):
    path = write(tmp_path, 'deploy.yaml', deploy(MOTORS))
    text = path.read_text()
    path.write_text(f'{text}step_dt: 0.01\n')
    line = 1 + len(text.splitlines())
    assert refusal(policy, path) == f"{path}:{line}: 'step_dt' is there twice"


def test_a_missing_history_and_another_width_are_told_by_their_terms(tmp_path):
    heights = 'without height_scan or height_scan_by_row?'
    for width, words in (
        (270, 'a history of 6 steps?'),
        (48, 'without linear_velocity?'),
        (45 + 187, heights),
    ):
        path = tmp_path / 'policy.pt'
        path.write_bytes(torchscript(exporter(*constant(width, np.zeros(12)))))
        text = refusal(path, write(tmp_path, 'deploy.yaml', deploy(MOTORS)))
        assert f'the network takes {width} numbers, deploy.yaml tells of 45' in text
        assert words in text


def test_who_is_told_nothing_is_told_what_to_give(policy):
    assert '--policy-config FILE' in refusal(policy)
    assert 'legged_gym, legged_gym_rough, playground' in refusal(policy)


@for_all('name', ['x' * 5000, 'a\0b'])
def test_a_name_that_no_file_can_have_is_refused_in_a_line(tmp_path, policy, name):
    for path, config in ((name, None), (policy, name)):
        assert refusal(path, config).startswith(name)


def test_a_tag_of_python_is_never_run(tmp_path, policy):
    mark = tmp_path / 'mark'
    text = yaml.safe_dump(deploy(MOTORS), sort_keys=False)
    evil = f'!!python/object/apply:os.system ["touch {mark}"]'
    path = tmp_path / 'deploy.yaml'
    path.write_text(text.replace('joint_ids: null', f'joint_ids: {evil}'))
    assert 'no code was run' in refusal(policy, path)
    assert not mark.exists()
    # The one that Isaac Lab writes means all of them.
    every = '!!python/object/apply:builtins.slice [null, null, null]'
    path.write_text(text.replace('joint_ids: null', f'joint_ids: {every}'))
    assert read_policy(policy, path).spec.width == 45


def test_a_pickle_is_never_run(tmp_path):
    mark = tmp_path / 'mark'

    class Evil:
        def __reduce__(self):
            return __import__('os').system, (f'touch {mark}',)

    path = tmp_path / 'policy.pt'
    config = write(tmp_path, 'config.yaml', rl_sar(MOTORS))
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('policy/data.pkl', pickle.dumps(Evil()))
        archive.writestr('policy/code/__torch__.py', FORWARD)
    assert 'no code was run' in refusal(path, config)
    path.write_bytes(pickle.dumps(Evil()))
    assert 'no ONNX or TorchScript file' in refusal(path, config)
    assert not mark.exists()


def test_a_file_cut_in_its_zip_is_said_to_be_before_its_settings_are_missed(tmp_path):
    path = tmp_path / 'policy.pt'
    path.write_bytes(torchscript(exporter(*ZERO))[:100])
    assert 'cut short' in refusal(path)


@for_all(
    ('change', 'words'),
    [
        ({'rnn': TorchModule('LSTM')}, 'wanted one chain of layers'),
        ({'normalizer': TorchModule('BatchNorm1d')}, 'BatchNorm1d: not known'),
    ],
)
def test_what_torchscript_has_beside_known_layers_is_refused(tmp_path, change, words):
    path = tmp_path / 'policy.pt'
    path.write_bytes(torchscript(exporter(*ZERO, **change)))
    text = refusal(path, write(tmp_path, 'config.yaml', rl_sar(MOTORS)))
    assert words in text
    assert 'export it to ONNX' in text


@for_all('more', ['torch.tanh(', '2.0 * ('])
def test_torchscript_that_computes_itself_is_refused(tmp_path, more):
    path = tmp_path / 'policy.pt'
    path.write_bytes(torchscript(exporter(*ZERO), FORWARD.replace('return (', f'return {more}(')))
    text = refusal(path, write(tmp_path, 'config.yaml', rl_sar(MOTORS)))
    assert 'computes more than its layers do' in text


def test_a_zip_bomb_and_a_file_of_two_gigabytes_are_refused_at_once(tmp_path):
    config = write(tmp_path, 'config.yaml', rl_sar(MOTORS))
    path = tmp_path / 'policy.pt'
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        archive.writestr('policy/data.pkl', b'\0' * 150_000_000)
    assert path.stat().st_size < 1_000_000
    assert 'too much' in refusal(path, config)
    sparse_file(tmp_path / 'large.onnx', 2_000_000_000)
    assert '2000.0 MB is too much' in refusal(tmp_path / 'large.onnx', config)


def test_weights_outside_its_folder_are_not_read(tmp_path, rng):
    weights, biases = layers(rng, 45, 12)
    secret = tmp_path / 'secret.data'
    secret.write_bytes(weights[0].tobytes())
    path = tmp_path / 'policy/walk.onnx'
    path.parent.mkdir()
    for name in ('../secret.data', str(secret)):
        path.write_bytes(onnx(weights, biases, mjlab(MOTORS), external=name))
        assert 'outside its folder: not read' in refusal(path)
    (path.parent / 'link.data').symlink_to(secret)
    path.write_bytes(onnx(weights, biases, mjlab(MOTORS), external='link.data'))
    assert 'outside its folder: not read' in refusal(path)
    path.write_bytes(onnx(weights, biases, mjlab(MOTORS), external='none.data'))
    assert 'no such file beside it' in refusal(path)


@pytest.mark.slow
def test_weights_beside_it_are_read(tmp_path, rng):
    weights, biases = layers(rng, 45, 12)
    (tmp_path / 'walk.onnx.data').write_bytes(weights[0].tobytes())
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(weights, biases, mjlab(MOTORS), external='walk.onnx.data'))
    shown = rng.normal(size=45).astype(np.float32)
    wanted = weights[0] @ shown + biases[0]
    np.testing.assert_allclose(read_policy(path).network(shown), wanted, atol=1e-5)


@pytest.mark.parametrize(('kind', 'most'), [(10, 2e-3), (11, 1e-5)], ids=['float16', 'double'])
def test_an_action_in_numbers_of_another_precision_is_played(tmp_path, rng, kind, most):
    weights, biases = layers(rng, 45, 16, 12)
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(weights, biases, mjlab(MOTORS), last='Cast', kind=kind))
    shown = rng.normal(size=45)
    wanted = run(weights, biases, shown)
    np.testing.assert_allclose(read_policy(path).network(shown), wanted, atol=most)


@pytest.mark.slow
def test_a_network_that_draws_draws_the_same_in_each_process(tmp_path):
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(*ZERO, mjlab(MOTORS), last='RandomNormalLike'))
    script = (
        'import sys; from policy_player.policy_file import read_policy; '
        'network = read_policy(sys.argv[1]).network; print(network(0.0).tolist())'
    )
    words = [sys.executable, '-c', script, str(path)]
    first, second = (subprocess.run(words, capture_output=True, check=True) for _ in range(2))
    assert first.stdout.startswith(b'[')
    assert first.stdout == second.stdout


def test_networks_that_cannot_be_played_are_refused_by_what_is_odd(tmp_path):
    path = tmp_path / 'walk.onnx'

    def refused(**how) -> str:
        path.write_bytes(onnx(*ZERO, mjlab(MOTORS), **how))
        return refusal(path)

    assert "2 inputs ('obs', 'h_in')" in refused(inputs=('obs', 'h_in'))
    assert 'none is called actions' in refused(outputs=('one', 'two'))
    assert 'onnxruntime cannot read it' in refused(last='NoSuchOperator')
    words = "output 'actions': got tensor(int64), wanted tensor(float)"
    assert words in refused(last='Cast', kind=7)
    path.write_bytes(onnx(*constant(45, np.zeros(11)), mjlab(MOTORS)))
    assert 'the network gives 11 numbers' in refusal(path)


def test_a_network_slower_than_its_period_is_refused(tmp_path, policy, monkeypatch):
    config = write(tmp_path, 'deploy.yaml', deploy(MOTORS))
    monkeypatch.setattr(policy_file, 'duration_of', lambda network: 0.031)
    assert 'takes 31 ms a step, which is to last 20 ms' in refusal(policy, config)


@pytest.mark.slow
def test_fifty_corrupted_files_end_in_a_line_or_a_policy(tmp_path, rng):
    weights, biases = layers(rng, 45, 16, 12)
    config = write(tmp_path, 'config.yaml', rl_sar(MOTORS))
    sources = {
        'a.onnx': onnx(weights, biases, mjlab(MOTORS)),
        'a.pt': torchscript(exporter(weights, biases)),
        'deploy.yaml': yaml.safe_dump(deploy(MOTORS), sort_keys=False).encode(),
        'b.onnx': onnx(weights, biases),
    }
    names = ('a.onnx', 'a.pt', 'b.onnx', 'a.pt', 'deploy.yaml')
    (tmp_path / 'good.pt').write_bytes(sources['a.pt'])
    refused = 0
    for trial in range(50):
        name = names[trial % len(names)]
        data = bytearray(sources[name])
        if trial % 3 == 0:
            del data[rng.integers(len(data)) :]
        else:  # where the structure is, at the ends, as well as anywhere
            for _ in range(1 + trial % 4):
                reach = len(data) if trial % 2 else 200
                at = int(rng.integers(reach))
                data[-at if trial % 7 == 0 else at] = int(rng.integers(256))
        path = tmp_path / name
        path.write_bytes(bytes(data))
        asked = (tmp_path / 'good.pt', path) if name == 'deploy.yaml' else (path, config)
        try:
            found = read_policy(*asked)
            found.network(np.zeros(45, np.float32))
        except PolicyError as error:
            refused += 1
            assert '\n' not in str(error)
    assert refused > 25


NESTED = (
    FORWARD.replace('torch.nn.Sequential', 'Actor')
    + """class Actor(Module):
  net : __torch__.torch.nn.Sequential
  def forward(self: __torch__.Actor,
    x: Tensor) -> Tensor:
    _0 = self.net
    return (_0).forward(x, )
"""
)


def test_torchscript_that_computes_itself_within_is_refused(tmp_path):
    path, config = tmp_path / 'policy.pt', write(tmp_path, 'config.yaml', rl_sar(MOTORS))
    actor = TorchModule('Actor', '__torch__', net=chain(*ZERO))
    root = TorchModule('Exporter', '__torch__', actor=actor)
    path.write_bytes(torchscript(root, NESTED))
    assert read_policy(path, config).spec.width == 45
    before, _, after = NESTED.rpartition('return (')
    path.write_bytes(torchscript(root, f'{before}return torch.tanh(({after}'))
    assert 'computes more than its layers do' in refusal(path, config)


# Torch writes the slope into the code alone, in two ways.
ELU = """class ELU(Module):
  def forward(self: __torch__.ELU,
    input: Tensor) -> Tensor:
    _0 = __torch__.torch.nn.functional.elu(input, SLOPE, False, )
    return _0
"""


def test_an_elu_of_another_slope_is_refused(tmp_path):
    path, config = tmp_path / 'policy.pt', write(tmp_path, 'config.yaml', rl_sar(MOTORS))
    weights = [np.zeros((8, 45), np.float32), np.zeros((12, 8), np.float32)]
    root = exporter(weights, [np.zeros(8, np.float32), np.zeros(12, np.float32)])
    root.members['actor'].members['1'].package = '__torch__'
    for slope, is_played in (('1.', True), ('0.5', False)):
        path.write_bytes(torchscript(root, FORWARD + ELU.replace('SLOPE', slope)))
        if is_played:
            assert read_policy(path, config).spec.width == 45
        else:
            assert 'wanted alpha 1' in refusal(path, config)
    traced = ELU.replace('_0 = __torch__.torch.nn.functional.elu(input, SLOPE, False, )\n', '')
    traced = traced.replace('return _0', 'return torch.elu(input, 0.5)')
    path.write_bytes(torchscript(root, FORWARD + traced))
    assert 'wanted alpha 1' in refusal(path, config)


def test_a_recurrent_torchscript_file_is_said_to_be_one(tmp_path):
    path = tmp_path / 'policy.pt'
    path.write_bytes(torchscript(exporter(*ZERO)))
    with zipfile.ZipFile(path, 'a') as archive:
        archive.writestr('policy/code/__torch__/torch/nn/modules/rnn.py', 'class LSTM(Module):\n')
    text = refusal(path, write(tmp_path, 'config.yaml', rl_sar(MOTORS)))
    assert text == f'{path}: is recurrent: a memory is not played'


def test_older_files_of_rl_sar_name_controllers_and_reduce_hips(tmp_path, policy):
    names = [f'{leg}_{part}' for leg in ('FL', 'FR', 'RL', 'RR') for part in PARTS]
    said = rl_sar(
        MOTORS,
        joint_controller_names=[f'{name}_controller' for name in names],
        hip_scale_reduction=0.5,
        hip_scale_reduction_indices=[0, 3, 6, 9],
        action_scale=0.25,
        dt=0.005,
        decimation=4,
    )
    del said['go2/own']['joint_mapping']
    spec = read_policy(policy, write(tmp_path, 'config.yaml', said)).spec
    assert spec.joints == tuple(f'{name}_joint' for name in names)
    assert spec.action_scale == 4 * (0.125, 0.25, 0.25)
    assert spec.assumed == ()
    said['go2/own'] |= {'framework': 'isaacsim', 'rows': 4, 'cols': 3}
    assert 'rows, cols' in refusal(policy, write(tmp_path, 'config.yaml', said))


PARTS = ('hip', 'thigh', 'calf')


def test_an_input_whose_size_has_a_name_is_as_wide_as_its_settings_say(tmp_path):
    path = tmp_path / 'dynamic.onnx'
    path.write_bytes(onnx(*ZERO, mjlab(MOTORS), is_named=True))
    network = read_policy(path).network
    assert (network.takes, network.gives) == (45, 12)
    assert network(np.zeros(45, np.float32)).tolist() == [0.0] * 12
    path.write_bytes(onnx(*constant(46, np.zeros(12)), mjlab(MOTORS), is_named=True))
    assert 'cannot be run on an input of [1, 45]' in refusal(path)


def test_a_stop_while_a_network_is_looked_at_blames_no_network(tmp_path, monkeypatch):
    def end_with_us(words, **options):
        """Return what a terminal's Ctrl-C leaves of who is in its process group."""
        assert options['start_new_session']
        return subprocess.CompletedProcess(words, -signal.SIGINT, b'', b'')

    stop = StopSignals()
    stop.number = signal.SIGINT
    monkeypatch.setattr(StopSignals, 'entered', [stop])
    monkeypatch.setattr(first_look.subprocess, 'run', end_with_us)
    with pytest.raises(Stopped):
        first_look.look(tmp_path / 'a.onnx', 45)
