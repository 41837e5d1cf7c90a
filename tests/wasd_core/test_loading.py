# SPDX-License-Identifier: Apache-2.0
"""While a program loads, Python looks for no garbage; afterwards it does."""

import gc
import subprocess
import sys

import pytest
from wasd_bringup.cli import main
from wasd_bringup.run.run import Run
from wasd_core.loading import loading


@pytest.fixture
def looks():
    """Return the generations that were looked through, as they are."""
    seen = []

    def note(phase, info):
        if phase == 'start':
            seen.append(info['generation'])

    gc.callbacks.append(note)
    yield seen
    gc.callbacks.remove(note)


def make_objects():
    return [[] for _ in range(100_000)]


def test_nothing_is_looked_through_while_a_program_loads_and_all_is_afterwards(looks):
    with loading():
        before = len(looks)
        kept = make_objects()
        assert len(looks) == before
    kept += make_objects()
    assert len(looks) > before


def test_an_error_while_it_loads_and_a_start_within_a_start_leave_it_as_it_was():
    with pytest.raises(ImportError), loading():
        raise ImportError
    assert gc.isenabled()
    gc.disable()
    try:
        with loading():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


COUNT = """
import gc
from wasd_core.loading import loading

def frozen():
    return gc.get_freeze_count()

with loading(is_ours=False):
    pass
counts = [frozen()]
for _ in range(2):
    with loading():
        import json
    counts.append(frozen())
print(counts[0] == 0 < counts[1] == counts[2])
"""


@pytest.mark.slow
def test_what_a_program_of_ours_has_loaded_is_set_aside_once_and_of_no_other_program():
    done = subprocess.run([sys.executable, '-c', COUNT], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ('True\n', '')


@pytest.mark.slow
def test_python_looks_for_garbage_while_robots_run(monkeypatch):
    seen = []
    monkeypatch.setattr(Run, 'run', lambda *_: seen.append(gc.isenabled()))
    assert main(['mbot', '--no-ros', '--viewer', 'none', '--duration', '1', '--speed', '0']) == 0
    assert seen == [True]
