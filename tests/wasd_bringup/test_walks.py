# SPDX-License-Identifier: Apache-2.0
"""A key, a velocity and a scan pass the files that docs/architecture.md names."""

from pathlib import Path
import re
import sys
import time

from geometry_msgs.msg import Twist
import pytest
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

pytestmark = pytest.mark.slow

PAGE = (Path(__file__).parents[2] / 'docs/architecture.md').read_text()


def named(beginning):
    """Return the files that a sentence of the page names."""
    (sentence,) = re.findall(rf'{beginning}((?:[^.]|\.py)*)\.\s', PAGE)
    return set(re.findall(r'`(\w+\.py)`', sentence))


def entered(act):
    """Return the files of functions that are called meanwhile."""
    files = set()

    def note(frame, event, _):
        if event == 'call':
            files.add(Path(frame.f_code.co_filename).name)

    sys.setprofile(note)
    try:
        act()
    finally:
        sys.setprofile(None)
    return files


def test_a_key_passes_eight_files_to_the_stick():
    run = Run(RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0))
    files = named('Files of a key that moves a stick of the Go2: ')
    assert len(files) == 8
    assert files - entered(lambda: run.press('w')) == {'key_reader.py'}  # which reads it
    run.close()


def test_a_velocity_passes_nine_files_to_wheels_and_odometry_and_four_more_from_ros(ros):
    run = make_ros_run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0))
    own = named('Files of a velocity that a program gives mbot: ')
    assert len(own) == 9

    def drive():
        run.robot.drive((0.3, 0.0, 0.0), 'program')
        run.simulation.advance(20)

    assert own <= entered(drive)
    of_ros = named('One on `cmd_vel` also passes ')
    assert len(of_ros) == 4
    subscription = run.face.faces[0].controller.node.cmd_vel._subscription
    told = Twist()
    told.linear.x = 0.2
    sent = {'source_timestamp': time.time_ns()}
    assert of_ros <= entered(lambda: subscription._on_message(told, sent))
    run.close()


def test_a_scan_passes_eleven_files_to_the_map_and_the_page():
    options = RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0, map='')
    run = Run(options)
    run.simulation.advance(500)
    files = named('Files of a scan on its way to a cell of the map and to the page: ')
    assert len(files) == 11

    def see():
        run.simulation.advance(250)
        run.navigations[0].view()

    assert files - entered(see) == {'bridge.py', 'map.py'}  # of the page, which shows the view
    run.close()
