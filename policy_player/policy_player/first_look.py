# SPDX-License-Identifier: Apache-2.0
"""
The first look at a stranger's network: in a process of its own, with bounds.

    python -m policy_player.first_look FILE WIDTH

What a broken or hostile file does to the library ends here. Prints one line of JSON.
"""

import json
from pathlib import Path
import resource
import subprocess
import sys
from typing import Any

from wasd_core.errors import Stopped
from wasd_core.extras import install_line
from wasd_core.signals import stop_requested

from policy_player.spec import PolicyError

# Of the child: address space [bytes], processor time and wall time [s].
MEMORY, PROCESSOR_TIME, PATIENCE = 6_000_000_000, 20, 60.0
# Networks that come with the package are no stranger's.
OURS = Path(__file__).parent / 'networks'


def look(path: Path, width: int) -> dict[str, Any]:
    """
    Return inputs and outputs of a network that runs, as `[name, shape, type]`.

    `width` is that of an input whose last size has a name for a number.

    Raises:
        PolicyError: it cannot be run.
        Stopped: a stop signal came meanwhile.
    """
    if path.parent == OURS:
        return describe(open_session(str(path)), width)
    words = [sys.executable, '-m', 'policy_player.first_look', str(path), str(width)]
    try:
        done = subprocess.run(
            words,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PATIENCE,
            check=False,
            start_new_session=True,  # Ctrl-C is for us
        )
    except subprocess.TimeoutExpired:
        raise PolicyError(f'the network does not run within {PATIENCE:g} s') from None
    if stop_requested():
        raise Stopped
    lines = done.stdout.decode(errors='replace').splitlines()
    try:
        found: dict[str, Any] = json.loads(lines[-1])
    except (ValueError, IndexError):
        raise PolicyError(
            f'the network crashes its runtime (status {done.returncode}): too large, or no ONNX'
        ) from None
    if 'error' in found:
        raise PolicyError(found['error'])
    return found


def open_session(model: bytes | str) -> Any:
    """
    Return a session of onnxruntime: one thread, on the processor, the same bits each time.

    Raises:
        PolicyError: the library is not here, or cannot read the network.
    """
    try:
        import onnxruntime
    except ImportError:
        raise PolicyError(f'a network needs onnxruntime: {install_line("policy")}') from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.log_severity_level = 4
    onnxruntime.set_default_logger_severity(4)
    onnxruntime.set_seed(0)  # else the clock seeds networks that draw their actions
    try:
        return onnxruntime.InferenceSession(model, options, ['CPUExecutionProvider'])
    except Exception as error:  # its own classes, which say nothing more
        reason = ' '.join(str(error).split())[:200]
        raise PolicyError(f'onnxruntime cannot read it: {reason}') from None


def describe(session: Any, width: int) -> dict[str, Any]:
    """
    Return what a session tells, after it has run on zeros.

    Raises:
        PolicyError: it does not run.
    """
    import numpy as np

    ends = {
        name: [[end.name, list(end.shape), end.type] for end in ends]
        for name, ends in (('inputs', session.get_inputs()), ('outputs', session.get_outputs()))
    }
    if len(ends['inputs']) != 1 or ends['inputs'][0][2] != 'tensor(float)':
        return ends  # refused by who asked, by name
    name, shape, _ = ends['inputs'][0]
    instead = [1] * (len(shape) - 1) + [width]
    shape[:] = [a if isinstance(a, int) else b for a, b in zip(shape, instead, strict=False)]
    try:
        outputs = session.run(None, {name: np.zeros(shape, np.float32)})
    except Exception as error:  # whatever the library raises while it runs
        reason = ' '.join(str(error).split())[:200] or type(error).__name__
        raise PolicyError(f'the network cannot be run on an input of {shape}: {reason}') from None
    for end, output in zip(ends['outputs'], outputs, strict=True):
        end[1] = list(np.shape(output))
    return ends


def main() -> None:
    """Look at the file that is named."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_TIME, PROCESSOR_TIME))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        print(json.dumps(describe(open_session(sys.argv[1]), int(sys.argv[2]))))
    except PolicyError as error:
        print(json.dumps({'error': str(error)}))


if __name__ == '__main__':
    main()
