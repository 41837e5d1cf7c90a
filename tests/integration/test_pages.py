# SPDX-License-Identifier: Apache-2.0
"""README, CONTRIBUTING and docs/: links lead somewhere, and what is to be typed exists."""

import argparse
import importlib
from pathlib import Path
import re
from typing import Any

from cases import for_all
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


@for_all('page', [*PAGES, *ROOT_PAGES])
def test_every_link_leads_to_a_file(page):
    links = re.findall(r'\]\(([^)#:]+)\)', page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_page_is_in_the_index():
    index = (ROOT / 'docs/README.md').read_text()
    missing = [page.name for page in PAGES if f'({page.name})' not in index]
    assert missing == ['README.md'], 'add a row to docs/README.md'


@for_all('page', PAGES)
def test_launch_files_and_their_arguments_exist(page, launch_file):
    for name, words in re.findall(r'ros2 launch wasd_bringup (\S+)([^#\n]*)', code(page)):
        arguments = launch_file(ROOT / 'wasd_bringup/launch' / name).arguments
        assert {word.partition(':=')[0] for word in re.findall(r'\S+:=\S+', words)} <= set(
            arguments
        )


@pytest.mark.slow
@for_all('page', [*PAGES, *ROOT_PAGES])
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


@pytest.fixture
def numbers(monkeypatch):
    """The benchmark's module that writes the page of numbers."""
    monkeypatch.syspath_prepend(str(ROOT / 'benchmarks'))
    return importlib.import_module('page')


def test_the_page_of_numbers_is_made_of_what_the_benchmark_has_written(numbers):
    assert (ROOT / 'docs/numbers.md').read_text() == numbers.page(numbers.last_result())


def test_written_again_the_result_has_no_trials_and_the_page_its_figures(
    numbers, monkeypatch, tmp_path
):
    monkeypatch.setattr(numbers, 'RESULT', tmp_path / 'numbers.json')
    monkeypatch.setattr(numbers, 'PAGE', tmp_path / 'numbers.md')
    row = {'what': 'w', 'measured': '1 m', 'must': '<= 2 m', 'anchor': '-', 'passed': False}
    numbers.write(
        {
            'version': '9.9',
            'date': '2030-01-01',
            'machine': 'a PC',
            'quick': False,
            'seconds': 90.0,
            'rows': [{**row, 'trials': [{'seed': 1}]}],
        }
    )
    assert numbers.last_result()['rows'] == [row]
    text = (tmp_path / 'numbers.md').read_text()
    assert '`./wasd bench` printed at version 9.9 (2030-01-01, a PC, 1.5 minutes)' in text
    assert '| w | 1 m | <= 2 m | - | FAIL |' in text
    assert numbers.duration(numbers.last_result()) == 'wasd bench took 2 minutes on a PC'


def test_a_part_that_is_written_alone_replaces_its_rows_and_no_others(
    numbers, monkeypatch, tmp_path
):
    monkeypatch.setattr(numbers, 'RESULT', tmp_path / 'numbers.json')
    monkeypatch.setattr(numbers, 'PAGE', tmp_path / 'numbers.md')
    facts = {'version': '9.9', 'date': '2030-01-01', 'machine': 'a PC', 'quick': True}

    def row(part: str, measured: str) -> dict[str, Any]:
        return {
            'what': f'{part}: w',
            'measured': measured,
            'must': '-',
            'anchor': '-',
            'passed': True,
            'trials': [],
            'part': part,
        }

    rows = [row('mbot', '1 m'), row('slam', '2 m'), row('slam', '2 m'), row('soak', '5 h')]
    numbers.write({**facts, 'seconds': 60.0, 'rows': rows})
    again = {**facts, 'version': '10.0', 'date': '2030-02-02', 'quick': False, 'seconds': 90.0}
    numbers.write(numbers.with_part({**again, 'rows': [row('slam', '3 m')]}, 'slam'))
    text = (tmp_path / 'numbers.md').read_text()
    assert '`./wasd bench --quick` printed at version 9.9 (2030-01-01, a PC, 1.0 minutes)' in text
    assert 'slam are of `./wasd bench slam` alone (version 10.0, 2030-02-02, a PC, 1.5' in text
    # In their place.
    assert re.findall(r'\| (\w+): w \| (.*?) \|', text) == [
        ('mbot', '1 m'),
        ('slam', '3 m'),
        ('soak', '5 h'),
    ]
    assert '| 2 m |' not in text
    numbers.write(numbers.with_part({**again, 'rows': [row('legs', '4 m')]}, 'legs'))
    assert [kept['part'] for kept in numbers.last_result()['rows']][2:] == ['soak', 'legs']
    numbers.write({**facts, 'seconds': 60.0, 'rows': [row('mbot', '1 m')]})
    assert 'alone' not in (tmp_path / 'numbers.md').read_text()


def test_the_readme_quotes_what_the_benchmark_printed(numbers):
    result = numbers.last_result()
    _, text = (ROOT / 'README.md').read_text().split('## Numbers\n')
    assert f'From `./{numbers.command(result)}` at version {result["version"]}' in text
    assert result['date'] in text
    printed = [
        float(number)
        for row in result['rows']
        for number in re.findall(r'[\d.]+\d|\d', row['measured'])
    ]
    for line in text.splitlines():
        quoted = re.findall(r'\d+(?:\.\d+)?', line.split('|')[2]) if line.startswith('| ') else []
        for number in quoted:
            digits = len(number.partition('.')[2])
            assert number in {f'{value:.{digits}f}' for value in printed}, line
