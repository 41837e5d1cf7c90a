# SPDX-License-Identifier: Apache-2.0
"""Every program started, stopped by Ctrl-C when it is up, again and again; what it leaves."""

from collections.abc import Iterable
import ctypes
import fcntl
import os
from pathlib import Path
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from environment import together

# Program -> its module, its words, and the topic that it offers once it is up; a run of `wasd`
# says on its first line where its page is.
PROGRAMS = {
    'key_publisher': ('teleop_keyboard.key_publisher_node', (), 'keys'),
    'keys_to_twist': ('teleop_keyboard.keys_to_twist_node', (), 'cmd_vel'),
    'teleop': ('teleop_keyboard.teleop_node', (), 'cmd_vel'),
    'twist_mux': ('teleop_keyboard.twist_mux_node', (), 'cmd_vel_out'),
    'state_publisher': ('robot_description.state_publisher_node', (), 'tf_static'),
    'simulator': ('mujoco_sim.simulator_node', (), 'joint_states'),
    'diff_drive_controller': (
        'diff_drive_sim.diff_drive_controller_node',
        (),
        'joint_commands',
    ),
    'leg_controller': ('quadruped_sim.leg_controller_node', (), 'joint_commands'),
    'wasd mbot': ('wasd_bringup.cli', ('mbot', '--viewer', 'web'), ''),
    'wasd go2': ('wasd_bringup.cli', ('go2', '--viewer', 'web'), ''),
}
# Where the page keeps how it was left.
KEPT = ('home/.config', 'home/.config/wasd', 'home/.config/wasd/cockpit.json')
SHARED = Path('/dev/shm')
PATIENCE = 120.0  # for a start or an end [s]; without a cache it compiles
A_MOMENT = 0.2  # up for so long [s]
OLD = 3600.0  # age of what was killed long ago [s]
SET_CHILD_SUBREAPER = 36  # of prctl(2)


class Cycled(NamedTuple):
    """What a program left behind after so many starts, and how each ended."""

    name: str
    statuses: list[int]
    shared: list[str]
    files: list[str]
    children: list[int]


def repeat_program(name: str, times: int, turn: int | None = None) -> Cycled:
    """Start and stop a program so often."""
    os.environ.update(together(turn))
    before = set(os.listdir(SHARED))
    with tempfile.TemporaryDirectory() as folder:
        workplace = Workplace(Path(folder))
        watch = Watch()
        try:
            statuses, seen = [], set()
            bare = workplace.files()
            for _ in range(times):
                status, names = _cycle(name, workplace, watch)
                seen |= names
                statuses.append(status)
            files = sorted(set(workplace.files()) - {*bare, *KEPT})
        finally:
            watch.close()
        shared = abandoned(seen - before)
        return Cycled(name, statuses, shared, files, children())


def kill_and_start_again(times: int, turn: int | None = None) -> dict[str, Any]:
    """Kill a node so often; return its segments that are left, and those after another start."""
    os.environ.update(together(turn))
    before = set(os.listdir(SHARED))
    with tempfile.TemporaryDirectory() as folder:
        workplace, watch = Workplace(Path(folder)), Watch()
        seen = set()
        try:
            for _ in range(times):
                seen |= _cycle('twist_mux', workplace, watch, signal.SIGKILL)[1]
        finally:
            watch.close()
        mine = abandoned(seen - before)
        left = [name for name in mine if is_segment(name)]
        ports = [name for name in mine if not is_segment(name)]
        for name in left:
            then = time.time() - OLD
            os.utime(SHARED / f'{name.removesuffix("_el")}_el', (then, then))
        watch = Watch()
        try:
            _cycle('twist_mux', workplace, watch)
        finally:
            watch.close()
        later, still = abandoned(left), abandoned(ports)
    trial = {'kills': times, 'left': left, 'later': later}
    return {**trial, 'ports': ports, 'ports_later': still}


class Workplace:
    """A home and a temporary folder of a program's own, and where it stands."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.home, self.temporary, self.here = (folder / name for name in ('home', 'tmp', 'here'))
        for path in (self.home, self.temporary, self.here):
            path.mkdir()

    @property
    def environment(self) -> dict[str, str]:
        """The environment of the program, whose caches are the user's: compiled once for all."""
        ours = ('ROS_LOG_DIR', 'ROS_HOME')
        kept = {name: value for name, value in os.environ.items() if name not in ours}
        caches = os.environ.get('XDG_CACHE_HOME') or str(Path.home() / '.cache')
        own = {'HOME': str(self.home), 'TMPDIR': str(self.temporary)}
        return {**kept, 'XDG_CACHE_HOME': caches, **own}

    def files(self) -> list[str]:
        """Return everything in it."""
        return sorted(str(path.relative_to(self.folder)) for path in self.folder.rglob('*'))


class Watch:
    """Sees over ROS who is there."""

    def __init__(self) -> None:
        import rclpy
        from wasd_core.node import init_ros, MessagePump

        init_ros([])
        self._ros = rclpy
        self._node = rclpy.create_node('watch')
        self._pump = MessagePump()
        self._pump.add_node(self._node)

    def wait(self, topic: str, is_there: bool, process: 'subprocess.Popen[bytes]') -> None:
        """Wait until a topic is offered, or no more."""
        deadline = time.monotonic() + PATIENCE
        while bool(self._node.count_publishers(topic)) != is_there:
            if time.monotonic() > deadline or (is_there and process.poll() is not None):
                raise RuntimeError(f'{process.args!r}: {topic} there: {not is_there}')
            self._pump.handle(0.02)

    def close(self) -> None:
        """Leave ROS."""
        self._pump.shutdown(timeout_sec=0.0)
        self._node.destroy_node()
        self._ros.shutdown()


def _cycle(
    name: str, workplace: Workplace, watch: Watch, how: signal.Signals = signal.SIGINT
) -> tuple[int, set[str]]:
    """Start a program, end it when it is up; return its status and what it had in /dev/shm."""
    module, words, topic = PROGRAMS[name]
    ctypes.CDLL(None).prctl(SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    process = subprocess.Popen(
        [sys.executable, '-m', module, *words],
        env=workplace.environment,
        cwd=workplace.here,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=_hear_interrupts,
    )
    assert process.stdout is not None
    try:
        if topic:
            watch.wait(topic, True, process)
        elif not select.select([process.stdout], [], [], PATIENCE)[0]:
            raise RuntimeError(f'{name} says nothing')
        time.sleep(A_MOMENT)
        seen = shared_by(process.pid)
        process.send_signal(how)
        process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        process.wait()
    if topic and how is signal.SIGINT:
        # Who is killed is missed only after its lease.
        watch.wait(topic, False, process)
    return process.returncode, seen


def _hear_interrupts() -> None:
    # A shell starts what goes to the background deaf to them.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def shared_by(pid: int) -> set[str]:
    """Return the files in /dev/shm that a process has mapped or open."""
    texts = [Path(f'/proc/{pid}/maps').read_text()]
    for link in Path(f'/proc/{pid}/fd').iterdir():
        try:
            texts.append(os.readlink(link))
        except FileNotFoundError:
            continue
    return set(re.findall(rf'{SHARED}/(\S+)', '\n'.join(texts)))


def abandoned(names: Iterable[str]) -> list[str]:
    """
    Return the files of these in /dev/shm that are there and that nobody uses.

    Ports are the machine's: another domain may have taken one over, and holds its lock then.
    """
    return [name for name in sorted(names) if (SHARED / name).exists() and not _is_held(name)]


def port_of(name: str) -> str:
    """Return the name of the port, or segment, to which a file in /dev/shm belongs."""
    name = name.removeprefix('sem.').removesuffix('_mutex')
    return name.removesuffix('_el').removesuffix('_sl')


def _is_held(name: str) -> bool:
    stem = port_of(name)
    for lock in (SHARED / f'{stem}_el', SHARED / f'{stem}_sl'):
        try:
            with lock.open() as file:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except FileNotFoundError:
            continue
        except BlockingIOError:
            return True
    return False


def is_segment(name: str) -> bool:
    """Whether a file in /dev/shm is a participant's memory or its lock, not a port."""
    return re.fullmatch(r'fastrtps_[0-9a-f]{16}(_el)?', name) is not None


def children() -> list[int]:
    """Return this process' children, dead ones that nobody took leave of, too."""
    paths = Path('/proc/self/task').glob('*/children')
    return [int(pid) for path in paths for pid in path.read_text().split()]
