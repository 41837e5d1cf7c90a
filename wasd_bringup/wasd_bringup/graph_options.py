# SPDX-License-Identifier: Apache-2.0
"""The options of the commands that look into a running ROS graph."""

import argparse
from typing import Any


def _window(text: str) -> int:
    value = int(text)
    if value < 1:
        raise ValueError
    return value


def add_graph_commands(commands: Any) -> None:
    """Declare `topics`, `echo`, `hz`, `call` and `params`."""
    topics = _add(commands, 'topics', 'list the topics of all running nodes')
    topics.add_argument('-t', '--show-types', action='store_true', help='with their types')
    echo = _add(commands, 'echo', 'print the messages of a topic')
    echo.add_argument('topic', metavar='TOPIC')
    echo.add_argument(
        'type', nargs='?', metavar='TYPE', help='e.g. std_msgs/msg/String: wait for the topic'
    )
    echo.add_argument('--once', action='store_true', help='print one message and exit')
    echo.add_argument('--field', metavar='PATH', help='only this, e.g. pose.pose.position')
    echo.add_argument('-f', '--full-length', action='store_true', help='do not cut long arrays')
    hz = _add(commands, 'hz', 'print how often messages come on a topic')
    hz.add_argument('topic', metavar='TOPIC')
    hz.add_argument(
        '-w', '--window', type=_window, default=10000, metavar='N', help='over the last N messages'
    )
    call = _add(commands, 'call', 'call a service')
    call.add_argument('service', metavar='SERVICE')
    call.add_argument(
        'rest',
        nargs='*',
        metavar='[TYPE] [YAML]',
        help='its type, looked up if left out, and the request, e.g. "{data: true}"',
    )
    params = _add(commands, 'params', "list, get or set a node's parameters")
    params.add_argument('node', metavar='NODE')
    params.add_argument('name', nargs='?', metavar='NAME', help='print its value')
    params.add_argument('value', nargs='?', metavar='VALUE', help='... or set it')


def _add(commands: Any, name: str, summary: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(name, help=summary, allow_abbrev=False)
    parser.set_defaults(looks_into_graph=True)
    return parser
