# SPDX-License-Identifier: Apache-2.0
"""The pages and parameter files that are written from the nodes say what the nodes say now."""

import importlib
from pathlib import Path

import pytest

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


def test_a_topic_that_nobody_describes_is_named(reference, ros, monkeypatch):
    monkeypatch.delitem(reference.TOPICS, 'odom')
    with pytest.raises(SystemExit, match='odom'):
        list(reference.pages())
