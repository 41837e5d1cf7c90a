# SPDX-License-Identifier: Apache-2.0
"""A URDF as other programs use it, RViz above all: each mesh under a URL that they can open."""

from collections.abc import Mapping
import os
from pathlib import Path
import re
from urllib.parse import unquote
import xml.etree.ElementTree as ElementTree
from xml.sax.saxutils import quoteattr

# A mesh with the URL in it; comments and what is no mesh stay as they are.
MESH = re.compile(r"""<!--.*?-->|(<mesh\b[^<>]*?\bfilename\s*=\s*)("[^"]*"|'[^']*')""", re.DOTALL)
PACKAGE = 'package://'


def published_urdf(urdf: str, files: Mapping[str, Path]) -> str:
    """
    Return the URDF with file:// for each mesh that a listener would not find by its URL.

    `files` are those that were found, by URL. A `package://` of the ament index stays if the file
    is there, as do file:// and the rest of the web; a mesh that was not found stays, too.
    """

    def replaced(match: 're.Match[str]') -> str:
        if match[1] is None:
            return match[0]
        url = ElementTree.fromstring(f'<mesh url={match[2]}/>').get('url', '')
        file = files.get(url)
        if file is None or opened_by_rviz(url) is not None:
            return match[0]
        return match[1] + quoteattr(file.absolute().as_uri())

    return MESH.sub(replaced, urdf)


def opened_by_rviz(url: str) -> Path | None:
    """
    Return the file that RViz would open for a URL; None when there is none.

    Its rule: `package://` goes through the ament index of AMENT_PREFIX_PATH, `file://` is an
    absolute path, a relative name means nothing.
    """
    file = None
    if url.startswith(PACKAGE):
        package, _, path = url.removeprefix(PACKAGE).partition('/')
        share = _share(package)
        file = share / path if share is not None else None
    elif url.startswith('file:///'):
        file = Path(unquote(url.removeprefix('file://')))
    return file if file is not None and file.is_file() else None


def _share(package: str) -> Path | None:
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix and Path(prefix, 'share/ament_index/resource_index/packages', package).is_file():
            return Path(prefix, 'share', package)
    return None
