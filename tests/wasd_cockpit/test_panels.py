# SPDX-License-Identifier: Apache-2.0
"""Each panel does what its widgets say, driven by a page without a browser."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys

from cases import for_all
import programs
import pytest

pytestmark = [pytest.mark.long, pytest.mark.slow]

HERE = Path(__file__).parent
# The page is the same without ROS, which costs a fifth of a run.
PLACE = ('--world', 'room', '--no-ros')
RUNS = {
    'mbot_scenarios': ('mbot', *PLACE),
    'both_scenarios': ('both', '--estimator', 'truth', '--map', *PLACE),
    'map_scenarios': ('mbot', '--map', *PLACE),
}


def scenarios() -> list[tuple[str, str]]:
    """Return the scenarios of all runs: module, name."""
    found = []
    for module in RUNS:
        text = (HERE / f'{module}.py').read_text()
        found += [(module, name) for name in re.findall(r'^def scenario_(\w+)', text, re.M)]
    return found


@pytest.fixture(scope='module')
def played(tmp_path_factory) -> dict[str, dict[str, str]]:
    """Return what failed in each scenario of each run."""
    results = {}
    for module, words in RUNS.items():
        environment = os.environ | {'XDG_CONFIG_HOME': str(tmp_path_factory.mktemp('config'))}
        done = programs.run(
            [sys.executable, '-m', 'run_scenarios', module, *words],
            timeout=400,
            env=environment,
            cwd=HERE.parent,
            stdin=subprocess.DEVNULL,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        results[module] = json.loads(done.stdout.splitlines()[-1])
    return results


@pytest.mark.takes_up_to(1200.0)
@for_all(('module', 'name'), scenarios())
def test_the_panels_do_what_they_say(played, module, name):
    assert played[module][f'scenario_{name}'] == ''
