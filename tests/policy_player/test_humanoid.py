# SPDX-License-Identifier: Apache-2.0
"""A G1 in a run: on the hoist, in a pose, by a network, pushed, down, and back."""

import numpy as np
from policy_files import constant, layers, mjlab, onnx
from policy_player.stands import G1_JOINTS, g1_stand
import pytest
from teleop_keyboard.keymap_file import preset_names
from terminals import wait_until
import wasd
from wasd_bringup.page.bridge import CockpitBridge
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_cockpit.link import Order
from wasd_core.errors import UserError

pytestmark = [pytest.mark.long, pytest.mark.slow]
pytest.importorskip('onnxruntime')
STAND = g1_stand(G1_JOINTS)


def network(folder, joints=G1_JOINTS, weights=None):
    """Return the file of a network that holds the pose, or one of random weights."""
    count = len(joints)
    pose = STAND.position if joints == G1_JOINTS else np.zeros(count)

    def listed(values):
        return ','.join(f'{value:.4f}' for value in values)

    told = mjlab(
        joints,
        default_joint_pos=listed(pose),
        joint_stiffness=listed(STAND.stiffness) if joints == G1_JOINTS else '80',
        joint_damping=listed(STAND.damping) if joints == G1_JOINTS else '2',
    )
    path = folder / 'walk.onnx'
    made = weights or constant(9 + 3 * count, np.zeros(count))
    path.write_bytes(onnx(*made, told))
    return str(path)


@pytest.fixture
def run_of(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    runs = []

    def make(**more):
        options = {'robot': 'g1', 'description': 'g1', 'preset': 'wasd', 'speed': 0.0, **more}
        runs.append(Run(RunOptions(**options)))
        return runs[-1]

    yield make
    for run in runs:
        run.close()


def pass_time(run, seconds):
    """Simulate; return the least height and the largest tilt on the way."""
    heights, tilts = [], []
    for _ in range(round(seconds / 0.02)):
        run.simulation.advance(20)
        base = run.world.base()
        heights.append(float(base.position[2]))
        tilts.append(base.tilt)
        assert np.isfinite(run.world.data.qpos).all()
    return min(heights), max(tilts)


def test_it_is_held_stands_is_pushed_falls_is_raised_and_put_back(run_of):
    run = run_of()
    robot = run.robot
    start = float(run.world.base().position[2])
    lowest, tilt = pass_time(run, 1.0)  # limp, on the hoist
    assert robot.state == 'passive'
    assert (lowest > start - 0.02, tilt < 0.1) == (True, True)
    run.press('2')
    pass_time(run, 1.5)
    run.press('h')
    assert robot.notice.text == 'the hoist has let go'
    lowest, tilt = pass_time(run, 2.5)  # by its gains alone
    assert (lowest > start - 0.02, tilt < 0.1) == (True, True)
    assert (
        robot.world.contact_forces(['left_ankle_roll_link', 'right_ankle_roll_link']).min() > 100
    )
    run.world.push((60.0, 0.0, 0.0), 0.1)
    assert pass_time(run, 2.0)[1] < 0.3
    run.world.push((0.0, 400.0, 0.0), 0.3)
    lowest, tilt = pass_time(run, 2.0)
    assert (robot.state, robot.status().state) == ('passive', 'fallen')
    assert lowest < 0.4
    assert robot.notice.text.startswith('fallen: h raises it, BACKSPACE puts it back')
    run.press('2')
    assert robot.state == 'passive'
    run.press('h')
    pass_time(run, 4.5)
    assert run.world.base().tilt < 0.15
    assert float(run.world.base().position[2]) > start - 0.03
    run.press('2')
    pass_time(run, 1.5)
    assert robot.state == 'stand'
    assert run.world.base().tilt < 0.05
    run.press('h')
    assert pass_time(run, 2.0)[1] < 0.15
    run.press('BACKSPACE')
    np.testing.assert_allclose(run.world.base().position, (0.0, 0.0, start), atol=1e-9)
    assert (robot.state, robot.hoist.is_on) == ('passive', True)
    assert pass_time(run, 0.5)[1] < 0.1


@pytest.mark.parametrize('preset', preset_names())
def test_no_keymap_takes_the_key_of_the_hoist(run_of, preset):
    if preset == 'go2':
        words = '--preset go2: g1 needs the key h itself .hoist.: take another preset'
        with pytest.raises(UserError, match=words):
            run_of(preset=preset)
    else:
        run = run_of(preset=preset)
        assert run.robot.hoist.is_on
        run.press('h')
        assert not run.robot.hoist.is_on


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({'map': ''}, '--map: nothing estimates where g1 is'),
        ({'guard': True}, '--guard: g1 has no controller that a guard can limit'),
    ],
)
def test_what_it_cannot_do_is_refused_without_a_cure_that_is_none(run_of, given, words):
    with pytest.raises(UserError, match=words):
        run_of(**given)


def test_one_that_hung_limp_and_stood_up_on_the_hoist_stands_without(run_of):
    run = run_of(seed=4)
    pass_time(run, 1.0)
    run.press('2')
    pass_time(run, 1.0)
    run.world.push((120.0, 120.0, 0.0), 0.2)
    pass_time(run, 3.0)
    assert run.world.base().tilt < 0.05
    run.press('h')
    assert pass_time(run, 2.5)[1] < 0.1


def test_a_network_that_holds_the_pose_takes_over_on_the_hoist_and_is_driven(run_of, tmp_path):
    run = run_of(policy=network(tmp_path))
    robot = run.robot
    run.press('w')
    pass_time(run, 0.1)
    assert robot.notice.text.startswith('press 2, then p to walk')
    assert robot.refusal == 'press 2 to stand, then p'
    run.press('SPACE')
    run.press('2')
    pass_time(run, 2.0)
    run.press('p')
    pass_time(run, 0.5)
    run.press('h')
    robot.drive((0.4, 0.0, 0.1), 'script')
    _, tilt = pass_time(run, 0.4)
    assert (robot.state, robot.refusal) == ('policy', '')
    assert 0.2 < robot.sample().command[0] < 0.4
    assert tilt < 0.1
    run.e_stop('test')
    pass_time(run, 1.2)
    assert robot.state == 'passive'
    assert not robot.sample().command[0]
    assert run.world.base().position[2] < 0.6  # limp, without the hoist


def test_a_random_network_falls_into_damping_and_is_said(run_of, tmp_path):
    weights = layers(np.random.default_rng(1), 96, 32, 29)
    weights[0][-1][:] *= 8.0
    run = run_of(policy=network(tmp_path, weights=weights))
    run.press('2')
    pass_time(run, 2.0)
    run.press('p')
    run.press('h')
    pass_time(run, 2.5)
    assert run.robot.status().state == 'fallen'
    assert run.robot.state == 'passive'


def test_any_keys_in_any_order_break_nothing(run_of, tmp_path):
    random = np.random.default_rng(7)
    weights = layers(random, 96, 32, 29)
    run = run_of(policy=network(tmp_path, weights=weights))
    keys = [
        '1',
        '2',
        'p',
        'h',
        'w',
        's',
        'a',
        'd',
        'q',
        'e',
        'r',
        'SPACE',
        'BACKSPACE',
        'ESC',
        '?',
    ]
    states = set()
    for _ in range(60):
        run.press(str(random.choice(keys, p=[0.02, 0.3, 0.3, *[0.38 / 12] * 12])))
        if random.random() < 0.1:
            run.world.push(random.normal(0.0, 150.0, 3), 0.1)
        pass_time(run, 0.15)
        states.add(run.robot.state)
        run.robot.status()
    assert run.world.actuation.rejected_commands == 0
    assert states == {'passive', 'stand', 'policy'}


def test_the_page_shows_its_states_and_presses_them(run_of, tmp_path):
    run = run_of(policy=network(tmp_path))
    bridge = CockpitBridge(run)
    try:
        bridge.attach('http://127.0.0.1:1/')
        pass_time(run, 0.2)
        bridge.step(0.0, 1.0 / 60.0)
        shown = bridge._link.snapshot
        assert [choice.name for choice in shown.choices] == ['passive', 'stand', 'policy', 'hoist']
        assert [choice.is_on for choice in shown.choices] == [True, False, False, True]
        bridge._link.order(Order('key', '2'))
        bridge.step(1.0, 1.0 / 60.0)
        pass_time(run, 2.0)
        for now in (2.0, 3.0, 4.0):  # why a button does nothing is asked in one of three
            bridge.step(now, 1.0 / 60.0)
        assert bridge._link.snapshot.state == 'stand'
        assert not any(choice.refusal for choice in bridge._link.snapshot.choices)
    finally:
        bridge.close()


def test_another_biped_is_held_and_moved_by_a_network_of_its_joints(run_of, tmp_path):
    from robot_description.description import load_robot
    from robot_description.packages import share_directory

    path = str(share_directory('bolt_description') / 'robots/bolt.urdf')
    with pytest.raises(
        UserError, match=r'biped.*wasd has no controller of its own for two legs.*--policy FILE'
    ):
        run_of(description=path)
    joints = tuple(joint.name for joint in load_robot(path).robot.movable_joints)
    run = run_of(description=path, policy=network(tmp_path, joints))
    _, tilt = pass_time(run, 1.0)
    assert tilt < 0.3
    for keys, seconds in (('2', 2.0), ('p', 0.5), ('h', 1.5)):
        run.press(keys)
        pass_time(run, seconds)
    with pytest.raises(UserError, match='29 joints of .* are none of it|is not in this robot'):
        run_of(policy=network(tmp_path, joints))


def test_what_is_drawn_for_four_legs_is_refused():
    with pytest.raises(UserError, match='^randomise: a quadruped is wanted'):
        wasd.G1(untold=wasd.Untold(randomise=1.0))


def test_each_cure_is_what_its_driver_has(run_of):
    robot, script = run_of().robot, wasd.G1()
    robot.controller.is_fallen = script._robot.controller.is_fallen = True
    assert robot.controller.refusal('p').startswith('give --policy FILE:')
    assert robot.controller.refusal('2').startswith('raise it by h, or put it back by BACKSPACE')
    with pytest.raises(UserError, match='^give policy=FILE:'):
        script.press('p')
    with pytest.raises(UserError, match=r"^raise it by press\('h'\), or put it back by reset\(\)"):
        script.press('2')


def test_a_script_has_it_stand_and_driven(tmp_path):
    robot = wasd.G1(seed=2, policy=network(tmp_path))
    assert (robot.state, robot.is_held) == ('passive', True)
    with pytest.raises(UserError, match='press 2 to stand, then p'):
        robot.press('p')
    with pytest.raises(UserError, match='wanted 1, 2, p, h'):
        robot.press('4')
    with pytest.raises(UserError, match='needs the state policy'):
        robot.drive(0.3)
    robot.press('2')
    robot.run(2.0)
    robot.press('p')
    robot.run(0.5)
    robot.press('h')
    robot.drive(0.3)
    robot.run(1.0)
    assert (robot.state, robot.is_held) == ('policy', False)
    assert robot._robot.sample().command[0] == pytest.approx(0.3)
    assert robot.truth.tilt < 0.1
    robot.press('h')
    robot.run(1.0)
    assert robot._robot.sample().command[0] == pytest.approx(0.3)
    robot.press('ESC')
    assert robot.state == 'passive'
    robot.reset()
    assert (robot.state, robot.is_held) == ('passive', True)
    again = wasd.G1(seed=2, policy=network(tmp_path))
    again.run(0.5)
    robot.run(0.5)
    np.testing.assert_array_equal(robot.truth.position, again.truth.position)


def test_other_processes_press_its_keys_drive_it_and_hear_its_state(ros, tmp_path):
    from geometry_msgs.msg import Twist
    import rclpy
    from sensor_msgs.msg import Imu, JointState
    from std_msgs.msg import String
    from wasd_bringup.ros.face import make_ros_run
    from wasd_core.topics import LATCHED

    run = make_ros_run(
        RunOptions(
            robot='g1', description='g1', preset='wasd', speed=0.0, policy=network(tmp_path)
        )
    )
    peer = rclpy.create_node('peer')
    keys = peer.create_publisher(String, 'keys', 10)
    twists = peer.create_publisher(Twist, 'cmd_vel', 10)
    heard = {'state': [], 'joint_states': [], 'imu/data': []}
    for topic, kind in (('state', String), ('joint_states', JointState), ('imu/data', Imu)):
        quality = LATCHED if topic == 'state' else 10
        peer.create_subscription(kind, topic, heard[topic].append, quality)

    def until(is_so, act=lambda: None):
        def look():
            act()
            run.simulation.advance(20)
            run.face.handle(0.02)
            rclpy.spin_once(peer, timeout_sec=0.0)
            return is_so()

        wait_until(look)

    def state():
        return heard['state'][-1].data if heard['state'] else ''

    try:
        until(lambda: state() == 'passive')
        until(lambda: state() == 'stand', lambda: keys.publish(String(data='2')))
        until(lambda: state() == 'policy', lambda: keys.publish(String(data='p')))
        ahead = Twist()
        ahead.linear.x = 0.3
        until(lambda: run.robot.sample().command[0] > 0.2, lambda: twists.publish(ahead))
        until(lambda: len(heard['joint_states']) > 3 and heard['imu/data'])
        assert set(heard['joint_states'][-1].name) == set(G1_JOINTS)
        until(lambda: state() == 'passive', lambda: keys.publish(String(data='1')))
    finally:
        peer.destroy_node()
        run.close()


@pytest.mark.parametrize(('interactive', 'times'), [(False, 2), (True, 0)])
def test_a_refused_key_or_velocity_is_told_once_in_the_log_where_no_status_line_is(
    run_of, caplog, interactive, times
):
    (robot,) = run_of(interactive=interactive).robots
    robot.press('p', 'keys')
    for _ in range(3):
        robot.drive((0.3, 0.0, 0.0), 'script')
    said = [record.getMessage() for record in caplog.records]
    assert said == ['g1: give --policy FILE: there is no network to walk with'] * times
