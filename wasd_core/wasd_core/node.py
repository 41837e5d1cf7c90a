# SPDX-License-Identifier: Apache-2.0
"""What every node of this project needs: parameters from their definition, a clean way out."""

import array
from collections.abc import Callable, Mapping, Sequence
import os
import sys
from typing import Any, TypeVar

from rcl_interfaces.msg import SetParametersResult
import rclpy
from rclpy.executors import ConditionReachedException
from rclpy.executors import Executor
from rclpy.executors import ShutdownException
from rclpy.executors import SingleThreadedExecutor
from rclpy.executors import TimeoutException
import rclpy.logging
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from wasd_core.descriptors import to_descriptor
from wasd_core.errors import Stopped
from wasd_core.errors import UserError
from wasd_core.executable import Executable
from wasd_core.parameters import InvalidParameter
from wasd_core.parameters import Known
from wasd_core.parameters import known_parameters
from wasd_core.parameters import Parameters
from wasd_core.ros_domains import join_domain
from wasd_core.ros_errors import explained
from wasd_core.ros_isolation import is_sourced
from wasd_core.ros_isolation import keep_to_this_machine
from wasd_core.shared_memory import remove_segments_of_the_dead
from wasd_core.stop_signals import last_status
from wasd_core.stop_signals import StopSignals
from wasd_core.streams import never_wait
from wasd_core.streams import prepare_streams
from wasd_core.streams import print_error

ParametersType = TypeVar('ParametersType', bound=Parameters)

# How long one wait for messages may last [s]: bounds the time a stop signal goes unnoticed.
SPIN_PERIOD = 0.05


def declare_parameters(
    node: Node,
    definition: type[ParametersType],
    on_change: Callable[[ParametersType], None] | None = None,
    defaults: ParametersType | None = None,
) -> ParametersType:
    """
    Declare a parameter set on a node and return its values; `defaults` replaces the definition's.

    With `on_change`, parameters that are not read-only can be set at run time: a legal change
    calls it with the new set, an illegal one is rejected with the reason. An integer is taken
    where a float is meant: people write `speed:=2`.

    Raises:
        InvalidParameter: when an override given at start is illegal.
    """
    values: dict[str, Any] = {}
    before = definition() if defaults is None else defaults
    known = known_parameters(definition)
    _refuse_unknown(node, definition, known)
    for name, (field, _) in known.items():
        default = before.value(name)
        given = node._parameter_overrides.get(name)
        if given is not None and {type(field.default), type(given.value)} <= {int, float}:
            definition.checked(name, given.value)  # ROS would say less of a range
        try:
            declared = node.declare_parameter(name, _to_ros(default), to_descriptor(field))
        except rclpy.exceptions.ParameterException as error:
            raise InvalidParameter(f'{name}: {error}') from None
        values[name] = _from_ros(declared.value)
    current = before.changed(values)

    def set_parameters(changes: 'Sequence[Parameter]') -> SetParametersResult:
        nonlocal current
        wanted = {
            change.name: _from_ros(change.value) for change in changes if change.name in known
        }
        if not wanted:
            return SetParametersResult(successful=True)
        try:
            changed = current.changed(wanted)
            if on_change is not None:
                on_change(changed)
        except (InvalidParameter, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        current = changed
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(set_parameters)
    return current


def _refuse_unknown(node: Node, definition: type[Parameters], known: Mapping[str, Known]) -> None:
    """Refuse `group.x` where the group has no x; other names may be meant for others."""
    groups = {place.group for place in known.values()} - {''}
    for name in node._parameter_overrides:
        if '.' in name and name.partition('.')[0] in groups and name not in known:
            definition.from_mapping({name: None})


def _to_ros(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _from_ros(value: Any) -> Any:
    """Return a list of any of ROS's kinds as a tuple."""
    return tuple(value) if isinstance(value, (list, array.array)) else value


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
    if is_local or not is_sourced(os.environ):
        keep_to_this_machine(os.environ, rclpy.get_rmw_implementation_identifier())
        choice = join_domain(os.environ) if joins else ''
        if choice:
            print(choice, file=sys.stderr, flush=True)
    remove_segments_of_the_dead()
    # The error says it all: no log line on top of it.
    rclpy.logging.set_logger_level('rcl', rclpy.logging.LoggingSeverity.FATAL)
    try:
        with explained():
            rclpy.init(
                args=_without_log_file(sys.argv if args is None else args, is_local),
                signal_handler_options=SignalHandlerOptions.NO,
            )
    finally:
        rclpy.logging.set_logger_level('rcl', rclpy.logging.LoggingSeverity.UNSET)


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
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        spin(executor, lambda: stop.requested)
    finally:
        # Whatever is left to the garbage collector complains when rclpy is gone before it.
        executor.shutdown(timeout_sec=0.0)


def run_node(
    make_node: Callable[[], Any],
    args: Sequence[str] | None = None,
    run: Callable[[Any, StopSignals], None] = spin_alone,
    joins: bool = False,
    program: Executable | None = None,
) -> int:
    """
    Run one node as a process until a signal or a shutdown; return the exit status.

    The node's `close` publishes what must be the last word, the zero command, on every way out.
    What is wrong with the arguments or parameters ends with one line on stderr and status 2.
    A node that `joins` is for the run that is there; see `init_ros`. What is not ROS's among the
    arguments is the `program`'s: its --help, or wrong.
    """
    prepare_streams()
    never_wait()
    with StopSignals() as stop:
        node = None
        try:
            if program is not None:
                program.read(sys.argv[1:] if args is None else args)
            init_ros(args, joins=joins)
            with explained():
                node = make_node()
            stop.last_words.append(node.close)
            run(node, stop)
        except Stopped:
            pass
        except UserError as error:
            print_error(error)
            return 2
        finally:
            if node is not None:
                node.close()
                node.destroy_node()
            rclpy.try_shutdown()
    return last_status(stop)


class MessagePump(SingleThreadedExecutor):
    """An executor for a loop that has other things to do: handles what is there and returns."""

    # Handlers run in one go at most, so that a flood of messages cannot stop the caller's loop.
    LIMIT = 100

    def handle(self, timeout: float = 0.0) -> None:
        """Run the handlers of all waiting messages; wait up to `timeout` [s] for the first."""
        handled_before = handled = 0
        while handled < self.LIMIT:
            try:
                handler, _, _ = self.wait_for_ready_callbacks(timeout_sec=timeout)
            except TimeoutException:
                # One pass takes one message of each subscription; more may be waiting.
                if handled == handled_before:
                    return
                handled_before = handled
                continue
            except (ShutdownException, ConditionReachedException):
                return
            handled += 1
            handler()
            error = handler.exception()
            if error is not None:
                raise error
            timeout = 0.0


def has_listener(publisher: Any) -> bool:
    """
    Whether a message would reach anybody; making and publishing one costs 50 us and more.

    For topics without latching, whose messages nobody gets who comes later.
    """
    return bool(publisher.get_subscription_count())


def has_subscriber(node: Node, publisher: Any) -> bool:
    """
    Whether somebody has subscribed; other than for `has_listener`, a recording does not count.

    For what is too large to be made just because everything is recorded.
    """
    return has_listener(publisher) and node.count_subscribers(publisher.topic_name) > 0


def spin(executor: Executor, stop: Callable[[], bool]) -> None:
    """Handle messages until `stop` or until the context is shut down."""
    while rclpy.ok() and not stop():
        executor.spin_once(timeout_sec=SPIN_PERIOD)
