# SPDX-License-Identifier: Apache-2.0
"""Every id of the SDK is answered at once, and the sport service does what its names say."""

import io
import itertools
import json
import math
from pathlib import Path
import random
import re

import numpy as np
from PIL import Image
import pytest
from quadruped_sim.keys import StateName
from unitree_bridge.bridge import INTO, OUT, SERVICES
from unitree_bridge.cdr import decode, encode
from unitree_bridge.motion import Motion
from unitree_bridge.remote import Remote
from unitree_bridge.rpc import BAD_PARAMETER, NOT_IMPLEMENTED, OK
from unitree_bridge.services import TRICKS
from unitree_bridge.shapes import STRING
from unitree_bridge.simulated import ALL_INTO
from unitree_rig import GOLDEN, low_cmd, request, Rig
from wasd_core.errors import UserError
from wasd_core.rotations import matrix_from_quaternion, rpy_from_matrix

from unitree_bridge import topics

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs/unitree.md').read_text()
SDK = json.loads((GOLDEN / 'ids.json').read_text())
# What asks for nothing but an answer, and parameters that please all others.
PARAMETERS = {'x': 0.0, 'y': 0.0, 'z': 0.0, 'yaw': 0.0, 'mode': 0, 'data': 1, 'enable': 1}
PARAMETERS |= {'name': 'mcf', 'switch': 1, 'silent': 0, 'volume': 3, 'brightness': 4}
PARAMETERS |= {'is_remote_commands_from_api': True}
DAMP, STAND_UP, BALANCE, STAND_DOWN, MOVE, STOP = 1001, 1004, 1002, 1005, 1008, 1003


def unheard(**options):
    """Return a robot whose LowStates, five hundred a second, nobody hears."""
    rig = Rig(**options)
    rig.wire.unheard.add(topics.LOW_STATE.name)
    return rig


def hear(rig, *wanted):
    """Listen to topics that take long."""
    rig.wire.unheard.difference_update(topic.name for topic in wanted)


@pytest.fixture
def rig():
    return unheard()


@pytest.fixture(scope='module')
def dog():
    """Return the robot of all tests that do not mind what it did before."""
    return unheard()


@pytest.fixture
def standing(dog):
    """Return that robot on its legs, at rest."""
    if dog.state == 'passive':
        dog.call('sport', STAND_UP)
        dog.run(2.2)
    elif dog.go2.bridge.motion.is_moving:
        dog.call('sport', STOP)
        dog.run(1.0)
    return dog


def test_all_services_that_the_sdk_has_clients_of_are_here():
    assert set(SERVICES) == set(SDK)
    names = {topic.name for topic in (*INTO, *OUT)}
    for service in SDK:
        assert {f'rt/api/{service}/request', f'rt/api/{service}/response'} <= names


def test_the_page_names_every_call_of_the_sport_service_that_is_no_trick():
    (row,) = (line for line in PAGE.splitlines() if line.startswith('| `sport` |'))
    listed = re.sub(r'\([^)]*\)', '', row.split('|')[2]).replace(' and Get', ', AutoRecoveryGet')
    names = {name.strip().upper().replace('SET', '_SET') for name in listed.split(',')}
    names = {name.replace('RECOVERYGET', 'RECOVERY_GET') for name in names}
    known = {name for name, api_id in SDK['sport']['ids'].items() if api_id not in TRICKS}
    assert names | {'FREEAVOID', 'SWITCHAVOIDMODE'} == known


def test_the_remappings_are_of_our_topics():
    text = (ROOT / 'unitree_bridge/config/go2_ros2_sdk.remap').read_text()
    rules = [line.removeprefix('-r ').split(':=') for line in text.splitlines() if line[0] != '#']
    topics = (ROOT / 'docs/topics.md').read_text()
    assert rules
    for ours, _ in rules:
        assert f'`{ours}`' in topics


@pytest.mark.slow
def test_every_id_of_the_sdk_is_answered_at_once(rig, monkeypatch):
    # A picture needs a renderer, which not every machine has.
    monkeypatch.setattr(rig.go2.robot, 'picture', lambda: b'\xff\xd8\xff')
    codes = {}
    for service, said in SDK.items():
        assert rig.call(service, 1)[:2] == (OK, said['version'])
        for api_id in said['ids'].values():
            # `call` simulates 2 ms, and finds the one answer after them.
            codes[service, api_id] = rig.call(service, api_id, **PARAMETERS)[0]
    assert set(codes.values()) == {OK, NOT_IMPLEMENTED}
    refused = {key for key, code in codes.items() if code == NOT_IMPLEMENTED}
    # Without a guard nothing can be avoided.
    avoiding = {('sport', 2048), ('sport', 2058), ('obstacles_avoid', 1001)}
    assert refused == {('sport', trick) for trick in TRICKS} | avoiding


@pytest.mark.slow
def test_ids_that_nobody_knows_are_answered_3203(dog):
    for service in SDK:
        for api_id in (0, -1, 2, 999, 1999, 2**62):
            assert dog.call(service, api_id) == (NOT_IMPLEMENTED, '', b''), service


@pytest.mark.slow
def test_a_trick_is_said_to_be_none_once(dog):
    for _ in range(5):
        assert dog.call('sport', 1030)[0] == NOT_IMPLEMENTED
    assert [line for line in dog.said if 'FrontFlip' in line] == [
        'sport: FrontFlip (1030) is not simulated (answered 3203)'
    ]


@pytest.mark.slow
def test_who_wants_no_answer_gets_none(standing):
    assert standing.call('sport', STAND_UP, noreply=True) is None
    assert standing.call('sport', 999, noreply=True) is None


MEANINGLESS = (
    *('{"x": NaN, "y": 0, "z": 0}', '{"x": 1e999, "y": 0, "z": 0}', '{"x": "1"}', '[]', '7'),
    *('{', '[' * 100_000, '{"x": ' + '9' * 400 + ', "y": 0, "z": 0}', '{}', 'null'),
)


@pytest.mark.slow
def test_parameters_that_mean_nothing_are_refused_and_move_nothing(standing):
    before = standing.position
    topic = 'rt/api/sport/response'
    for parameter, api_id in itertools.product(MEANINGLESS, (MOVE, 1007)):
        told = len(standing.wire.told[topic])
        standing.wire.come['rt/api/sport/request'].append(request(1, api_id, parameter))
        standing.run(0.05)
        (answer,) = standing.wire.told[topic][told:]
        code = decode(topics.response('sport').shape, answer)['header']['status']['code']
        assert code == BAD_PARAMETER, parameter[:40]
    standing.run(0.5)
    assert np.abs(standing.position - before).max() < 2e-3
    assert standing.state == 'fixed stand'


@pytest.mark.slow
def test_a_refusal_that_is_not_answered_is_said(dog):
    assert dog.call('sport', MOVE, noreply=True, x=math.nan, y=0.0, z=0.0) is None
    assert dog.said[-1] == 'sport: request 1008 refused with 3204'


@pytest.mark.slow
def test_a_speed_level_that_there_is_not_is_refused(dog):
    for level in (7, -100, 0.5):
        assert dog.call('sport', 1015, data=level)[0] == BAD_PARAMETER
    assert dog.call('sport', 1015, data=1)[0] == OK


@pytest.mark.slow
def test_motors_that_are_released_are_said_to_be_without_a_lowcmd(rig):
    said = []
    rig.go2.legs.on_said = said.append
    rig.call('motion_switcher', 1003)
    assert rig.said == ['the motors are released; our controller is stopped']
    assert said == []


class Playing:
    """A robot of `Motion` that walks by a network; what it is told."""

    state = coming_state = StateName.POLICY
    time = 0.0

    def __init__(self):
        self.driven, self.pressed = [], []

    def drive(self, velocity):
        self.driven.append(velocity)
        return True

    def press(self, key):
        self.pressed.append(key)
        return True


def test_a_move_drives_the_network_that_walks():
    robot = Playing()
    motion = Motion(robot, print)
    assert motion.move((0.4, 0.0, 0.0))
    motion.step(0.002)
    assert (robot.driven, robot.pressed) == ([(0.4, 0.0, 0.0)], [])


@pytest.mark.filterwarnings('error')
def test_a_lean_by_any_number_is_a_lean_to_the_end():
    motion = Motion(Playing(), print)
    motion.lean(1e308, -1e308, 0.0)
    assert motion._lean == (20, -20, 0)


@pytest.mark.slow
def test_gaits_are_chosen_by_their_calls(standing):
    for api_id, parameter, gait in [
        *((1061, {}, 'walk'), (1062, {}, 'trot'), (2046, {'data': True}, 'bound')),
        *((2046, {'data': False}, 'trot'), (2047, {'data': True}, 'pronk'), (1063, {}, 'trot')),
    ]:
        assert standing.call('sport', api_id, **parameter)[0] == OK
        assert standing.go2.robot.gait == gait


@pytest.mark.slow
def test_euler_leans_by_its_angles(standing):
    standing.call('sport', BALANCE)
    standing.run(0.5)
    start = rpy_from_matrix(matrix_from_quaternion(standing.go2.world.base().orientation))
    for roll, pitch, yaw in ((0.2, 0.0, 0.0), (0.0, 0.15, 0.0), (-0.1, 0.1, 0.2)):
        standing.call('sport', 1007, x=roll, y=pitch, z=yaw)
        standing.run(1.0)
        base = standing.go2.world.base()
        leant = rpy_from_matrix(matrix_from_quaternion(base.orientation)) - start
        assert leant == pytest.approx(np.array((roll, pitch, yaw)), abs=math.radians(2.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ('first', 'second', 'state'),
    [
        (STAND_UP, DAMP, 'passive'),
        (DAMP, STAND_UP, 'fixed stand'),
        (BALANCE, STAND_UP, 'fixed stand'),
    ],
)
def test_of_two_calls_one_after_the_other_the_last_counts(standing, first, second, state):
    if first == STAND_UP:
        standing.call('sport', DAMP)
        standing.run(0.3)
    for api_id in (first, second):
        assert standing.call('sport', api_id)[0] == OK
    standing.run(1.6)
    assert standing.state == state


@pytest.mark.slow
def test_stand_up_stands_within_three_seconds_and_stand_down_lies(rig):
    assert rig.call('sport', STAND_UP)[0] == OK
    rig.run(3.0)
    assert rig.position[2] > 0.3
    assert rig.sport_state['mode'] == 6  # locked
    rig.call('sport', STAND_DOWN)
    rig.run(3.0)
    assert rig.position[2] < 0.15
    assert (rig.state, rig.sport_state['mode']) == ('passive', 7)
    rig.call('sport', STAND_DOWN)
    rig.run(0.5)
    assert rig.state == 'passive'


@pytest.mark.slow
def test_move_at_0_3_for_four_seconds_is_a_metre_and_a_fifth(standing):
    rig = standing
    start = rig.position[0]
    for _ in range(40):
        rig.call('sport', MOVE, noreply=True, x=0.3, y=0.0, z=0.0)
        rig.run(0.098)
    rig.call('sport', STOP)
    rig.run(1.0)
    assert rig.position[0] - start == pytest.approx(1.2, rel=0.05)
    assert np.hypot(*rig.go2.world.base().linear_velocity[:2]) < 0.05


@pytest.mark.slow
def test_a_move_that_nobody_repeats_ends_after_a_second(standing):
    standing.call('sport', MOVE, noreply=True, x=0.3, y=0.0, z=0.0)
    standing.run(0.9)
    assert standing.go2.bridge.motion.is_moving
    standing.run(1.2)
    assert not standing.go2.bridge.motion.is_moving
    before = standing.position
    standing.run(0.3)
    assert np.abs(standing.position - before)[:2].max() < 0.01
    assert standing.position[2] > 0.2


@pytest.mark.slow
def test_a_robot_that_lies_does_not_move(rig):
    rig.call('sport', MOVE, noreply=True, x=0.3, y=0.0, z=0.0)
    rig.run(0.5)
    assert rig.state == 'passive'
    assert 'sport: Move has no effect on a lying robot (StandUp first)' in rig.said


@pytest.mark.slow
def test_a_robot_that_walks_goes_on_where_it_balances(standing):
    for _ in range(5):
        standing.call('sport', MOVE, noreply=True, x=0.3, y=0.0, z=0.0)
        standing.run(0.1)
    assert standing.state == 'move base'
    standing.call('sport', BALANCE)
    standing.run(1.2)
    assert standing.state == 'free stand'
    standing.call('sport', MOVE, noreply=True, x=0.0, y=0.0, z=0.5)
    standing.run(0.3)
    assert standing.state == 'move base'


@pytest.mark.slow
def test_the_slow_speed_level_is_unitree_guide_s(standing):
    standing.call('sport', 1015, data=-1)
    for _ in range(40):
        standing.call('sport', MOVE, noreply=True, x=2.0, y=0.0, z=0.0)
        standing.run(0.05)
    ahead = standing.go2.world.base().planar_velocity[0]
    standing.call('sport', 1015, data=0)
    assert ahead == pytest.approx(0.4, abs=0.08)


@pytest.mark.slow
def test_damp_lets_go_in_the_midst_of_anything(standing):
    for _ in range(5):
        standing.call('sport', MOVE, noreply=True, x=0.5, y=0.0, z=0.0)
        standing.run(0.1)
    standing.call('sport', 1001)
    standing.run(0.01)
    assert standing.state == 'passive'
    assert not standing.go2.bridge.motion.is_moving


@pytest.mark.slow
def test_buttons_count_again_after_a_program_that_held_them_has_died(standing):
    def damp(seconds=0.5):
        for _ in range(round(seconds / 0.02)):
            remote = Remote(down=frozenset({'L2', 'B'}))
            standing.wire.come['rt/wirelesscontroller'].append(remote.message())
            standing.run(0.02)

    damp()
    assert standing.state == 'passive'
    standing.run(0.8)
    standing.call('sport', STAND_UP)
    standing.run(1.0)
    assert standing.state == 'fixed stand'
    damp()
    assert standing.state == 'passive'
    # What a remote says while it is not followed keeps nothing down.
    standing.call('sport', 1027, data=False)
    standing.call('sport', STAND_UP)
    damp(1.0)
    assert standing.state == 'fixed stand'
    standing.call('sport', 1027, data=True)
    damp()
    assert standing.state == 'passive'


@pytest.mark.slow
def test_the_remote_of_a_program_drives_and_its_silence_stops(standing):
    def hold(seconds, **sticks):
        for _ in range(round(seconds / 0.02)):
            standing.wire.come['rt/wirelesscontroller'].append(Remote(**sticks).message())
            standing.run(0.02)

    hold(1.2, ly=0.25)
    assert standing.go2.world.base().planar_velocity[0] > 0.2
    standing.run(1.0)
    assert abs(standing.go2.world.base().planar_velocity[0]) < 0.05
    hold(0.1, down=frozenset({'L2', 'B'}))
    assert standing.state == 'passive'
    hold(0.1)
    hold(0.1, down=frozenset({'L2', 'A'}))
    standing.run(1.6)
    assert (standing.state, standing.position[2] > 0.3) == ('fixed stand', True)
    standing.call('sport', 1027, data=False)
    hold(0.5, ly=1.0)
    assert standing.state == 'fixed stand'


@pytest.mark.slow
def test_robot_state_switches_the_sport_mode(rig):
    def status():
        return {
            each['name']: each['status'] for each in json.loads(rig.call('robot_state', 1003)[1])
        }

    assert status()['sport_mode'] == 1
    off = rig.call('robot_state', 1001, name='sport_mode', switch=0)
    assert json.loads(off[1]) == {'name': 'sport_mode', 'status': 0}
    assert status()['sport_mode'] == 0
    assert rig.go2.bridge.low.is_released
    assert json.loads(rig.call('robot_state', 1001, name='sport', switch=0)[1])['status'] == 5


@pytest.mark.slow
def test_a_lease_is_given_once_until_it_is_not_renewed(dog):
    code, data, _ = dog.call('sport_lease', 101, name='a')
    assert (code, json.loads(data)['term']) == (OK, 1_000_000)
    assert dog.call('sport_lease', 101, name='b')[0] == 3207
    dog.run(0.8)
    assert dog.call('sport_lease', 102)[0] == OK
    dog.run(1.2)
    assert dog.call('sport_lease', 102)[0] == 3206
    assert dog.call('sport_lease', 101, name='b')[0] == OK


@pytest.mark.slow
def test_the_lidar_s_cloud_has_the_walls_where_they_are():
    rig = unheard(world='room')
    hear(rig, *topics.LIDAR_OUT)
    rig.run(0.5)
    said = rig.wire.last(topics.CLOUD)
    assert (said['header']['frame_id'], said['point_step']) == ('utlidar_lidar', 32)
    points = np.frombuffer(said['data'], '<f4').reshape(said['width'], 8)[:, :3]
    assert said['width'] > 300
    names = [field['name'] for field in said['fields']]
    assert ' '.join(names) == 'x y z intensity ring time'
    distances = np.linalg.norm(points, axis=1)
    assert (distances < 12.0).all()
    assert (distances > 1.5).sum() > 50
    assert rig.wire.last(topics.ROBOT_POSE)['header']['frame_id'] == 'odom'
    assert len(rig.wire.told['rt/utlidar/imu']) == 125
    rig.wire.come['rt/utlidar/switch'].append(encode(STRING, {'data': 'OFF'}))
    rig.run(0.01)
    told = {name: len(messages) for name, messages in rig.wire.told.items() if 'utlidar' in name}
    rig.run(0.5)
    assert told == {
        name: len(messages) for name, messages in rig.wire.told.items() if 'utlidar' in name
    }


def cloud_of(said):
    """Return the points of a cloud, (n, 3) [m], and their times [s]."""
    columns = np.frombuffer(said['data'], '<f4').reshape(said['width'], 8)
    return columns[:, :3].astype(float), columns[:, 6]


@pytest.mark.slow
def test_a_deskewed_cloud_has_the_floor_level_while_the_robot_trots_and_turns(rig):
    rig.call('sport', STAND_UP)
    rig.run(1.3)
    rig.call('sport', BALANCE)
    rig.run(0.7)
    hear(rig, topics.CLOUD_DESKEWED)
    rig.call('sport', MOVE, x=0.6, y=0.0, z=1.0)
    rig.run(0.9)
    said = rig.wire.last(topics.CLOUD_DESKEWED)
    points, _ = cloud_of(said)
    assert said['header']['frame_id'] == 'odom'
    truth = rig.go2.world.base()
    believed = rig.go2.legs.odometry
    assert np.linalg.norm(points[:, :2] - believed.position[:2], axis=1).max() < 12.0
    floor = points[points[:, 2] < truth.position[2] - 0.15]
    near = floor[np.linalg.norm(floor[:, :2] - believed.position[:2], axis=1) < 1.5]
    assert len(near) > 30
    ground = believed.position[2] - truth.position[2]  # where odometry has the floor
    assert abs(np.median(near[:, 2]) - ground) < 0.02
    assert near[:, 2].std() < 0.04  # the lidar's noise is 2 cm


@pytest.mark.slow
def test_the_height_map_has_the_floor_and_the_steps_where_programs_read_them():
    rig = unheard(world='stairs:0.13')
    rig.call('sport', STAND_UP)
    rig.run(1.3)
    assert 'rt/utlidar/height_map_array' not in rig.wire.told
    hear(rig, topics.HEIGHT_MAP)
    rig.run(1.5)
    assert 20 <= len(rig.wire.told['rt/utlidar/height_map_array']) <= 23
    said = rig.wire.last(topics.HEIGHT_MAP)
    assert (said['frame_id'], said['width'], said['height']) == ('odom', 100, 100)
    assert said['stamp'] == pytest.approx(rig.go2.world.time, abs=0.15)
    # As programs of the real one do it.
    known = {}
    for row in range(said['height']):
        for column in range(said['width']):
            height = said['data'][column + said['width'] * row]
            if height != np.float32(1e9):
                x = column * said['resolution'] + said['origin'][0]
                y = row * said['resolution'] + said['origin'][1]
                known[x, y] = height
    assert 0.2 < len(known) / 100**2 < 0.9
    off = rig.go2.legs.odometry.position - rig.go2.world.base().position
    heights = np.array([(x - off[0], y - off[1], z - off[2]) for (x, y), z in known.items()])
    x, z = heights[:, 0], heights[:, 2]
    assert np.abs(z[x < 0.74]).max() < 0.05
    assert np.median(np.abs(z[x < 0.74])) < 0.01
    step = z[(x > 0.86) & (x < 1.0)]
    assert len(step) > 50
    assert abs(np.median(step) - 0.13) < 0.015


@pytest.mark.slow
def test_the_front_video_has_three_sizes_of_one_picture():
    rig = unheard(world='room')
    hear(rig, topics.VIDEO)
    rig.run(0.41)
    assert len(rig.wire.told['rt/frontvideostream']) == 3
    said = rig.wire.last(topics.VIDEO)
    sizes = [Image.open(io.BytesIO(said[f'video{lines}p'])).size for lines in (720, 360, 180)]
    assert sizes == [(1280, 720), (640, 360), (320, 180)]
    assert said['time_frame'] == 400_000


@pytest.mark.slow
def test_the_first_picture_is_prepared_before_a_client_that_has_come_asks_for_one(monkeypatch):
    rig, taken = unheard(), []

    def picture():
        taken.append(rig.go2.robot.time)
        if len(taken) == 1:
            raise UserError('nothing renders here')
        return b'jpeg'

    monkeypatch.setattr(rig.go2.robot, 'picture', picture)
    rig.run(0.1)
    assert not taken
    hear(rig, topics.response('videohub'))
    rig.run(0.2)
    assert len(taken) == 1
    assert not any('picture' in line for line in rig.said)
    assert rig.call('videohub', 1001) == (OK, '', b'jpeg')


def fuzzed(topic, rng):
    """Return a message that is none, or nearly one that asks for nothing."""
    if topic.name.startswith('rt/api/'):
        whole = request(rng.randrange(2**40), rng.choice((1, 2, 1003, 7777)), '{"x": 1}')
        fixed = range(12, 20)  # the id, which may not become another
    elif topic.name == 'rt/lowcmd':
        whole, fixed = low_cmd(tau=20.0, is_sealed=False), ()
    elif topic.name == 'rt/wirelesscontroller':
        whole, fixed = Remote(lx=math.nan).message(), range(4, 8)
    else:
        whole, fixed = encode(STRING, {'data': 'ON'}), ()
    kind = rng.randrange(3)
    if kind == 0:
        return rng.randbytes(rng.randrange(200))
    if kind == 1:
        return whole[: rng.randrange(len(whole))]
    wrong = bytearray(whole)
    for _ in range(rng.randrange(1, 20)):
        place = rng.randrange(len(wrong))
        if place not in fixed:
            wrong[place] = rng.randrange(256)
    return bytes(wrong)


@pytest.mark.slow
def test_a_thousand_fuzzed_messages_of_each_topic_move_nothing():
    rig, quiet = unheard(), unheard()
    for topic in ALL_INTO:
        rng = random.Random(topic.name)
        rig.said.clear()
        for _ in range(100):
            wrong = [fuzzed(topic, rng) for _ in range(10)]
            rig.wire.come[topic.name] += wrong
            if topic.name == 'rt/lowcmd':  # of which the last of an instant is read
                assert not any(rig.go2.bridge.low.take(raw, lambda: True) for raw in wrong)
            rig.run(0.002)
        quiet.run(0.2)
        assert rig.state == quiet.state == 'passive', topic.name
        assert np.array_equal(rig.go2.world.data.qpos, quiet.go2.world.data.qpos), topic.name
        assert len(rig.said) <= 100, topic.name
