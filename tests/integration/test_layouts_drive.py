# SPDX-License-Identifier: Apache-2.0
"""The same places of the hand drive the same robot, whatever its keys are called."""

import contextlib
import os

import numpy as np
import pytest
from quadruped_sim.keys import StickValues
import rclpy
from std_msgs.msg import String
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(('layout', 'key'), [('qwerty', 'w'), ('azerty', 'z'), ('dvorak', ',')])
def test_the_key_above_the_home_row_drives_mbot_forward(wasd, layout, key):
    options = '--preset', 'wasd', '--layout', layout, '--duration', '1'
    report = wasd.report('mbot', *options, play=f'0.1 {key}*25')
    assert report['samples']['position'][-1][0] > 0.1


def test_the_sticks_of_the_go2_are_where_the_hand_is(wasd):
    # w a l of qwerty; the states are digits everywhere.
    keys = '0.1 2\n2.1 4\n2.3 z*4 q*2 l*2'
    report = wasd.report('go2', '--layout', 'azerty', '--duration', '3.2', play=keys)
    forward, left, turn = report['samples']['command'][-1]
    full = np.array([2.0, 0.8, -2.0])
    np.testing.assert_allclose([forward, left, turn], full * 0.05 * [4, 2, 2], atol=1e-9)


def test_a_key_that_comes_back_from_its_topic_is_not_pressed_again(wasd):
    options = '--layout', 'azerty', '--speed', '1', '--duration', '4'
    report = wasd.report('go2', *options, play='0.1 2\n2.1 4\n2.3 z*4')
    np.testing.assert_allclose(report['samples']['command'][-1], [0.4, 0.0, 0.0], atol=1e-9)


@pytest.mark.usefixtures('ros')
def test_an_outside_keyboard_of_the_layout_moves_the_legs_until_it_is_gone(spin_until):
    keys = tuple(parse_key_script('0.1 2\n2.1 4', 'keys'))
    options = RunOptions(
        robot='go2', description='go2', preset='unitree', layout='azerty', keys=keys, speed=0.0
    )
    run = make_ros_run(options)
    sticks = run.robot.legs.controller.sticks
    with contextlib.closing(run):
        run.simulation.advance(2300)
        context = rclpy.Context()
        context.init(args=[], domain_id=int(os.environ['ROS_DOMAIN_ID']))
        keyboard = rclpy.create_node('other_keyboard', context=context)
        talk = keyboard.create_publisher(String, 'keys', 10)
        spin_until(run.face, lambda: talk.get_subscription_count() >= 1)
        # What this run's own keyboard sends, too: `z` where qwerty has `w`.
        for key in ('w', 'z', 'z'):
            talk.publish(String(data=key))
        spin_until(run.face, lambda: sticks.values.ly > 0.05)
        assert sticks.values == StickValues(ly=sticks.values.ly)
        assert sticks.values.ly == pytest.approx(0.1)
        # It is looked for ten times a second.
        spin_until(run.face, lambda: run.face.faces[0]._keyboards._had_any)
        keyboard.destroy_node()
        context.try_shutdown()
        spin_until(run.face, lambda: sticks.values == StickValues())


def test_an_unknown_layout_is_one_line(wasd):
    done = wasd('go2', '--layout', 'qwertz')
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "argument --layout: invalid choice: 'qwertz'" in line
