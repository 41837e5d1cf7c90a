# SPDX-License-Identifier: Apache-2.0
"""The layouts for Foxglove show topics that there are, and drive by those that are taken."""

import json
from pathlib import Path
import re
import sys

from cases import for_all
import pytest
from wasd_bringup.robots import HUMANOID, ROBOTS
from wasd_bringup.ros.foxglove import load_sdk
from wasd_core.errors import UserError
from wasd_core.extras import install_line

ROOT = Path(__file__).resolve().parents[2]
LAYOUTS = ROOT / 'wasd_bringup/foxglove'
# Of the robots' own sensors and of what is always there: topics.md is asked of the nodes.
TOPICS = set(re.findall(r'^\| `/?([\w/~]+)`', (ROOT / 'docs/topics.md').read_text(), re.M))


def strings(value):
    """Yield every text in a layout, keys included."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from strings(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from strings(inner)
    elif isinstance(value, str):
        yield value


@for_all('robot', ROBOTS)
def test_every_topic_of_a_layout_is_there(robot):
    layout = json.loads((LAYOUTS / f'{robot}.json').read_text())
    named = {text[1:].partition('.')[0] for text in strings(layout) if text.startswith('/')}
    odometry = 'ground_truth/odom' if ROBOTS[robot].kind is HUMANOID else 'odom'
    assert {'cmd_vel', odometry, 'robot_description'} <= named
    assert named <= TOPICS


@for_all('robot', ROBOTS)
def test_the_panels_of_a_layout_are_those_that_are_placed(robot):
    layout = json.loads((LAYOUTS / f'{robot}.json').read_text())

    def placed(node):
        if isinstance(node, str):
            return [node]
        return placed(node['first']) + placed(node['second'])

    assert sorted(placed(layout['layout'])) == sorted(layout['configById'])


@for_all('robot', ROBOTS)
def test_the_panel_that_drives_sends_often_enough_and_stops(robot):
    layout = json.loads((LAYOUTS / f'{robot}.json').read_text())
    panel = layout['configById']['Teleop!drive']
    assert panel['topic'] == '/cmd_vel'
    assert panel['publishRate'] >= 3
    assert (panel['autoSendStopOnRelease'], panel['stopButton']['value']) == (True, 0)


@pytest.mark.slow
def test_a_run_without_a_terminal_says_where_it_serves_and_what_it_waits_for(wasd):
    pytest.importorskip('foxglove.websocket', reason="the extra 'foxglove' is not installed")
    done = wasd('mbot', '--foxglove', '0', '--gamepad', '--duration', '0.1', '--speed', '0')
    assert done.returncode == 0, done.stderr
    assert re.search(r'^foxglove: ws://127\.0\.0\.1:\d+$', done.stdout, re.M)
    assert re.search(r'^gamepad( \(.*\))?: hold L1 to drive', done.stdout, re.M)


def test_without_the_extra_one_line_says_how_it_comes(monkeypatch):
    monkeypatch.setitem(sys.modules, 'foxglove', None)
    with pytest.raises(UserError) as error:
        load_sdk()
    assert str(error.value) == f'--foxglove needs: {install_line("foxglove")}'
