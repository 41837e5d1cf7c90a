# SPDX-License-Identifier: Apache-2.0
"""
What happens to a xacro file in the bounded process: xacro with our functions in it.

Its result is a document as text and as a list of elements, which other processes understand.
"""

from collections.abc import Callable, Iterator, Mapping
import contextlib
import glob
import io
import os
from pathlib import Path
import re
import sys
from types import SimpleNamespace
from typing import Any
from xml.dom import minidom, Node

from wasd_core.errors import DescriptionError, PackageNotFound
from wasd_core.parameter_file import read_yaml
from wasd_core.safe_files import (
    check_xml,
    LocatedError,
    parse_with_places,
    Place,
    place_of,
    read_file,
)
import xacro
from xacro import substitution_args

from robot_description.packages import AllowedPaths
from robot_description.xacro.sandbox import evaluate, MEMORY
from robot_description.xacro.source import check_format, FOREIGN_TAGS, tidy, unprefixed_calls


def describe_document(document: minidom.Document, file: Path) -> dict[str, Any]:
    """
    Return a document's text, `urdf`, and its elements, `nodes`, in JSON.

    A node is its tag, attributes, text, place and the index of its parent or -1; parents come
    first. `file` is given for those of which no place is known.

    Raises:
        LocatedError: there are too many elements, or too many within each other.
    """
    nodes: list[list[Any]] = []
    waiting: list[tuple[Any, int]] = [(document.documentElement, -1)]
    for node, parent in waiting:  # which grows meanwhile
        _join_text(node)
        # <xacro:attribute> leaves numbers.
        attributes = {name: str(value) for name, value in node.attributes.items()}
        for name in ('xmlns', 'xmlns:xacro'):  # all tags are URDF's, whoever named them
            if attributes.pop(name, None) is not None:
                node.removeAttribute(name)
        for name, value in attributes.items():
            node.setAttribute(name, value)
        texts = (child.data for child in node.childNodes if child.nodeType == child.TEXT_NODE)
        place = listed(place_of(node) or Place(file, 1))
        waiting += [
            (child, len(nodes))
            for child in node.childNodes
            if child.nodeType == child.ELEMENT_NODE
        ]
        nodes.append([node.tagName, attributes, ''.join(texts).strip(), place, parent])
    urdf = document.toprettyxml(indent='  ')
    try:
        check_xml(urdf, file)
    except LocatedError as error:  # the line is one of what it makes
        raise LocatedError(
            Place(file, 1), f'its expansion has a mistake: {error.reason}'
        ) from None
    return {'urdf': urdf, 'nodes': nodes}


def _join_text(element: Any) -> None:
    """Take remarks out of an element's text, which they would divide; others stay."""
    remarks = (Node.COMMENT_NODE, Node.PROCESSING_INSTRUCTION_NODE)
    texts = (child.data for child in element.childNodes if child.nodeType == Node.TEXT_NODE)
    if not any(text.strip() for text in texts):
        return
    for child in list(element.childNodes):
        if child.nodeType in remarks:
            element.removeChild(child)
    element.normalize()


def listed(place: Place | None) -> list[Any] | None:
    """Return a place as JSON has it."""
    return [str(place.file), place.line, place.column] if place else None


def unlisted(place: list[Any] | None) -> Place | None:
    """Return a place that JSON had."""
    return Place(Path(place[0]), *place[1:]) if place else None


LONGEST_REASON = 300
LONGEST_NOTE = 200
LONGEST_NAME = 60
# Macros within macros; xacro itself runs out of Python's frames after 200 to 250.
MOST_MACROS = 300
# Frames of Python; a macro within a macro takes about ten.
FRAMES = 6000
# What launch files write in place of $(find NAME).
LAUNCH_FIND = '$(find-pkg-share'
CONDITIONS = ('xacro:if', 'xacro:unless')


def process(job: Mapping[str, Any], note: Callable[[Any], None]) -> dict[str, Any]:
    """
    Return what a job comes to: `urdf`, `nodes`, `warnings`, or an `error`; and `sources`.

    The job has `path`, `arguments`, `search` and `texts`, files that are read in place of those of
    the name; `note` is told the place that is evaluated, and the text there. Bytes are written
    as Latin-1, places as lists.
    """
    processor = Processor(job, note)
    try:
        answer = describe_document(processor.run(), processor.path)
        answer['warnings'] = [(listed(place), text) for place, text in processor.warnings]
    except Exception as error:  # xacro raises a dozen unrelated types
        answer = {'error': processor.located(error)}
    sources = {str(path): data.decode('latin-1') for path, data in processor.read.items()}
    return {**answer, 'sources': sources}


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


class Processor:
    """
    Runs xacro on one file; `warnings` are what it had to say, with places, `read` what it read.

    Xacro asks ament_index_python for packages, opens any file, evaluates anything Python can and
    does not know line numbers; here it does none of this.
    """

    def __init__(self, job: Mapping[str, Any], note: Callable[[Any], None]) -> None:
        self.warnings: list[tuple[Place | None, str]] = []
        self.read: dict[Path, bytes] = {}
        self.path = Path(job['path'])
        self._note = note
        self._texts = {Path(path): text.encode('latin-1') for path, text in job['texts'].items()}
        self._arguments = _Arguments(job['arguments'])
        self._search = [Path(folder) for folder in job['search']]
        # What is being processed: elements around elements; and the tag looked at last.
        self._stack: list[Any] = []
        self._detail: Any = None
        self._eval_all = xacro.eval_all
        self._eval_text = xacro.eval_text
        self._handle_macro_call = xacro.handle_macro_call
        self._check_attributes = xacro.check_attrs

    def run(self) -> minidom.Document:
        """Return the expanded document, whose elements know their places."""
        self._allowed = AllowedPaths(self.path, self._search)
        self._furnish()
        document: minidom.Document = xacro.process_file(str(self.path), mappings=self._arguments)
        for name in sorted(set(self._arguments) - self._arguments.asked):
            known = ', '.join(sorted(self._arguments.asked)) or 'none'
            self.warnings.append((None, f'no argument {name!r} here; it has: {known}'))
        return document

    def located(self, error: Exception) -> dict[str, Any]:
        """Return an error: its `place`, where xacro was, `reason`, the line it came `via`."""
        place = self._failed_at
        if isinstance(error, LocatedError):  # in a file that was to be included there
            return {
                'place': listed(error.place), 'reason': error.reason, 'via': listed(place),
            }  # fmt: skip
        if place is None and isinstance(error, DescriptionError):  # the file itself
            return {'place': None, 'reason': str(error), 'via': None}
        place = place or Place(self.path, 1)
        via = self._called_from if place.file != self.path else None
        reason = self._reason(error)
        return {'place': listed(place), 'reason': reason, 'via': listed(via)}

    def _reason(self, error: BaseException) -> str:
        """Return what went wrong in one line, without the layers that xacro wraps around it."""
        cause, suffix = _unwrapped(error)
        here = self._detail or self._stack[-1] if self._stack else None
        if isinstance(cause, substitution_args.ArgException):
            name = str(cause)[:LONGEST_NAME]
            usual = 'false' if here is not None and here.tagName in CONDITIONS else 'VALUE'
            value = self._default(name) or usual
            return f'the argument {name!r} has no value; give it: --xacro-arg {name}:={value}'
        if isinstance(cause, RecursionError):
            depth = len(xacro.macrostack or ())
            if depth < MOST_MACROS:
                return 'nested too deep'
            name = xacro.macrostack[-1].body.getAttribute('name')
            return f'macros call each other without end: xacro:{name} more than {depth} deep'
        text = str(cause)
        if isinstance(cause, MemoryError):
            text = f'expanding {self.path.name} took more than {MEMORY / 1e6:g} MB'
        if isinstance(cause, NameError):
            suffix += self._unprefixed()
        text = ' '.join(f'{text} {suffix}'.replace('(<expression>, line 1)', '').split())
        text = text or type(cause).__name__
        return text if len(text) <= LONGEST_REASON else f'{text[:LONGEST_REASON]} ...'

    def _default(self, name: str) -> str:
        """Return what a file says further on about an argument's default, or nothing."""
        tag = rf'<xacro:arg\s[^>]*\bname="{re.escape(name)}"[^>]*\bdefault="([^"$]+)"'
        found = (re.search(tag, data.decode('utf-8', 'replace')) for data in self.read.values())
        return next((match[1] for match in found if match), '')

    def _unprefixed(self) -> str:
        """Return a tag, of <property> and its like, that was not read for want of its prefix."""
        for path, tag in unprefixed_calls(self.read):
            where = Place(path, tag.line)
            return f'; <{tag.name}> at {where} lacks its prefix: write <xacro:{tag.name}>'
        return ''

    @property
    def _failed_at(self) -> Place | None:
        """Where xacro was."""
        return place_of(self._detail or (self._stack[-1] if self._stack else None))

    @property
    def _called_from(self) -> Place | None:
        """Where in the given file it had come from."""
        places = (place_of(node) for node in reversed(self._stack))
        return next((place for place in places if place and place.file == self.path), None)

    def _furnish(self) -> None:
        """Put our functions in place of xacro's; both names of `find` are asked."""
        vars(xacro).update(
            parse=self._parse,
            open=self._open,
            glob=SimpleNamespace(glob=self._glob),
            safe_eval=evaluate,
            eval_all=self._visit,
            eval_text=self._evaluate,
            handle_macro_call=self._call_macro,
            check_attrs=self._look_at,
            warning=self._warn,
            print_location=lambda: None,
            root_dir=os.curdir,
        )
        vars(substitution_args).update(
            _eval_find=self._find,
            _eval_dirname=self._folder,
            eval=lambda text, _, names: evaluate(text, {}, names),  # of `$(eval text)`
        )
        substitution_args._eval_dict['find'] = self._find
        xacro.substitution_args_context['filename'] = str(self.path)
        functions = xacro._global_symbols['xacro']
        functions.update(dict.fromkeys(('message', 'warning', 'error'), self._say), arg=_argument)
        python = xacro._global_symbols['python']
        python.update(type=lambda value: type(value))  # of three arguments it makes types
        dict.pop(python, 'vars')  # all attributes at once
        sys.setrecursionlimit(max(sys.getrecursionlimit(), FRAMES))

    def _find(self, package: str) -> str:
        is_foreign = any(node.tagName in FOREIGN_TAGS for node in self._stack if node is not None)
        is_include = self._detail is not None and self._detail.tagName == 'xacro:include'
        try:
            return str(self._allowed.package(package))
        except PackageNotFound as error:
            if is_include or not is_foreign:
                raise
            self._warn(f'{error}; left to the program that reads this')
            return f'package://{package}'

    def _folder(self, _: str) -> str:
        return str(os.path.dirname(os.path.abspath(xacro.filestack[-1])))

    def _parse(self, _: None, filename: str) -> minidom.Document:
        """Stand in for xacro.parse, which opens what it is told to."""
        path = Path(filename)
        if len(xacro.filestack) > 1:
            path = self._in_source(path)
            self._check_include(path)
        data, notes = tidy(self._texts[path] if path in self._texts else read_file(path))
        self.warnings += [(Place(path, 1), note) for note in notes]
        check_format(data, path)
        check_xml(data, path)
        self.read[path] = data
        return parse_with_places(data, path)

    def _in_source(self, path: Path) -> Path:
        """
        Return where a file is in its package's source, whose folders an installation leaves out.

        CMake installs `description/urdf` as `urdf`; only one file may be meant.
        """
        for package in self._allowed.packages:
            if os.path.lexists(path) or not path.is_relative_to(package):
                continue
            tail = path.relative_to(package)
            meant = [
                found for found in package.glob(f'*/{glob.escape(str(tail))}') if found.is_file()
            ]
            if len(meant) == 1:
                self._warn(f'{path} is not there, using {meant[0]}, which is installed so')
                xacro.filestack[-1] = str(meant[0])
                return meant[0]
        return path

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
        with self._inside(node):
            self._eval_all(node, macros, symbols)

    def _call_macro(self, node: Any, macros: Any, symbols: Any) -> bool:
        with self._inside(node):
            is_call = node.tagName.startswith('xacro:')
            if is_call and len(xacro.macrostack or ()) >= MOST_MACROS:
                raise RecursionError
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

    def _evaluate(self, text: str, symbols: Any) -> Any:
        if isinstance(text, str):
            if '$' not in text:
                return text  # what xacro would find, too, and most of its time
            self._note([listed(self._failed_at), text[:LONGEST_NOTE]])
            if LAUNCH_FIND in text:
                self._warn(f'{LAUNCH_FIND} NAME) is of launch files, taken as $(find NAME)')
                text = text.replace(LAUNCH_FIND, '$(find')
        return self._eval_text(text, symbols)

    def _warn(self, text: str) -> None:
        self.warnings.append((self._failed_at, ' '.join(text.split())))

    def _say(self, *words: Any, **_: Any) -> str:
        """Stand in for what a file may print itself."""
        self._warn(' '.join(map(str, words)))
        return ''


def _argument(name: str) -> str:
    try:
        return str(xacro.substitution_args_context['arg'][name])
    except KeyError:
        raise substitution_args.ArgException(name) from None


def _unwrapped(error: BaseException) -> tuple[BaseException, str]:
    """Return what xacro has wrapped, and what it said about the place."""
    suffix = ''
    while (cause := getattr(error, 'exc', None)) is not None:
        message = str(error.args[0] or '') if error.args else ''
        is_known = isinstance(cause, DescriptionError | substitution_args.ArgException)
        if message and not message.startswith('<class') and not is_known:
            break
        suffix = suffix or str(getattr(error, 'suffix', None) or '')
        error = cause
    return error, suffix
