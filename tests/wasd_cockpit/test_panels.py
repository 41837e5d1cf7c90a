# SPDX-License-Identifier: Apache-2.0
"""Each panel does what its widgets say, driven by a page without a browser."""

import json
import os
from pathlib import Path
import subprocess
import sys

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


@pytest.mark.parametrize('module', RUNS)
def test_the_panels_do_what_they_say(module, tmp_path):
    done = programs.run(
        [sys.executable, '-m', 'run_scenarios', module, *RUNS[module]],
        timeout=400,
        env=os.environ | {'XDG_CONFIG_HOME': str(tmp_path)},
        cwd=HERE.parent,
        stdin=subprocess.DEVNULL,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    played = json.loads(done.stdout.splitlines()[-1])
    assert played
    assert {name: text for name, text in played.items() if text} == {}
