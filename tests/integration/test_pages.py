# SPDX-License-Identifier: Apache-2.0
"""README, CONTRIBUTING and docs/: links lead somewhere, and what is to be typed exists."""

import argparse
from pathlib import Path
import re

from executables import SCRIPTS
import pytest
from wasd_bringup.cli import make_parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / 'docs').glob('*.md'))
ROOT_PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md']
# Commands of `wasd` that are no subparsers.
OTHER_COMMANDS = {'COMMAND', 'test', 'bench', 'lint'}


def code(page: Path) -> str:
    """Return what a page shows as code."""
    text = page.read_text()
    return '\n'.join([*re.findall(r'^    (.*)$', text, re.M), *re.findall(r'`([^`\n]+)`', text)])


@pytest.mark.parametrize('page', [*PAGES, *ROOT_PAGES], ids=str)
def test_every_link_leads_to_a_file(page):
    links = re.findall(r'\]\(([^)#:]+)\)', page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_page_is_in_the_index():
    index = (ROOT / 'docs/README.md').read_text()
    missing = [page.name for page in PAGES if f'({page.name})' not in index]
    assert missing == ['README.md'], 'add a row to docs/README.md'


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_launch_files_and_their_arguments_exist(page, launch_file):
    for name, words in re.findall(r'ros2 launch wasd_bringup (\S+)([^#\n]*)', code(page)):
        arguments = launch_file(ROOT / 'wasd_bringup/launch' / name).arguments
        assert {word.partition(':=')[0] for word in re.findall(r'\S+:=\S+', words)} <= set(
            arguments
        )


@pytest.mark.parametrize('page', [*PAGES, *ROOT_PAGES], ids=str)
def test_executables_and_commands_exist(page):
    for package, executable in re.findall(r'ros2 run (\w+) (\w+)', code(page)):
        assert SCRIPTS[executable].partition('.')[0] == package
    for executable in re.findall(r'\.venv/bin/(\w+) --ros-args', code(page)):
        assert executable in SCRIPTS
    (commands,) = (
        action.choices
        for action in make_parser()._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    named = set(re.findall(r'(?:^|\s)(?:\./)?wasd ([A-Za-z]\w*)', code(page), re.M))
    assert named - OTHER_COMMANDS <= set(commands)


def test_the_readme_is_short():
    assert len((ROOT / 'README.md').read_text().splitlines()) <= 120
