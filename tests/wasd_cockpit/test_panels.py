# SPDX-License-Identifier: Apache-2.0
"""Each panel does what its widgets say, driven by a page without a browser."""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
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


Run = subprocess.CompletedProcess[str]


def run_scenarios(module: str, folder: Path) -> Run:
    """Run what a hand does, of a module."""
    return programs.run(
        [sys.executable, '-m', 'run_scenarios', module, *RUNS[module]],
        timeout=400,
        env=os.environ | {'XDG_CONFIG_HOME': str(folder)},
        cwd=HERE.parent,
        stdin=subprocess.DEVNULL,
        text=True,
    )


@pytest.fixture(scope='module')
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Future[Run]]]:
    """Return a run of each module; two at a time, for hands wait a good deal."""
    with ThreadPoolExecutor(2) as pool:
        yield {
            module: pool.submit(run_scenarios, module, tmp_path_factory.mktemp(module))
            for module in RUNS
        }


@pytest.mark.parametrize('module', RUNS)
def test_the_panels_do_what_they_say(module: str, runs: dict[str, Future[Run]]) -> None:
    done = runs[module].result()
    assert done.returncode == 0, done.stderr
    # Studio's library may say a line of its own, also after ours.
    (line,) = (line for line in done.stdout.splitlines() if line.startswith('{'))
    played = json.loads(line)
    assert played
    assert {name: text for name, text in played.items() if text} == {}
