# SPDX-License-Identifier: Apache-2.0
"""
A TorchScript file read as tensors and known layers, without torch and without running it.

It is a zip: `data.pkl` has the modules, `data/N` their tensors, `code/` what they compute. The
pickle is read with a closed list of names: modules become plain records, tensors arrays, anything
else is refused. The code is compared with what a chain of layers does.
"""

from collections import OrderedDict
import io
import pickle
import re
from typing import Any
import zipfile

import numpy as np

from policy_player.network import ACTIVATIONS, Layer, LayeredNetwork
from policy_player.onnx_file import LARGEST_NETWORK
from policy_player.spec import PolicyError

MOST_FILES = 10_000
CURE = 'export it to ONNX: play.py of the training framework writes exported/policy.onnx'
STORAGES = {
    'FloatStorage': np.dtype('<f4'),
    'DoubleStorage': np.dtype('<f8'),
    'HalfStorage': np.dtype('<f2'),
    'LongStorage': np.dtype('<i8'),
    'IntStorage': np.dtype('<i4'),
    'BoolStorage': np.dtype('?'),
}


class Module:
    """A module of the file: its qualified class, and its members by name."""

    kind = ''

    def __init__(self) -> None:
        self.members: dict[str, Any] = {}

    def __setstate__(self, state: Any) -> None:
        """Take the members that the file tells."""
        if not isinstance(state, dict):
            raise PolicyError(f'a module of the file is not one: {CURE}')
        self.members = state

    @property
    def name(self) -> str:
        """The class without its package."""
        return self.kind.rpartition('.')[2]

    @property
    def children(self) -> dict[str, 'Module']:
        """The modules within, in their order."""
        return {k: v for k, v in self.members.items() if isinstance(v, Module)}

    @property
    def tensors(self) -> dict[str, np.ndarray]:
        """The tensors within."""
        return {k: v for k, v in self.members.items() if isinstance(v, np.ndarray)}


def read_torchscript(data: bytes) -> LayeredNetwork:
    """
    Return the network of a file: linear layers and activations, normalised first or not.

    Raises:
        PolicyError: it holds anything else, and the cure.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = _unpack(archive)
    except PolicyError:
        raise
    except Exception:  # zipfile's, zlib's and struct's
        raise PolicyError(f'is no TorchScript file, or is cut short: {CURE}') from None
    if 'data.pkl' not in files or not any(name.startswith('code/') for name in files):
        raise PolicyError(f'is a checkpoint of training, no exported network: {CURE}')
    if any(name.startswith('code/__torch__/torch/nn/modules/rnn') for name in files):
        raise PolicyError('is recurrent: a memory is not played')
    try:
        root = _Unpickler(files).load()
    except PolicyError:
        raise
    except Exception as error:  # a pickle can break in any way
        reason = ' '.join(str(error).split())[:100]
        raise PolicyError(f'its modules cannot be read ({reason}): {CURE}') from None
    if not isinstance(root, Module):
        raise PolicyError(f'holds no module: {CURE}')
    try:
        return _network(root, files)
    except (KeyError, AttributeError, TypeError, IndexError, ValueError) as error:
        if isinstance(error, PolicyError):
            raise
        raise PolicyError(f'its layers have an unknown format: {CURE}') from None


def _unpack(archive: zipfile.ZipFile) -> dict[str, bytes]:
    """Return the files of an archive by their names below its one folder."""
    infos = archive.infolist()
    total = sum(info.file_size for info in infos)
    if len(infos) > MOST_FILES or total > LARGEST_NETWORK:
        raise PolicyError(f'unpacks to {total / 1e6:.0f} MB in {len(infos)} files: too much')
    files, left = {}, LARGEST_NETWORK
    for info in infos:
        if info.flag_bits & 1:
            raise PolicyError('is encrypted')
        with archive.open(info) as file:
            content = file.read(left + 1)
        left -= len(content)
        if left < 0:
            raise PolicyError('unpacks to more than it says: too much')
        files[info.filename.partition('/')[2]] = content
    return files


class _Unpickler(pickle.Unpickler):
    """Knows modules, tensors and ordered dictionaries, and nothing else."""

    def __init__(self, files: dict[str, bytes]) -> None:
        super().__init__(io.BytesIO(files['data.pkl']))
        self._files = files

    def find_class(self, module: str, name: str) -> Any:
        if module == '__torch__' or module.startswith('__torch__.'):
            return type('Module', (Module,), {'kind': f'{module}.{name}'})
        if (module, name) == ('torch._utils', '_rebuild_tensor_v2'):
            return _tensor
        if module == 'torch' and name in STORAGES:
            return STORAGES[name]
        if (module, name) == ('collections', 'OrderedDict'):
            return OrderedDict
        raise PolicyError(f'asks for {module}.{name}: refused, no code was run; {CURE}')

    def persistent_load(self, pid: Any) -> np.ndarray:
        """Return the numbers of a storage: ('storage', its type, its file, device, count)."""
        if not (isinstance(pid, tuple) and len(pid) >= 3 and pid[0] == 'storage'):
            raise PolicyError(f'a tensor of the file is not one: {CURE}')
        return np.frombuffer(self._files[f'data/{pid[2]}'], pid[1])


def _tensor(storage: Any, offset: Any, size: Any, stride: Any, *_: Any) -> np.ndarray:
    """Return a copy of a view on a storage; what would lie outside it is refused."""
    if not isinstance(storage, np.ndarray):
        raise PolicyError(f'a tensor of the file is not one: {CURE}')
    last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
    count = int(np.prod(size, dtype=object))
    if min((offset, *size, *stride, 0)) < 0 or count > len(storage) or last >= len(storage):
        if count:
            raise PolicyError('a tensor of the file lies outside of its numbers')
        return np.zeros(size, storage.dtype)
    step = storage.itemsize
    strides = [step * one for one in stride]
    return np.lib.stride_tricks.as_strided(storage[offset:], size, strides).copy()


def _network(root: Module, files: dict[str, bytes]) -> LayeredNetwork:
    children = dict(root.children)
    name = 'normalizer' if 'normalizer' in children else 'actor_obs_normalizer'
    normaliser = children.pop(name, None)
    chains = {name: child for name, child in children.items() if child.name != 'Identity'}
    if root.name == 'Sequential':
        chains = {'': root}
    if len(chains) != 1:
        found = ', '.join(f'{name} ({child.name})' for name, child in chains.items()) or 'nothing'
        raise PolicyError(f'wanted one chain of layers, got {found}: {CURE}')
    _check_code(root, files)
    (chain,) = chains.values()
    mean = deviation = None
    if normaliser is not None and normaliser.name != 'Identity':
        tensors = normaliser.tensors
        names = ('_mean', '_std')
        if normaliser.name != 'EmpiricalNormalization' or not set(names) <= set(tensors):
            raise PolicyError(f'normalizer {normaliser.name}: not known: {CURE}')
        if re.search(rf'\bself\.{name}\b', _forward(root, files)):  # else it is never called
            mean, deviation = (np.ravel(tensors[each]).astype(np.float32) for each in names)
            deviation = deviation + np.float32(normaliser.members.get('eps', 0.01))
    return LayeredNetwork(_layers(chain, files), mean, deviation)


def _layers(chain: Module, files: dict[str, bytes]) -> list[Layer]:
    """Return the layers of a Sequential, or of what holds one and only hands on to it."""
    while chain.name != 'Sequential':
        _check_code(chain, files)
        (chain,) = chain.children.values()
    layers: list[Layer] = []
    for index, (name, child) in enumerate(
        sorted(chain.children.items(), key=lambda item: int(item[0]))
    ):
        if child.name == 'Linear':
            weight = child.tensors['weight'].astype(np.float32)
            bias = child.tensors.get('bias', np.zeros(len(weight))).astype(np.float32)
            if weight.ndim != 2 or bias.shape != (len(weight),):
                raise PolicyError(f'layer {name}: weight and bias do not fit')
            layers.append(Layer(weight, bias))
        elif child.name in ACTIVATIONS and layers and layers[-1].activation is None:
            slope = re.search(r'\belu_?\(\w+, ([^,)]+)', _forward(child, files))
            if slope is not None and float(slope[1]) != 1.0:
                raise PolicyError(f'layer {name}, {child.name}: wanted alpha 1: {CURE}')
            layers[-1] = layers[-1]._replace(activation=ACTIVATIONS[child.name])
        elif child.name not in ('Identity', 'Dropout'):
            raise PolicyError(f'layer {index}, {child.name}: not known here: {CURE}')
    return layers


def _check_code(root: Module, files: dict[str, bytes]) -> None:
    """Check that the outermost module only passes data from one of its modules to the next."""
    body = _forward(root, files)
    if not body:
        raise PolicyError(f'does not say what it computes: {CURE}')
    if re.search(r'torch\.|ops\.|[-+*/%]', body):
        raise PolicyError(f'computes more than its layers do: {CURE}')


def _forward(module: Module, files: dict[str, bytes]) -> str:
    """Return the code by which a module computes, '' where the file has none."""
    path = 'code/' + module.kind.rpartition('.')[0].replace('.', '/') + '.py'
    code = files.get(path, b'').decode(errors='replace')
    found = re.search(
        rf'class {re.escape(module.name)}\(Module\):(.*?)(?=^class |\Z)', code, re.DOTALL | re.M
    )
    body = re.search(r'def forward\((.*?)(?=\n  def |\Z)', found[1], re.DOTALL) if found else None
    return '' if body is None else body[1].partition('->')[2].partition(':')[2]
