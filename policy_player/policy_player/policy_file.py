# SPDX-License-Identifier: Apache-2.0
"""Loads a policy from its files: the network and its training settings."""

import os
from pathlib import Path
import time
from typing import NamedTuple

import numpy as np
from wasd_core.errors import DescriptionError, suggest
from wasd_core.safe_files import read_file

from policy_player.formats import from_deploy, from_metadata, from_rl_gym, from_rl_sar, PRESETS
from policy_player.network import Network, OnnxNetwork
from policy_player.onnx_file import LARGEST_NETWORK, OnnxFile, read_onnx
from policy_player.spec import PolicyError, PolicySpec
from policy_player.torchscript_file import read_torchscript
from policy_player.yaml_values import read_values

# Where what was trained with is looked for, beside the network and one folder up.
_BESIDE = (
    *('deploy.yaml', 'params/deploy.yaml', 'config.yaml'),
    *('../params/deploy.yaml', '../deploy.yaml'),
)
CURE = (
    'give --policy-config FILE (deploy.yaml of Isaac Lab, config.yaml of rl_sar), or one of '
    f'{", ".join(PRESETS)}'
)


# Policies that come along, by name: `ours` is a clone of the model-based walker.
OWN = {'ours': Path(__file__).parent / 'networks/ours.onnx'}
# So often a network is run to find out how long it takes.
RUNS = 10


class Policy(NamedTuple):
    """A network and its settings; `config` is the file of the settings, '' for none."""

    spec: PolicySpec
    network: Network
    config: str = ''


def read_policy(path: str | Path, config: str | Path | None = None) -> Policy:
    """
    Return a policy of an ONNX or TorchScript file, or of the name of one that comes along.

    `config` is a file that says how it was trained, or a preset; without one the network's own
    metadata, or a file beside it, does.

    Raises:
        PolicyError: what is wrong, in one line that begins with the file.
    """
    path = OWN.get(str(path), Path(path))
    try:
        data = read_file(path, LARGEST_NETWORK)
    except DescriptionError as error:
        raise PolicyError(str(error)) from None
    try:
        is_zip = data[:4] == b'PK\x03\x04'
        file = read_torchscript(data) if is_zip else read_onnx(path, data)
        metadata = file.metadata if isinstance(file, OnnxFile) else {}
        spec, found = _specification(path, metadata, config)
        network = OnnxNetwork(file, spec.width) if isinstance(file, OnnxFile) else file
        spec.check_widths(network.takes, network.gives)
        _check_speed(network, spec.period)
    except _ConfigError as error:
        raise PolicyError(str(error)) from None
    except PolicyError as error:
        raise PolicyError(f'{path}: {error}') from None
    return Policy(spec, network, found)


def duration_of(network: Network) -> float:
    """Return how long a step of a network takes on this machine [s]: the least of some."""
    shown, took = np.zeros(network.takes, np.float32), []
    for _ in range(RUNS):
        started = time.perf_counter()
        network(shown)
        took.append(time.perf_counter() - started)
    return min(took)


def _check_speed(network: Network, period: float) -> None:
    duration = duration_of(network)
    if duration > period:
        raise PolicyError(
            f'the network takes {1e3 * duration:.0f} ms a step, which is to last '
            f'{1e3 * period:.0f} ms: it is too slow for this machine'
        )


class _ConfigError(PolicyError):
    """Something is wrong with the other file; begins with its name."""


def _specification(
    path: Path, metadata: dict[str, str], config: str | Path | None
) -> tuple[PolicySpec, str]:
    if config is not None and str(config) in PRESETS:
        return PRESETS[str(config)](), str(config)
    if config is not None:
        return _read_config(Path(config)), str(config)
    if 'joint_names' in metadata:
        return from_metadata(metadata), ''
    for name in _BESIDE:
        beside = path.parent / name
        if beside.is_file():
            return _read_config(beside), str(beside)
    raise PolicyError(f'its training settings are missing: {CURE}')


def _read_config(path: Path) -> PolicySpec:
    try:
        values = read_values(path)
    except PolicyError as error:
        known = f'{error}{suggest(str(path), PRESETS)}' if not os.path.exists(path) else str(error)
        raise _ConfigError(known) from None
    try:
        if 'joint_ids_map' in values:
            return from_deploy(values)
        inner = next(iter(values.values())) if len(values) == 1 else values
        if isinstance(inner, dict) and 'rl_kp' in inner:
            return from_rl_sar(values, _base(path))
        if 'kps' in values and 'default_angles' in values:
            return from_rl_gym(values)
    except PolicyError as error:
        raise _ConfigError(f'{path}: {error}') from None
    raise _ConfigError(
        f'{path}: neither a deploy.yaml (joint_ids_map), nor a config.yaml of rl_sar (rl_kp), '
        'nor a file of unitree_rl_gym (kps)'
    )


def _base(path: Path) -> dict[str, object]:
    """Return the values of the robot's base.yaml, beside or one folder up, if there is one."""
    for folder in (path.parent, path.parent.parent):
        base = folder / 'base.yaml'
        if base.is_file():
            return read_values(base)
    return {}
