# SPDX-License-Identifier: Apache-2.0
"""Keys that were saved give the same velocities again."""

from contextlib import closing
from pathlib import Path
import random

from cases import for_all
import pytest
from rclpy.serialization import serialize_message
from rclpy.time import Time
from std_msgs.msg import String
from teleop_keyboard.key_publisher_node import KeyPublisherNode, open_keyboard
from teleop_keyboard.key_script import KeyScriptWriter, parse_key_script
from teleop_keyboard.keymap import NAMED_KEYS
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from teleop_keyboard.keys_to_twist_node import KeysToTwistNode
from teleop_keyboard.parameters import teleop
from wasd_core.errors import UserError
from wasd_core.output_file import OutputError, OutputFile
from wasd_core.signals import StopSignals

pytestmark = pytest.mark.slow

KEYS = ['i', 'j', ' ', '*', '#', '+', 'é', 'CTRL+*', 'ALT+#', 'SHIFT+UP', 'CTRL+SPACE']
EVENTS = ['HELD+i', 'RELEASE+i', 'HELD+SPACE', 'RELEASE+UP', 'HELD+#', 'RELEASE+*']


@for_all('key', [*KEYS, *EVENTS, *sorted(NAMED_KEYS)])
def test_every_key_is_read_back_as_it_was(tmp_path, key):
    path = tmp_path / 'saved.keys'
    with closing(KeyScriptWriter(OutputFile(path, '--save-keys'))) as writer:
        writer.write(0.1, key)
    assert parse_key_script(path.read_text()) == [(0.1, key)]


def test_a_replay_gives_identical_messages(ros_domain, spawn, tmp_path):
    def drive(presses, save=None):
        node = spawn(KeysToTwistNode(KeysToTwist(load_preset('wasd'))))
        sent = []
        node.output.receivers.append(sent.append)
        waiting = list(presses)
        for index in range(3000):
            now = index * 0.002
            while waiting and waiting[0][0] <= now:
                _, key = waiting.pop(0)
                node.keys.hear(String(data=key))
                if save is not None:
                    save.write(now, key)
            node.step(0.002)
        return sent

    generator = random.Random(4)
    times = sorted(generator.uniform(0.0, 5.0) for _ in range(200))
    names = ['w', 'a', 'd', 'q', 'r', 'HELD+w', 'RELEASE+w', ' ', 'x']
    typed = [(time, generator.choice(names)) for time in times]
    path = tmp_path / 'saved.keys'
    with closing(KeyScriptWriter(OutputFile(path, '--save-keys'))) as writer:
        first = drive(typed, writer)
    assert len(first) > 100
    second = drive(parse_key_script(path.read_text()))
    third = drive(parse_key_script(path.read_text()))
    # To the byte, as another process gets them.
    assert len({b''.join(map(serialize_message, drive)) for drive in (first, second, third)}) == 1


def test_saved_times_go_on_where_the_clock_jumps_back(spawn, tmp_path):
    file = OutputFile(tmp_path / 'saved.keys', '--save-keys')
    node = spawn(KeyPublisherNode())
    clock = node.get_clock()
    clock._set_ros_time_is_active(True)
    clock.set_ros_time_override(Time(seconds=100, clock_type=clock.clock_type))
    node.save_to(file)
    for seconds, key in ((101, 'w'), (2, 'a'), (5, 's')):
        clock.set_ros_time_override(Time(seconds=seconds, clock_type=clock.clock_type))
        node.publish_key(key)
    file.close()
    assert parse_key_script(Path(file.path).read_text()) == [(1.0, 'w'), (1.0, 'a'), (4.0, 's')]


def test_a_file_that_cannot_be_written_is_one_line():
    words = ['--save-keys', '/nowhere/a.keys']
    with (
        pytest.raises(OutputError, match='--save-keys /nowhere/a.keys: wanted a file'),
        open_keyboard(teleop, words, StopSignals()),
    ):
        pass


def test_options_are_ours_up_to_ros_args(tmp_path):
    path = str(tmp_path / 'a')
    options = teleop.read(['--save-keys', path, '--ros-args', '-p', 'speed:=0.3'])
    assert (str(options.save_keys), options.ros) == (path, ['--ros-args', '-p', 'speed:=0.3'])
    with pytest.raises(UserError, match='unrecognized arguments: --sav a'):
        teleop.read(['--sav', 'a'])
