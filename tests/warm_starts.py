# SPDX-License-Identifier: Apache-2.0
"""
Starts our programs for tests in forks of a process that has loaded what they load.

Of the second of a processor that a start costs, more than half are imports. Here each worker does
them once. What comes of it is a process of its own: a child of the worker, with its own number,
session, terminal, streams, folder and environment, in which Python runs the program from its
beginning, as `python -m` does. What loads, in which order and in which environment, is left to
the tests that start Python itself, as is all that `as_warm` cannot tell to be the same.
"""

from collections.abc import Callable, Mapping
import ctypes
import functools
import gc
import importlib
import json
import os
from pathlib import Path
import runpy
import signal
import socket
import subprocess
import sys
import threading
from typing import Any

# What every one of these would load is loaded before.
PROGRAMS = (
    'diff_drive_sim.diff_drive_controller_node',
    'mujoco_sim.simulator_node',
    'quadruped_sim.leg_controller_node',
    'robot_description.state_publisher_node',
    'teleop_keyboard.key_publisher_node',
    'teleop_keyboard.keys_to_twist_node',
    'teleop_keyboard.teleop_node',
    'teleop_keyboard.twist_mux_node',
    'wasd_bringup.cli',
    'wasd_navigation.navigator_node',
)
PARTS = (
    'programs',
    'mujoco_sim.compiled',
    'mujoco_sim.viewer.page',
    'wasd_bringup.cli.run_command',
    'wasd_bringup.page.bridge',
    'wasd_bringup.page.legged',
    'wasd_bringup.page.robot_view',
    'wasd_bringup.page.wheels',
    'wasd_bringup.ros.face',
    'wasd_bringup.run.elevation',
    'wasd_bringup.run.go2',
    'wasd_bringup.run.mbot',
    'wasd_bringup.tools.graph.commands',
    'wasd_bringup.tools.recording.replay',
)
# Other commands choose how to draw before they load MuJoCo.
COMMANDS = ('go2', 'mbot', 'both', 'replay', 'topics', 'echo', 'hz', 'pub', 'call', 'params')
# What a program may have of its own in its environment: it is read when it runs, not loads.
LATER = (
    *('ROS_', 'PYTEST_', 'WASD_', 'XDG_CONFIG_HOME', 'TERM', 'LINES', 'COLUMNS'),
    # Our own code sets these in a worker, too.
    *('SKIP_DEFAULT_XML_FILE', 'PYTHON_COLORS'),
)
KNOWN = {'cwd', 'env', 'stdin', 'stdout', 'stderr', 'text', 'start_new_session'}
# Words of the process that forks that make room for those of its forks in the list of processes.
ROOM = 4096
SET_CHILD_SUBREAPER = 36
# What is loaded is loaded in this environment, not in that of the test which starts first.
USUAL: dict[str, str] = {}


def know_environment() -> None:
    """Take the environment of now, when all tests are loaded and none has begun, for the usual."""
    USUAL.clear()
    USUAL.update(os.environ)


class Started(subprocess.Popen[Any]):
    """A program that has been forked; for whoever waits for it, one like any other."""

    def __init__(self, words: list[str], is_on_terminal: bool, **options: Any) -> None:
        self._is_on_terminal = is_on_terminal
        super().__init__(words, **options)

    def _execute_child(self, *arguments: Any) -> None:  # type: ignore[misc]
        words, _, _, _, _, folder, environment = arguments[:7]
        pipes = arguments[10:16]
        given = (pipes[0], pipes[3], pipes[5])  # of each pipe, the child's end
        request = {
            'words': words,
            'folder': os.fspath(folder or os.getcwd()),
            'environment': dict(os.environ if environment is None else environment),
            'is_on_terminal': self._is_on_terminal,
            'leads': bool(arguments[20]),
        }
        streams = [number if one == -1 else one for number, one in enumerate(given)]
        self.pid = _server().fork(request, streams)
        self._child_created = True
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]


def as_warm(words: list[str], options: dict[str, Any], on_terminal: list[str]) -> Any:
    """Start a program by a fork; None where that may not be the same as to start Python."""
    is_on_terminal = words[: len(on_terminal)] == on_terminal
    rest = words[len(on_terminal) :] if is_on_terminal else words[1:]
    if words[0] != sys.executable or rest[:1] != ['-m'] or rest[1] not in PROGRAMS:
        return None
    if rest[1] == 'wasd_bringup.cli' and not set(rest[2:3]) <= set(COMMANDS):
        return None
    if not options.keys() <= KNOWN:
        return None
    if differing(os.environ if options.get('env') is None else options['env']):
        return None
    return Started(rest[1:], is_on_terminal, **options)


def differing(own: Mapping[str, str]) -> set[str]:
    """Return what in an environment may make a difference to what loads in it."""
    names = {name for name in own.keys() | USUAL.keys() if own.get(name) != USUAL.get(name)}
    return {name for name in names if not name.startswith(LATER)}


class Server:
    """The process that forks."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair()
        self._lock = threading.Lock()
        words = [sys.executable, __file__, str(theirs.fileno()), '.' * ROOM]
        silent = subprocess.DEVNULL
        self._process = subprocess.Popen(
            words, env=USUAL, pass_fds=(theirs.fileno(),), stdin=silent, stdout=silent
        )
        theirs.close()

    def fork(self, request: dict[str, Any], streams: list[int]) -> int:
        """Have a child of this process forked with these streams; return its number."""
        data = json.dumps(request).encode()
        with self._lock:
            # Its parent ends at once, and orphans go to who asks for them.
            _set_subreaper(True)
            try:
                socket.send_fds(self._socket, [len(data).to_bytes(4, 'big')], streams)
                self._socket.sendall(data)
                return int.from_bytes(_receive(self._socket, 4), 'big')
            finally:
                _set_subreaper(False)


@functools.cache
def _server() -> Server:
    return Server()


def _set_subreaper(is_one: bool) -> None:
    assert ctypes.CDLL(None).prctl(SET_CHILD_SUBREAPER, int(is_one), 0, 0, 0) == 0


def _receive(connection: socket.socket, size: int) -> bytes:
    data = b''
    while len(data) < size:
        more = connection.recv(size - len(data))
        if not more:
            raise EOFError
        data += more
    return data


def serve(connection: socket.socket) -> str:
    """Fork when asked; return in each fork, which is then to run the module that is returned."""
    tracing = _find_tracing()
    while True:
        head, streams, _, _ = socket.recv_fds(connection, 4, 3)
        if not head:
            os._exit(0)
        request = json.loads(_receive(connection, int.from_bytes(head, 'big')))
        read, write = os.pipe()
        tracing('before_fork')
        between = os.fork()
        if not between:
            if os.fork():
                os._exit(0)
            tracing('after_fork_child')
            _name_process([sys.executable, '-m', *request['words']])
            os.write(write, os.getpid().to_bytes(4, 'big'))
            break
        tracing('after_fork_parent')
        os.waitpid(between, 0)
        connection.sendall(os.read(read, 4))
        for each in (read, write, *streams):
            os.close(each)
    connection.detach()
    return become(request, streams)


def _find_tracing() -> Callable[[str], None]:
    """
    Return a function that tells LTTng of a fork: ROS brings it, and it has threads of its own.

    A fork that was not told of would end the threads that it has not, and itself by a fault.
    """
    maps = Path('/proc/self/maps').read_text().splitlines()
    paths = {line.split()[-1] for line in maps if 'liblttng-ust' in line}
    mask = ctypes.create_string_buffer(128)  # of signals
    libraries = [ctypes.CDLL(path) for path in paths]

    def tell(moment: str) -> None:
        for library in libraries:
            for name in (f'ust_{moment}', f'lttng_ust_{moment}'):  # the latter from 2.13 on
                if hasattr(library, name):
                    getattr(library, name)(mask)
                    break

    return tell


def become(request: dict[str, Any], streams: list[int]) -> str:
    """Make this process what `python -m` with these words would be; return the module."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    os.closerange(3, os.sysconf('SC_OPEN_MAX'))
    if request['leads'] or request['is_on_terminal']:
        os.setsid()
    if request['is_on_terminal']:
        import fcntl
        import termios

        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    os.chdir(request['folder'])
    os.environ.clear()
    os.environ.update(request['environment'])
    module, *words = request['words']
    sys.argv = ['-m', *words]
    sys.orig_argv = [sys.executable, '-m', module, *words]
    for name, mode in (('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w')):
        usual = getattr(sys, name)
        stream = open(  # noqa: SIM115
            ('stdin', 'stdout', 'stderr').index(name),
            mode,
            encoding=usual.encoding,
            errors=usual.errors,
            closefd=False,
        )
        stream.reconfigure(line_buffering=name == 'stderr' or stream.isatty())
        setattr(sys, name, stream)
        setattr(sys, f'__{name}__', stream)
    if module == 'programs':
        sys.path.insert(0, os.path.dirname(__file__))
    if not hasattr(sys.modules[module], '__path__'):
        del sys.modules[module]  # it is run, not imported
    # Our packages, once loaded, end silently by it, and look for nothing where the user stands.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.enable()
    return str(module)


def _name_process(words: list[str]) -> None:
    """Write these words where the system looks for those of this process."""
    with open('/proc/self/stat') as file:
        fields = file.read().rpartition(')')[2].split()
    start, end = int(fields[45]), int(fields[46])
    text = '\0'.join(words).encode()[: end - start]
    ctypes.memset(start, 0, end - start)
    ctypes.memmove(start, text, len(text))


def load() -> None:
    """Load what the programs load, and what is compiled of the legs."""
    from quadruped_sim.compilation import warm_up
    from quadruped_sim.robot_model import RobotModel
    from robot_description.description import load_robot

    for name in (*PROGRAMS, *PARTS):
        importlib.import_module(name)
    warm_up(RobotModel(load_robot('go2')))


if __name__ == '__main__':
    gc.disable()
    load()
    gc.freeze()
    del sys.path[0]  # the folder of the tests
    os.dup2(1, 2)  # from here on only its forks have a word to say
    runpy._run_module_as_main(serve(socket.socket(fileno=int(sys.argv[1]))))  # type: ignore[attr-defined]
