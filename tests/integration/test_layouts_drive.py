# SPDX-License-Identifier: Apache-2.0
"""The same places of the hand drive the same robot, whatever its keys are called."""

import numpy as np
import pytest

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
    """As the legs know it, `w` of azerty is `z`; as it is published, it is `w` of qwerty."""
    options = '--layout', 'azerty', '--speed', '1', '--duration', '4'
    report = wasd.report('go2', *options, play='0.1 2\n2.1 4\n2.3 w*8')
    assert report['samples']['command'][-1] == [0.0, 0.0, 0.0]


def test_an_unknown_layout_is_one_line(wasd):
    done = wasd('go2', '--layout', 'qwertz')
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "argument --layout: invalid choice: 'qwertz'" in line
