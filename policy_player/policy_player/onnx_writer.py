# SPDX-License-Identifier: Apache-2.0
"""Writes layers as an ONNX file with what a policy was trained with, as mjlab does."""

from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path

import numpy as np

from policy_player.formats import from_metadata
from policy_player.spec import PolicyError, PolicySpec

# How terms are written that mjlab calls otherwise.
_CALLED = {
    'linear_velocity': 'base_lin_vel',
    'angular_velocity': 'base_ang_vel',
    'gravity': 'projected_gravity',
    'joint_position': 'joint_pos',
    'joint_velocity': 'joint_vel',
    'last_action': 'actions',
}
# Versions of the format and of its operators.
_VERSION, _OPERATORS = 8, 17


def write_layers(
    path: str | os.PathLike[str], spec: PolicySpec, layers: Sequence[tuple[np.ndarray, np.ndarray]]
) -> None:
    """
    Write linear layers, weight (out, in) and bias (out,), with ELU between them.

    Raises:
        PolicyError: the spec has what the file cannot say, such as steps of other than 20 ms.
    """
    metadata = metadata_of(spec)
    written = _parts(from_metadata(metadata))
    for name, given in _parts(spec).items():
        if written[name] != given:
            raise PolicyError(
                f'{path}: {name}: got {given}, the file can only say {written[name]}'
            )
    graph, name = b'', 'obs'
    for index, (weight, bias) in enumerate(layers):
        is_last = index == len(layers) - 1
        out = 'actions' if is_last else f'y{index}'
        graph += _field(5, _tensor(f'w{index}', weight)) + _field(5, _tensor(f'b{index}', bias))
        graph += _field(1, _node('Gemm', (name, f'w{index}', f'b{index}'), out, 'transB'))
        name = out
        if not is_last:
            graph += _field(1, _node('Elu', (name,), f'x{index}'))
            name = f'x{index}'
    graph += _field(2, b'policy') + _field(11, _end('obs', layers[0][0].shape[1]))
    graph += _field(12, _end('actions', layers[-1][0].shape[0]))
    model = _number(1, _VERSION) + _field(2, b'wasd') + _field(7, graph)
    model += _field(8, _field(1, b'') + _number(2, _OPERATORS))
    for key, value in metadata.items():
        model += _field(14, _field(1, key.encode()) + _field(2, value.encode()))
    Path(path).write_bytes(model)


def metadata_of(spec: PolicySpec) -> dict[str, str]:
    """Return what `from_metadata` reads."""

    def listed(values: Sequence[object]) -> str:
        return ','.join(map(str, values))

    ends = [np.broadcast_to(end, len(spec.joints)).tolist() for end in spec.action_clip]
    told = {
        'joint_names': listed(spec.joints),
        'joint_stiffness': listed(spec.stiffness),
        'joint_damping': listed(spec.damping),
        'default_joint_pos': listed(spec.default_position),
        'action_scale': listed(spec.action_scale),
        'command_names': 'twist',
        'observation_names': listed([_CALLED.get(term.name, term.name) for term in spec.terms]),
        'observation_terms_scale': listed([term.scale[0] for term in spec.terms]),
        'observation_terms_clip': listed([f'{a};{b}' for a, b in (t.clip for t in spec.terms)]),
        'observation_terms_history_length': listed([len(term.ages) for term in spec.terms]),
        'phase_period': str(spec.phase_period),
        'observation_clip': str(spec.observation_clip),
        'action_clip': listed([f'{low};{high}' for low, high in zip(*ends, strict=True)]),
    }
    if spec.ranges is not None:
        told['command_ranges'] = listed([f'{low};{high}' for low, high in spec.ranges])
    return told


def _parts(spec: PolicySpec) -> dict[str, object]:
    """Return what is played of a spec, by name; its clip of actions is always written."""
    terms = tuple(
        replace(term, scale=term.scale[:1]) if len(set(term.scale)) == 1 else term
        for term in spec.terms
    )
    if all(term.ages == (0,) for term in terms):  # what else is said of the past means nothing
        spec = replace(spec, by_time=False, begins_with_zeros=False)
    played = replace(spec, source='', assumed=(), action_clip=((), ()), terms=terms)
    return {f'observation {term.name}': term for term in terms} | vars(played)


def _varint(value: int) -> bytes:
    out = b''
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def _field(number: int, data: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _number(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)


def _tensor(name: str, array: np.ndarray) -> bytes:
    sizes = b''.join(_number(1, size) for size in array.shape)
    data = array.astype('<f4').tobytes()
    return sizes + _number(2, 1) + _field(8, name.encode()) + _field(9, data)


def _node(kind: str, inputs: Sequence[str], output: str, flag: str = '') -> bytes:
    out = b''.join(_field(1, name.encode()) for name in inputs)
    out += _field(2, output.encode()) + _field(4, kind.encode())
    if flag:
        out += _field(5, _field(1, flag.encode()) + _number(3, 1) + _number(20, 2))
    return out


def _end(name: str, width: int) -> bytes:
    sizes = b''.join(_field(1, _number(1, size)) for size in (1, width))
    kind = _field(1, _number(1, 1) + _field(2, sizes))
    return _field(1, name.encode()) + _field(2, kind)
