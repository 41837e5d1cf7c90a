# SPDX-License-Identifier: Apache-2.0
"""Policies of each framework: observation and target equal an independent reference's."""

from dataclasses import replace

from cases import for_all
import numpy as np
from policy_files import (
    constant,
    deploy,
    exporter,
    FORWARD,
    layers,
    mjlab,
    MOTORS,
    onnx,
    ORDERS,
    rl_sar,
    RL_SAR_BASE,
    run,
    TorchModule,
    torchscript,
    write,
)
from policy_player.formats import from_deploy, from_metadata, from_rl_gym, PRESETS
from policy_player.observations import Observer
from policy_player.onnx_writer import metadata_of, write_layers
from policy_player.player import Player
from policy_player.policy_file import read_policy
from policy_player.spec import MOTOR_ORDER, PolicyError, PolicySpec, Term
import pytest
from quadruped_sim.height_scan import COLUMNS, ROWS
from wasd_core.robot_io import Senses

pytest.importorskip('onnxruntime')
STEPS = 9
G1_ORDER = MOTOR_ORDER[29]


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def moments(rng, joints: tuple[str, ...]) -> list[dict]:
    """Return what a robot goes through, joints by name; nothing of it in a policy's order."""
    found = []
    for _ in range(STEPS):
        quaternion = rng.normal(size=4)
        found.append(
            {
                'q': quaternion / np.linalg.norm(quaternion),
                'omega': rng.normal(size=3),
                'v': rng.normal(size=3),
                'command': rng.uniform(-1, 1, 3),
                'position': dict(zip(joints, rng.normal(size=len(joints)), strict=True)),
                'velocity': dict(zip(joints, 5 * rng.normal(size=len(joints)), strict=True)),
            }
        )
    return found


def down(q: np.ndarray) -> np.ndarray:
    """Return R(q)^T (0, 0, -1) by the rotation matrix."""
    w, x, y, z = q
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return R.T @ (0.0, 0.0, -1.0)


def play(policy, moments) -> list[tuple[np.ndarray, dict]]:
    """Return what is shown to the network and the targets by joint, moment by moment."""
    player, found = Player(policy), []
    for moment in moments:
        joints = [
            np.array([moment[kind][name] for name in player.joints])
            for kind in ('position', 'velocity')
        ]
        senses = Senses(moment['q'], moment['omega'], moment['v'], *joints)
        targets = player.step(senses, moment['command'], policy.spec.period)
        named = zip(player.joints, np.array(targets).T, strict=True)
        found.append((player.observation, dict(named)))
    return found


def compare(policy, moments, reference) -> None:
    """Compare with `reference(past moments, past actions) -> (shown, action, targets by name)`."""
    actions = []
    for at, (shown, targets) in enumerate(play(policy, moments)):
        wanted, action, wanted_targets = reference(moments[: at + 1], actions)
        actions.append(action)
        np.testing.assert_allclose(shown, wanted, atol=1e-6, rtol=1e-6)
        assert targets.keys() == wanted_targets.keys()
        for name, target in targets.items():
            np.testing.assert_allclose(target, wanted_targets[name], atol=1e-6, rtol=1e-6)


@pytest.mark.slow
# Each is a process that looks at the network: of what was before, in two orders.
@for_all(
    ('order', 'length'),
    [*((order, 0) for order in [*ORDERS, 'G1']), ('by kind, FR first', 4), ('G1', 4)],
)
def test_metadata_of_mjlab(tmp_path, rng, order, length):
    joints = G1_ORDER if order == 'G1' else ORDERS[order]
    count = len(joints)
    weights, biases = layers(rng, (9 + 3 * count) * max(length, 1), 32, count)
    extra = {
        'observation_terms_scale': '0.5,1,2,1,0.05,1',
        'observation_terms_clip': '-1;1,-inf;inf,-inf;inf,-inf;inf,-20;20,-inf;inf',
        'observation_terms_history_length': ','.join([str(length)] * 6),
    }
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(weights, biases, mjlab(joints, **extra)))

    def reference(past, actions):
        def terms(index):
            m = past[max(index, 0)]
            before = actions[index - 1] if index > 0 else np.zeros(count)
            return [
                0.5 * np.clip(m['omega'], -1, 1),
                down(m['q']),
                2 * m['command'],
                [m['position'][name] - (0.1 * i - 0.5) for i, name in enumerate(joints)],
                [0.05 * np.clip(m['velocity'][name], -20, 20) for name in joints],
                before,
            ]

        now = len(past) - 1
        rows = [terms(now - age) for age in range(max(length, 1))][::-1]
        shown = np.concatenate([row[term] for term in range(6) for row in rows])
        action = run(weights, biases, shown)
        targets = {
            name: (0.1 * i - 0.5 + round(0.2 + 0.01 * i, 3) * action[i], 20 + i, 0.5 + 0.01 * i)
            for i, name in enumerate(joints)
        }
        return shown, action, targets

    compare(read_policy(path), moments(rng, joints), reference)


@pytest.mark.slow
@for_all('order', [*ORDERS, 'G1'])
@for_all(('length', 'by_time'), [(1, False), (5, False), (3, True)])
def test_deploy_yaml_of_isaac_lab(tmp_path, rng, order, length, by_time):
    motors = G1_ORDER if order == 'G1' else MOTORS
    joints = tuple(rng.permutation(G1_ORDER).tolist()) if order == 'G1' else ORDERS[order]
    count = len(joints)
    said = deploy(joints, motors)
    for term in said['observations'].values():
        term['history_length'] = length
    said['observations']['joint_vel_rel']['clip'] = [-10.0, 10.0]
    said['observations'] = {'use_gym_history': by_time, **said['observations']}
    said['actions']['JointPositionAction']['clip'] = [[-0.6, 0.7]] * count
    weights, biases = layers(rng, (9 + 3 * count) * length, 24, count)
    path = tmp_path / 'exported/policy.onnx'
    path.parent.mkdir()
    path.write_bytes(onnx(weights, biases))
    write(tmp_path, 'params/deploy.yaml', said)

    def reference(past, actions):
        def terms(index):
            m = past[max(index, 0)]
            before = actions[index - 1] if index > 0 else np.zeros(count)
            return [
                0.2 * m['omega'],
                down(m['q']),
                m['command'],
                [m['position'][name] - (0.1 * i - 0.5) for i, name in enumerate(joints)],
                [0.05 * np.clip(m['velocity'][name], -10, 10) for name in joints],
                before,
            ]

        now = len(past) - 1
        rows = [terms(now - age) for age in range(length)][::-1]
        if by_time:
            shown = np.concatenate([part for row in rows for part in row])
        else:
            shown = np.concatenate([row[term] for term in range(6) for row in rows])
        action = run(weights, biases, shown)
        targets = {}
        for i, name in enumerate(joints):
            motor = motors.index(name)
            target = np.clip(0.1 * i - 0.45 + (0.25 + 0.01 * i) * action[i], -0.6, 0.7)
            targets[name] = (target, 20 + motor, 0.5 + 0.01 * motor)
        return shown, action, targets

    policy = read_policy(path)
    assert policy.spec.ranges == ((-0.5, 1.0), (-0.3, 0.3), (-0.2, 0.2))
    compare(policy, moments(rng, joints), reference)


GYM = {
    'policy_path': '{LEGGED_GYM_ROOT_DIR}/deploy/pre_train/g1/motion.pt',
    'kps': [100.0, 100.0, 100.0, 150.0, 40.0, 40.0] * 2,
    'kds': [2.0, 2.0, 2.0, 4.0, 2.0, 2.5] * 2,
    'default_angles': [-0.1, 0.0, 0.0, 0.3, -0.2, 0.0, -0.12, 0.0, 0.0, 0.31, -0.2, 0.0],
    'ang_vel_scale': 0.25,
    'dof_pos_scale': 1.0,
    'dof_vel_scale': 0.05,
    'action_scale': 0.25,
    'cmd_scale': [2.0, 2.0, 0.25],
    'num_actions': 12,
}
GYM_STEPS = {
    'deploy_mujoco': {'simulation_dt': 0.002, 'control_decimation': 10},
    'deploy_real': {'control_dt': 0.02, 'max_cmd': [0.8, 0.5, 1.57]},
}


@pytest.mark.slow
@pytest.mark.parametrize('kind', GYM_STEPS)
@pytest.mark.parametrize('width', [45, 47])
def test_the_file_of_unitree_rl_gym_is_of_the_twelve_joints_of_a_g1s_legs(
    tmp_path, rng, kind, width
):
    weights, biases = layers(rng, width, 24, 12)
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(weights, biases))
    config = write(tmp_path, 'g1.yaml', {**GYM, **GYM_STEPS[kind], 'num_obs': width})
    joints = G1_ORDER[:12]

    def reference(past, actions):
        m, turn = past[-1], 2 * np.pi * 0.02 * (len(past) - 1) / 0.8
        rest = dict(zip(joints, GYM['default_angles'], strict=True))
        shown = np.concatenate(
            [
                0.25 * m['omega'],
                down(m['q']),
                m['command'] * (2.0, 2.0, 0.25),
                [m['position'][name] - rest[name] for name in joints],
                [0.05 * m['velocity'][name] for name in joints],
                actions[-1] if actions else np.zeros(12),
                [np.sin(turn), np.cos(turn)][: width - 45],
            ]
        )
        action = run(weights, biases, shown)
        return (
            shown,
            action,
            {
                name: (rest[name] + 0.25 * action[i], GYM['kps'][i], GYM['kds'][i])
                for i, name in enumerate(joints)
            },
        )

    policy = read_policy(path, config)
    assert policy.spec.period == pytest.approx(0.02)
    most = policy.spec.ranges and [high for _, high in policy.spec.ranges]
    assert most == GYM_STEPS[kind].get('max_cmd')
    compare(policy, moments(rng, G1_ORDER), reference)


@for_all(
    ('change', 'words'),
    [
        ({'policy_path': 'pre_train/h1_2/motion.pt'}, 'policy_path.* in doubt'),
        ({'num_actions': 10}, 'num_actions: got 10'),
        ({'num_obs': 48}, 'num_obs: got 48'),
        ({'kps': [1.0] * 11}, 'kps: got 11 numbers, wanted 12'),
        ({'control_decimation': None}, 'control_decimation: it is missing'),
    ],
)
def test_a_file_of_unitree_rl_gym_in_doubt_is_refused_by_the_name(change, words):
    said = {**GYM, **GYM_STEPS['deploy_mujoco'], 'num_obs': 47, **change}
    with pytest.raises(PolicyError, match=words):
        from_rl_gym(said)


@pytest.mark.slow
@for_all('order', ORDERS)
@for_all(
    ('ages', 'priority'),
    [([], 'time'), ([0, 1, 2, 3, 4, 5], 'time'), ([3, 2, 1, 0], 'term'), ([2, 0], 'time')],
)
def test_config_yaml_of_rl_sar(tmp_path, rng, order, ages, priority):
    joints = ORDERS[order]
    more = {'observations_history': ages, 'observations_history_priority': priority}
    write(tmp_path, 'base.yaml', RL_SAR_BASE)
    config = write(tmp_path, 'own/config.yaml', rl_sar(joints, **more))
    weights, biases = layers(rng, 45 * max(len(ages), 1), 24, 12)
    biases[-1] *= 30.0  # beyond the clip
    path = tmp_path / 'own/policy.pt'
    path.write_bytes(torchscript(exporter(weights, biases)))

    def reference(past, actions):
        def terms(index):
            if index < 0:
                return [np.zeros(3)] * 3 + [np.zeros(12)] * 3
            m = past[index]
            before = actions[index - 1] if index > 0 else np.zeros(12)
            return [
                0.25 * m['omega'],
                down(m['q']),
                m['command'] * (2.0, 2.0, 0.25),
                [m['position'][name] - (0.1 * i - 0.5) for i, name in enumerate(joints)],
                [0.05 * m['velocity'][name] for name in joints],
                before,
            ]

        now = len(past) - 1
        rows = [terms(now - age) for age in ages or [0]]
        if priority == 'time':
            shown = np.concatenate([part for row in rows for part in row])
        else:
            shown = np.concatenate([row[term] for term in range(6) for row in rows])
        action = np.clip(run(weights, biases, shown), -3.0, 2.5)
        targets = {
            name: (0.1 * i - 0.5 + (0.125 + 0.01 * i) * action[i], 20 + i, 0.5 + 0.01 * i)
            for i, name in enumerate(joints)
        }
        return shown, action, targets

    policy = read_policy(path, config)
    assert policy.spec.joints == joints
    compare(policy, moments(rng, joints), reference)


@pytest.mark.slow
def test_presets_follow_their_conventions(tmp_path, rng):
    weights, biases = layers(rng, 48, 24, 12)
    path = tmp_path / 'walk.onnx'
    path.write_bytes(onnx(weights, biases, outputs=('continuous_actions',)))
    moment = moments(rng, MOTORS)[:1]
    v, omega = moment[0]['v'], moment[0]['omega']

    def angles(order, default):
        return [moment[0]['position'][name] - default[name] for name in order]

    ((shown, targets),) = play(read_policy(path, 'playground'), moment)
    home = {name: -1.8 if 'calf' in name else 0.9 for name in MOTORS}
    home |= {
        f'{leg}_hip_joint': 0.1 if leg[1] == 'R' else -0.1 for leg in ('FL', 'FR', 'RL', 'RR')
    }
    speeds = [moment[0]['velocity'][name] for name in MOTORS]
    parts = (v, omega, down(moment[0]['q']), angles(MOTORS, home), speeds, np.zeros(12))
    wanted = np.concatenate([*parts, moment[0]['command']])
    np.testing.assert_allclose(shown, wanted, atol=1e-6)
    action = run(weights, biases, wanted)
    for i, name in enumerate(MOTORS):
        np.testing.assert_allclose(targets[name][0], home[name] + 0.5 * action[i], atol=1e-5)

    ((shown, targets),) = play(read_policy(path, 'legged_gym'), moment)
    order = ORDERS['FL first']
    home = {name: -1.5 if 'calf' in name else 1.0 if name[0] == 'R' else 0.8 for name in order}
    home |= {
        f'{leg}_hip_joint': -0.1 if leg[1] == 'R' else 0.1 for leg in ('FL', 'FR', 'RL', 'RR')
    }
    speeds = [0.05 * moment[0]['velocity'][name] for name in order]
    command = moment[0]['command'] * (2.0, 2.0, 0.25)
    parts = (2 * v, 0.25 * omega, down(moment[0]['q']), command, angles(order, home), speeds)
    wanted = np.concatenate([*parts, np.zeros(12)])
    np.testing.assert_allclose(shown, wanted, atol=1e-6)
    action = run(weights, biases, wanted)
    for i, name in enumerate(order):
        np.testing.assert_allclose(targets[name][0], home[name] + 0.25 * action[i], atol=1e-5)


NORMALISED = FORWARD.replace('forward(x, )', 'forward((self.normalizer).forward(x, ), )')


def test_a_torchscript_file_normalises_first_where_it_says_so(tmp_path, rng):
    weights, biases = layers(rng, 45, 16, 12)
    mean, deviation = rng.normal(size=(1, 45)), rng.uniform(0.5, 2.0, (1, 45))
    path = tmp_path / 'policy.pt'
    config = write(tmp_path, 'config.yaml', rl_sar(MOTORS))
    shown = rng.normal(size=45).astype(np.float32)
    for eps in (0.01, 1e-5):
        normal = TorchModule('EmpiricalNormalization', _mean=mean, _std=deviation, eps=eps)
        root = exporter(weights, biases, normalizer=normal)
        path.write_bytes(torchscript(root, NORMALISED))
        wanted = run(weights, biases, (shown - mean[0]) / (deviation[0] + eps))
        np.testing.assert_allclose(read_policy(path, config).network(shown), wanted, atol=1e-5)
    path.write_bytes(torchscript(root))
    wanted = run(weights, biases, shown)
    np.testing.assert_allclose(read_policy(path, config).network(shown), wanted, atol=1e-5)


def test_between_the_steps_of_a_policy_targets_stay(tmp_path, rng):
    policy = _constant_policy(tmp_path)
    player = Player(policy)
    asked = []
    network = policy.network
    player.policy = policy._replace(network=lambda shown: asked.append(shown) or network(shown))
    moment = moments(rng, MOTORS)[0]
    joints = (np.zeros(12), np.zeros(12))
    senses = Senses(moment['q'], moment['omega'], moment['v'], *joints)
    for _ in range(500):  # a second at 500 Hz
        player.step(senses, np.zeros(3), 0.002)
    assert len(asked) == 50


@pytest.mark.parametrize('bad', [np.nan, np.inf])
def test_a_network_that_says_no_number_fails_and_its_targets_stay(tmp_path, rng, bad):
    policy = _constant_policy(tmp_path)
    player = Player(policy)
    senses = Senses(np.array((1.0, 0, 0, 0)), *np.zeros((2, 3)), *np.zeros((2, 12)))
    before = player.step(senses, np.zeros(3), 0.02)
    player.policy = policy._replace(network=lambda shown: np.full(12, bad))
    after = player.step(senses, np.zeros(3), 0.02)
    assert player.failure == 'the output of the network is not a number'
    np.testing.assert_array_equal(before.position, after.position)
    player.reset()
    assert player.failure == ''


def _constant_policy(folder):
    path = folder / 'policy.pt'
    path.write_bytes(torchscript(exporter(*constant(45, np.linspace(-1, 1, 12)))))
    return read_policy(path, write(folder, 'config.yaml', rl_sar(MOTORS)))


def test_a_policy_of_two_lengths_cannot_be_stacked_by_time(tmp_path):
    said = deploy(MOTORS)
    said['observations']['last_action']['history_length'] = 3
    said['observations']['use_gym_history'] = True
    path = tmp_path / 'policy.pt'
    path.write_bytes(torchscript(exporter(*constant(45, np.zeros(12)))))
    with pytest.raises(PolicyError, match='stacked by time'):
        read_policy(path, write(tmp_path, 'deploy.yaml', said))


REMEMBERED = Term(name='gravity', ages=(1, 0))


def written_spec(**changes):
    """Return a spec that `write_layers` can say, but for `changes`."""
    terms = ('angular_velocity', 'gravity', 'command', 'joint_position', 'joint_velocity')
    spec = PolicySpec(
        source='ours',
        joints=MOTORS,
        stiffness=(30.0,) * 12,
        damping=(1.0,) * 12,
        default_position=(0.0, 0.8, -1.6) * 4,
        action_scale=(0.3,) * 12,
        action_offset=(0.0, 0.8, -1.6) * 4,
        terms=(*(Term(name=name, scale=(0.5,)) for name in terms), Term(name='phase')),
        phase_period=0.4,
        ranges=((-0.6, 1.3), (-0.4, 0.4), (-1.0, 1.0)),
    )
    return replace(spec, **changes)


@pytest.mark.slow
def test_what_is_written_is_read_again(tmp_path, rng):
    spec = written_spec()
    weights, biases = layers(rng, spec.width, 16, 12)
    write_layers(tmp_path / 'a.onnx', spec, list(zip(weights, biases, strict=True)))
    policy = read_policy(tmp_path / 'a.onnx')
    changes = {'source': spec.source, 'assumed': spec.assumed}
    assert replace(policy.spec, **changes) == spec
    shown = rng.normal(size=spec.width).astype(np.float32)
    np.testing.assert_allclose(policy.network(shown), run(weights, biases, shown), atol=1e-5)


@pytest.mark.parametrize(
    ('name', 'spec'),
    [
        ('period: got 0.01,', written_spec(period=0.01)),
        ('action_offset: ', written_spec(action_offset=(0.1, 0.8, -1.6) * 4)),
        ('target_clip: ', written_spec(target_clip=((-1.0,) * 12, (1.0,) * 12))),
        ('begins_with_zeros: ', written_spec(terms=(REMEMBERED,), begins_with_zeros=True)),
        ('by_time: ', written_spec(terms=(REMEMBERED,), by_time=True)),
        ('observation gravity: ', written_spec(terms=(Term(name='gravity', ages=(0, 1)),))),
        ('observation command: ', PRESETS['legged_gym_rough']()),
    ],
)
def test_what_the_file_cannot_say_is_not_written(tmp_path, name, spec):
    path = tmp_path / 'a.onnx'
    with pytest.raises(PolicyError) as error:
        write_layers(path, spec, [(np.zeros((12, spec.width)), np.zeros(12))])
    assert str(error.value).startswith(f'{path}: {name}')
    assert not path.exists()


def test_what_another_file_says_is_written_where_it_means_the_same(tmp_path):
    shown = from_deploy(deploy(MOTORS))  # the scale of a term is said for each of its numbers
    shown = replace(shown, action_offset=shown.default_position)
    for spec in (shown, replace(shown, by_time=True, begins_with_zeros=True)):
        write_layers(tmp_path / 'a.onnx', spec, [(np.zeros((12, spec.width)), np.zeros(12))])
        observers = Observer(spec), Observer(read_policy(tmp_path / 'a.onnx').spec)
        given, read = ([each._scale, each._low, each._high] for each in observers)
        np.testing.assert_array_equal(given, read)


def test_all_that_the_file_can_say_is_written():
    changes = ({}, {'ranges': None}, {'observation_clip': 9.0}, {'action_clip': ((-1.0,), (1.0,))})
    for spec in (*(written_spec(**each) for each in changes), read_policy('ours').spec):
        read = from_metadata(metadata_of(spec))
        for name in ('ranges', 'observation_clip', 'terms', 'period'):
            assert getattr(read, name) == getattr(spec, name)


def test_the_clock_of_the_phase_begins_with_the_policy():
    default = (0.0,) * 12
    spec = PolicySpec(
        source='here',
        joints=MOTORS,
        stiffness=(30.0,) * 12,
        damping=(1.0,) * 12,
        default_position=default,
        action_scale=(0.3,) * 12,
        action_offset=default,
        terms=(Term(name='phase'),),
        phase_period=0.4,
    )
    observer = Observer(spec)
    senses = Senses(np.array((1.0, 0, 0, 0)), *np.zeros((2, 3)), *np.zeros((2, 12)))
    for _ in range(2):
        seen = [observer.step(senses, np.zeros(3), np.zeros(12)) for _ in range(21)]
        angles = 2 * np.pi * 0.02 / 0.4 * np.arange(21)
        np.testing.assert_allclose(seen, np.c_[np.sin(angles), np.cos(angles)], atol=1e-6)
        observer.reset()


@for_all(('name', 'turns'), [('height_scan', False), ('height_scan_by_row', True)])
def test_heights_are_shown_x_or_y_fastest_clipped_before_the_scale(name, turns):
    spec = replace(
        PRESETS['legged_gym'](), terms=(Term(name=name, scale=(5.0,), clip=(-1.0, 1.0)),)
    )
    senses = Senses(np.array((1.0, 0, 0, 0)), *np.zeros((2, 3)), *np.zeros((2, 12)))
    heights = np.linspace(-2.0, 2.0, COLUMNS * ROWS)
    assert spec.width == COLUMNS * ROWS
    seen = Observer(spec).step(senses, np.zeros(3), np.zeros(12), heights)
    wanted = 5.0 * np.clip(heights, -1.0, 1.0)
    if turns:
        wanted = np.array(
            [wanted[row * COLUMNS + column] for column in range(COLUMNS) for row in range(ROWS)]
        )
    np.testing.assert_allclose(seen, wanted, atol=1e-6)


def test_clips_scales_and_pasts_of_any_kind_are_as_their_words_say():
    rng = np.random.default_rng(5)
    for _ in range(200):
        spec = replace(
            PRESETS['legged_gym'](),
            observation_clip=float(rng.choice((0.4, np.inf))),
            by_time=bool(rng.integers(2)),
            begins_with_zeros=bool(rng.integers(2)),
            terms=tuple(
                Term(
                    name=str(term),
                    scale=tuple(rng.normal(size=3 if rng.integers(2) else 1)),
                    clip=tuple(np.sort(rng.normal(size=2)))
                    if rng.integers(2)
                    else (-np.inf, np.inf),
                    scales_first=bool(rng.integers(2)),
                    ages=(2, 0, 1),
                )
                for term in rng.permutation(['angular_velocity', 'linear_velocity', 'command'])
            ),
        )
        observer, past = Observer(spec), []
        for _ in range(4):
            told = dict(
                zip(
                    ('angular_velocity', 'linear_velocity', 'command'),
                    rng.normal(size=(3, 3)),
                    strict=True,
                )
            )
            senses = Senses(
                np.array((1.0, 0, 0, 0)),
                told['angular_velocity'],
                told['linear_velocity'],
                *np.zeros((2, 12)),
            )
            seen = observer.step(senses, told['command'], np.zeros(12))
            now = [by_hand(term, told[term.name], spec.observation_clip) for term in spec.terms]
            past = [
                now,
                *(past or [[np.zeros(3) if spec.begins_with_zeros else part for part in now]] * 2),
            ]
            shown = [[past[age][at] for age in term.ages] for at, term in enumerate(spec.terms)]
            ordered = zip(*shown, strict=True) if spec.by_time else shown
            np.testing.assert_allclose(
                seen, np.concatenate([part for parts in ordered for part in parts]), atol=1e-6
            )
            past = past[:3]


def by_hand(term, value, most):
    """Return a term's numbers of an instant, one step after the other."""
    if not term.scales_first:
        value = np.clip(value, *term.clip)
    value = np.array(term.scale) * value
    if term.scales_first:
        value = np.clip(value, *term.clip)
    return np.clip(value, -most, most)
