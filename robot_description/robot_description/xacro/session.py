# SPDX-License-Identifier: Apache-2.0
"""Xacro to URDF with our own `$(find)`, so that it works with and without a ROS installation."""

from collections.abc import Mapping, Sequence
import contextlib
import hashlib
from itertools import starmap
import json
from pathlib import Path
import re
import sys
from typing import Any, NamedTuple

from wasd_core.cache import cache_folder
from wasd_core.errors import DescriptionError
from wasd_core.output_file import OutputError, OutputFile
from wasd_core.ownership import others_can_write
from wasd_core.safe_files import check_xml, LocatedError, parse_with_places, Place, read_file
import xacro

from robot_description.meshes.files import EXTENSIONS
from robot_description.packages import DESCRIPTIONS
from robot_description.xacro.processor import describe_document, process, unlisted
from robot_description.xacro.sandbox import OutOfBounds, run_bounded
from robot_description.xacro.source import check_format, tidy, WANTED

# How files end that may be too large to be looked into.
NO_DESCRIPTIONS = (*EXTENSIONS, '.usd', '.usda', '.usdc', '.usdz')

# A comment without an end goes to the end of the file: the time grows no faster than the file.
NO_XACRO = re.compile(rb'<!--.*?(?:-->|\Z)|\sxmlns:xacro="[\w:/.-]*"', re.DOTALL)
OTHER_MARKUP = re.compile(rb'<!(?!--)|<\?(?!xml )')

# Of these alone we know that they depend on nothing else than the XML that is read: no variable of
# the environment, no YAML.
OUR_FILES = frozenset(Path(__file__).parents[1] / file for file in DESCRIPTIONS.values())


class Expansion(NamedTuple):
    """An expanded file: text; elements as `describe_document` has them; warnings; files read."""

    urdf: str
    nodes: list[list[Any]]
    warnings: tuple[tuple[Place | None, str], ...]
    files: tuple[Path, ...]


# By file and arguments, with what was read: to expand takes half of the time that a robot takes.
# Of those without arguments the user's cache keeps one each, for other processes.
_known: dict[tuple[Path, tuple[tuple[str, str], ...]], tuple[Expansion, dict[Path, bytes]]] = {}


class XacroSession:
    """
    Runs xacro on one file, see Processor; `sources` are the files it read.

    `texts` are read in place of the files of that name.
    """

    def __init__(
        self,
        path: Path,
        arguments: Mapping[str, str] | None = None,
        search: Sequence[Path] = (),
        texts: Mapping[Path, bytes] | None = None,
    ) -> None:
        self.sources: dict[Path, bytes] = {}
        self.kept: Path | None = None  # where the answer is kept
        self.path = path
        self.search = search
        self._arguments = dict(arguments or {})
        self._texts = dict(texts or {})

    def expand(self) -> Expansion:
        """
        Return what the file expands to.

        Raises:
            DescriptionError: one line with the file and, where there is one, the line.
        """
        try:
            data = self._texts[self.path] if self.path in self._texts else read_file(self.path)
        except DescriptionError:  # it is too large, say
            if self.path.suffix.lower() not in NO_DESCRIPTIONS:
                raise
            what = f'is a mesh or a scene by its name ({self.path.suffix}), {WANTED}'
            reason = f'{what}; name the .urdf or .xacro that uses it'
            raise LocatedError(Place(self.path, 1), reason) from None
        data, notes = tidy(data)
        check_format(data, self.path)
        answer = self._run() if _is_xacro(data) else self._read(data, notes)
        if 'error' in answer:
            error = answer['error']
            at, reason, via = unlisted(error['place']), error['reason'], unlisted(error['via'])
            raise LocatedError(at, reason, via) if at else DescriptionError(reason)
        tag, _, _, (file, *at), _ = answer['nodes'][0]
        if tag != 'robot':
            reason = f'is <{tag}>, {WANTED}; make <robot> its first tag'
            raise LocatedError(Place(Path(file), *at), reason)
        warnings = tuple((unlisted(where), text) for where, text in answer['warnings'])
        return Expansion(answer['urdf'], answer['nodes'], warnings, tuple(self.sources))

    def _read(self, data: bytes, notes: Sequence[str]) -> dict[str, Any]:
        """Read a file in which xacro would change nothing."""
        check_xml(data, self.path)
        self.sources = {self.path: data}
        unknown = [*notes]
        unknown += [f'no argument {name!r} here; it has: none' for name in sorted(self._arguments)]
        document = parse_with_places(data, self.path)
        described = describe_document(document, self.path)
        return {**described, 'warnings': [(None, text) for text in unknown]}

    def _run(self) -> dict[str, Any]:
        job = {
            'path': str(self.path),
            'arguments': self._arguments,
            'search': [str(folder) for folder in self.search],
            'texts': {str(file): text.decode('latin-1') for file, text in self._texts.items()},
        }
        try:
            answer = _read_kept(self.kept) or run_bounded(process, job)
        except OutOfBounds as error:
            listed, text = error.note or (None, '')
            at = f', at {" ".join(text.split())!r}' if text else ''
            place = unlisted(listed) or Place(self.path, 1)
            raise LocatedError(place, f'expanding {self.path.name} {error}{at}') from None
        self.sources = _sources(answer)
        if self.kept and 'state' not in answer and 'error' not in answer:
            with contextlib.suppress(OutputError):
                data = json.dumps({**answer, 'state': _state()}).encode()
                OutputFile(self.kept, '').write(data)
        return answer


def expand_document(
    path: Path, arguments: Mapping[str, str] | None = None, search: Sequence[Path] = ()
) -> Expansion:
    """
    Return what a xacro or URDF file expands to.

    `arguments` are xacro args; `search` are folders in which `$(find)` looks first. A file of ours
    whose expansion is known, here or in the cache, is not expanded again while it stays as it is.

    Raises:
        DescriptionError: one line with the file and, where there is one, the line.
    """
    session = XacroSession(path, arguments, search)
    if search or path not in OUR_FILES:
        return session.expand()
    asked = path, tuple(sorted((arguments or {}).items()))
    known, sources = _known.get(asked, (None, {}))
    if known is None or not all(starmap(_is_still, sources.items())):
        folder = None if arguments else cache_folder('expansions')
        name = hashlib.sha256(str(path).encode()).hexdigest()[:16]
        session.kept = folder and folder / f'{path.stem}-{name}.json'
        known = session.expand()
        _known[asked] = known, session.sources
    return known


def _is_xacro(data: bytes) -> bool:
    """Return whether xacro may change a file: more than a comment or a namespace names it."""
    # In CDATA and the like `<!--` begins no comment.
    if b'eval-comments' not in data and not OTHER_MARKUP.search(data):
        data = NO_XACRO.sub(b'', data)
    # In UTF-16 one cannot see that it is xacro.
    return any(sign in data for sign in (b'xacro', b'$', b'\0'))


def _is_still(file: Path, text: bytes) -> bool:
    try:
        return read_file(file) == text
    except DescriptionError:
        return False


def _sources(answer: Mapping[str, Any]) -> dict[Path, bytes]:
    return {Path(file): text.encode('latin-1') for file, text in answer['sources'].items()}


def _read_kept(path: Path | None) -> dict[str, Any] | None:
    """Return the answer in a file, where it would be the same today and only we could write it."""
    try:
        if path is None or others_can_write(path.stat()):
            return None
        kept: dict[str, Any] = json.loads(path.read_bytes())
        is_still = kept['state'] == _state() and all(starmap(_is_still, _sources(kept).items()))
        return kept if is_still else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _state() -> str:
    """Return a digest of the code that expands."""
    here, theirs = Path(__file__).parent, Path(xacro.__file__).parent
    files = sorted(file for at in (here, here.parent, theirs) for file in at.glob('*.py'))
    code = b''.join(file.read_bytes() for file in files)
    return hashlib.sha256(sys.version.encode() + code).hexdigest()
