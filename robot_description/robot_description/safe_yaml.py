# SPDX-License-Identifier: Apache-2.0
"""YAML that strangers wrote: small, also when its aliases are written out."""

from pathlib import Path

import yaml

from robot_description.errors import DescriptionError
from robot_description.safe_reading import read_file

# YAML is read by Python, 0.1 MB in about a second.
LARGEST_FILE = 100_000
MOST_VALUES = 10_000


def read_yaml(path: Path) -> str:
    """
    Return the text of a YAML file.

    Raises:
        DescriptionError: it cannot be read, is not YAML, or its aliases make it large or endless.
    """
    data = read_file(path, LARGEST_FILE)
    try:
        text = data.decode()
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise DescriptionError(f'{path}: not YAML: {" ".join(str(error).split())}') from None
    if root is not None and _values(root, {}) > MOST_VALUES:
        raise DescriptionError(f'{path}: more than {MOST_VALUES} values, its aliases written out')
    return text


def _values(node: yaml.Node, known: dict[int, float]) -> float:
    """Return how many values a node has; those of an alias count each time, itself without end."""
    if id(node) not in known:
        known[id(node)] = float('inf')  # until it is counted: within itself it has no end
        parts = node.value if isinstance(node, yaml.CollectionNode) else []
        children = [p for part in parts for p in (part if isinstance(part, tuple) else (part,))]
        known[id(node)] = 1.0 + sum(_values(child, known) for child in children)
    return known[id(node)]
