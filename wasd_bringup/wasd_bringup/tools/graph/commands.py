# SPDX-License-Identifier: Apache-2.0
"""`wasd topics`, `echo`, `hz`, `pub`, `call`, `params`: what ros2cli does, where there is none."""

import argparse
from collections.abc import Callable, Sequence
import functools
import itertools
import math
import re
import sys
import time
from typing import Any

from rclpy.duration import Duration
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from wasd_core.errors import one_line, suggest, UserError
from wasd_core.parameter_file import load_yaml
from wasd_core.signals import last_status
from wasd_core.streams import print_error
from wasd_core.topics import RELIABLE
import yaml

from wasd_bringup.tools.graph.listener import TopicListener
from wasd_bringup.tools.graph.rate import RateMeter
from wasd_bringup.tools.graph.ros_graph import (
    find_type,
    full_name,
    Interrupted,
    NotFound,
    PATIENCE,
    POLL_PERIOD,
    RosGraph,
)
from wasd_bringup.tools.messages import field_of, fill, SHOWN_LENGTH, to_yaml, type_name

# A rate is printed so often [s].
HZ_PERIOD = 1.0
TYPE_NAME = re.compile(r'\w+(/(msg|srv))?/[A-Z]\w*')
# Time for the last message to leave if nobody confirms it [s].
FAREWELL = 1.0
# An answer that has not come after so long [s] is lost: services answer, actions bring results.
LONGEST_CALL = 60.0
RESULT = '/_action/get_result'
# How `ros2 param get` calls the types of rcl_interfaces/ParameterType, in their order.
KINDS = (
    'Parameter not set.',
    'Boolean value is:',
    'Integer value is:',
    'Double value is:',
    'String value is:',
    'Byte values are:',
    'Boolean values are:',
    'Integer values are:',
    'Double values are:',
    'String values are:',
)


def run_graph_command(arguments: argparse.Namespace) -> int:
    """
    Run one of the commands; return the exit status: 1 where what was asked for is not there.

    Raises:
        UserError: a name, a type or a value is malformed.
    """
    graph = RosGraph()
    try:
        with graph:
            return COMMANDS[arguments.command](graph, arguments)
    except NotFound as error:
        print_error(error)
        return 1
    except Interrupted:
        return last_status(graph.stop)


def list_topics(graph: RosGraph, arguments: argparse.Namespace) -> int:
    """Print every topic."""
    for name, kinds in graph.topics().items():
        print(f'{name} [{", ".join(kinds)}]' if arguments.show_types else name)
    if emptiness := graph.emptiness():
        print(emptiness, file=sys.stderr)
    return 0


def echo(graph: RosGraph, arguments: argparse.Namespace) -> int:
    """Print messages until Ctrl-C, or one."""
    topic = full_name(arguments.topic)
    kind = find_type(arguments.type or graph.type_of('topic', topic), 'msg')
    longest = None if arguments.full_length else SHOWN_LENGTH
    if arguments.field:
        field_of(kind(), re.sub(r'\[-?\d+\]', '', arguments.field))  # a typing error shows now
    received: list[Any] = []
    listener = TopicListener(graph.node, topic, kind, received.append)
    while True:
        listener.look()
        graph.spin()
        while received:
            message = received.pop(0)
            value = field_of(message, arguments.field) if arguments.field else message
            print(f'{to_yaml(value, longest)}---', flush=True)
            if arguments.once:
                return 0


def hz(graph: RosGraph, arguments: argparse.Namespace) -> int:
    """Print once a second how often messages come, in wall time."""
    topic = full_name(arguments.topic)
    kind = find_type(graph.type_of('topic', topic), 'msg')
    meter = RateMeter(arguments.window)
    came = 0

    def count(_: bytes) -> None:
        nonlocal came
        came += 1
        meter.add(time.monotonic())

    listener = TopicListener(graph.node, topic, kind, count, raw=True)
    due, printed = time.monotonic() + HZ_PERIOD, 0
    while True:
        listener.look()
        graph.spin()
        if time.monotonic() >= due:
            due += HZ_PERIOD
            if came > max(printed, 1):
                printed = came
                print(meter.rate(), flush=True)


def pub(graph: RosGraph, arguments: argparse.Namespace) -> int:
    """Publish a message at a rate of wall time, until Ctrl-C or so many times."""
    topic, (given, text) = full_name(arguments.topic), _type_and_yaml('pub', arguments.rest)
    values = _read_yaml(text)
    kind = find_type(given or graph.type_of('topic', topic), 'msg')
    message = kind()
    fill(message, values, functools.partial(find_type, kind='msg'))
    publisher = graph.node.create_publisher(kind, topic, RELIABLE)
    if arguments.times is not None and not graph.wait(publisher.get_subscription_count):
        raise NotFound(f'nobody listens to {topic} as {type_name(kind)}')
    due = time.monotonic()
    for number in itertools.count(1):
        print(f'publishing #{number}: {message!r}\n', flush=True)
        publisher.publish(message)
        if number == arguments.times:
            break
        # What was missed while the process was stopped is not made up for.
        due = max(due + 1.0 / arguments.rate, time.monotonic())
        graph.spin(0.0)
        while (rest := due - time.monotonic()) > 0.0:
            graph.spin(min(rest, POLL_PERIOD))
    publisher.wait_for_all_acked(Duration(seconds=FAREWELL))
    return 0


def call(graph: RosGraph, arguments: argparse.Namespace) -> int:
    """Call a service and print what it answers."""
    service, (given, text) = full_name(arguments.service), _type_and_yaml('call', arguments.rest)
    offered = graph.type_of('service', service)
    kind: Any = find_type(given or offered, 'srv')
    if given is not None and find_type(offered, 'srv') is not kind:
        raise UserError(f'{service} is a {offered}, not a {given}')
    request = kind.Request()
    fill(request, _read_yaml(text), functools.partial(find_type, kind='msg'))
    client = graph.node.create_client(kind, service)
    if not client.service_is_ready():
        print('waiting for service to become available...', flush=True)
    if not graph.wait(client.service_is_ready):
        raise NotFound(f'service {service} does not answer')
    print(f'requester: making request: {request!r}\n', flush=True)
    future = client.call_async(request)  # once: a request may do something each time
    longest = math.inf if service.endswith(RESULT) else LONGEST_CALL
    answer = _answer(graph, lambda: future, client.service_is_ready, longest)
    print(f'response:\n{answer!r}\n')
    return 0


# What `ros2 param` has before the node.
VERBS_OF_ROS = ('list', 'get', 'set')


def params(graph: RosGraph, arguments: argparse.Namespace) -> int:
    """List a node's parameters, or get or set one."""
    node = full_name(arguments.node)
    try:
        graph.require_node(node)
    except NotFound as error:
        usage = '; write params NODE [NAME [VALUE]]' * (arguments.node in VERBS_OF_ROS)
        raise NotFound(f'{error}{usage}') from None
    client = AsyncParameterClient(graph.node, node)
    there = client.services_are_ready
    if not graph.wait(there):
        raise NotFound(f'node {node} has no parameter services')
    names = sorted(_answer(graph, client.list_parameters, there).result.names)
    name = arguments.name
    if name is None:
        print('\n'.join(f'  {one}' for one in names))
        return 0
    if name not in names:
        raise NotFound(f'node {node} has no parameter {name!r}{suggest(name, names)}')
    value = _answer(graph, lambda: client.get_parameters([name]), there).values[0]
    if arguments.value is None:
        print(KINDS[value.type], *([parameter_value_to_python(value)] if value.type else ()))
        return 0
    change = _parameter(name, arguments.value, type(parameter_value_to_python(value)))
    return _set(graph, client, change)


COMMANDS = {
    'topics': list_topics,
    'echo': echo,
    'hz': hz,
    'pub': pub,
    'call': call,
    'params': params,
}


def _set(graph: RosGraph, client: AsyncParameterClient, change: Parameter) -> int:
    there = client.services_are_ready
    (result,) = _answer(graph, lambda: client.set_parameters([change]), there).results
    reason = f': {result.reason}' if result.reason else ''
    if not result.successful:
        print(f'Setting parameter failed{reason}', file=sys.stderr)
        return 1
    print(f'Set parameter successful{reason}')
    return 0


def _parameter(name: str, text: str, kind: type) -> Parameter:
    """Return a parameter with the value that a text stands for where a `kind` has been so far."""
    value = text if kind is str else _read_yaml(text)
    if kind is float and type(value) is int:
        value = float(value)
    try:
        return Parameter(name, value=value)
    except TypeError:
        raise UserError(f'{name}: no parameter can be {text!r}') from None


def _type_and_yaml(command: str, words: Sequence[str]) -> tuple[str | None, str]:
    """Return the type, if it is among the words of a command, and the YAML behind it."""
    rest = list(words)
    given = rest.pop(0) if rest and TYPE_NAME.fullmatch(rest[0]) else None
    if len(rest) > 1:
        raise UserError(f'{command}: got {" ".join(rest)!r}, wanted [TYPE] [YAML]; quote the YAML')
    return given, rest[0] if rest else '{}'


def _read_yaml(text: str) -> Any:
    try:
        return load_yaml(text)
    except yaml.YAMLError as error:
        reason = one_line(error)
        raise UserError(f'not YAML: {text!r}: {reason}') from None


def _answer(
    graph: RosGraph,
    ask: Callable[[], Any],
    is_there: Callable[[], bool],
    longest: float = math.inf,
) -> Any:
    """
    Return what a call brings, waiting as long as the node that was asked is there.

    Asks again in between: an answer is lost when the service has not found the asker yet.

    Raises:
        NotFound: no answer came, or not within the longest time [s].
    """
    over = time.monotonic() + longest
    while True:
        future, again = ask(), min(time.monotonic() + PATIENCE, over)
        while not future.done() and time.monotonic() < again:
            graph.spin()
            if not (future.done() or is_there()):
                raise NotFound('gone before it has answered')
        if future.done():
            return future.result()
        if time.monotonic() >= over:
            raise NotFound(f'no answer within {longest:g} s; the request may have been acted on')
