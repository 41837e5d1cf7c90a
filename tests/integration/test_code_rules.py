# SPDX-License-Identifier: Apache-2.0
"""Rules of the code: a fact has one home, kernels are compiled in one way."""

import ast
import functools
import gc
from pathlib import Path
import re

from cases import for_all
import pytest
from source_trees import imports, modules, nodes, PACKAGES, ROOT

# Facts of which some code has to know all values: the module in whose literals they stand.
ONE_HOME = {
    'worlds': ({'flat', 'room'}, 'mujoco_sim.scene'),
    'terrains': ({'slope', 'stairs', 'step', 'boxes'}, 'mujoco_sim.scene'),
    'drive modes': ({'float', 'arbotix', 'fake'}, 'diff_drive_sim.__init__'),
    'opposite sides': (
        {'left', 'right', 'front', 'back'},
        'robot_description.morphology.names',
    ),
}


@pytest.fixture(scope='module', autouse=True)
def _forget_syntax_trees():
    """
    Let half a million nodes go: later tests fork, and collect garbage.

    While they are made, there is none, and to look for it takes twice as long as to make them.
    """
    gc.disable()
    yield
    nodes.cache_clear()
    gc.enable()


@functools.cache
def literals(path: Path) -> tuple[set[object], ...]:
    """Return the constants of each tuple, list and set in a module, and the keys of each dict."""
    found = []
    for node in nodes(path):
        if isinstance(node, ast.Dict | ast.Tuple | ast.List | ast.Set):
            values = node.keys if isinstance(node, ast.Dict) else node.elts
            found.append({value.value for value in values if isinstance(value, ast.Constant)})
    return tuple(found)


def homes(words: set[str]) -> set[str]:
    """Return the modules in which three or all of these words stand in one literal."""
    return {
        module
        for package in PACKAGES
        for module, path in modules(package).items()
        if any(len(literal & words) >= min(3, len(words)) for literal in literals(path))
    }


@for_all('fact', ONE_HOME)
def test_a_fact_has_one_home(fact):
    words, home = ONE_HOME[fact]
    assert homes(words) == {home}


def test_gravity_has_one_home():
    known = {
        module
        for package in PACKAGES
        for module, path in modules(package).items()
        for node in nodes(path)
        if isinstance(node, ast.Constant) and node.value in (9.81, -9.81, 9.8, 9.80665)
    }
    assert known == {'wasd_core.robot_io'}


def test_the_words_for_keys_that_are_down_have_one_home():
    words = {'HELD', 'RELEASE', 'HELD+', 'RELEASE+'}
    known = {
        module
        for package in PACKAGES
        for module, path in modules(package).items()
        for node in nodes(path)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in words
    }
    assert known == {'wasd_core.timing'}


def test_kernels_are_compiled_in_one_way():
    compiling = {
        module
        for package in PACKAGES
        for module, path in modules(package).items()
        if re.search(r'\b(njit|numba\.jit)\b', path.read_text())
    }
    assert compiling == {'wasd_core.jit'}
    importing = {
        module
        for package in PACKAGES
        for module, path in modules(package).items()
        if any(name.partition('.')[0] == 'numba' for name in imports(path))
    }
    assert importing == {'wasd_core.jit', 'wasd_core.own_numba'}


def test_the_benchmark_needs_nothing_that_only_tests_install():
    """`wasd bench` runs where nobody has run `wasd test`; the part for a Chromium does without."""
    folders = [ROOT / name for name in ('benchmarks', 'tests', 'tests/wasd_cockpit')]
    own = {path.stem: path for folder in folders for path in folder.glob('*.py')}
    waiting, seen = sorted(path.stem for path in folders[0].glob('*.py')), set()
    while waiting:
        name = waiting.pop()
        if name not in seen and name in own:
            seen.add(name)
            waiting += {found.split('.')[0] for found in imports(own[name])}
    assert {'scribbling', 'page_puppet'} <= seen
    users = {name for name in seen for found in imports(own[name]) if found.startswith('pytest')}
    assert users == {'page_in_browser'}
