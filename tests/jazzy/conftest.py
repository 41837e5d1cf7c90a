# SPDX-License-Identifier: Apache-2.0
"""A sourced Jazzy with an empty home, in which the documentation's own lines have been run."""

import os
from pathlib import Path
import re
import textwrap

import pytest
from sourced_jazzy import missing, ROOT, SourcedJazzy


def documented_lines() -> str:
    """Return the lines of docs/install.md that make a workspace, as they stand."""
    section = (ROOT / 'docs/install.md').read_text().split('## In a ROS 2 Jazzy workspace\n')[1]
    block = re.search(r'(?:^    .*\n)+', section, re.MULTILINE)
    assert block is not None
    return textwrap.dedent(block[0])


@pytest.fixture(scope='session')
def jazzy(tmp_path_factory: pytest.TempPathFactory) -> SourcedJazzy:
    """A home in which the documented lines were run, all of them, without an error."""
    if not os.environ.get('WASD_TEST_JAZZY'):
        pytest.skip('installs a second time, for minutes: WASD_TEST_JAZZY=1 asks for it')
    if lacks := missing():
        pytest.skip(lacks)
    made = SourcedJazzy(tmp_path_factory.mktemp('jazzy'))
    lines = documented_lines()
    assert lines.count('<this repository>') == 1
    done = made.run(lines.replace('<this repository>', str(made.clone_of_checkout())))
    assert done.returncode == 0, done.stdout + done.stderr
    return made


@pytest.fixture(scope='session')
def workspace(jazzy: SourcedJazzy) -> Path:
    """The workspace that the documented lines have made."""
    return jazzy.home / 'ros2_ws'
