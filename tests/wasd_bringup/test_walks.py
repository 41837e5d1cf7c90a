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


def test_a_velocity_on_cmd_vel_passes_nine_files_to_wheels_and_odometry(ros):
    run = make_ros_run(RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0))
    files = named('Files of a velocity on `cmd_vel` to the wheels of mbot: ')
    assert len(files) == 9
    message = Twist()
    message.linear.x = 0.3
    cmd_vel = run.face.faces[0].controller.node.cmd_vel
    sent = {'source_timestamp': time.time_ns()}
    heard = entered(lambda: cmd_vel._on_message(message, sent))
    assert not heard & {'messages.py', 'controllers.py'}
    assert files <= heard | entered(lambda: run.simulation.advance(20))
    assert run.robot.drive_unit.controller.target.linear == 0.3
    run.close()


def test_a_largest_velocity_passes_eight_files_to_the_ramp(tmp_path):
    files = named("Files of a `max_velocity` of mbot's controller file to the ramp: ")
    assert len(files) == 7  # two are called parameters.py
    path = tmp_path / 'drive.yaml'
    path.write_text('linear.x.max_velocity: 0.123')

    def limit():
        run = Run(
            RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0, controller=path)
        )
        assert run.robot.drive_unit.controller._ramp.linear.limits.forward == 0.123
        run.close()

    assert files <= entered(limit)


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
