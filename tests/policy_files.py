# SPDX-License-Identifier: Apache-2.0
"""Files of policies made by hand: ONNX byte by byte, TorchScript without torch, configurations."""

import io
import pickle
from types import SimpleNamespace
import zipfile

import numpy as np
import yaml

LEGS = {
    'FL first': ('FL', 'FR', 'RL', 'RR'),
    'FR first': ('FR', 'FL', 'RR', 'RL'),
    'RR first': ('RR', 'RL', 'FR', 'FL'),
}
PARTS = ('hip', 'thigh', 'calf')
ORDERS = {
    name: tuple(f'{leg}_{part}_joint' for leg in legs for part in PARTS)
    for name, legs in LEGS.items()
} | {
    'by kind': tuple(f'{leg}_{part}_joint' for part in PARTS for leg in LEGS['FL first']),
    'by kind, FR first': tuple(
        f'{leg}_{part}_joint' for part in PARTS for leg in LEGS['FR first']
    ),
}
# The order of the Go2's motors.
MOTORS = ORDERS['FR first']


def varint(value: int) -> bytes:
    out = b''
    while True:
        value, low = value >> 7, value & 127
        if not value:
            return out + bytes([low])
        out += bytes([low | 128])


def field(number: int, value: int | bytes | str) -> bytes:
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def tensor(name: str, array: np.ndarray, external: str = '') -> bytes:
    out = b''.join(field(1, size) for size in array.shape) + field(2, 1) + field(8, name)
    if not external:
        return out + field(9, array.astype('<f4').tobytes())
    pair = field(1, 'location') + field(2, external)
    return out + field(13, pair) + field(14, 1)


def node(kind: str, inputs: list[str], output: str, **flags: int) -> bytes:
    out = b''.join(field(1, name) for name in inputs) + field(2, output) + field(4, kind)
    for name, value in flags.items():
        out += field(5, field(1, name) + field(3, value) + field(20, 2))
    return out


def end(name: str, width: int, rank: int = 2, kind: int = 1, *, is_named: bool = False) -> bytes:
    sizes = [1] * (rank - 1) + [width]
    if is_named:
        shape = b''.join(field(1, field(2, f'size{place}')) for place in range(rank))
    else:
        shape = b''.join(field(1, field(1, size)) for size in sizes)
    return field(1, name) + field(2, field(1, field(1, kind) + field(2, shape)))


def onnx(
    weights: list[np.ndarray],
    biases: list[np.ndarray],
    metadata: dict[str, str] | None = None,
    *,
    activation: str = 'Elu',
    external: str = '',
    inputs: tuple[str, ...] = ('obs',),
    outputs: tuple[str, ...] = ('actions',),
    last: str = '',
    kind: int = 1,
    is_named: bool = False,
) -> bytes:
    """
    Return a model: linear layers with an activation between them, `last` behind the last.

    With `is_named` the sizes of its input have names for numbers, as of dynamic axes. `kind` is
    ONNX's number of the type of what it gives, that of `Cast`.
    """
    graph, name = b'', inputs[0]
    for index, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        graph += field(5, tensor(f'w{index}', weight, external if index == 0 else ''))
        graph += field(5, tensor(f'b{index}', bias))
        is_last = index == len(weights) - 1
        out = f'y{index}' if not is_last or last else outputs[0]
        graph += field(1, node('Gemm', [name, f'w{index}', f'b{index}'], out, transB=1))
        name = out
        if not is_last:
            graph += field(1, node(activation, [name], f'x{index}'))
            name = f'x{index}'
    if last:
        to = {'to': kind} if last == 'Cast' else {}
        graph += field(1, node(last, [name], outputs[0], **to))
    for extra in outputs[1:]:
        graph += field(1, node('Identity', [outputs[0]], extra))
    graph += field(2, 'policy')
    for shown in inputs:
        graph += field(11, end(shown, weights[0].shape[1], is_named=is_named))
    for shown in outputs:
        graph += field(12, end(shown, weights[-1].shape[0], kind=kind))
    model = field(1, 8) + field(7, graph) + field(8, field(1, '') + field(2, 17))
    for key, value in (metadata or {}).items():
        model += field(14, field(1, key) + field(2, value))
    return model


def layers(rng: np.random.Generator, *widths: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return weights and biases, float32, of a network of these widths."""
    pairs = list(zip(widths, widths[1:], strict=False))
    weights = [(rng.normal(size=(b, a)) / np.sqrt(a)).astype(np.float32) for a, b in pairs]
    return weights, [(0.1 * rng.normal(size=b)).astype(np.float32) for _, b in pairs]


def run(weights: list[np.ndarray], biases: list[np.ndarray], shown: np.ndarray) -> np.ndarray:
    """Return what such a network with ELU says, in double precision."""
    x = shown.astype(float)
    for index, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        x = weight.astype(float) @ x + bias
        if index < len(weights) - 1:
            x = np.where(x > 0, x, np.exp(np.minimum(x, 0)) - 1)
    return x


def constant(width: int, action: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the layers of a network that always says the same."""
    return [np.zeros((len(action), width), np.float32)], [np.asarray(action, np.float32)]


# --- configurations -----------------------------------------------------------------------------


def mjlab(joints: tuple[str, ...], **changes: str) -> dict[str, str]:
    """Return metadata as mjlab writes it."""
    count = len(joints)
    values = np.arange(count)
    return {
        'run_path': 'none',
        'joint_names': ','.join(joints),
        'joint_stiffness': ','.join(f'{20 + v}' for v in values),
        'joint_damping': ','.join(f'{0.5 + 0.01 * v:.3f}' for v in values),
        'default_joint_pos': ','.join(f'{0.1 * v - 0.5:.3f}' for v in values),
        'command_names': 'twist',
        'observation_names': 'base_ang_vel,projected_gravity,command,joint_pos,joint_vel,actions',
        'action_scale': ','.join(f'{0.2 + 0.01 * v:.3f}' for v in values),
        **changes,
    }


def deploy(joints: tuple[str, ...], motors: tuple[str, ...] = MOTORS, **changes) -> dict:
    """Return a deploy.yaml as unitree_rl_lab writes it."""
    count = len(joints)
    terms = {
        'base_ang_vel': 0.2,
        'projected_gravity': 1.0,
        'velocity_commands': 1.0,
        'joint_pos_rel': 1.0,
        'joint_vel_rel': 0.05,
        'last_action': 1.0,
    }
    return {
        'joint_ids_map': [motors.index(name) for name in joints],
        'step_dt': 0.02,
        'stiffness': [20.0 + index for index in range(count)],
        'damping': [0.5 + 0.01 * index for index in range(count)],
        'default_joint_pos': [0.1 * index - 0.5 for index in range(count)],
        'commands': {
            'base_velocity': {
                'ranges': {
                    'lin_vel_x': [-0.5, 1.0],
                    'lin_vel_y': [-0.3, 0.3],
                    'ang_vel_z': [-0.2, 0.2],
                    'heading': None,
                }
            }
        },
        'actions': {
            'JointPositionAction': {
                'clip': None,
                'joint_names': ['.*'],
                'scale': [0.25 + 0.01 * index for index in range(count)],
                'offset': [0.1 * index - 0.45 for index in range(count)],
                'joint_ids': None,
            }
        },
        'observations': {
            name: {
                'params': {},
                'clip': [-100.0, 100.0],
                'scale': [scale] * (count if name.startswith(('joint', 'last')) else 3),
                'history_length': 1,
            }
            for name, scale in terms.items()
        },
    } | changes


def rl_sar(joints: tuple[str, ...], **changes) -> dict:
    """Return a config.yaml as rl_sar has it, for the Go2's motors."""
    count = len(joints)
    return {
        'go2/own': {
            'model_name': 'policy.pt',
            'num_observations': 45,
            'observations': [
                'ang_vel',
                'gravity_vec',
                'commands',
                'dof_pos',
                'dof_vel',
                'actions',
            ],
            'observations_history': [],
            'observations_history_priority': 'time',
            'clip_obs': 100.0,
            'clip_actions_lower': [-3.0] * count,
            'clip_actions_upper': [2.5] * count,
            'rl_kp': [20.0 + index for index in range(count)],
            'rl_kd': [0.5 + 0.01 * index for index in range(count)],
            'num_of_dofs': count,
            'action_scale': [0.125 + 0.01 * index for index in range(count)],
            'wheel_indices': [],
            'lin_vel_scale': 2.0,
            'ang_vel_scale': 0.25,
            'dof_pos_scale': 1.0,
            'dof_vel_scale': 0.05,
            'commands_scale': [2.0, 2.0, 0.25],
            'default_dof_pos': [0.1 * index - 0.5 for index in range(count)],
            'joint_mapping': [MOTORS.index(name) for name in joints],
        }
        | changes
    }


RL_SAR_BASE = {
    'go2': {'dt': 0.005, 'decimation': 4, 'joint_names': list(MOTORS), 'num_of_dofs': 12}
}


def write(folder, name: str, values: dict):
    """Write YAML and return its path."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(values, sort_keys=False))
    return path


# --- TorchScript --------------------------------------------------------------------------------


class _Name:
    """Something that the pickle only names."""

    def __init__(self, module: str, name: str) -> None:
        self.module, self.name = module, name


class _Pickler(pickle._Pickler):  # the one in Python: it writes names that lead nowhere
    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, protocol=2)
        self.arrays: list[np.ndarray] = []

    def persistent_id(self, thing):
        if isinstance(thing, SimpleNamespace) and hasattr(thing, 'storage'):
            self.arrays.append(thing.storage)
            kind = _Name('torch', 'FloatStorage')
            return ('storage', kind, str(len(self.arrays) - 1), 'cpu', thing.storage.size)
        return None

    def save(self, thing, save_persistent_id=True):
        if isinstance(thing, _Name):
            self.write(pickle.GLOBAL + f'{thing.module}\n{thing.name}\n'.encode())
        elif isinstance(thing, TorchModule):
            self.save(_Name(thing.package, thing.kind))
            self.write(pickle.EMPTY_TUPLE + pickle.NEWOBJ)
            self.save(thing.members)
            self.write(pickle.BUILD)
        elif isinstance(thing, np.ndarray):
            array = np.ascontiguousarray(thing, '<f4')
            strides = tuple(step // 4 for step in array.strides)
            self.save(_Name('torch._utils', '_rebuild_tensor_v2'))
            storage = SimpleNamespace(storage=array)
            self.save((storage, 0, array.shape, strides, False, {}))
            self.write(pickle.REDUCE)
        else:
            super().save(thing, save_persistent_id)


class TorchModule:
    """A module: its class, and its members."""

    def __init__(self, kind: str, package: str = '__torch__.torch.nn', **members) -> None:
        self.kind, self.package, self.members = kind, package, {'training': False, **members}


def chain(weights, biases) -> TorchModule:
    """Return a Sequential of linear layers with ELU between them."""
    children = {}
    for index, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        children[str(2 * index)] = TorchModule('Linear', weight=weight, bias=bias)
        if index < len(weights) - 1:
            children[str(2 * index + 1)] = TorchModule('ELU')
    return TorchModule('Sequential', **children)


FORWARD = """class Exporter(Module):
  actor : __torch__.torch.nn.Sequential
  def forward(self: __torch__.Exporter,
    x: Tensor) -> Tensor:
    _0 = self.actor
    return (_0).forward(x, )
"""


def torchscript(root: TorchModule, code: str = FORWARD, compression=zipfile.ZIP_STORED) -> bytes:
    """Return a TorchScript file of an exporter around modules."""
    pickled, file = io.BytesIO(), io.BytesIO()
    pickler = _Pickler(pickled)
    pickler.dump(root)
    with zipfile.ZipFile(file, 'w', compression) as archive:
        archive.writestr('policy/data.pkl', pickled.getvalue())
        for index, array in enumerate(pickler.arrays):
            archive.writestr(f'policy/data/{index}', array.tobytes())
        archive.writestr('policy/code/__torch__.py', code)
        archive.writestr('policy/version', '3\n')
    return file.getvalue()


def exporter(weights, biases, **more) -> TorchModule:
    """Return rsl_rl's exporter around a chain."""
    return TorchModule('Exporter', '__torch__', actor=chain(weights, biases), **more)


def sparse_file(path, size: int) -> None:
    """Make a file of so many bytes that takes no room."""
    with open(path, 'wb') as file:
        file.write(b'\x08\x08')
        file.truncate(size)
