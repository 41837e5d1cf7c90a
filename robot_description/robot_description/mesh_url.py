# SPDX-License-Identifier: Apache-2.0
"""What a mesh's URL names: a file in a package, an absolute path, a relative one, or nothing."""

from pathlib import PurePosixPath
import re
from typing import NamedTuple
from urllib.parse import unquote


class MeshUrl(NamedTuple):
    """
    A URL taken apart.

    `package` is its package, None for a plain path; `path` is relative to the package, absolute,
    or relative to the description; `kinds` are the repairs that reading it took.
    """

    package: str | None
    path: PurePosixPath
    kinds: tuple[str, ...] = ()


def read_url(url: str) -> list[MeshUrl]:
    """
    Return what a URL may mean, the likelier reading first; nothing when it is no local file.

    A percent escape is tried as it stands, then decoded.
    """
    plain = _read(url.strip())
    if plain is None or plain.path == PurePosixPath('.'):
        return []
    decoded = unquote(str(plain.path))
    if decoded == str(plain.path) or '\0' in decoded:
        return [plain]
    escaped = plain._replace(path=PurePosixPath(decoded), kinds=(*plain.kinds, 'percent-escape'))
    return [plain, escaped]


def _read(url: str) -> MeshUrl | None:
    if left := re.fullmatch(r'\$\(find\s+([^\s)]+)\s*\)/*(.*)', url.removeprefix('file://')):
        return MeshUrl(left[1], PurePosixPath(left[2]), ('find-left',))
    scheme, colon, rest = url.partition('://')
    if not colon:
        return MeshUrl(None, PurePosixPath(url))
    if scheme.lower() == 'file':
        return MeshUrl(None, PurePosixPath(rest))
    if scheme.lower() in ('package', 'model'):
        package, _, path = rest.lstrip('/').partition('/')
        return MeshUrl(unquote(package), PurePosixPath(path))
    return None
