# SPDX-License-Identifier: Apache-2.0
"""Reads YAML of training frameworks as plain values: tags make no objects."""

from pathlib import Path
from typing import Any

from wasd_core.errors import DescriptionError, one_line
from wasd_core.parameter_file import children, compose_yaml, LARGEST_YAML, line_of, value_of
from wasd_core.parameters import InvalidParameter
from wasd_core.safe_files import read_file
import yaml

from policy_player.spec import PolicyError

_PYTHON = 'tag:yaml.org,2002:python/'
_MERGE = 'tag:yaml.org,2002:merge'
# What means "all of them", and a list that Python could not change.
_ALL, _TUPLE = f'{_PYTHON}object/apply:builtins.slice', f'{_PYTHON}tuple'


def read_values(path: Path) -> dict[str, Any]:
    """
    Return the values of a file: dictionaries, lists, texts, numbers; a slice is None, all of them.

    Raises:
        PolicyError: it cannot be read, is no YAML, or has a tag that would make something.
    """
    try:
        data = read_file(path, LARGEST_YAML)
    except DescriptionError as error:
        raise PolicyError(str(error)) from None
    try:
        root = compose_yaml(data.decode('utf-8-sig'))
        value = None if root is None else _value(root)
    except (PolicyError, InvalidParameter) as error:
        raise PolicyError(f'{path}{error}') from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise PolicyError(f'{path}: not YAML: {one_line(error)[:200]}') from None
    if not isinstance(value, dict):
        raise PolicyError(f'{path}: wanted "name: value" pairs')
    return value


def _value(node: yaml.Node) -> Any:
    if node.tag.startswith(_PYTHON):
        if node.tag == _ALL:
            return None
        if node.tag != _TUPLE or not isinstance(node, yaml.SequenceNode):
            tag = node.tag.removeprefix('tag:yaml.org,2002:')
            raise PolicyError(
                f':{line_of(node)}: !!{tag} is refused, no code was run: write the value itself'
            )
    if isinstance(node, yaml.MappingNode):
        for key, _ in node.value:
            if key.tag == _MERGE:
                raise PolicyError(f':{line_of(key)}: "<<" is not read: write its values out')
        return {name: _value(child) for name, child in children(node).items()}
    if isinstance(node, yaml.SequenceNode):
        return [_value(item) for item in node.value]
    return value_of(node)
