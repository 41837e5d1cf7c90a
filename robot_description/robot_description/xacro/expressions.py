# SPDX-License-Identifier: Apache-2.0
"""
Xacro's expressions, evaluated so that a file reaches nothing but its own values.

Time and memory are the affair of `bounded`.
"""

import ast
from collections.abc import Mapping, Sequence
from functools import lru_cache
import string
from types import CodeType
from typing import Any

from wasd_core.errors import DescriptionError

# Whose public attributes are about themselves alone, xacro's tables and YAML being dictionaries.
VALUES = (str, bytes, int, float, complex, list, tuple, dict, set, frozenset, range)
FORMATS = ('format', 'format_map')
# What expressions call for each `a.b`; two underscores begin no name that a file may use.
ATTRIBUTE = '__attribute'


def evaluate(text: str, names: dict[str, Any], local_names: Any = None) -> Any:
    """
    Return the value of a Python expression in which only `names` are known.

    Raises:
        DescriptionError: it uses what leads out of the expression.
        Exception: whatever Python says about the expression.
    """
    code = _compile(text.strip())
    dict.__setitem__(names, '__builtins__', {ATTRIBUTE: _attribute})  # past xacro's own table
    return eval(code, names, local_names)


def evaluate_substitution(text: str, _: Any, local_names: Any) -> Any:
    """Return the value of `$(eval text)`; `local_names` has arguments and functions."""
    return evaluate(text, {}, local_names)


@lru_cache(maxsize=1024)
def _compile(text: str) -> CodeType:
    tree = ast.parse(text, '<expression>', 'eval')
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id.startswith('__'):
            raise _refused(node.id)
        if isinstance(node, ast.Attribute) and not isinstance(node.ctx, ast.Load):
            raise _refused(node.attr)
    return compile(ast.fix_missing_locations(_Guarded().visit(tree)), '<expression>', 'eval')


class _Guarded(ast.NodeTransformer):
    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:  # noqa: N802
        """Replace `a.b` by `__attribute(a, 'b')`."""
        self.generic_visit(node)
        function = ast.Name(ATTRIBUTE, ast.Load())
        return ast.Call(function, [node.value, ast.Constant(node.attr)], [])


def _attribute(value: Any, name: str) -> Any:
    """
    Return an attribute of a plain value, or of a type of them.

    Functions, generators and classes have attributes that lead into the interpreter, and so have
    the fields of a format.
    """
    is_type = any(value is kind for kind in VALUES)
    is_formatted = name in FORMATS
    is_key = isinstance(value, dict) and name in value and not name.startswith('__')
    if (name.startswith('_') and not is_key) or not (is_type or isinstance(value, VALUES)):
        raise _refused(name)
    if is_formatted and is_type:
        raise _refused(name)
    if is_formatted and isinstance(value, str):
        return _Formatter(value).call if name == 'format' else _Formatter(value).call_map
    return getattr(value, name)


class _Formatter(string.Formatter):
    """`str.format` whose fields name values and their items, but no attributes."""

    def __init__(self, template: str) -> None:
        self._template = template

    def call(self, *arguments: Any, **named: Any) -> str:
        return self.vformat(self._template, arguments, named)

    def call_map(self, named: Mapping[str, Any]) -> str:
        return self.vformat(self._template, (), named)

    def get_field(self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        if '.' in field_name:
            raise _refused(field_name)
        return super().get_field(field_name, args, kwargs)


def _refused(name: str) -> DescriptionError:
    return DescriptionError(f'{name!r} cannot be used in an expression')
