# SPDX-License-Identifier: Apache-2.0
"""
A process that has loaded what our programs load, and becomes one of them by forking.

`starting.Popen` talks to it. What it forks is a process like any other: with its own arguments,
environment, folder, streams, session and terminal. What its `import` statements find is loaded
already, and its interpreter is not taken apart at the end.
"""

import atexit
import ctypes
import fcntl
import gc
import importlib
import json
import os
import runpy
import socket
import sys
import termios
import threading
from typing import Any

import expansions

# What `wasd` and the nodes import, some of them only when it is needed.
MODULES = (
    'wasd_bringup.cli',
    'wasd_bringup.go2_stack',
    'wasd_bringup.graph.commands',
    'wasd_bringup.mbot_stack',
    'wasd_bringup.recording.recorder',
    'wasd_bringup.recording.replay',
    'wasd_bringup.run_command',
    'diff_drive_sim.diff_drive_controller_node',
    'mujoco_sim.simulator_node',
    'quadruped_sim.leg_controller_node',
    'robot_description.state_publisher_node',
    'teleop_keyboard.key_publisher_node',
    'teleop_keyboard.keys_to_twist_node',
    'teleop_keyboard.teleop_node',
    'teleop_keyboard.twist_mux_node',
)
MOST_BYTES = 1 << 20
STREAMS = 3


def load() -> None:
    """Load what the programs load: modules, compiled functions, our robots' expanded files."""
    for name in MODULES:
        importlib.import_module(name)
    from quadruped_sim.robot_model import RobotModel
    from robot_description.description import load_robot

    from quadruped_sim import leg_controller_node

    expansions.remember()
    load_robot('mbot')
    leg_controller_node.warm_up(RobotModel(load_robot('go2')))
    # What that loads is loaded once; of the model it keeps nothing.
    leg_controller_node.warm_up = lambda model: None
    _load_type_supports()
    gc.collect()
    gc.freeze()


def _load_type_supports() -> None:
    """Have the libraries of all message types here, which each program would load by itself."""
    for name, module in list(sys.modules.items()):
        for thing in vars(module).values() if name.endswith(('.msg', '.srv')) else ():
            if hasattr(type(thing), '__import_type_support__'):
                type(thing).__import_type_support__()


def serve(link: socket.socket) -> dict[str, Any]:
    """Answer each request with the number of a process; return the request in that process."""
    while True:
        data, streams, _, _ = socket.recv_fds(link, MOST_BYTES, STREAMS)
        if not data:
            os._exit(0)
        request: dict[str, Any] = json.loads(data)
        said, saying = os.pipe()
        between = os.fork()
        if not between:
            number = os.fork()
            if number:  # leaves its child to whoever asked, who is a subreaper for this moment
                os.write(saying, str(number).encode())
                os._exit(0)
            _become(request, streams)
            return request
        os.waitpid(between, 0)
        link.send(os.read(said, 32))
        for descriptor in (said, saying, *streams):
            os.close(descriptor)


def _become(request: dict[str, Any], streams: list[int]) -> None:
    """Be as a process that has just been started in this way."""
    if request['session']:
        os.setsid()
    # Two steps, for a descriptor may have the number of another's place.
    above = [fcntl.fcntl(stream, fcntl.F_DUPFD, 64) for stream in streams]
    for number, descriptor in enumerate(above):
        os.dup2(descriptor, number)
    os.closerange(STREAMS, 1024)
    if 'machine' in request:
        _move_to(request['machine'])
    if request['terminal']:
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    os.chdir(request['folder'])
    os.environ.clear()
    os.environ.update(request['environment'])
    _open_streams()
    # As -m and a PYTHONPATH of the tests have it: the folder where it was started, then theirs.
    sys.path.insert(0, request['folder'])
    sys.argv = ['', *request['words']]


def _move_to(machine: int) -> None:
    """Have the interfaces and mounts of another process, as `nsenter` does it."""
    for name in ('net', 'mnt'):
        with open(f'/proc/{machine}/ns/{name}') as space:
            if ctypes.CDLL(None, use_errno=True).setns(space.fileno(), 0):
                raise OSError(ctypes.get_errno(), f'cannot enter {space.name}')


def _open_streams() -> None:
    """Have Python's streams know what they are connected to now."""
    old = sys.stdin, sys.stdout, sys.stderr
    opened = [
        open(  # noqa: SIM115
            number,
            'w' if number else 'r',
            buffering=1 if number == 2 else -1,
            encoding=stream.encoding,
            errors=stream.errors,
            closefd=False,
        )
        for number, stream in enumerate(old)
    ]
    sys.stdin, sys.stdout, sys.stderr = opened
    sys.__stdin__, sys.__stdout__, sys.__stderr__ = opened  # type: ignore[misc]
    if os.environ.get('PYTHONUNBUFFERED'):
        sys.stdout.reconfigure(write_through=True)  # type: ignore[union-attr]


def main() -> None:
    """Load everything, say so, and serve until the other side is gone."""
    link = socket.socket(fileno=int(sys.argv[1]))
    load()
    link.send(b'ready')
    module = serve(link)['module']
    link.detach()
    sys.modules.pop(module, None)  # it comes again, as __main__
    try:
        runpy.run_module(module, run_name='__main__', alter_sys=True)
        _leave(0)
    except SystemExit as end:
        _leave(end.code)


def _leave(code: Any) -> None:
    """
    End as Python does, but for taking the interpreter apart.

    Fast DDS does not survive that in a process that was forked, where a node is still there.
    """
    if isinstance(code, str):
        print(code, file=sys.stderr)
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else int(code is not None))


if __name__ == '__main__':
    main()
