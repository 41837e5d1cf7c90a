# SPDX-License-Identifier: Apache-2.0
"""
Marks each test by what it uses, and holds it to that.

A test is `process` when it starts one, `ros` when it talks ROS in this process, `run` when it runs
the `wasd` command, `browser` when it drives one. What it uses is what its code can reach: its own
names, those of the helpers and fixtures that they lead to. A test without a mark is quick, and
fails when it starts a process or ROS all the same.
"""

from collections.abc import Callable, Iterator
import functools
import importlib
import inspect
from pathlib import Path
import sys
from types import CodeType
from types import FunctionType
from types import ModuleType
from typing import Any

import pytest

MARKS = ('process', 'ros', 'run', 'browser')
SLOW_MARKS = (*MARKS, 'slow')
TESTS = str(Path(__file__).resolve().parent)

_PROCESS_MODULES = {'subprocess', 'starting', 'multiprocessing', 'pty', '_pytest.pytester'}
_ROS_MODULES = ('rclpy', 'wasd_core.node', 'wasd_core.ros_parameters')
_RUN_NAMES = {'Runner', 'Session', 'run_command', 'demo_command', 'replay_command'}
# Events of Python's audit hooks that a quick test must not cause. A fork is quick: each expansion
# of a xacro file is one, of milliseconds.
_PROCESS_EVENTS = {'subprocess.Popen', 'os.posix_spawn', 'os.system', 'pty.spawn'}

_running_quick: list[str] = []


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks, and watch what quick tests do."""
    for mark in MARKS:
        config.addinivalue_line('markers', f'{mark}: set automatically, see tests/marking.py')
    # numpy 1's asks the machine by a process what it can do, once, when it is first used.
    importlib.import_module('numpy.testing')
    sys.addaudithook(_refuse_processes)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Set the marks before `-m` chooses by them."""
    for item in items:
        if isinstance(item, pytest.Function):
            for mark in sorted(marks_of(item)):
                item.add_marker(mark)


@pytest.fixture(autouse=True)
def _quick_stays_quick(request: pytest.FixtureRequest) -> Iterator[None]:
    """Have a test without a mark fail when it starts a process or ROS."""
    if any(request.node.get_closest_marker(mark) for mark in SLOW_MARKS):
        yield
        return
    _watch_ros()
    _running_quick.append(request.node.nodeid)
    yield
    _running_quick.clear()


def marks_of(item: pytest.Function) -> set[str]:
    """Return the marks of a test: those of its function and of every fixture that it asks for."""
    functions = [item.function]
    for definitions in item._fixtureinfo.name2fixturedefs.values():
        functions += [definition.func for definition in definitions]
    found: set[str] = set()
    for function in functions:
        found |= _marks_reached(inspect.unwrap(function))
    return found


@functools.cache
def _marks_reached(function: Callable[..., Any]) -> frozenset[str]:
    """Return the marks of everything that a function of the tests can reach by name."""
    found: set[str] = set()
    seen: set[int] = set()
    waiting: list[Any] = [function]
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        found |= _marks_of_thing(thing)
        waiting += _names_in(thing)
    return frozenset(found)


def _marks_of_thing(thing: Any) -> set[str]:
    """Return what using one function, class or module means."""
    if isinstance(thing, ModuleType):
        return set(_marks_of_module(thing.__name__))
    name = str(getattr(thing, '__name__', ''))
    marks = set(_marks_of_module(str(getattr(thing, '__module__', ''))))
    if name in _RUN_NAMES:
        marks.add('run')
    if name == 'browser':
        marks.add('browser')
    return marks


@functools.cache
def _marks_of_module(name: str) -> frozenset[str]:
    found = {
        'process': bool({name, name.partition('.')[0]} & _PROCESS_MODULES),
        'ros': name.startswith(_ROS_MODULES) or (name.endswith('_node') and '.' in name),
        'run': name == 'wasd_bringup.cli',
        'browser': name.startswith('selenium'),
    }
    return frozenset(mark for mark, is_used in found.items() if is_used)


def _names_in(thing: Any) -> list[Any]:
    """Return what a function or class of the tests names; others are not looked into."""
    if isinstance(thing, functools._lru_cache_wrapper):
        return [thing.__wrapped__]
    if isinstance(thing, FunctionType):
        function = inspect.unwrap(thing)
        if not function.__code__.co_filename.startswith(TESTS):
            return []
        names = set(_names_of_code(function.__code__))
        found = [function.__globals__[name] for name in names if name in function.__globals__]
        # What is imported inside a function is among its names, imported yet or not.
        found += [ModuleType(name) for name in names if _marks_of_module(name)]
        cells = function.__closure__ or ()
        return found + [cell.cell_contents for cell in cells if _is_filled(cell)]
    if isinstance(thing, type):
        path = getattr(sys.modules.get(thing.__module__), '__file__', None) or ''
        return list(vars(thing).values()) + list(thing.__bases__) if path.startswith(TESTS) else []
    if isinstance(thing, (property, classmethod, staticmethod, functools.partial)):
        return [getattr(thing, 'fget', None) or getattr(thing, '__func__', None) or thing.func]
    return []


def _names_of_code(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names_of_code(constant)


def _is_filled(cell: Any) -> bool:
    try:
        return cell.cell_contents is not None
    except ValueError:
        return False


def _watch_ros() -> None:
    """Have contexts say who starts them; a module that never imported rclpy starts none."""
    context: Any = getattr(sys.modules.get('rclpy.context'), 'Context', None)
    if context is None or hasattr(context.init, '__wrapped__'):
        return

    @functools.wraps(context.init)
    def init(*arguments: Any, **options: Any) -> Any:
        if _running_quick:
            raise RuntimeError(f'{_running_quick[0]} is marked quick, but starts ROS')
        return init.__wrapped__(*arguments, **options)

    context.init = init


def _refuse_processes(event: str, arguments: tuple[Any, ...]) -> None:
    if _running_quick and event in _PROCESS_EVENTS:
        raise RuntimeError(f'{_running_quick[0]} is marked quick, but causes {event}')
