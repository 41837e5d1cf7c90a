# SPDX-License-Identifier: Apache-2.0
"""Runs a node as a process: starts ROS, handles messages, and shuts down cleanly."""

from collections.abc import Callable, Iterator, Sequence
import contextlib
import importlib
import math
import os
import stat
import sys
import time
from typing import Any, TypeVar

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.event_handler import EventHandler
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import (
    ConditionReachedException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
import rclpy.logging
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.time_source import CLOCK_TOPIC

from wasd_core.errors import Stopped, UserError
from wasd_core.network import (
    do_without_shared_memory,
    domain_of,
    FAST_DDS,
    is_sourced,
    join_domain,
    keep_to_this_machine,
    SKIP_FOLDERS_PROFILES,
)
from wasd_core.ros_parameters import misspelt_parameters
from wasd_core.shared_memory import remove_segments_of_the_dead, why_no_shared_memory
from wasd_core.signals import last_status, letting_go, StopSignals
from wasd_core.streams import never_wait, prepare_streams, print_error, visible

# A node with a `close`.
NodeType = TypeVar('NodeType', bound=Any)

# How long one wait for messages may last [s]: bounds the time a stop signal goes unnoticed.
SPIN_PERIOD = 0.05
# What a process has open.
OPEN_FILES = ('/dev/fd/', '/proc/self/fd/')
CLOCK_LOGGER = rclpy.logging.get_logger('clock')


@contextlib.contextmanager
def explain_ros_errors() -> Iterator[None]:
    """
    Context in which ROS is initialised and nodes are made.

    Raises:
        UserError: the reason, e.g. a malformed argument or name, or a parameter's wrong type.
    """
    try:
        yield
    except UnknownROSArgsError as error:
        raise UserError(f'unknown ROS arguments: {error}') from None
    except RCLError as error:
        raise UserError(f'ROS: {_first_words(str(error))}') from None
    except (ParameterException, NameValidationException) as error:
        # The second line of the latter is the name, the third an arrow to a character of it.
        words = ' '.join(line.strip() for line in str(error).splitlines()[:2])
        raise UserError(f'ROS: {words}') from None


def _first_words(error: str) -> str:
    """Return rcl's error without where in its sources it arose."""
    said = error.removeprefix('failed to initialize rcl: ').partition(', at ')[0]
    what, _, why = said.partition('. Error: ')
    # What its lexer expected is a number.
    return what if not why or 'lexeme' in why else f'{what}: {why}'


def _load_no_generator() -> None:
    """
    Load what finds the type support of messages without what makes messages of their text.

    With the first message ROS loads that, too, with its parser: a quarter of the start of ROS.
    Here it is loaded when somebody asks for it.
    """
    package, generator = 'rosidl_generator_py', 'generate_py'
    path = f'{package}.{generator}_impl'
    if package in sys.modules:
        return
    sys.modules[path] = None  # type: ignore[assignment]  # as if it were not installed
    try:
        loaded = importlib.import_module(package)
    finally:
        del sys.modules[path]

    def load(name: str) -> Any:
        if name != generator:
            raise AttributeError(f'{package} has no {name}')
        return getattr(importlib.import_module(path), name)

    vars(loaded)['__getattr__'] = load


_load_no_generator()


def init_ros(
    args: Sequence[str] | None = None, *, is_local: bool = False, joins: bool = False
) -> None:
    """
    Initialise rclpy but leave the signals to us.

    Its own handlers end the context before a node could publish its last, zero command.
    ROS keeps to this machine unless the user says otherwise, in a sourced ROS only if `is_local`.
    With `joins` it is in the domain of the user's run, where there is one. What killed processes
    left in shared memory is removed.

    Raises:
        UserError: arguments after --ros-args that are none, in one line.
    """
    args = list(sys.argv if args is None else args)
    _refuse_folders_and_pipes(args)
    domain_of(os.environ)  # ROS itself says it in words of its own
    middleware = rclpy.get_rmw_implementation_identifier()
    if is_local or not is_sourced(os.environ):
        keep_to_this_machine(os.environ, middleware)
        choice = join_domain(os.environ) if joins else ''
        if choice:
            print(choice, file=sys.stderr, flush=True)
    os.environ[SKIP_FOLDERS_PROFILES] = '1'
    remove_segments_of_the_dead()
    if middleware.startswith(FAST_DDS) and (why := why_no_shared_memory(domain_of(os.environ))):
        do_without_shared_memory(os.environ)
        words = f'wasd: uses UDP instead of shared memory: {why}'
        print(words, file=sys.stderr, flush=True)
    # The error says it all: no log line on top of it.
    rclpy.logging.set_logger_level('rcl', rclpy.logging.LoggingSeverity.FATAL)
    try:
        with explain_ros_errors():
            rclpy.init(
                args=_without_log_file(args, is_local),
                signal_handler_options=SignalHandlerOptions.NO,
            )
    finally:
        rclpy.logging.set_logger_level('rcl', rclpy.logging.LoggingSeverity.UNSET)


def _refuse_folders_and_pipes(args: Sequence[str]) -> None:
    """
    Refuse a folder and a named pipe of parameters.

    ROS would find a mistake in line 0 of the folder, and would wait without end for a writer of
    the pipe. A shell's `<(...)` is no named pipe: its writer is there.
    """
    for word, path in zip(args, args[1:], strict=False):
        is_other = word != '--params-file' or path.startswith(OPEN_FILES)
        mode = os.stat(path).st_mode if not is_other and os.path.exists(path) else 0
        if stat.S_ISFIFO(mode) or stat.S_ISDIR(mode):
            found = 'folder' if stat.S_ISDIR(mode) else 'pipe'
            raise UserError(f'--params-file {path}: is a {found}, wanted a file')


def _without_log_file(args: Sequence[str], is_local: bool) -> list[str]:
    """
    Return arguments that keep ROS from leaving a file in the home at each start.

    What is logged is printed, and goes to /rosout. A file is written where ROS is sourced and its
    tools look for it, or where the user asks for it: by a place, or by ROS' own argument.
    """
    asked = '--enable-external-lib-logs' in args or {'ROS_LOG_DIR', 'ROS_HOME'} & os.environ.keys()
    if asked or (is_sourced(os.environ) and not is_local):
        return list(args)
    return [*args, '--ros-args', '--disable-external-lib-logs']


def spin_alone(node: Node, stop: StopSignals) -> None:
    """Spin one node until a stop signal or a shutdown."""
    executor = MessagePump()
    executor.add_node(node)
    try:
        while rclpy.ok() and not stop.requested:
            executor.handle(SPIN_PERIOD)
    finally:
        # Whatever is left to the garbage collector complains when rclpy is gone before it.
        executor.shutdown(timeout_sec=0.0)


def run_program(work: Callable[[StopSignals], None]) -> int:
    """
    Do a program's work until a signal or a shutdown; return the exit status.

    What the user can mend, in arguments, parameters or files, ends with one line on stderr and
    status 2.
    """
    prepare_streams()
    never_wait()
    with StopSignals() as stop:
        try:
            work(stop)
        except UserError as error:
            print_error(error)
            return 2
        except (Stopped, KeyboardInterrupt):
            # The latter is Ctrl-C again, because leaving took too long: nothing to explain.
            pass
        finally:
            with letting_go():
                rclpy.try_shutdown()
    return last_status(stop)


@contextlib.contextmanager
def open_node(make_node: Callable[[], NodeType], stop: StopSignals) -> Iterator[NodeType]:
    """
    Context with a node whose `close` publishes the last word, the zero command, on every way out.

    Raises:
        UserError: what ROS has against the node.
    """
    with explain_ros_errors():
        node = make_node()
    for text in misspelt_parameters(node):
        node.get_logger().warning(visible(text))
    stop.last_words.append(node.close)
    try:
        yield node
    finally:
        node.close()
        with letting_go():
            node.destroy_node()


def run_node(
    make_node: Callable[[], NodeType],
    args: Sequence[str] | None = None,
    run: Callable[[NodeType, StopSignals], None] = spin_alone,
    joins: bool = False,
) -> int:
    """
    Run one node as a program; see `run_program` and `open_node`.

    A node that `joins` is for the run that is there; see `init_ros`.
    """

    def work(stop: StopSignals) -> None:
        init_ros(args, joins=joins)
        with open_node(make_node, stop) as node:
            run(node, stop)

    return run_program(work)


def _is_of_clock(error: BaseException, entity: Any) -> bool:
    """Return whether an error is rclpy's on a time below 0, which anybody can send; tell of it."""
    if not isinstance(error, ValueError) or getattr(entity, 'topic_name', '') != CLOCK_TOPIC:
        return False
    CLOCK_LOGGER.warning(f'{CLOCK_TOPIC}: {error}: ignored', throttle_duration_sec=5.0)
    return True


class MessagePump(SingleThreadedExecutor):
    """
    An executor for a loop with other work: handles the present messages and returns.

    rclpy makes what it waits for again at each pass, a dozen microseconds for each thing. So
    events of quality of service, one or two for each topic, wait for up to EVENT_PERIOD: rclpy
    has nothing for them but a line of its log.
    """

    # Handlers run in one go at most, so that a flood of messages cannot stop the caller's loop.
    LIMIT = 100
    EVENT_PERIOD = 1.0  # [s of wall time]

    def __init__(self) -> None:
        super().__init__()
        self._looks_at_events, self._events_at = True, -math.inf
        self._only: set[Any] | None = None  # what this pass is about; None: everything

    def can_execute(self, entity: Any) -> bool:
        """Whether this pass is about a subscription, a timer or the like."""
        if self._only is not None and entity not in self._only:
            return False
        if not self._looks_at_events and isinstance(entity, EventHandler):
            return False
        return bool(super().can_execute(entity))

    def handle(self, timeout: float = 0.0) -> None:
        """Run the handlers of all waiting messages; wait up to `timeout` [s] for the first."""
        now = time.monotonic()
        self._looks_at_events = now >= self._events_at + self.EVENT_PERIOD
        if self._looks_at_events:
            self._events_at = now
        try:
            self._handle(timeout)
        finally:
            self._only = None

    def _handle(self, timeout: float) -> None:
        handled: set[Any] = set()  # in this pass
        for _ in range(self.LIMIT):
            try:
                while (found := self._next(timeout)) is None:
                    if not handled:
                        return
                    # One pass takes one message of each subscription; of those more may wait.
                    self._only, handled = handled, set()
            except (ShutdownException, ConditionReachedException):
                return
            handler, entity = found
            handled.add(entity)
            handler()
            error = handler.exception()
            if error is not None and not _is_of_clock(error, entity):
                raise error
            timeout = 0.0

    def _next(self, timeout: float) -> tuple[Any, Any] | None:
        """Return what is to be run next, and what it belongs to; None at the end of a pass."""
        try:
            ready: tuple[Any, Any, Any] = self.wait_for_ready_callbacks(timeout_sec=timeout)
        except TimeoutException:
            return None
        return ready[:2]
