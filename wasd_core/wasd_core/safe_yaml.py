# SPDX-License-Identifier: Apache-2.0
"""YAML that strangers wrote: small, also when its aliases are written out."""

from pathlib import Path
from typing import Any

import yaml

from wasd_core.errors import DescriptionError
from wasd_core.safe_reading import read_file

# YAML is read by Python, 0.1 MB in about a second.
LARGEST_FILE = 100_000
MOST_VALUES = 10_000
# Values within values; the deepest parameter file known has six levels.
DEEPEST = 50


class BoundedLoader(yaml.SafeLoader):
    """Composes what is not too deep for those who walk through it."""

    _depth = 0

    def compose_node(self, parent: Any, index: Any) -> yaml.Node | None:
        """Compose a node and all within it."""
        self._depth += 1
        if self._depth > DEEPEST:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            problem = f'nested more than {DEEPEST} deep'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


def read_text(path: Path, encoding: str = 'utf-8') -> str:
    """
    Return the text of a file, of an endless one a beginning that `compose_yaml` finds too long.

    Raises:
        OSError, UnicodeDecodeError: it cannot be read, or is no text.
    """
    with path.open('rb') as file:
        return file.read(4 * LARGEST_FILE + 4).decode(encoding)


def compose_yaml(text: str, expands: bool = True) -> yaml.Node | None:
    """
    Return the root of a YAML text, or None if there is nothing in it.

    A reader that never follows an alias into what it stands in says `expands` False.

    Raises:
        yaml.YAMLError: it is not YAML, too long or deep, or its aliases make it large or endless.
    """
    if len(text) > LARGEST_FILE:
        raise yaml.MarkedYAMLError(problem=f'more than {1e-6 * LARGEST_FILE:g} MB')
    root: yaml.Node | None = yaml.compose(text, Loader=BoundedLoader)
    if expands and root is not None and _values(root, {}) > MOST_VALUES:
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


def read_yaml(path: Path) -> str:
    """
    Return the text of a YAML file.

    Raises:
        DescriptionError: it cannot be read, is not YAML, or its aliases make it large or endless.
    """
    data = read_file(path, LARGEST_FILE)
    try:
        text = data.decode()
        load_yaml(text)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise DescriptionError(f'{path}: not YAML: {" ".join(str(error).split())}') from None
    return text


def _values(node: yaml.Node, known: dict[int, float]) -> float:
    """Return how many values a node has; those of an alias count each time, itself without end."""
    if id(node) not in known:
        known[id(node)] = float('inf')  # until it is counted: within itself it has no end
        parts = node.value if isinstance(node, yaml.CollectionNode) else []
        children = [p for part in parts for p in (part if isinstance(part, tuple) else (part,))]
        known[id(node)] = 1.0 + sum(_values(child, known) for child in children)
    return known[id(node)]
