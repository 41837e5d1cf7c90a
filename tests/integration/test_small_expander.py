# SPDX-License-Identifier: Apache-2.0
"""What tests expand in a small process is what they would expand themselves."""

import os
from pathlib import Path
import sys
from typing import Any

import pytest
from robot_description.xacro import expand_document
from robot_description.xacro import sandbox
import small_expander
from wasd_core.errors import DescriptionError

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
HUGE = "${len('a' * 2**40)}"

pytestmark = pytest.mark.skipif(sys.platform != 'linux', reason='elsewhere nothing forks')


@pytest.fixture
def forks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list of the forks of this process, told without a patch of a test's own."""
    counted: list[int] = []
    fork = os.fork

    def count() -> int:
        counted.append(1)
        return fork()

    monkeypatch.setitem(vars(os), 'fork', count)
    return counted


def write(folder: Path, body: str) -> Path:
    path = folder / 'robot.xacro'
    path.write_text(f'{HEAD}{body}</robot>')
    return path


def test_it_is_expanded_elsewhere_with_the_environment_and_the_folder_of_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forks: list[int]
) -> None:
    monkeypatch.setenv('LINK_OF_NOW', 'base')
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path, '<link name="$(env LINK_OF_NOW)"/><link name="${1 + 1}"/>')
    found = expand_document(Path(path.name))
    assert not forks
    assert [node.attributes['name'] for node in found.nodes] == ['r', 'base', '2']
    monkeypatch.setattr(sandbox, 'NOTE', sandbox.NOTE)  # now it is expanded here
    assert expand_document(Path(path.name)) == found
    assert forks


def test_a_refusal_and_a_bound_are_told_as_they_would_be_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forks: list[int]
) -> None:
    def refusals() -> list[str]:
        said = []
        for body in ('<link name="${nobody}"/>', f'<link name="{HUGE}"/>'):
            with pytest.raises(DescriptionError) as error:
                expand_document(write(tmp_path, body))
            said.append(str(error.value))
        return said

    elsewhere = refusals()
    assert not forks
    monkeypatch.setattr(sandbox, 'NOTE', sandbox.NOTE)
    assert refusals() == elsewhere
    assert len(forks) == 2


def test_tests_of_expansions_expand_themselves(
    tmp_path: Path, forks: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    expander: Any = small_expander.EXPANDER
    for name in small_expander.TESTS_OF_IT:
        expander.attend(name, monkeypatch)
        forks.clear()
        expand_document(write(tmp_path, '<link name="a"/>'))
        assert forks
