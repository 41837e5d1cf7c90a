# SPDX-License-Identifier: Apache-2.0
"""`wasd replay`: a recording is shown as it was, and driven again to the same bits."""

from collections import Counter
from collections.abc import Iterator
import os
from pathlib import Path
import re
from types import SimpleNamespace
from typing import Any

from cases import for_all
from geometry_msgs.msg import Twist, TwistStamped
from mcap.reader import make_reader
from mujoco_sim.boxes import NOWHERE
from mujoco_sim.parameters import BoxSize
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.cli import main
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.inputs import ScriptedBox
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.worlds import build_worlds
from wasd_bringup.tools.recording.bag_writer import BagWriter, new_writer
from wasd_bringup.tools.recording.reader import (
    BagReader,
    describe_run,
    read_commands,
    recorded_options,
    recorded_ros_arguments,
    RecordedMessage,
    RecordingError,
)
from wasd_bringup.tools.recording.recorder import BagRecorder, full_definition, to_bytes
from wasd_bringup.tools.recording.replay import ReplayView
from wasd_core.messages import to_stamp

pytestmark = [pytest.mark.long, pytest.mark.slow]

KEYS = '0.5 i*40\n2.5 j*30'
PUSH = '1 20 5 0 0.3'
BOX = '4 3 0'


@pytest.fixture(scope='module')
def run(new_runner: Any) -> tuple[Any, dict[str, Any]]:
    """Record 5 s of mbot, driven and pushed; return the runner and the report."""
    runner = new_runner()
    words = ('mbot', '--seed', '7', '--duration', '5', '--push', PUSH, '--box', BOX)
    return runner, runner.report(*words, '--record', 'run.mcap', play=KEYS)


def test_the_commands_driven_again_go_the_same_way(run: Any) -> None:
    done = run[0].anew()('replay', 'run.mcap', '--drive')
    assert (done.returncode, done.stdout) == (0, '250 of 250 recorded poses are identical\n')


def test_a_speed_or_port_that_nobody_sees_is_told_and_changes_nothing(run: Any) -> None:
    runner = run[0].anew()
    quiet = runner('replay', 'run.mcap', '--viewer', 'none')
    done = runner('replay', 'run.mcap', '--viewer', 'none', '--speed', '5', '--port', '8090')
    assert (done.returncode, done.stdout) == (quiet.returncode, quiet.stdout)
    assert done.stderr == quiet.stderr + 'WARNING: without effect here: --port, --speed\n'


def test_velocities_are_driven_again_too(run: Any) -> None:
    runner, _ = run
    words = ('mbot', '--duration', '3', '--record', 'twist.mcap')
    runner.report(*words, twist='0.3 0.4 0 0.5\n1.5 -0.1 0 0\n2 stop')
    done = runner('replay', 'twist.mcap', '--drive')
    assert (done.returncode, done.stdout) == (0, '150 of 150 recorded poses are identical\n')


@pytest.mark.usefixtures('ros')
def test_a_reset_in_the_midst_is_repeated_by_a_service_or_by_its_key(run: Any) -> None:
    runner, path = run[0], run[0].folder / 'reset.mcap'
    keys = tuple(parse_key_script('0.2 i*40', 'keys'))
    options = RunOptions(robot='mbot', description='mbot', preset='mbot', keys=keys, speed=0.0)
    recorder = BagRecorder(path, describe_run(options))
    session = make_ros_run(options, recorder=recorder)
    session.simulation.advance(1000)
    assert session.world.base().position[0] > 0.05
    session.simulation.reset()
    session.simulation.advance(1000)
    session.press('BACKSPACE', 'page')
    session.simulation.advance(1000)
    session.close()
    recorder.close()
    done = runner('replay', path.name, '--drive')
    assert (done.returncode, done.stdout) == (0, '150 of 150 recorded poses are identical\n')


@pytest.mark.usefixtures('ros')
@pytest.mark.parametrize('policy', [None, 'ours'])
def test_steps_by_hand_are_repeated(run: Any, policy: str | None) -> None:
    """A state that is published takes noise of the sensors; a network's physics step is split."""
    runner, path = run[0], run[0].folder / 'step.mcap'
    keys = tuple(
        parse_key_script(f'0.02 2\n1.2 {"4" if policy is None else "p"}\n1.3 w*4', 'keys')
    )
    options = RunOptions(
        robot='go2', description='go2', preset='unitree', keys=keys, speed=0.0, policy=policy
    )
    recorder = BagRecorder(path, describe_run(options))
    session = make_ros_run(options, recorder=recorder)
    session.simulation.advance(1700)
    for _ in range(3):
        session.simulation.step()
    session.simulation.advance(497)
    session.simulation.step()
    session.close()
    recorder.close()
    done = runner('replay', path.name, '--drive')
    assert (done.returncode, done.stdout) == (0, '115 of 115 recorded poses are identical\n')


@pytest.mark.usefixtures('ros')
def test_who_looked_at_the_elevation_before_the_eyes_opened_changes_no_walk(run: Any) -> None:
    runner, path = run[0], run[0].folder / 'eyes.mcap'
    keys = tuple(parse_key_script('0.02 2\n1.2 4\n1.3 w*6\n2 e', 'keys'))
    options = RunOptions(
        robot='go2',
        description='go2',
        preset='unitree',
        world='boxes:0.05',
        keys=keys,
        speed=0.0,
    )
    recorder = BagRecorder(path, describe_run(options))
    session = make_ros_run(options, recorder=recorder)
    session.robot.elevation.wanted_by.append(lambda: session.world.time < 2.2)
    session.simulation.advance(3000)
    session.close()
    recorder.close()
    done = runner('replay', path.name, '--drive')
    assert (done.returncode, done.stdout) == (0, '150 of 150 recorded poses are identical\n')


@pytest.mark.usefixtures('ros')
@pytest.mark.parametrize('is_latched', [False, True])
def test_an_e_stop_in_motion_is_repeated_limp_at_once(run: Any, is_latched: bool) -> None:
    """By its key alone it would squat first, and end elsewhere."""
    runner, path = run[0], run[0].folder / 'e_stop.mcap'
    keys = tuple(parse_key_script('0.02 2\n1.2 4\n1.3 w*10', 'keys'))
    options = RunOptions(
        robot='go2',
        description='go2',
        preset='unitree',
        keys=keys,
        speed=0.0,
        latched=is_latched,
        seed=3,
    )
    recorder = BagRecorder(path, describe_run(options))
    session = make_ros_run(options, recorder=recorder)
    session.simulation.advance(2200)
    assert np.linalg.norm(session.world.base().linear_velocity[:2]) > 0.3
    session.e_stop('page')
    assert session.robot.state == 'passive'
    session.simulation.advance(700)
    if is_latched:
        session.end_e_stop()
    session.press('2', 'page')
    session.simulation.advance(500)
    assert session.robot.state != 'passive'
    session.close()
    recorder.close()
    done = runner('replay', path.name, '--drive')
    assert (done.returncode, done.stdout) == (0, '170 of 170 recorded poses are identical\n')


def test_ros_arguments_are_repeated_but_for_other_names_of_topics(run: Any) -> None:
    runner = run[0]
    words = ('mbot', '--duration', '2', '--record', 'ros.mcap')
    ros = ('--ros-args', '-r', '__ns:=/robot', '-p', 'diff_drive_controller:publish_rate:=25.0')
    (runner.folder / 'keys.txt').write_text(KEYS)
    play = ('--speed', '0', '--play', 'keys.txt')
    assert runner(*words, *play, *ros).returncode == 0
    done = runner('replay', 'ros.mcap', '--drive')
    assert (done.returncode, done.stdout) == (0, '100 of 100 recorded poses are identical\n')
    assert runner(*words, *play, '--ros-args', '-r', 'cmd_vel:=other').returncode == 0
    done = runner('replay', 'ros.mcap', '--drive')
    assert done.returncode == 2
    said = 'error: ros.mcap: recorded with cmd_vel:=other: cannot be driven again\n'
    assert done.stderr == said


@pytest.mark.usefixtures('ros')
@pytest.mark.parametrize('has_program', [False, True])
def test_keys_beside_an_interface_are_repeated_and_what_its_programs_did_is_refused(
    run: Any, isolated_ros: int, has_program: bool
) -> None:
    """With the interface the controller of a network runs in each instant."""
    pytest.importorskip('cyclonedds')
    runner, path = run[0], run[0].folder / 'unitree.mcap'
    keys = tuple(parse_key_script('0.02 2\n1.2 p\n1.3 w*8', 'keys'))
    options = RunOptions(
        robot='go2',
        description='go2',
        preset='unitree',
        keys=keys,
        speed=0.0,
        policy='ours',
        interface='unitree',
        domain=isolated_ros,
    )
    recorder = BagRecorder(path, describe_run(options))
    session = make_ros_run(options, recorder=recorder)
    session.simulation.advance(2200)
    if has_program:
        session.interfaces[0].bridge.release_motors()
        session.simulation.advance(100)
    session.close()
    recorder.close()
    done = runner('replay', path.name, '--drive')
    if has_program:
        said = 'an SDK program had the motors, or switched a guard on: cannot be driven again'
        assert (done.returncode, done.stderr) == (2, f'error: unitree.mcap: {said}\n')
    else:
        same = (0, '110 of 110 recorded poses are identical\n')
        assert (done.returncode, done.stdout) == same


def test_files_of_ros_arguments_are_found_from_another_folder(run: Any, new_runner: Any) -> None:
    runner = run[0]
    words = ('mbot', '--duration', '1', '--speed', '0', '--record', 'files.mcap')
    (runner.folder / 'rate.yaml').write_text('/**: {ros__parameters: {state_rate: 100.0}}')
    (runner.folder / 'drive.yaml').write_text('/**: {ros__parameters: {wheel_radius: 0.05}}')
    ros = ('--ros-args', '--params-file', 'rate.yaml', '-p', 'controller:=drive.yaml')
    assert runner(*words, *ros).returncode == 0
    done = new_runner()('replay', str(runner.folder / 'files.mcap'), '--drive')
    assert (done.returncode, done.stdout) == (0, '100 of 100 recorded poses are identical\n')


@pytest.mark.parametrize(
    ('rule', 'is_driven'),
    [
        ('cmd_vel:=x', False),
        ('/cmd_vel:=/vel', False),
        ('teleop:/robot/cmd_vel:=/vel', False),
        ('/ground_truth/odom:=/truth', False),
        ('scan:=lidar', True),
        ('/my_cmd_vel:=/vel', True),
    ],
)
def test_other_names_of_topics_of_a_replay_are_refused_in_any_form(
    rule: str, is_driven: bool
) -> None:
    words = ['--ros-args', '-r', '__ns:=/robot', '-r', rule]
    recorded = describe_run(RunOptions(robot='mbot', description='mbot'), words)
    if is_driven:
        assert recorded_ros_arguments(recorded) == words
    else:
        with pytest.raises(RecordingError, match=f'recorded with {rule}: cannot be driven'):
            recorded_ros_arguments(recorded)


def test_a_robot_alone_is_driven_again_in_a_namespace_of_any_depth(run: Any) -> None:
    runner = run[0]
    words = ('mbot', '--duration', '1', '--speed', '0', '--record', 'deep.mcap')
    ros = ('--ros-args', '-r', '__ns:=/fleet/robot')
    assert runner(*words, *ros).returncode == 0
    done = runner('replay', 'deep.mcap', '--drive')
    assert (done.returncode, done.stdout) == (0, '50 of 50 recorded poses are identical\n')


@pytest.mark.parametrize(
    ('words', 'play'),
    [
        (('--layout', 'azerty'), '0.02 2\n1.2 4\n1.3 z*8'),
        (('--preset', 'wasd'), '0.02 2\n1.2 5\n1.5 e*20'),
    ],
)
def test_keys_mean_the_same_again_on_their_layout_and_in_their_preset(
    run: Any, words: tuple[str, ...], play: str
) -> None:
    runner = run[0]
    recorded = runner.report('go2', *words, '--duration', '2.6', '--record', 'go2.mcap', play=play)
    start, *_, end = recorded['samples']['position']
    assert np.hypot(end[0] - start[0], end[1] - start[1]) > 0.05 or words[0] == '--preset'
    done = runner('replay', 'go2.mcap', '--drive')
    assert (done.returncode, done.stdout) == (0, '130 of 130 recorded poses are identical\n')


@pytest.mark.usefixtures('ros')
def test_a_stamped_velocity_that_was_old_when_it_came_holds_as_long_again(run: Any) -> None:
    runner, path = run[0], run[0].folder / 'old.mcap'
    file = runner.folder / 'stamped.yaml'
    file.write_text('use_stamped_vel: true\n')
    options = RunOptions(
        robot='mbot', description='mbot', preset='mbot', speed=0.0, controller=file
    )
    recorder = BagRecorder(path, describe_run(options))
    session: Any = make_ros_run(options, recorder=recorder)
    session.simulation.advance(1000)
    old = TwistStamped()
    old.header.stamp, old.twist.linear.x = to_stamp(session.world.time - 0.4), 0.3
    session.face.handle(0.0)  # which sets the clocks
    session.face.faces[0].controller.node.cmd_vel.hear(old)
    session.simulation.advance(1000)
    assert 0.0 < session.world.base().position[0] < 0.1  # for 0.1 of 0.5 s
    session.close()
    recorder.close()
    done = runner('replay', path.name, '--drive')
    assert (done.returncode, done.stdout) == (0, '100 of 100 recorded poses are identical\n')


@pytest.mark.parametrize('is_stamped_first', [False, True])
def test_velocities_of_two_types_on_one_topic_are_read_each_by_its_own(
    tmp_path: Path, is_stamped_first: bool
) -> None:
    plain, stamped = Twist(), TwistStamped()
    plain.linear.x, plain.angular.z, stamped.twist.linear.x = 0.3, 0.1, 0.4
    stamped.header.frame_id = 'base_footprint'
    bag = BagWriter(
        tmp_path / 'two.mcap', describe_run(RunOptions(robot='mbot', description='mbot'))
    )
    messages = [stamped, plain] if is_stamped_first else [plain, stamped]
    for time, message in enumerate(messages):
        kind = f'geometry_msgs/msg/{type(message).__name__}'
        channel = bag.add_channel('/cmd_vel', kind, full_definition(kind), '')
        bag.write(channel, time, to_bytes(message))
    bag.close()
    velocities = [one.velocity for one in read_commands(BagReader(tmp_path / 'two.mcap'))]
    wanted = [(0.3, 0.0, 0.1), (0.4, 0.0, 0.0)]
    assert velocities == (wanted[::-1] if is_stamped_first else wanted)


def test_another_way_is_told_with_its_beginning(run: Any) -> None:
    """A copy that says nothing of the push leads elsewhere from 1 s on."""
    runner, _ = run
    original = BagReader(runner.folder / 'run.mcap')
    copy = BagWriter(runner.folder / 'other.mcap', {**original.run, 'pushes': '[]'})
    kinds = {topic.name: topic.kind for topic in original.topics}
    channels = {name: copy.add_channel(name, kind, '', '') for name, kind in kinds.items()}
    for message in original.messages(kinds):
        copy.write(channels[message.topic], message.time, message.data)
    copy.close()
    done = runner('replay', 'other.mcap', '--drive')
    assert done.returncode == 1
    assert done.stdout.startswith('51 of 250 recorded poses are identical')
    assert 'differs from 1.02 s on' in done.stdout


def test_unseen_it_says_what_is_in_it(run: Any) -> None:
    done = run[0]('replay', 'run.mcap')
    assert done.returncode == 0
    assert 'Storage id:        mcap' in done.stdout
    line = '  Topic: /ground_truth/odom | Type: nav_msgs/msg/Odometry | Count: 250'
    assert line in done.stdout.splitlines()


class Film:
    """A viewer with a picture for each instant, which keeps where the robot was in it."""

    period = 0.0

    def __init__(self, world: Any) -> None:
        self.world = world
        self.places: list[list[float]] = []

    def sync(self) -> None:
        self.places.append(self.world.base().position.tolist())

    def close(self) -> None:
        pass


@pytest.fixture
def shown(run: Any) -> Iterator[Film]:
    """Show the recording, a picture for each instant; yield what was seen."""
    bag = BagReader(run[0].folder / 'run.mcap')
    ((_, _, world),) = build_worlds(recorded_options(bag.run), visuals=False)
    film = Film(world)
    view = ReplayView(bag, [world], speed=0.0)
    view._view = film
    view.run(lambda: len(film.places) >= 250)
    yield film


def test_robots_that_are_not_there_are_not_shown_and_joints_without_a_place_are_told(
    run: Any,
) -> None:
    bag = BagReader(run[0].folder / 'run.mcap')
    ((_, _, world),) = build_worlds(recorded_options(bag.run), visuals=False)
    joints = to_bytes(JointState(name=['left_wheel_joint']))
    message = RecordedMessage('/joint_states', 0, joints, 'sensor_msgs/msg/JointState')
    with pytest.raises(RecordingError, match='/joint_states at 0.00 s: got 0 positions of 1 j'):
        ReplayView(bag, [world], speed=0.0)._apply(message)
    other: Any = SimpleNamespace(prefix='go2/', physics=world.physics)
    assert not ReplayView(bag, [other], speed=0.0)._truths


def test_it_is_shown_where_it_was(run: Any, shown: Film) -> None:
    np.testing.assert_array_equal(shown.places[:250], run[1]['samples']['position'])


@pytest.mark.usefixtures('ros')
def test_a_box_that_a_reset_removed_is_shown_no_more(run: Any) -> None:
    path = run[0].folder / 'box.mcap'
    options = RunOptions(robot='mbot', description='mbot', preset='mbot', speed=0.0,
                         boxes=(ScriptedBox(0.1, 3.0, 0.0, 0.0, BoxSize()),))  # fmt: skip
    recorder = BagRecorder(path, describe_run(options))
    session = make_ros_run(options, recorder=recorder)
    session.simulation.advance(500)
    session.simulation.reset()
    session.simulation.advance(500)
    session.close()
    recorder.close()
    bag = BagReader(path)
    ((_, _, world),) = build_worlds(recorded_options(bag.run), visuals=False)
    view = ReplayView(bag, [world], 0.0, options.boxes)
    heights: list[float] = []
    view._view = SimpleNamespace(
        period=0.0, sync=lambda: heights.append(float(world.data.mocap_pos[0, 2]))
    )
    view.run(lambda: len(heights) > 50)
    assert 0.0 in heights
    assert heights[-1] == NOWHERE


def middle_of_a_chunk(recording: bytes) -> int:
    """Return where the middle of the first chunk is: indices beside it have no sum."""
    at = 8  # after the magic; each record is a kind, a length and so many bytes
    while recording[at] != 6:
        at += 9 + int.from_bytes(recording[at + 1 : at + 9], 'little')
    return at + 9 + int.from_bytes(recording[at + 1 : at + 9], 'little') // 2


@for_all(
    ('name', 'said'),
    [
        ('nowhere.mcap', 'nowhere.mcap: No such file'),
        ('play.txt', 'play.txt: no MCAP recording'),
        ('.', '.: Is a directory'),
        ('foreign.mcap', 'foreign.mcap: recorded by another version'),
        ('bare.mcap', 'bare.mcap: not recorded by'),
        ('begun.mcap', 'begun.mcap: not recorded by'),
        ('magic.mcap', 'magic.mcap: not recorded by `wasd ... --record`, or broken off at its'),
        ('flipped.mcap', 'flipped.mcap: damaged ('),
        ('empty.mcap', 'empty.mcap: is empty'),
        ('torn.mcap', 'torn.mcap: no MCAP recording ('),
        ('pipe.mcap', 'pipe.mcap: is a device or pipe'),
        ('/dev/zero', '/dev/zero: is a device or pipe'),
    ],
)
def test_what_is_no_recording_is_said_in_one_line(
    run: Any,
    name: str,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    runner, _ = run
    BagWriter(Path(runner.folder) / 'foreign.mcap', {'robot': 'mbot'}).close()
    whole = (runner.folder / 'run.mcap').read_bytes()
    parts = {'bare': 20, 'begun': 3, 'empty': 0, 'magic': 8}
    for part, size in parts.items():
        (runner.folder / f'{part}.mcap').write_bytes(whole[:size])
    flipped = bytearray(whole)
    flipped[middle_of_a_chunk(whole)] ^= 1
    (runner.folder / 'flipped.mcap').write_bytes(flipped)
    (runner.folder / 'torn.mcap').write_bytes(whole[:200] + whole[-200:])
    if name == 'pipe.mcap':
        os.mkfifo(runner.folder / name)
    monkeypatch.chdir(runner.folder)
    assert main(['replay', name, '--drive']) == 2
    errors = capsys.readouterr().err
    assert errors.startswith(f'error: {said}'), errors
    assert len(errors.splitlines()) == 1
    assert errors.count(name) == 1 or name == '.'


def write_again(source: Path, to: Path, run: dict[str, str], spoilt: str) -> None:
    """
    Write a recording again, of another run; half of each message of a topic is missing.

    Or else, as 'A:B', topic A is called B, and B is left out; as 'A:late', the last message of A
    comes centuries later.
    """
    topic, _, name = spoilt.partition(':')
    whole = make_reader(source.open('rb'))
    known: Any = whole.get_summary()
    with to.open('wb') as file:
        writer = new_writer(file)
        for one in whole.iter_metadata():
            writer.add_metadata(one.name, one.metadata | run)
        for schema in known.schemas.values():
            writer.register_schema(schema.name, schema.encoding, schema.data)
        for one in known.channels.values():
            called = name if name[:1] == '/' and one.topic == topic else one.topic
            writer.register_channel(called, one.message_encoding, one.schema_id, one.metadata)
        counts = Counter(channel.topic for _, channel, _ in whole.iter_messages())
        for _, channel, message in whole.iter_messages():
            if channel.topic == name:
                continue
            data = message.data[: len(message.data) // (1 + (channel.topic == spoilt))]
            time = message.log_time
            if name == 'late' and channel.topic == topic:
                counts[topic] -= 1
                time = time if counts[topic] else 2**63
            writer.add_message(message.channel_id, time, data, message.publish_time)
        writer.finish()


@for_all(
    ('run_of', 'spoilt', 'said'),
    [
        ({'seed': '"abc"'}, '', "seed: got 'abc', wanted a whole number"),
        ({'seed': '-1'}, '', 'seed must be >= 0'),
        ({'world': '5'}, '', 'world: got 5, wanted a text'),
        ({'description': 'null'}, '', 'description: got None, wanted a text'),
        ({'policy': '5'}, '', 'policy: got 5, wanted a text or None'),
        ({'layout': '"abcde"'}, '', "layout: got 'abcde', wanted qwerty, azerty, dvorak"),
        ({'ros_arguments': '[5]'}, '', 'ros_arguments: got [5], wanted a list of texts'),
        ({'ros_arguments': 'null'}, '', 'ros_arguments: got None, wanted a list of texts'),
        ({}, '/cmd_vel', 'damaged: /cmd_vel at '),
        ({}, '/robot_description', 'damaged: /robot_description at '),
        ({}, '/ground_truth/odom', 'damaged: /ground_truth/odom at '),
        ({}, '/odom:/cmd_vel', 'damaged: /cmd_vel at 0.00 s is no Twist'),
        ({}, '/ground_truth/odom:late', 'damaged: no pose from 5 s to 9223372037 s'),
    ],
)
def test_what_a_whole_recording_has_that_no_run_says_is_told_in_one_line(
    run: Any,
    run_of: dict[str, str],
    spoilt: str,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    runner, _ = run
    write_again(runner.folder / 'run.mcap', runner.folder / 'odd.mcap', run_of, spoilt)
    monkeypatch.chdir(runner.folder)
    assert main(['replay', 'odd.mcap', '--drive', '--viewer', 'none']) == 2
    errors = capsys.readouterr().err
    assert errors.startswith('error: odd.mcap: ')
    assert said in errors
    assert len(errors.splitlines()) == 1


def test_a_recording_that_breaks_off_is_driven_as_far_as_it_goes(run: Any) -> None:
    runner, _ = run
    whole = (runner.folder / 'run.mcap').read_bytes()
    (runner.folder / 'cut.mcap').write_bytes(whole[: len(whole) * 4 // 5])
    done = runner('replay', 'cut.mcap', '--drive')
    assert done.returncode == 0, done.stderr
    same, _, count, *_ = done.stdout.split()
    assert same == count
    assert 20 <= int(count) < 250
    told = re.fullmatch(r'WARNING: cut.mcap: breaks off after (.+) s\n', done.stderr)
    assert told is not None, done.stderr
    # Other messages come between a pose and the next.
    assert -1e-9 < float(told[1]) - 0.02 * (int(count) - 1) < 0.02 + 1e-9
