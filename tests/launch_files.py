# SPDX-License-Identifier: Apache-2.0
"""
Reads launch files where `launch` is not installed: it is not on the Python package index.

Stands in for the few classes that our launch files use. Arguments become values by the rules of
launch (choices) and of launch_ros (`ParameterValue` by its type, other values by YAML).
"""

from collections.abc import Iterator, Mapping
import contextlib
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path
import runpy
import sys
import types
from typing import Any
from unittest import mock

import yaml


@dataclass(frozen=True)
class LaunchDescription:
    entities: list[Any]


@dataclass(frozen=True)
class LaunchConfiguration:
    name: str


class Shutdown:
    pass


@dataclass(frozen=True)
class DeclareLaunchArgument:
    name: str
    default_value: str | None = None
    description: str = ''
    choices: list[str] | None = None

    def value(self, given: Mapping[str, str]) -> str:
        """Return what the argument is, as launch does."""
        value = given.get(self.name, self.default_value)
        assert isinstance(value, str), f'{self.name} is required, and a text'
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f'Argument "{self.name}" provided value "{value}" is not valid.')
        return value


@dataclass(frozen=True)
class ParameterValue:
    value: LaunchConfiguration
    value_type: type


@dataclass(frozen=True, kw_only=True)
class Node:
    package: str
    executable: str
    namespace: Any = ''
    output: str = 'log'
    parameters: list[dict[str, Any]] = field(default_factory=list)
    remappings: list[tuple[str, Any]] = field(default_factory=list)
    on_exit: Any = None


@dataclass(frozen=True)
class Started:
    """A node as launch would start it."""

    executable: str
    namespace: str
    parameters: dict[str, Any]
    remappings: dict[str, str]

    def command_line(self, folder: Path) -> list[str]:
        """Return the arguments of the process; the parameters are in a file, as launch's."""
        path = folder / f'launch_params_{self.executable}'
        path.write_text(yaml.safe_dump({'/**': {'ros__parameters': self.parameters}}))
        rules = [f'{name}:={target}' for name, target in self.remappings.items()]
        rules += [f'__ns:={self.namespace}'] if self.namespace else []
        words = [word for rule in rules for word in ('-r', rule)]
        return ['--ros-args', '--params-file', str(path), *words]


MODULES: dict[str, dict[str, Any]] = {
    'launch': {'LaunchDescription': LaunchDescription},
    'launch.actions': {'DeclareLaunchArgument': DeclareLaunchArgument, 'Shutdown': Shutdown},
    'launch.substitutions': {'LaunchConfiguration': LaunchConfiguration},
    'launch_ros': {},
    'launch_ros.actions': {'Node': Node},
    'launch_ros.parameter_descriptions': {'ParameterValue': ParameterValue},
}


@contextlib.contextmanager
def stand_ins() -> Iterator[None]:
    """Let launch files find the classes of this file."""
    modules = {}
    for name, classes in MODULES.items():
        modules[name] = types.ModuleType(name)
        vars(modules[name]).update(classes)
    with mock.patch.dict(sys.modules, modules):
        yield


class LaunchFile:
    """A launch file: the arguments it declares, and what it starts."""

    def __init__(self, path: Path) -> None:
        with stand_ins():
            # Leaves no compiled file beside it, as an import would.
            entities = runpy.run_path(str(path))['generate_launch_description']().entities
        self.arguments = {e.name: e for e in entities if isinstance(e, DeclareLaunchArgument)}
        self.nodes = [entity for entity in entities if isinstance(entity, Node)]

    def start(self, **given: str) -> list[Started]:
        """Return the nodes with `name:=value` given on the command line."""
        assert set(given) <= set(self.arguments)
        values = {name: entry.value(given) for name, entry in self.arguments.items()}
        return [
            Started(
                node.executable,
                _text(node.namespace, values),
                {name: _value(v, values) for p in node.parameters for name, v in p.items()},
                {name: _text(target, values) for name, target in node.remappings},
            )
            for node in self.nodes
        ]


def _text(value: Any, values: Mapping[str, str]) -> str:
    return values[value.name] if isinstance(value, LaunchConfiguration) else str(value)


def _value(value: Any, values: Mapping[str, str]) -> Any:
    if isinstance(value, ParameterValue):
        text = _text(value.value, values)
        return yaml.safe_load(text) if value.value_type is bool else value.value_type(text)
    if isinstance(value, LaunchConfiguration):
        return yaml.safe_load(values[value.name])
    return value
