# SPDX-License-Identifier: Apache-2.0
"""YAML of a bounded size, and parameters in it: a plain table, or one node's of a ROS 2 file."""

from collections.abc import Callable, Collection, Iterator
import contextlib
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from wasd_core.errors import DescriptionError, did_you_mean, one_line
from wasd_core.parameters import InvalidParameter, known_parameters, Parameters, shown
from wasd_core.safe_files import read_beginning, read_file

# ROS's own; it may stand in every file.
USE_SIM_TIME = 'use_sim_time'


class NodeKind(NamedTuple):
    """Whose parameters are wanted: the node's name, what it is, parameters that only it has."""

    name: str
    words: str
    marks: Collection[str] = ()


class Entry(NamedTuple):
    """A value of the file and the line it is in."""

    value: Any
    line: int


def read_parameters(path: str, definition: type[Parameters], kind: NodeKind) -> dict[str, Any]:
    """
    Return the parameters of a file by their names, checked.

    Raises:
        InvalidParameter: `file:line: key, what came, what is wanted`.
    """

    def read(root: yaml.MappingNode) -> dict[str, Any]:
        _, entries = entries_of(root, kind)
        values = {
            key: checked(definition, key, entry.value, key, entry.line)
            for key, entry in entries.items()
            if key != USE_SIM_TIME
        }
        definition.from_mapping(values)
        return values

    values: dict[str, Any] = read_mapping(path, read)
    return values


def read_mapping(path: str, read: Callable[[yaml.MappingNode], Any]) -> Any:
    """
    Return what `read` makes of a file's root; its errors, of `:line:` or of all, get the path.

    Raises:
        InvalidParameter: it cannot be read, is no YAML, no mapping, or what `read` says.
    """
    try:
        # YAML forbids tabs to indent; people use them, and what they mean is plain.
        text = read_text(Path(path), 'utf-8-sig').expandtabs(8)
    except UnicodeDecodeError:
        raise InvalidParameter(f'{path}: not a text file') from None
    except (OSError, ValueError) as error:  # a name with a null byte
        raise InvalidParameter(f'{path}: {one_line(error)}') from None
    try:
        root = compose_yaml(text)
    except yaml.YAMLError as error:
        raise InvalidParameter(f'{path}{_where(error)}') from None
    if not isinstance(root, yaml.MappingNode):
        raise InvalidParameter(f'{path}: wanted "name: value" pairs')
    try:
        return read(root)
    except InvalidParameter as error:
        text = str(error)
        raise InvalidParameter(path + ('' if text.startswith(':') else ': ') + text) from None


def entries_of(root: yaml.MappingNode, kind: NodeKind) -> tuple[str, dict[str, Entry]]:
    """Return the node's name, '' if the file tells none, and its parameters by dotted names."""
    if not any(key == 'ros__parameters' for key in _all_keys(root)):
        return '', _entries(root)
    nodes = {name: _entries(node) for name, node in _parameter_nodes(root)}
    everybody = {
        key: entry for name in ('/**', '**') for key, entry in nodes.pop(name, {}).items()
    }
    chosen = [name for name in nodes if name.rpartition('/')[2] == kind.name] or [
        name for name, entries in nodes.items() if any(mark in entries for mark in kind.marks)
    ]
    if not chosen and everybody:
        return '', everybody
    if len(chosen) != 1:
        found = ', '.join(chosen or nodes) or 'none'
        raise InvalidParameter(
            f': wanted the parameters of one {kind.words}, e.g. {kind.name}, got {found}'
        )
    return chosen[0].rpartition('/')[2], {**everybody, **nodes[chosen[0]]}


def checked(
    definition: type[Parameters],
    outward: str,
    value: Any,
    key: str,
    line: int,
    aliases: Collection[str] = (),
) -> Any:
    """
    Return a value as it is kept; `key` is what the user wrote for the parameter `outward`.

    Raises:
        InvalidParameter: an unknown name or an illegal value.
    """
    known = known_parameters(definition)
    if outward not in known:
        if ':' in key:
            raise InvalidParameter(f':{line}: {shown(key)}: a space is missing after the colon')
        hint = did_you_mean(key, [*known, *aliases])
        raise InvalidParameter(f':{line}: unknown parameter {shown(key)}{hint}')
    try:
        return definition.checked(outward, value)
    except InvalidParameter as error:
        # By the name that the user wrote.
        raise InvalidParameter(f':{line}: {str(error).replace(outward, key, 1)}') from None


def _parameter_nodes(
    node: yaml.MappingNode, prefix: str = ''
) -> Iterator[tuple[str, yaml.MappingNode]]:
    for key, child in children(node).items():
        if not isinstance(child, yaml.MappingNode):
            continue
        if key == 'ros__parameters':
            yield prefix, child
        else:
            yield from _parameter_nodes(child, f'{prefix}/{key}' if prefix else key)


def children(node: yaml.MappingNode) -> dict[str, yaml.Node]:
    """
    Return what is in a mapping by name.

    Raises:
        InvalidParameter: a name is there twice.
    """
    found: dict[str, yaml.Node] = {}
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise InvalidParameter(f':{line_of(key)}: a name must be a word, got a {key.id}')
        name = str(key.value)
        if name in found:
            raise InvalidParameter(f':{line_of(key)}: {shown(name)} is there twice')
        found[name] = value
    return found


def _all_keys(node: yaml.Node) -> Iterator[str]:
    if isinstance(node, yaml.MappingNode):
        for key, child in children(node).items():
            yield key
            yield from _all_keys(child)


def _entries(node: yaml.MappingNode) -> dict[str, Entry]:
    """Return scalars and lists by dotted names: `a.b` is the same name as b in a."""
    found: dict[str, Entry] = {}
    for name, entry in flat(node):
        if name in found:
            raise InvalidParameter(f':{entry.line}: {shown(name)} is there twice')
        found[name] = entry
    return found


def flat(node: yaml.MappingNode, prefix: str = '') -> Iterator[tuple[str, Entry]]:
    """Yield scalars and lists by dotted names."""
    for key, child in children(node).items():
        if isinstance(child, yaml.MappingNode):
            yield from flat(child, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', Entry(value_of(child), line_of(child))


def value_of(node: yaml.Node) -> Any:
    """
    Return the value of a node; what is a number to ROS is one.

    Raises:
        InvalidParameter: it stands for none.
    """
    if isinstance(node, yaml.SequenceNode):
        return [value_of(item) for item in node.value]
    try:
        value = construct(node)
    except yaml.YAMLError as error:
        raise InvalidParameter(_where(error)) from None
    if isinstance(value, str) and isinstance(node, yaml.ScalarNode) and not node.style:
        with contextlib.suppress(ValueError):
            return float(value)  # 1e-3 is a number to ROS and to people, not to YAML 1.1
    return value


def line_of(node: yaml.Node) -> int:
    """Return the line in which a node begins, from 1."""
    return int(node.start_mark.line) + 1


def _where(error: yaml.YAMLError) -> str:
    mark = getattr(error, 'problem_mark', None)
    problem = getattr(error, 'problem', None) or one_line(error)
    hint = ' (is a space missing after a colon?)' if 'mapping values' in problem else ''
    return f':{mark.line + 1}: {problem}{hint}' if mark else f': {problem}'


# YAML is read by Python, 0.1 MB in about a second.
LARGEST_YAML = 100_000
MOST_VALUES = 10_000
# Values within values; the deepest parameter file known has six levels.
DEEPEST_YAML = 50


class BoundedLoader(yaml.SafeLoader):
    """Composes YAML up to a bounded depth."""

    _depth = 0

    def compose_node(self, parent: Any, index: Any) -> yaml.Node | None:
        """Compose a node and all within it."""
        self._depth += 1
        if self._depth > DEEPEST_YAML:
            mark = self.peek_event().start_mark
            problem = f'nested more than {DEEPEST_YAML} deep'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


def read_text(path: Path, encoding: str = 'utf-8') -> str:
    """
    Return the text of a file, of an endless one a beginning that `compose_yaml` finds too long.

    Raises:
        OSError, UnicodeDecodeError: it cannot be read, a pipe without a writer, or is no text.
    """
    return read_beginning(path, 4 * LARGEST_YAML + 4).decode(encoding)


def compose_yaml(text: str, expands: bool = True) -> yaml.Node | None:
    """
    Return the root of a YAML text, or None if there is nothing in it.

    A reader that never follows an alias into what it stands in says `expands` False.

    Raises:
        yaml.YAMLError: it is not YAML, too long or deep, or its aliases make it large or endless.
    """
    if len(text) > LARGEST_YAML:
        raise yaml.MarkedYAMLError(problem=f'more than {1e-6 * LARGEST_YAML:g} MB')
    root: yaml.Node | None = yaml.compose(text, Loader=BoundedLoader)
    if expands and root is not None and _count_values(root, {}) > MOST_VALUES:
        problem = f'more than {MOST_VALUES} values, its aliases written out'
        raise yaml.MarkedYAMLError(problem=problem)
    return root


def load_yaml(text: str) -> Any:
    """
    Return the values of a YAML text: plain dictionaries, lists, texts, numbers.

    Raises:
        yaml.YAMLError: as `compose_yaml`, or a value that is none, such as a 13th month.
    """
    root = compose_yaml(text)
    return None if root is None else construct(root)


def construct(node: yaml.Node) -> Any:
    """
    Return the value of a node.

    Raises:
        yaml.YAMLError: it stands for none.
    """
    try:
        value = yaml.SafeLoader('').construct_object(node, deep=True)
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, int):
                float(part)  # a longer one is no number to anybody
        return value
    except (ValueError, OverflowError) as error:
        raise yaml.MarkedYAMLError(problem=str(error), problem_mark=node.start_mark) from None
    except (AttributeError, LookupError, TypeError):  # PyYAML believes what a tag says
        problem = f'{shown(node.value)} is no {node.tag.rpartition(":")[2]}'
        raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark) from None


def read_yaml(path: Path) -> str:
    """
    Return the text of a YAML file.

    Raises:
        DescriptionError: it cannot be read, is not YAML, or its aliases make it large or endless.
    """
    data = read_file(path, LARGEST_YAML)
    try:
        text = data.decode()
        load_yaml(text)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise DescriptionError(f'{path}: not YAML: {one_line(error)}') from None
    return text


def _count_values(node: yaml.Node, known: dict[int, float]) -> float:
    """Return how many values a node has; those of an alias count each time, itself without end."""
    if id(node) not in known:
        known[id(node)] = float('inf')  # until it is counted: within itself it has no end
        parts = node.value if isinstance(node, yaml.CollectionNode) else []
        children = [p for part in parts for p in (part if isinstance(part, tuple) else (part,))]
        known[id(node)] = 1.0 + sum(_count_values(child, known) for child in children)
    return known[id(node)]
