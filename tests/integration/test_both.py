# SPDX-License-Identifier: Apache-2.0
"""`wasd both`: two robots in one world, one keyboard, and no command that crosses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_types import store
from rosbags.rosbag2.storage_mcap import McapReader
from terminals import PATIENCE

pytestmark = pytest.mark.slow

# Who is driven, and which keys: go2 begins.
PARTS = (
    ('0.1 2\n1.2 4\n1.4 w*15', 2.0),
    ('2.05 i*24\n2.9 j*5', 3.1),
    ('3.15 a*8\n3.45 l*3', 3.6),
    ('3.65 u*6', 3.9),
    ('3.95 SPACE', 4.0),
)
DURATION = '4.1'
FIRST_OF_MBOT = 2.05e9  # [ns]
SCRIPT = '\n'.join(f'{keys}\n{end} TAB' for keys, end in PARTS)
GO2_KEYS = '\n'.join(keys for keys, _ in PARTS[0::2])
MBOT_KEYS = '\n'.join(keys for keys, _ in PARTS[1::2])


@pytest.fixture(scope='module')
def runner(new_runner: Any) -> Any:
    """Return what runs `wasd` in a folder of its own."""
    return new_runner()


@pytest.fixture(scope='module')
def both(runner: Any) -> dict[str, Any]:
    """Drive both by turns, recorded; return the report."""
    report: dict[str, Any] = runner.report(
        'both', '--duration', DURATION, '--record', 'both.mcap', play=SCRIPT
    )
    return report


@pytest.fixture(scope='module')
def bag(runner: Any, both: Any) -> dict[str, list[tuple[int, Any]]]:
    """Return the messages of that run, by topic."""
    reader = McapReader(Path(runner.folder / 'both.mcap'))
    reader.open()
    found: dict[str, list[tuple[int, Any]]] = {one.topic: [] for one in reader.connections}
    for one, at, data in reader.messages(reader.connections):
        found[one.topic].append((at, store().deserialize_cdr(data, one.msgtype)))
    reader.close()
    return found


@pytest.mark.parametrize(
    ('robot', 'keys'), [('go2', GO2_KEYS), ('mbot', MBOT_KEYS)], ids=['go2', 'mbot']
)
def test_each_robot_is_commanded_as_if_it_were_alone(
    runner: Any, both: dict[str, Any], robot: str, keys: str
) -> None:
    alone = runner.report(robot, '--duration', DURATION, play=keys)['samples']
    together = both['robots'][robot]['samples']
    assert together['command'] == alone['command']
    assert together['state'] == alone['state']
    assert np.abs(together['command']).max() > 0.1


def test_keys_and_velocities_go_to_the_robot_in_turn_only(bag: dict[str, Any]) -> None:
    assert '/keys' not in bag
    assert '/cmd_vel' not in bag
    turns = [0.0, *(end for _, end in PARTS)]
    for robot, remainder in (('go2', 0), ('mbot', 1)):
        for at, message in bag[f'/{robot}/keys']:
            turn = sum(start <= 1e-9 * at + 1e-6 for start in turns) - 1
            assert turn % 2 == remainder, (robot, at, message.data)
            assert message.data != 'TAB'
    pressed = [message.data for _, message in bag['/mbot/keys']]
    assert set(pressed) == {'i', 'j', 'u'}
    # Of mbot only, and not before its first key: the Go2's sticks are no velocities.
    assert bag['/mbot/cmd_vel'][0][0] >= FIRST_OF_MBOT


def test_who_is_not_driven_stays_where_it_is(both: dict[str, Any]) -> None:
    samples = both['robots']['mbot']['samples']
    until = samples['t'].index(PARTS[0][1])
    start = samples['position'][0]
    np.testing.assert_allclose(start[:2], [0.0, -0.6], atol=1e-6)
    np.testing.assert_allclose(samples['position'][until], start, atol=1e-3)
    go2 = both['robots']['go2']['samples']
    np.testing.assert_allclose(go2['position'][0][:2], [0.0, 0.6], atol=1e-3)
    assert go2['position'][until][0] > 0.1
    assert both['robots']['go2']['falls'] == 0
    assert samples['position'][-1][0] > 0.1


def test_odometry_of_each_is_counted_from_its_own_start(both: dict[str, Any], bag: Any) -> None:
    for robot in ('go2', 'mbot'):
        odometry = both['robots'][robot]['samples']['odom'][5]
        np.testing.assert_allclose(odometry, [0.0, 0.0, 0.0], atol=0.02)
        _, truth = bag[f'/{robot}/ground_truth/odom'][5]
        # The truth is in the one frame that both share, which no odometry drifts from.
        assert truth.header.frame_id == 'world'
        start = both['robots'][robot]['samples']['position'][0]
        assert abs(truth.pose.pose.position.y - start[1]) < 0.02


def test_one_clock_and_one_tree_of_frames(bag: dict[str, Any]) -> None:
    assert [topic for topic in bag if topic.endswith('/clock')] == ['/clock']
    if '/tf' not in bag:
        pytest.skip('tf2_msgs is not built')
    parents: dict[str, str] = {}
    for _, message in [*bag['/tf_static'], *bag['/tf']]:
        for transform in message.transforms:
            child, parent = transform.child_frame_id, transform.header.frame_id
            assert parents.setdefault(child, parent) == parent
    assert set(parents.values()) - set(parents) == {'world'}
    assert all(frame.startswith(('go2/', 'mbot/')) for frame in parents)


def test_driven_again_from_the_recording_both_go_the_same_way(runner: Any, both: Any) -> None:
    done = runner('replay', 'both.mcap', '--drive', timeout=PATIENCE)
    poses = 2 * len(both['robots']['go2']['samples']['t'])
    assert done.stdout == f'{poses} of {poses} recorded poses are identical\n', done.stderr
    assert done.returncode == 0
