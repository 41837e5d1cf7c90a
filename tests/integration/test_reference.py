# SPDX-License-Identifier: Apache-2.0
"""The pages and parameter files that are written from the nodes say what the nodes say now."""

import ast
import importlib
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def reference(monkeypatch):
    pytest.importorskip('tf2_msgs', reason='no tf2_msgs, so no /tf to write about')
    monkeypatch.syspath_prepend(str(ROOT / 'docs'))
    return importlib.import_module('reference')


def test_every_page_and_parameter_file_is_up_to_date(reference, ros):
    stale = [
        str(path.relative_to(ROOT))
        for path, text in reference.pages()
        if not path.is_file() or path.read_text() != text
    ]
    assert not stale, f'{", ".join(stale)}: run {reference.COMMAND}'


def test_every_node_of_the_packages_is_asked(reference):
    classes = {
        node.name
        for package in ROOT.glob('*/package.xml')
        for path in (package.parent / package.parent.name).rglob('*.py')
        if 'Node' in (text := path.read_text())
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ClassDef) and 'Node' in map(ast.unparse, node.bases)
    }
    asked = [*reference.NODES, *reference.VARIANTS]
    assert classes == {kind.__name__ for kind in asked if isinstance(kind, type)}


def test_a_topic_that_nobody_describes_is_named(reference, ros, monkeypatch):
    monkeypatch.delitem(reference.TOPICS, 'odom')
    with pytest.raises(SystemExit, match='odom'):
        list(reference.pages())
