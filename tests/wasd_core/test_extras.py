# SPDX-License-Identifier: Apache-2.0
"""What an installation lacks is asked for by the name of its extra, and each such name is one."""

import ast
import shlex
import sys

import pytest
from source_trees import nodes, PROJECT, ROOT
from wasd_core.errors import UserError
from wasd_core.extras import import_extra, install_line

# Where calls name an extra.
ARGUMENT = {'import_extra': 1, 'install_line': 0}


def test_what_is_missing_is_asked_for_in_a_line_that_can_be_typed():
    said = r"^--dance needs: \S+ -m pip install 'wasd-robots\[ballet\]'$"
    with pytest.raises(UserError, match=said):
        import_extra('no_such_module', 'ballet', '--dance')
    assert import_extra('json', 'ballet', '--dance').loads('1') == 1


def test_an_extra_is_asked_for_by_what_it_adds(tmp_path, monkeypatch):
    info = tmp_path / 'wasd_robots-9.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(
        'Name: wasd-robots\nVersion: 9\nRequires-Dist: floor>=1\n'
        "Requires-Dist: shoes<2,>=1; extra == 'ballet'\n"
        'Requires-Dist: stage==3 ; extra == "ballet"\n'
        "Requires-Dist: drum==1; extra == 'march'\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    words = [sys.executable, '-m', 'pip', 'install', 'shoes<2,>=1', 'stage==3']
    assert shlex.split(install_line('ballet')) == words


def test_every_extra_that_is_asked_for_exists():
    asked = set()
    for path in [*ROOT.glob('*_*/*_*/**/*.py'), *ROOT.glob('benchmarks/*.py')]:
        text = path.read_text()
        if not any(f'{name}(' in text for name in ARGUMENT):
            continue  # to parse them all takes seconds
        for node in nodes(path):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ARGUMENT:
                extra = node.args[ARGUMENT[ast.unparse(node.func)]]
                asked |= {ast.literal_eval(extra)} if isinstance(extra, ast.Constant) else set()
    assert {'compare', 'foxglove', 'cluster'} <= asked
    assert asked <= set(PROJECT['project']['optional-dependencies'])
