# SPDX-License-Identifier: Apache-2.0
"""Xacro to URDF with our own `$(find)`, so that it works with and without a ROS installation."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import glob
import io
import os
from pathlib import Path
import sys
from types import SimpleNamespace
from typing import Any, NamedTuple
from xml.dom import minidom

from wasd_core.errors import DescriptionError
from wasd_core.parameter_file import read_yaml
from wasd_core.safe_files import check_xml
from wasd_core.safe_files import LocatedError
from wasd_core.safe_files import parse_with_places
from wasd_core.safe_files import Place
from wasd_core.safe_files import place_of
from wasd_core.safe_files import read_file
import xacro
from xacro import substitution_args

from robot_description.packages import AllowedPaths
from robot_description.xacro.expressions import Evaluator

LONGEST_REASON = 300
# Macros that unroll a loop call themselves; more often than this none has been seen to.
DEEPEST_MACRO = 150
# All attributes and texts of a robot together [characters].
MOST_TEXT = 10_000_000
MOST_ELEMENTS = 20_000  # of an expansion; more would take seconds
FRAMES = 6000


class Expansion(NamedTuple):
    """An expanded file: its elements know their places; `warnings` are xacro's, `files` read."""

    document: minidom.Document
    warnings: tuple[tuple[Place | None, str], ...]
    files: tuple[Path, ...]

    @property
    def urdf(self) -> str:
        """The URDF text."""
        return str(self.document.toprettyxml(indent='  '))


class _Arguments(dict[str, str]):
    """Xacro arguments that remember which of them the file asked for."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


class XacroSession:
    """
    Runs xacro on one file; `warnings` are what it had to say, with places, `sources` what it read.

    `texts` are read in place of the files of that name.

    Xacro asks ament_index_python for packages, opens any file, evaluates anything Python can and
    does not know line numbers; here it does none of this.
    """

    def __init__(
        self,
        path: Path,
        arguments: Mapping[str, str],
        search: Sequence[Path] = (),
        texts: Mapping[Path, bytes] | None = None,
    ) -> None:
        self.warnings: list[tuple[Place | None, str]] = []
        self.sources: dict[Path, bytes] = {}
        self.path = path
        self._texts = texts or {}
        self._arguments = _Arguments(arguments)
        self.search = search
        self._allowed = AllowedPaths(path, search)
        self._evaluator = Evaluator()
        self._elements = 0
        self._text = 0
        # What is being processed: elements around elements; and the tag looked at last.
        self._stack: list[Any] = []
        self._detail: Any = None
        self._eval_all = xacro.eval_all
        self._eval_text = xacro.eval_text
        self._handle_macro_call = xacro.handle_macro_call
        self._check_attributes = xacro.check_attrs

    def expand(self) -> Expansion:
        """
        Return what the file expands to.

        Raises:
            DescriptionError: see `expand`.
        """
        try:
            document = self._run()
        except Exception as error:  # xacro raises a dozen unrelated types
            raise self._located(error) from None
        return Expansion(document, tuple(self.warnings), tuple(self.sources))

    def _run(self) -> minidom.Document:
        """Return the expanded document, whose elements know their places."""
        with self._rules():
            document: minidom.Document = xacro.process_file(
                str(self.path), mappings=self._arguments
            )
        for element in document.getElementsByTagName('*'):
            for name, value in element.attributes.items():
                if not isinstance(value, str):  # <xacro:attribute> leaves numbers
                    element.setAttribute(name, str(value))
        for name in sorted(set(self._arguments) - self._arguments.asked):
            known = ', '.join(sorted(self._arguments.asked)) or 'none'
            self.warnings.append((None, f'no argument {name!r} here; it has: {known}'))
        return document

    def _located(self, error: Exception) -> DescriptionError:
        """Return the error with the place where xacro was."""
        place = self._failed_at
        if place is None and isinstance(error, DescriptionError):  # the file itself
            return error
        if isinstance(error, LocatedError):  # in a file that was to be included there
            return LocatedError(error.place, error.reason, place)
        place = place or Place(self.path, 1)
        via = self._called_from if place.file != self.path else None
        return LocatedError(place, _reason(error), via)

    @property
    def _failed_at(self) -> Place | None:
        """Where xacro was."""
        return place_of(self._detail or (self._stack[-1] if self._stack else None))

    @property
    def _called_from(self) -> Place | None:
        """Where in the given file it had come from."""
        places = (place_of(node) for node in reversed(self._stack))
        return next((place for place in places if place and place.file == self.path), None)

    @contextlib.contextmanager
    def _rules(self) -> Iterator[None]:
        """Put our functions in place of xacro's; both names of `find` are asked."""
        limit = sys.getrecursionlimit()
        functions = {
            'parse': self._parse,
            'open': self._open,
            'glob': SimpleNamespace(glob=self._glob),
            'safe_eval': self._evaluator.evaluate,
            'eval_all': self._visit,
            'eval_text': self._measure,
            'handle_macro_call': self._call_macro,
            'check_attrs': self._look_at,
            'warning': self._warn,
            'print_location': lambda: None,
            'root_dir': os.curdir,
        }
        substitutions = {
            '_eval_find': self._find,
            '_eval_dirname': self._folder,
            'eval': self._evaluator.evaluate_substitution,
        }
        with (
            _replaced(vars(xacro), functions),
            _replaced(vars(substitution_args), substitutions),
            _replaced(substitution_args._eval_dict, {'find': self._find}),
            _replaced(xacro.substitution_args_context, {'filename': str(self.path)}),
        ):
            sys.setrecursionlimit(max(limit, FRAMES))
            try:
                yield
            finally:
                sys.setrecursionlimit(limit)

    def _find(self, package: str) -> str:
        return str(self._allowed.package(package))

    def _folder(self, _: str) -> str:
        return str(os.path.dirname(os.path.abspath(xacro.filestack[-1])))

    def _parse(self, _: None, filename: str) -> minidom.Document:
        """Stand in for xacro.parse, which opens what it is told to."""
        path = Path(filename)
        if len(xacro.filestack) > 1:
            self._check_include(path)
        data = self._texts[path] if path in self._texts else read_file(path)
        check_xml(data, path)
        self.sources[path] = data
        return parse_with_places(data, path)

    def _check_include(self, path: Path) -> None:
        self._allowed.check(path)
        if not os.path.lexists(path):
            xacro.filestack.pop()  # as xacro does: the caller of an optional include relies on it
            missing = FileNotFoundError(f'{path}: no such file')
            raise xacro.XacroException(exc=missing)
        before = [Path(file).resolve() for file in xacro.filestack[:-1]]
        if path.resolve() in before:
            circle = [*before[before.index(path.resolve()) :], path]
            chain = ' -> '.join(file.name for file in circle)
            raise DescriptionError(f'files include each other in a circle: {chain}')

    def _glob(self, pattern: str) -> list[str]:
        """Stand in for glob.glob, which would look through the whole disk."""
        fixed = [part for part in Path(pattern).parts if not glob.has_magic(part)]
        self._allowed.check(Path(*fixed))
        return glob.glob(pattern)

    def _open(self, filename: str) -> io.StringIO:
        """Stand in for the `open` of load_yaml."""
        return io.StringIO(read_yaml(self._allowed.check(Path(filename))))

    def _visit(self, node: Any, macros: Any, symbols: Any) -> None:
        self._elements += 1
        if self._elements > MOST_ELEMENTS:
            raise DescriptionError(f'it grows to more than {MOST_ELEMENTS} elements')
        with self._inside(node):
            self._eval_all(node, macros, symbols)

    def _call_macro(self, node: Any, macros: Any, symbols: Any) -> bool:
        if len(xacro.macrostack) > DEEPEST_MACRO:
            raise DescriptionError(
                f'macros call each other without end: {node.tagName} more than '
                f'{DEEPEST_MACRO} deep'
            )
        with self._inside(node):
            return bool(self._handle_macro_call(node, macros, symbols))

    @contextlib.contextmanager
    def _inside(self, node: Any) -> Iterator[None]:
        """Remember the node while it is processed, and after an error."""
        depth = len(self._stack)
        self._stack.append(node)
        self._detail = None
        yield
        del self._stack[depth:]
        self._detail = None

    def _look_at(self, tag: Any, required: list[str], optional: list[str]) -> Any:
        self._detail = tag
        return self._check_attributes(tag, required, optional)

    def _measure(self, text: str, symbols: Any) -> Any:
        value = self._eval_text(text, symbols)
        if isinstance(value, str):
            self._text += len(value)
            if self._text > MOST_TEXT:
                raise DescriptionError(f'it grows to more than {MOST_TEXT} characters')
        return value

    def _warn(self, text: str) -> None:
        self.warnings.append((self._failed_at, ' '.join(text.split())))


def expand(
    path: Path, arguments: Mapping[str, str] | None = None, search: Sequence[Path] = ()
) -> str:
    """
    Return the URDF text of a xacro or URDF file.

    `arguments` are xacro args; `search` are folders in which `$(find)` looks first.

    Raises:
        DescriptionError: one line with the file and, where there is one, the line.
    """
    return expand_document(path, arguments, search).urdf


def expand_document(
    path: Path, arguments: Mapping[str, str] | None = None, search: Sequence[Path] = ()
) -> Expansion:
    """
    Return what a xacro or URDF file expands to, as elements that know their places.

    Raises:
        DescriptionError: see `expand`.
    """
    return XacroSession(path, arguments or {}, search).expand()


@contextlib.contextmanager
def _replaced(names: dict[str, Any], values: Mapping[str, Any]) -> Iterator[None]:
    """Give names other values for a while; names that were not there go away again."""
    before = {name: names[name] for name in values if name in names}
    names.update(values)
    try:
        yield
    finally:
        for name in values:
            del names[name]
        names.update(before)


def _reason(error: BaseException) -> str:
    """Return what went wrong in one line, without the layers that xacro wraps around it."""
    suffix = ''
    while (cause := getattr(error, 'exc', None)) is not None:
        message = str(error.args[0] or '') if error.args else ''
        if (
            message
            and not message.startswith('<class')
            and not isinstance(cause, DescriptionError)
        ):
            break
        suffix = suffix or str(getattr(error, 'suffix', None) or '')
        error = cause
    if isinstance(error, RecursionError):
        return 'nested too deep'
    if isinstance(error, MemoryError):
        return 'needs too much memory'
    text = ' '.join(f'{error} {suffix}'.replace('(<expression>, line 1)', '').split())
    text = text or type(error).__name__
    return text if len(text) <= LONGEST_REASON else f'{text[:LONGEST_REASON]} ...'
