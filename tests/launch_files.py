# SPDX-License-Identifier: Apache-2.0
"""
Reads launch files where `launch` is not installed: it is not on the Python package index.

Stands in for the few classes that our launch files use. Arguments become values by the rules of
launch (choices) and of launch_ros (`ParameterValue` by its type, other values by YAML).
"""

from collections.abc import Iterator, Mapping
import contextlib
from dataclasses import dataclass, field
import importlib
from pathlib import Path
import runpy
import sys
import types
from typing import Any
from unittest import mock

from executables import SCRIPTS
import programs
import yaml

ROOT = Path(__file__).resolve().parents[1]


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
    default_value: Any = None
    description: str = ''
    choices: list[str] | None = None

    def value(self, given: Mapping[str, str], before: Mapping[str, str]) -> str:
        """Return what the argument is, as launch does; a default may build on those before."""
        value = given.get(self.name, self.default_value)
        value = value if value is None else _text(value, before)
        assert isinstance(value, str), f'{self.name} is required, and a text'
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f'Argument "{self.name}" provided value "{value}" is not valid.')
        return value


@dataclass(frozen=True)
class ParameterValue:
    value: Any
    value_type: type


class Equals:
    def __init__(self, left: Any, right: Any) -> None:
        self.left, self.right = left, right

    def text(self, values: Mapping[str, str]) -> str:
        """Return what launch makes of it: true or false."""
        return str(_text(self.left, values) == _text(self.right, values)).lower()


class NotEquals(Equals):
    def text(self, values: Mapping[str, str]) -> str:
        """Return what launch makes of it: true or false."""
        return 'false' if super().text(values) == 'true' else 'true'


class And(Equals):
    def text(self, values: Mapping[str, str]) -> str:
        """Return what launch makes of it: true or false."""
        both = {_text(self.left, values), _text(self.right, values)}
        return str(both == {'true'}).lower()


@dataclass(frozen=True)
class FindPackageShare:
    package: str

    def text(self, values: Mapping[str, str]) -> str:
        """Return the folder of the checkout that a build puts at share/PACKAGE."""
        return str(ROOT / self.package)


@dataclass(frozen=True)
class PathJoinSubstitution:
    parts: list[Any]

    def text(self, values: Mapping[str, str]) -> str:
        """Return the path."""
        return '/'.join(_text(part, values) for part in self.parts)


@dataclass(frozen=True)
class IfCondition:
    predicate: Any

    def holds(self, values: Mapping[str, str]) -> bool:
        """Return whether it holds; launch takes nothing for true or false but these."""
        return {'true': True, '1': True, 'false': False, '0': False}[
            _text(self.predicate, values).lower()
        ]


@dataclass(frozen=True)
class PythonLaunchDescriptionSource:
    path: Any


@dataclass(frozen=True)
class IncludeLaunchDescription:
    source: PythonLaunchDescriptionSource
    launch_arguments: Any = ()
    condition: 'IfCondition | None' = None


@dataclass(frozen=True)
class GroupAction:
    actions: list[Any]
    scoped: bool = True


@dataclass(frozen=True, kw_only=True)
class Node:
    package: str
    executable: str
    name: str = ''
    namespace: Any = ''
    output: str = 'log'
    parameters: list[Any] = field(default_factory=list)
    remappings: list[tuple[str, Any]] = field(default_factory=list)
    arguments: list[Any] = field(default_factory=list)
    condition: IfCondition | None = None
    on_exit: Any = None


@dataclass(frozen=True)
class Started:
    """A node as launch would start it; of what is `given`, values and files, the last counts."""

    executable: str
    namespace: str
    given: list[dict[str, Any] | Path]
    remappings: dict[str, str]
    package: str
    arguments: list[str]
    ends_all: bool = False  # its end is that of the launch

    @property
    def parameters(self) -> dict[str, Any]:
        """Its parameters, but for those of files."""
        values = [each for each in self.given if isinstance(each, dict)]
        return {name: value for each in values for name, value in each.items()}

    @property
    def files(self) -> list[Path]:
        """Its files of parameters."""
        return [each for each in self.given if isinstance(each, Path)]

    def command_line(self, folder: Path) -> list[str]:
        """Return the arguments of the process; values are in files, as launch's."""
        paths = []
        for number, each in enumerate(self.given):
            path = folder / f'launch_params_{self.executable}_{number}'
            if isinstance(each, dict):
                path.write_text(yaml.safe_dump({'/**': {'ros__parameters': each}}))
            paths.append(path if isinstance(each, dict) else each)
        rules = [f'{name}:={target}' for name, target in self.remappings.items()]
        # Absolute, as launch_ros makes it.
        rules += [f'__ns:=/{self.namespace.lstrip("/")}'] if self.namespace else []
        words = [word for rule in rules for word in ('-r', rule)]
        files = [word for path in paths for word in ('--params-file', str(path))]
        return ['--ros-args', *files, *words]

    def process(self, folder: Path, **options: Any) -> Any:
        """Start it, by the module that its executable runs; `folder` is for its parameters."""
        module, _, name = SCRIPTS[self.executable].partition(':')
        program = getattr(importlib.import_module(module), name).module
        return programs.start(
            [sys.executable, '-m', program, *self.command_line(folder)], **options
        )


MODULES: dict[str, dict[str, Any]] = {
    'launch': {'LaunchDescription': LaunchDescription},
    'launch.actions': {
        'DeclareLaunchArgument': DeclareLaunchArgument,
        'GroupAction': GroupAction,
        'IncludeLaunchDescription': IncludeLaunchDescription,
        'Shutdown': Shutdown,
    },
    'launch.conditions': {'IfCondition': IfCondition},
    'launch.launch_description_sources': {
        'PythonLaunchDescriptionSource': PythonLaunchDescriptionSource
    },
    'launch.substitutions': {
        'AndSubstitution': And,
        'EqualsSubstitution': Equals,
        'LaunchConfiguration': LaunchConfiguration,
        'NotEqualsSubstitution': NotEquals,
        'PathJoinSubstitution': PathJoinSubstitution,
    },
    'launch_ros': {},
    'launch_ros.actions': {'Node': Node},
    'launch_ros.parameter_descriptions': {'ParameterValue': ParameterValue},
    'launch_ros.substitutions': {'FindPackageShare': FindPackageShare},
}


@contextlib.contextmanager
def stand_ins() -> Iterator[None]:
    """Let launch files find the classes of this file."""
    modules = {}
    for name, classes in MODULES.items():
        modules[name] = types.ModuleType(name)
        vars(modules[name]).update(classes)
    with mock.patch.dict(sys.modules, modules):
        # Read by launch itself before, it has launch's own classes.
        sys.modules.pop('wasd_bringup.ros.launch_parts', None)
        yield


class LaunchFile:
    """A launch file: the arguments it declares, and what it starts."""

    def __init__(self, path: Path) -> None:
        with stand_ins():
            # Leaves no compiled file beside it, as an import would.
            entities = runpy.run_path(str(path))['generate_launch_description']().entities
        groups = [entity.actions for entity in entities if isinstance(entity, GroupAction)]
        entities = [*entities, *(entity for group in groups for entity in group)]
        self.arguments = {e.name: e for e in entities if isinstance(e, DeclareLaunchArgument)}
        self.nodes = [entity for entity in entities if isinstance(entity, Node)]
        self._included = [e for e in entities if isinstance(e, IncludeLaunchDescription)]

    def start(self, **given: str) -> list[Started]:
        """
        Return the nodes with `name:=value` given on the command line.

        A launch file of another project is one, too: its package, its file and its arguments.
        """
        assert set(given) <= set(self.arguments)
        values: dict[str, str] = {}
        for name, entry in self.arguments.items():
            values[name] = entry.value(given, values)
        started = [
            _started(node, values)
            for node in self.nodes
            if node.condition is None or node.condition.holds(values)
        ]
        for include in self._included:
            if include.condition is not None and not include.condition.holds(values):
                continue
            inner = {name: _text(value, values) for name, value in include.launch_arguments}
            path = Path(_text(include.source.path, values))
            package = path.relative_to(ROOT).parts[0]
            if (ROOT / package).is_dir():
                started += LaunchFile(path).start(**inner)
            else:
                started.append(Started(path.name, '', [inner], {}, package, []))
        return started


def _started(node: Node, values: Mapping[str, str]) -> Started:
    return Started(
        node.executable,
        _text(node.namespace, values),
        [
            {name: _value(v, values) for name, v in entry.items()}
            if isinstance(entry, dict)
            else Path(_text(entry, values))
            for entry in node.parameters
        ],
        {name: _text(target, values) for name, target in node.remappings},
        node.package,
        [_text(argument, values) for argument in node.arguments],
        isinstance(node.on_exit, Shutdown),
    )


def _text(value: Any, values: Mapping[str, str]) -> str:
    if isinstance(value, LaunchConfiguration):
        return values[value.name]
    return value.text(values) if hasattr(value, 'text') else str(value)


def _value(value: Any, values: Mapping[str, str]) -> Any:
    if isinstance(value, ParameterValue):
        text = _text(value.value, values)
        return yaml.safe_load(text) if value.value_type is bool else value.value_type(text)
    if isinstance(value, LaunchConfiguration):
        return yaml.safe_load(values[value.name])
    return value
