# SPDX-License-Identifier: Apache-2.0
"""Networks that run: by onnxruntime, or layer by layer in numpy."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from wasd_core.errors import suggest

from policy_player import first_look
from policy_player.onnx_file import OnnxFile
from policy_player.spec import PolicyError

# Of several outputs, what an action is called.
ACTIONS = ('actions', 'action', 'continuous_actions', 'output')
# The numbers that an action may consist of, as ONNX calls a tensor of them.
FLOATS = {
    'tensor(float)': np.float32,
    'tensor(double)': np.float64,
    'tensor(float16)': np.float16,
}


class OnnxNetwork:
    """A network of an ONNX file, run by onnxruntime in one thread."""

    def __init__(self, file: OnnxFile, width: int) -> None:
        """
        Look at the file in another process, then load it; `width` is that of the observation.

        Raises:
            PolicyError: it cannot be run, or has not one input and an output of actions.
        """
        found = first_look.look(file.path, width)
        inputs, outputs = found['inputs'], found['outputs']
        if len(inputs) != 1:
            names = ', '.join(repr(name) for name, *_ in inputs)
            raise PolicyError(
                f'the network has {len(inputs)} inputs ({names}), wanted one, the observation: '
                'a memory or a motion is not played'
            )
        name, shown, kind = inputs[0]
        if kind != 'tensor(float)':
            raise PolicyError(f'input {name!r}: got {kind}, wanted tensor(float)')
        output = _choose([end[0] for end in outputs])
        given, kind = {end[0]: end[1:] for end in outputs}[output]
        if kind not in FLOATS:
            raise PolicyError(f'output {output!r}: got {kind}, wanted tensor(float)')
        self.takes, self.gives = int(np.prod(shown)), int(np.prod(given))
        model: bytes | str = str(file.path) if file.external else file.data
        self._session = first_look.open_session(model)
        # Its memory is ours, which saves a third of the time of a small network.
        self._shown, self._action = np.zeros(self.takes, np.float32), np.zeros(given, FLOATS[kind])
        self._bound = self._session.io_binding()
        for bind, end, memory, ends in (
            (self._bound.bind_input, name, self._shown, shown),
            (self._bound.bind_output, output, self._action, given),
        ):
            bind(end, 'cpu', 0, memory.dtype, ends, memory.ctypes.data)

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Return the action for an observation."""
        self._shown[:] = observation
        self._session.run_with_iobinding(self._bound)
        return self._action.reshape(-1).copy()


def _choose(outputs: Sequence[str]) -> str:
    """Return which output is the action: the only one, or the one that is called so."""
    if len(outputs) == 1:
        return outputs[0]
    named = [name for name in ACTIONS if name in outputs]
    if not named:
        raise PolicyError(f'outputs: none is called actions{suggest("actions", outputs)}')
    return named[0]


class Layer(NamedTuple):
    """A linear map, weight (out, in) and bias (out,), and what is done to its result."""

    weight: np.ndarray
    bias: np.ndarray
    activation: Callable[[np.ndarray], np.ndarray] | None = None


def elu(x: np.ndarray) -> np.ndarray:
    """Return x, or exp(x) - 1 where that is negative."""
    return np.asarray(np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0))))


def relu(x: np.ndarray) -> np.ndarray:
    """Return x, or 0 where that is negative."""
    return np.asarray(np.maximum(x, 0.0))


ACTIVATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'ELU': elu,
    'ReLU': relu,
    'Tanh': np.tanh,
}


class LayeredNetwork:
    """Layers one after the other; `mean` and `deviation` (takes,) normalise what is shown."""

    def __init__(
        self,
        layers: Sequence[Layer],
        mean: np.ndarray | None = None,
        deviation: np.ndarray | None = None,
    ) -> None:
        """
        Take layers that fit.

        Raises:
            PolicyError: there are none, or one does not fit the one before.
        """
        if not layers:
            raise PolicyError('the network has no layers')
        for before, after in zip(layers, layers[1:], strict=False):
            if before.weight.shape[0] != after.weight.shape[1]:
                raise PolicyError('the layers of the network do not fit each other')
        self._layers, self._mean, self._deviation = tuple(layers), mean, deviation
        self.takes, self.gives = layers[0].weight.shape[1], layers[-1].weight.shape[0]

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Return the action for an observation."""
        x: Any = observation.astype(np.float32, copy=False)
        if self._mean is not None:
            x = (x - self._mean) / self._deviation
        for weight, bias, activation in self._layers:
            x = weight @ x + bias
            if activation is not None:
                x = activation(x)
        return np.asarray(x, np.float32)


# Maps an observation (takes,) to an action (gives,), float32.
Network = OnnxNetwork | LayeredNetwork
