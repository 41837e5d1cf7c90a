# SPDX-License-Identifier: Apache-2.0
"""Reads a recording: what run it is of, its topics and messages, the commands in it."""

from collections.abc import Collection, Iterator, Mapping, Sequence
import contextlib
from dataclasses import asdict
import inspect
import itertools
import json
import os
from pathlib import Path
import stat
import struct
import tempfile
from typing import Any, BinaryIO, NamedTuple

from geometry_msgs.msg import Twist, TwistStamped
from mcap.exceptions import EndOfFile
from mcap.reader import FOOTER_SIZE, make_reader
from mcap.records import Channel, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, StreamReader
from mcap.writer import MCAP0_MAGIC, Writer
from mujoco_sim.parameters import Payload, SimulatorParameters, Untold
from mujoco_sim.scene import TERRAINS, WORLDS
from rclpy.serialization import deserialize_message
from robot_description.packages import DESCRIPTIONS, OTHERS
from std_msgs.msg import String
from teleop_keyboard.keymap import LAYOUTS
from teleop_keyboard.keymap_file import preset_names
from wasd_core.arguments import check
from wasd_core.errors import one_line, UserError
from wasd_core.messages import to_seconds, to_stamp
from wasd_core.parameters import shown
from wasd_core.timing import judge_stamp
from wasd_core.velocity_messages import to_velocity, VELOCITY_TYPES

from wasd_bringup.robots import BOTH, ROBOTS, UNITREE_PRESET, WHEELED
from wasd_bringup.run.inputs import box_text, Command, parse_box, parse_push, push_text
from wasd_bringup.run.options import RunOptions
from wasd_bringup.tools.recording.bag_writer import new_writer, RECORD_NAME
from wasd_bringup.tools.recording.recorder import EVENTS


class RecordingError(UserError):
    """A recording cannot be read; the text is one line with its path."""


class Topic(NamedTuple):
    """A topic of a recording: its full name, its type, how many messages it has."""

    name: str
    kind: str
    messages: int


class RecordedMessage(NamedTuple):
    """A message as CDR, its type, and when it was published [ns of simulated time]."""

    topic: str
    time: int
    data: bytes
    kind: str


class BagReader:
    """
    An MCAP file that `--record` wrote, whole or as far as it goes.

    `run` is what `describe_run` said of it; `start` and `end` are the times of the first and the
    last message [ns]. It `breaks_off` where the run was killed, or has not ended yet.
    """

    def __init__(self, path: Path) -> None:
        """
        Open a recording and read its index.

        Raises:
            RecordingError: it cannot be read, or is not of `wasd`.
        """
        self.path = path
        file = _open(path)
        try:
            file, self.breaks_off = _with_index(file)
            self._reader: Any = make_reader(file, validate_crcs=True)
            summary: Any = self._reader.get_summary()
            metadata = {one.name: one.metadata for one in self._reader.iter_metadata()}
            counts = summary.statistics.channel_message_counts
            self.topics = [
                Topic(one.topic, summary.schemas[one.schema_id].name, int(counts.get(key, 0)))
                for key, one in sorted(summary.channels.items(), key=lambda item: item[1].topic)
            ]
            self.start = int(summary.statistics.message_start_time)
            self.end = int(summary.statistics.message_end_time)
        except OSError as error:
            raise RecordingError(f'{path}: {one_line(error)}') from None
        except CRCValidationError as error:
            raise RecordingError(f'{path}: damaged ({one_line(error)})') from None
        except Exception as error:  # mcap raises whatever a wrong byte leads to
            raise RecordingError(f'{path}: no MCAP recording ({one_line(error)})') from None
        if RECORD_NAME not in metadata:
            short = ', or broken off at its beginning' if not self.topics else ''
            raise RecordingError(f'{path}: not recorded by `wasd ... --record`{short}')
        self.run: dict[str, str] = metadata[RECORD_NAME]

    def messages(self, topics: Collection[str]) -> Iterator[RecordedMessage]:
        """
        Yield the messages of some topics in the order in which they were published.

        Raises:
            RecordingError: the file is damaged.
        """
        try:
            for schema, channel, message in self._reader.iter_messages(topics=list(topics)):
                yield RecordedMessage(channel.topic, message.log_time, message.data, schema.name)
        except Exception as error:
            raise RecordingError(f'{self.path}: damaged ({one_line(error)})') from None

    def read(self, message: RecordedMessage, kind: type) -> Any:
        """
        Return a message of a type.

        Raises:
            RecordingError: it is none.
        """
        with contextlib.suppress(RuntimeError, ValueError):  # of rmw; of text that is not UTF-8
            if message.kind.endswith(f'/{kind.__name__}'):
                return deserialize_message(message.data, kind)
        at = f'{message.topic} at {1e-9 * message.time:.2f} s'
        raise RecordingError(f'{self.path}: damaged: {at} is no {kind.__name__}')


def _open(path: Path) -> BinaryIO:
    """Open a file that may be a recording; refuse one that is empty or no file."""
    try:
        if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():
            raise RecordingError(f'{path}: is a device or pipe, wanted a file')
        file = path.open('rb')
        is_empty = not file.read(1)
    except OSError as error:
        raise RecordingError(f'{path}: {one_line(error)}') from None
    if is_empty:
        raise RecordingError(f'{path}: is empty')
    return file


def _with_index(file: BinaryIO) -> tuple[BinaryIO, bool]:
    """
    Return a recording, or of one without an index a copy with one, and whether it breaks off.

    The copy has all whole chunks.

    Raises:
        CRCValidationError: a chunk is damaged.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - len(MCAP0_MAGIC)))
    # Shorter is no more than a beginning, which ends in the same bytes.
    is_whole = file.read() == MCAP0_MAGIC and size > FOOTER_SIZE + 2 * len(MCAP0_MAGIC)
    file.seek(0)
    if is_whole:
        return file, False
    copy: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115
    writer = new_writer(copy)
    breaks_off = True
    with contextlib.suppress(EndOfFile, struct.error):  # of a record that is not whole
        for record in StreamReader(file, validate_crcs=True).records:
            if isinstance(record, DataEnd):
                breaks_off = False
                break
            _write_again(writer, record)
    writer.finish()
    copy.seek(0)
    return copy, breaks_off


def _write_again(writer: Writer, record: McapRecord) -> None:
    """Copy a record; channels and schemas have the same numbers as they come in the same order."""
    if isinstance(record, Metadata):
        writer.add_metadata(record.name, record.metadata)
    elif isinstance(record, Schema):
        writer.register_schema(record.name, record.encoding, record.data)
    elif isinstance(record, Channel):
        encoding, schema = record.message_encoding, record.schema_id
        writer.register_channel(record.topic, encoding, schema, record.metadata)
    elif isinstance(record, Message):
        writer.add_message(record.channel_id, record.log_time, record.data, record.publish_time)


KEYS = 'keys'
VELOCITIES = 'cmd_vel'
DESCRIPTION = 'robot_description'
TRUTH = 'ground_truth/odom'
# Topics that a replay has to find under their own names.
REPLAYED = (KEYS, VELOCITIES, DESCRIPTION, TRUTH)
# Options that are recorded as they are; where one is missing, an older recording has the default.
PLAIN = (
    *('robot', 'description', 'world', 'layout', 'seed', 'lidar', 'interface', 'estimator'),
    *('limits', 'gait', 'mode', 'guard', 'eyes', 'policy', 'policy_config', 'height_scan'),
)


def describe_run(options: RunOptions, ros_arguments: Sequence[str] = ()) -> dict[str, str]:
    """Return what has to be known to run the same commands again, as JSON by name."""
    controller = options.controller
    kind, colon, _ = options.world.partition(':')
    run: dict[str, Any] = {name: getattr(options, name) for name in PLAIN} | {
        'description': _absolute(options.description, [*DESCRIPTIONS, *OTHERS]),
        'package_path': [str(path) for path in options.package_path],
        'world': options.world if colon and kind in TERRAINS else _absolute(options.world, WORLDS),
        'preset': _absolute(options.preset, [UNITREE_PRESET, *preset_names()]),
        'untold': asdict(options.untold),
        'controller': None if controller is None else str(controller.resolve()),
        # A walker that a script gives has no name.
        'policy': _absolute(options.policy) if isinstance(options.policy, str) else None,
        'policy_config': options.policy_config and _absolute(options.policy_config),
        'pushes': [push_text(push) for push in options.pushes],
        'boxes': [box_text(box) for box in options.boxes],
        'ros_arguments': _with_absolute_files(ros_arguments),
    }
    return {name: json.dumps(value) for name, value in run.items()}


def recorded_options(run: Mapping[str, str]) -> RunOptions:
    """
    Return the options of a recorded run, without its commands.

    Raises:
        RecordingError: it is of another version of this program.
    """
    try:
        known = {name: json.loads(value) for name, value in run.items()}
        controller = known['controller']
        types = inspect.get_annotations(RunOptions) | {'policy': str | None}
        for name in (name for name in PLAIN if name in known):
            check(name, known[name], types[name])
        SimulatorParameters.checked('seed', known.get('seed', 0))
        if known.get('layout', LAYOUTS[0]) not in LAYOUTS:
            raise UserError(f'layout: got {known["layout"]!r}, wanted {", ".join(LAYOUTS)}')
        robot = known['robot']
        preset = '' if robot == BOTH else ROBOTS[robot].preset
        if robot != BOTH and ROBOTS[robot].kind is not WHEELED:
            preset = known.get('preset', preset)  # wheels repeat velocities
            check('preset', preset, str)
        return RunOptions(
            **{name: known[name] for name in PLAIN if name in known},
            package_path=tuple(map(Path, known['package_path'])),
            preset=preset,
            untold=_untold(known.get('untold')),
            controller=None if controller is None else Path(controller),
            pushes=tuple(map(parse_push, known['pushes'])),
            boxes=tuple(map(parse_box, known.get('boxes', ()))),
        )
    except UserError as error:
        raise RecordingError(f'recorded by another version of wasd ({error})') from None
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f'recorded by another version of wasd ({error!r})') from None


def _untold(known: Mapping[str, Any] | None) -> Untold:
    if known is None:
        return Untold()
    payload = known['payload']
    payload = None if payload is None else Payload(payload[0], tuple(payload[1]))
    return Untold(**{**known, 'payload': payload})


def recorded_ros_arguments(run: Mapping[str, str]) -> list[str]:
    """
    Return the ROS arguments of a recorded run.

    Raises:
        RecordingError: they are none, or give other names to topics, which then cannot be told
            apart.
    """
    arguments: list[str] = json.loads(run.get('ros_arguments', '[]'))
    if not (isinstance(arguments, list) and all(isinstance(word, str) for word in arguments)):
        raise RecordingError(f'ros_arguments: got {shown(arguments)}, wanted a list of texts')
    for word in arguments:
        name, rule, _ = word.partition(':=')
        topic = f'/{name.rpartition(":")[2]}'
        if rule and topic.endswith(tuple(f'/{one}' for one in REPLAYED)):
            raise RecordingError(f'recorded with {word}: cannot be driven again')
    return arguments


def _absolute(words: str, names: Collection[str] = ()) -> str:
    """Return a file's path, or a plan's PICTURE,SCALE, from the root; other words as they are."""
    if words not in names and os.path.isfile(words):
        return str(Path(words).resolve())
    path, comma, scale = words.rpartition(',')
    return f'{_absolute(path)},{scale}' if comma else words


# Parameters that name files.
FILES = ('controller', 'policy', 'policy_config')


def _with_absolute_files(ros_arguments: Sequence[str]) -> list[str]:
    words = list(ros_arguments)
    for number, (option, word) in enumerate(itertools.pairwise(ros_arguments), start=1):
        name, rule, value = word.partition(':=')
        if option == '--params-file':
            words[number] = _absolute(word)
        elif option in ('-p', '--param') and name.rpartition(':')[2] in FILES:
            words[number] = f'{name}{rule}{_absolute(value)}'
    return words


def robot_topics(bag: BagReader, name: str) -> dict[str, str]:
    """
    Return the full names of a topic of every robot, by the robot's name.

    A robot alone has none, whichever namespace ROS arguments gave it.
    """
    found = {}
    is_alone = json.loads(bag.run['robot']) != BOTH
    for topic in bag.topics:
        namespace, _, last = topic.name[1:].rpartition(name)
        namespace = namespace.rstrip('/')
        if topic.name.endswith(f'/{name}') and not last and (is_alone or '/' not in namespace):
            found['' if is_alone else namespace] = topic.name
    return found


def _age_of(twist: Twist | TwistStamped, time: float) -> float:
    """Return how old a velocity was by its stamp when it came [s]; 0 without a stamp."""
    if isinstance(twist, Twist):
        return 0.0
    # One that was too old is not in the recording.
    return judge_stamp(to_seconds(twist.header.stamp), to_seconds(to_stamp(time)), 0.0).age or 0.0


def read_commands(bag: BagReader) -> tuple[Command, ...]:
    """
    Return everything that commanded the robots, in the order in which it came.

    Raises:
        RecordingError: the file is damaged, or a program did what is in no message.
    """
    keys = {topic: namespace for namespace, topic in robot_topics(bag, KEYS).items()}
    velocities = {topic: namespace for namespace, topic in robot_topics(bag, VELOCITIES).items()}
    commands = []
    for message in bag.messages([*keys, *velocities, EVENTS]):
        time = 1e-9 * message.time
        if message.topic in velocities:
            twist = bag.read(message, VELOCITY_TYPES.get(message.kind, Twist))
            came = Command(time, velocities[message.topic], velocity=to_velocity(twist))
            commands.append(came._replace(age=_age_of(twist, time)))
        else:
            text = bag.read(message, String).data
            if message.topic in keys:
                commands.append(Command(time, keys[message.topic], key=text))
            elif text == 'program':
                did = 'an SDK program had the motors, or switched a guard on'
                raise RecordingError(f'{bag.path}: {did}: cannot be driven again')
            else:
                commands.append(Command(time, '', event=text))
    return tuple(commands)
