# SPDX-License-Identifier: Apache-2.0
"""A document as text and as a list of elements, which other processes understand."""

from pathlib import Path
from typing import Any
from xml.dom import minidom

from wasd_core.safe_files import check_xml
from wasd_core.safe_files import LocatedError
from wasd_core.safe_files import Place
from wasd_core.safe_files import place_of


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
        # <xacro:attribute> leaves numbers.
        attributes = {name: str(value) for name, value in node.attributes.items()}
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
            Place(file, 1), f'it expands to what is wrong: {error.reason}'
        ) from None
    return {'urdf': urdf, 'nodes': nodes}


def listed(place: Place | None) -> list[Any] | None:
    """Return a place as JSON has it."""
    return [str(place.file), place.line, place.column] if place else None


def unlisted(place: list[Any] | None) -> Place | None:
    """Return a place that JSON had."""
    return Place(Path(place[0]), *place[1:]) if place else None
