# SPDX-License-Identifier: Apache-2.0
"""Xacro's expressions, evaluated so that a file can neither run programs nor eat the machine."""

import ast
from collections.abc import Iterable, Iterator
from functools import lru_cache
import re
from types import CodeType
from typing import Any

from wasd_core.errors import DescriptionError

# What all expressions of a description may do together: calls, and items of their loops.
MOST_STEPS = 200_000
# Bits of a power, characters and items of a repetition, sizes given to `range` and its like.
LARGEST_SIZE = 10_000
SIZED_BY_ARGUMENT = frozenset(
    ('range', 'ljust', 'rjust', 'center', 'zfill', 'expandtabs', 'format')
    + ('factorial', 'comb', 'perm', 'ldexp')
)
# Ways around the check of names: into the interpreter's frames, or by a name in a text.
FORBIDDEN = frozenset(
    ('vars', 'type', 'mro', 'format_map', 'gi_frame', 'gi_code')
    + ('f_back', 'f_globals', 'f_locals', 'f_builtins')
)


class Evaluator:
    """Evaluates the expressions of one description; their steps are counted over all of them."""

    def __init__(self) -> None:
        self._steps = 0
        self._guards = {
            '__power': self._power,
            '__plus': self._plus,
            '__times': self._times,
            '__shift': self._shift,
            '__mod': self._mod,
            '__call': self._call,
            '__loop': self._loop,
            '__text': self._text,
        }

    def evaluate(self, text: str, names: dict[str, Any], local_names: Any = None) -> Any:
        """
        Return the value of a Python expression in which only `names` are known.

        Raises:
            DescriptionError: it uses what leads out of the expression, or grows too large.
            Exception: whatever Python says about the expression.
        """
        code = _compile(text.strip())
        dict.__setitem__(names, '__builtins__', self._guards)  # past xacro's own table
        return eval(code, names, local_names)

    def evaluate_substitution(self, text: str, _: Any, local_names: Any) -> Any:
        """Return the value of `$(eval text)`; `local_names` has arguments and functions."""
        return self.evaluate(text, {}, local_names)

    def _step(self) -> None:
        self._steps += 1
        if self._steps > MOST_STEPS:
            raise _too_large(f'more than {MOST_STEPS} steps')

    def _loop(self, items: Iterable[Any]) -> Iterator[Any]:
        for item in items:
            self._step()
            yield item

    def _call(self, function: Any, *arguments: Any, **named: Any) -> Any:
        self._step()
        name = getattr(function, '__name__', '')
        if name in SIZED_BY_ARGUMENT:
            for argument in (*arguments, *named.values()):
                if isinstance(argument, int):
                    _limit(abs(argument), name)
        if name == 'format':
            _limit_widths(str(getattr(function, '__self__', '')))
        return _checked(function(*arguments, **named))

    def _power(self, base: Any, exponent: Any) -> Any:
        if isinstance(base, int) and isinstance(exponent, int) and exponent > 0:
            _limit(base.bit_length() * exponent, 'a power')
        return base**exponent

    def _shift(self, number: Any, bits: Any) -> Any:
        if isinstance(bits, int):
            _limit(bits, 'a shift')
        return number << bits

    def _times(self, left: Any, right: Any) -> Any:
        for sequence, count in ((left, right), (right, left)):
            if isinstance(sequence, str | list | tuple) and isinstance(count, int):
                _limit(len(sequence) * count, 'a repetition')
        return left * right

    def _plus(self, left: Any, right: Any) -> Any:
        return _checked(left + right)

    def _text(self, text: str) -> Any:
        return _checked(text)

    def _mod(self, left: Any, right: Any) -> Any:
        if isinstance(left, str):
            _limit_widths(left)
        return left % right


def _limit(size: float, what: str) -> None:
    if size > LARGEST_SIZE:
        raise _too_large(what)


def _checked(value: Any) -> Any:
    if isinstance(value, str | list | tuple):
        _limit(len(value), 'a text or list')
    return value


def _limit_widths(template: str) -> None:
    if re.search(r'\d{4}|\*', template):
        raise _too_large('a format')


def _too_large(what: str) -> DescriptionError:
    return DescriptionError(f'the expression grows too large: {what}')


@lru_cache(maxsize=1024)
def _compile(text: str) -> CodeType:
    tree = ast.parse(text, '<expression>', 'eval')
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        _check(node, id(node) in called)
    return compile(ast.fix_missing_locations(_Guarded().visit(tree)), '<expression>', 'eval')


def _check(node: ast.AST, is_called: bool) -> None:
    name = getattr(node, 'id', None) or getattr(node, 'attr', None) or getattr(node, 'arg', None)
    if not isinstance(name, str):
        name = ''
    # What is sized by an argument must be called in sight, not by `map`.
    hidden = name in SIZED_BY_ARGUMENT and not is_called
    if name.startswith('__') or name in FORBIDDEN or hidden:
        raise DescriptionError(f'{name!r} cannot be used in an expression')
    if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
        _limit_widths(ast.unparse(node.format_spec).replace('{', '*'))  # {} is a width unseen


class _Guarded(ast.NodeTransformer):
    """Turns what can take long or grow large into calls of the evaluator's guards."""

    OPERATORS = {
        ast.Add: '__plus',
        ast.LShift: '__shift',
        ast.Mod: '__mod',
        ast.Mult: '__times',
        ast.Pow: '__power',
    }

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:  # noqa: N802
        """Replace `a ** b` by `__power(a, b)` and so on."""
        self.generic_visit(node)
        guard = self.OPERATORS.get(type(node.op))
        return _guard(guard, node.left, node.right) if guard else node

    def visit_Call(self, node: ast.Call) -> ast.AST:  # noqa: N802
        """Replace `f(x)` by `__call(f, x)`."""
        self.generic_visit(node)
        call = _guard('__call', node.func, *node.args)
        call.keywords = node.keywords
        return call

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:  # noqa: N802
        """Replace an f-string by `__text(f-string)`."""
        self.generic_visit(node)
        return _guard('__text', node)

    def visit_comprehension(self, node: ast.comprehension) -> ast.AST:
        """Replace `for x in y` by `for x in __loop(y)`."""
        self.generic_visit(node)
        node.iter = _guard('__loop', node.iter)
        return node


def _guard(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])
