# SPDX-License-Identifier: Apache-2.0
import functools
import gc
import weakref

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.simulation import Simulation, TickStatistics
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.world import build_shared_world
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory
from wasd_core.messages import to_joint_commands
from wasd_core.robot_io import JointCommand

pytestmark = pytest.mark.slow

WHEELS = ('left_wheel_joint', 'right_wheel_joint')


FOUR = '<robot name="four">{}{}</robot>'.format(
    '<link name="base"><inertial><mass value="5"/>'
    '<inertia ixx="0.05" iyy="0.07" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>',
    ''.join(
        f'<link name="{name}_link"><inertial><mass value="0.5"/>'
        '<inertia ixx="1e-3" iyy="2e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<collision><origin rpy="1.5707963 0 0"/><geometry>'
        '<cylinder radius="0.08" length="0.03"/></geometry></collision></link>'
        f'<joint name="{name}" type="continuous"><parent link="base"/><child link="{name}_link"/>'
        f'<origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>'
        for name, x, y in (
            ('fl', 0.1, 0.2), ('fr', 0.1, -0.2), ('bl', -0.1, 0.2), ('br', -0.1, -0.2)
        )
    ),
)  # fmt: skip


@pytest.mark.parametrize('head', ['', '/drive/diff_drive_controller:\n ros__parameters:\n'])
def test_wheels_that_the_controller_s_file_names_get_the_motors(spawn, tmp_path, head):
    (tmp_path / 'four.urdf').write_text(FOUR)
    (tmp_path / 'two.yaml').write_text(
        f'{head}  left_wheel_names: [bl]\n  right_wheel_names: [br]\n'
    )
    names = {'description': 'four.urdf', 'controller': 'two.yaml'}
    overrides = [Parameter(name, value=str(tmp_path / file)) for name, file in names.items()]
    node = spawn(SimulatorNode(parameter_overrides=overrides))
    world = node.simulation.world
    assert world.motor_names == ('bl', 'br')
    friction = world.model.geom_friction[:, 0]
    assert friction[world.model.geom('fl_link/0').id] == 0.0
    assert friction[world.model.geom('bl_link/0').id] == 1.0


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


def rolling(speed):
    """Return the message that lets both wheels turn at a speed [rad/s]."""
    zeros = np.zeros(2)
    command = JointCommand(zeros, np.full(2, speed), zeros, zeros, np.full(2, 0.3))
    return to_joint_commands(WHEELS, command, Time())


class Peer(Node):
    """Another node: collects what the simulator says, commands it, calls its services."""

    def __init__(self):
        super().__init__('peer')
        self.clock, self.states, self.truth, self.diagnostics = [], [], [], []
        self.create_subscription(Clock, '/clock', self.clock.append, 1000)
        self.create_subscription(JointState, 'joint_states', self.states.append, 1000)
        self.create_subscription(Odometry, 'ground_truth/odom', self.truth.append, 1000)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.diagnostics.append, 1000)
        self.commands = self.create_publisher(JointTrajectory, 'joint_commands', 10)


@pytest.fixture
def simulator(spawn, loaded, world):
    node = spawn(SimulatorNode(loaded, world))
    node.schedule_publishing()
    return node


@pytest.fixture
def peer(spawn, simulator, spin_until):
    peer = spawn(Peer())
    spin_until(spawn.pump, lambda: peer.commands.get_subscription_count() > 0)
    return peer


@pytest.fixture
def run(spawn, simulator):
    """Return a function that simulates for so many steps and handles messages meanwhile."""

    def run(steps):
        for _ in range(steps // 10):
            simulator.simulation.advance(10)
            spawn.pump.handle(0.001)

    return run


@pytest.fixture
def call(spawn, peer, spin_until):
    """Return a function that calls a service of the simulator and returns the response."""

    def call(name, request):
        kind = SetBool if isinstance(request, SetBool.Request) else Trigger
        client = peer.create_client(kind, f'simulator/{name}')
        spin_until(spawn.pump, client.service_is_ready)
        answer = client.call_async(request)
        spin_until(spawn.pump, answer.done)
        return answer.result()

    return call


def command(peer, simulator, spawn, spin_until, message):
    """Publish joint commands and wait until the simulator follows them."""
    peer.commands.publish(message)
    spin_until(spawn.pump, lambda: simulator._world.data.ctrl.any())


def test_joint_states_name_every_joint_with_position_velocity_effort(peer, run, spawn, spin_until):
    run(40)
    spin_until(spawn.pump, lambda: len(peer.states) == 4)
    state = peer.states[1]
    assert list(state.name) == [*WHEELS, 'front_caster_joint', 'back_caster_joint']
    assert len(state.position) == len(state.velocity) == len(state.effort) == 4
    assert seconds(state.header.stamp) == pytest.approx(0.01)


def test_the_clock_runs_at_its_rate_and_never_backward(peer, run, simulator, spawn, spin_until):
    run(200)
    simulator.simulation.reset()
    run(300)
    spin_until(spawn.pump, lambda: len(peer.clock) == 50)
    times = [seconds(message.clock) for message in peer.clock]
    np.testing.assert_allclose(times, 0.01 * np.arange(50), atol=1e-12)


def test_the_truth_is_the_pose_of_the_footprint_in_the_world(peer, run, spawn, spin_until, world):
    half = 0.5 * np.pi / 3.0
    world.data.qpos[:2] = [1.0, 2.0]
    world.data.qpos[3:7] = [np.cos(half), 0.0, 0.0, np.sin(half)]
    world.data.qvel[:2] = 0.1 * np.array([np.cos(2 * half), np.sin(2 * half)])
    run(10)
    spin_until(spawn.pump, lambda: peer.truth)
    truth = peer.truth[0]
    assert (truth.header.frame_id, truth.child_frame_id) == ('world', 'base_footprint')
    assert (truth.pose.pose.position.x, truth.pose.pose.position.y) == (1.0, 2.0)
    assert truth.pose.pose.orientation.z == pytest.approx(np.sin(half))
    # The twist is in the robot's own frame: it goes ahead, whatever its heading.
    assert truth.twist.twist.linear.x == pytest.approx(0.1)
    assert truth.twist.twist.linear.y == pytest.approx(0.0, abs=1e-12)


def test_joint_commands_drive_the_robot(peer, simulator, run, spawn, spin_until, world):
    command(peer, simulator, spawn, spin_until, rolling(5.0))
    run(90)
    assert world.joints().velocity[:2].min() > 3.0
    assert world.base().linear_velocity[0] > 0.1


def test_silence_brakes_the_motors_and_says_so(
    peer, simulator, run, spawn, spin_until, world, capfd
):
    command(peer, simulator, spawn, spin_until, rolling(5.0))
    for _ in range(7):  # then it is through with starting
        run(90)
        peer.commands.publish(rolling(5.0))
        spin_until(spawn.pump, lambda: simulator._commanded_at == world.time)
    run(100)
    assert world.data.ctrl.any()
    run(20)
    assert not world.data.ctrl.any()
    run(500)
    assert world.base().linear_velocity[0] == pytest.approx(0.0, abs=1e-3)
    assert capfd.readouterr().err.count('joint_commands silent for 0.1 s: motors brake') == 1


def test_a_controller_that_stalls_while_it_starts_is_no_warning(
    peer, simulator, run, spawn, spin_until, world, capfd
):
    command(peer, simulator, spawn, spin_until, rolling(5.0))
    run(300)
    assert not world.data.ctrl.any()
    said = capfd.readouterr().err
    assert 'WARN' not in said
    assert said.count('the controller is starting') == 1


def test_without_any_command_there_is_nothing_to_warn_of(simulator, run, capfd):
    run(300)
    assert 'silent' not in capfd.readouterr().err


def test_a_new_command_ends_the_braking(peer, simulator, run, spawn, spin_until, world):
    command(peer, simulator, spawn, spin_until, rolling(5.0))
    run(200)
    command(peer, simulator, spawn, spin_until, rolling(4.0))
    run(50)
    assert world.data.ctrl.any()


def not_finite():
    message = rolling(5.0)
    message.points[0].velocities = [float('nan'), 1.0]
    return message


def unknown_joint():
    message = rolling(5.0)
    message.joint_names = ['base_l_wheel_joint', 'right_wheel_joint']
    return message


@pytest.mark.parametrize(
    ('message', 'warning'),
    [
        (not_finite(), 'joint_commands is not finite: refused, motors brake'),
        (unknown_joint(), 'joint_commands names base_l_wheel_joint; motors are left_wheel_joint'),
        (JointTrajectory(joint_names=list(WHEELS)), 'joint_commands needs 2 points'),
    ],
)
def test_an_illegal_command_warns_and_the_simulation_goes_on(
    peer, simulator, run, world, capfd, message, warning
):
    said = ''
    for _ in range(200):
        peer.commands.publish(message)
        run(10)
        said += capfd.readouterr().err
        if warning in said:
            break
    assert warning in said
    assert np.isfinite(world.data.qpos).all()
    assert not world.data.ctrl.any()


def test_reset_puts_the_robot_back_and_not_the_time(peer, simulator, run, call, world):
    world.data.qvel[0] = 0.5
    run(200)
    assert world.base().position[0] > 0.05
    response = call('reset', Trigger.Request())
    assert response.success
    np.testing.assert_array_equal(world.base().position, np.zeros(3))
    assert world.time == 0.2


def test_pause_and_step_go_one_physics_step_at_a_time(simulator, call, world):
    assert not call('step', Trigger.Request()).success
    assert world.tick == 0
    assert call('pause', SetBool.Request(data=True)).message == 'paused'
    assert simulator.simulation.paused
    for tick in (1, 2, 3):
        assert call('step', Trigger.Request()).success
        assert world.tick == tick
    assert call('pause', SetBool.Request(data=False)).message == 'running'
    assert not simulator.simulation.paused


def test_each_step_by_hand_is_published_once(peer, simulator, call, run, spawn, spin_until):
    simulator.simulation.paused = True
    for _ in range(20):
        assert call('step', Trigger.Request()).success
    spin_until(spawn.pump, lambda: len(peer.clock) == 21)
    simulator.simulation.paused = False
    run(10)  # what is due at 20 ms is what the last step by hand has published
    spin_until(spawn.pump, lambda: peer.truth and seconds(peer.truth[-1].header.stamp) >= 0.02)
    wanted = 0.001 * np.arange(21)
    np.testing.assert_allclose([seconds(m.clock) for m in peer.clock], wanted, atol=1e-12)
    for messages in (peer.states, peer.truth):
        stamps = [seconds(message.header.stamp) for message in messages]
        np.testing.assert_allclose(stamps, wanted, atol=1e-12)


@pytest.mark.parametrize('name', 'ab')
def test_a_step_of_either_robot_is_one_of_the_clock_and_of_both(spawn, loaded, spin_until, name):
    worlds = build_shared_world([(f'{each}/', loaded, RobotSetup()) for each in 'ab'])
    simulation, peer = Simulation(worlds[0], 1.0), spawn(Node('peer'))
    simulation.paused = True
    for world in worlds:
        spawn(SimulatorNode(loaded, world, simulation=simulation))
    heard = {'clock': 0.0, 'a': 0.0, 'b': 0.0}
    peer.create_subscription(Clock, '/clock', lambda m: heard.update(clock=seconds(m.clock)), 10)
    for each in 'ab':
        hear = functools.partial(
            lambda each, m: heard.update({each: seconds(m.header.stamp)}), each
        )
        peer.create_subscription(JointState, f'/{each}/joint_states', hear, 10)
    client = peer.create_client(Trigger, f'/{name}/simulator/step')
    spin_until(spawn.pump, client.service_is_ready)
    for _ in range(20):  # the last of them, at least, after all have found each other
        spin_until(spawn.pump, client.call_async(Trigger.Request()).done)
    assert simulation.world.tick == 20
    spin_until(spawn.pump, lambda: list(heard.values()) == [0.02, 0.02, 0.02])


def test_in_a_simulation_that_it_is_given_nobody_else_may_command_the_motors(spawn, loaded, world):
    node = spawn(SimulatorNode(loaded, world, simulation=Simulation(world, 1.0)))
    assert node.count_subscribers('joint_commands') == 0


def test_diagnostics_say_how_fast_it_runs(peer, simulator, spawn, spin_until):
    pacer = simulator.simulation.pacer
    ticks = TickStatistics(0.005)
    ticks.add(0.006)
    for simulated in (0.5, 2.0):
        pacer.restart()
        pacer.allowed(0.0, 0.0)
        pacer.measure(1.0, simulated)
        simulator.publish_diagnostics('driving', ticks)
    spin_until(spawn.pump, lambda: len(peer.diagnostics) == 2)
    (slow,), (fast,) = (message.status for message in peer.diagnostics)
    assert (slow.level, slow.message) == (DiagnosticStatus.WARN, 'slower than asked for')
    assert (fast.level, fast.message) == (DiagnosticStatus.OK, 'driving')
    assert {pair.key: pair.value for pair in slow.values} == {
        'real_time_factor': '0.50',
        'state': 'driving',
        'tick_p99_us': '6000',
        'overruns': '1',
        'rejected_commands': '0',
    }


def test_diagnostics_of_a_paused_simulator_say_so_and_repeat_no_factor(
    peer, simulator, spawn, spin_until
):
    simulator.simulation.pacer.real_time_factor = 0.47
    simulator.simulation.paused = True
    simulator.publish_diagnostics('running')
    spin_until(spawn.pump, lambda: peer.diagnostics)
    (status,) = peer.diagnostics[0].status
    said = {pair.key: pair.value for pair in status.values}
    assert (status.level, status.message) == (DiagnosticStatus.OK, 'paused')
    assert (said['state'], said['real_time_factor']) == ('paused', '0.00')


def test_that_two_controllers_command_the_motors_is_said_once(
    peer, simulator, spawn, spin_until, capfd
):
    simulator.each_second()
    assert 'joint_commands' not in capfd.readouterr().err
    spawn(Node('rival')).create_publisher(JointTrajectory, 'joint_commands', 10)
    spin_until(spawn.pump, lambda: simulator.count_publishers('joint_commands') == 2)
    simulator.each_second()
    simulator.each_second()
    assert capfd.readouterr().err.count('joint_commands comes from peer, rival: ') == 1
    spawn(Node('another')).create_publisher(JointTrajectory, 'joint_commands', 10)
    spin_until(spawn.pump, lambda: simulator.count_publishers('joint_commands') == 3)
    simulator.each_second()
    assert capfd.readouterr().err.count('joint_commands comes from another, peer, rival: ') == 1


def test_that_another_simulator_sets_the_time_too_is_said_once_with_a_cure(
    simulator, spawn, loaded, spin_until, capfd, isolated_ros
):
    simulator.each_second()
    worlds = build_shared_world([(f'{each}/', loaded, RobotSetup()) for each in 'ab'])
    for world in worlds:  # one of them has the clock
        spawn(SimulatorNode(loaded, world, simulation=Simulation(worlds[0], 1.0)))
    spin_until(spawn.pump, lambda: simulator.count_publishers('/clock') == 2)
    assert '/clock' not in capfd.readouterr().err
    for _ in range(2):
        simulator.each_second()
    (line,) = (line for line in capfd.readouterr().err.splitlines() if '/clock' in line)
    assert '/clock comes from simulator, simulator: time jumps; stop one, ' in line
    assert f'or give it another ROS_DOMAIN_ID than {isolated_ros} (' in line


def test_the_first_diagnostics_call_nothing_slow(peer, simulator, spawn, spin_until):
    simulator.simulation.pacer.speed = 0.05  # even a busy machine keeps up with that
    spin = spawn.pump.handle
    simulator.simulation.run(
        stop=lambda: bool(peer.diagnostics),
        poll=spin,
        each_second=lambda: simulator.publish_diagnostics('running'),
    )
    assert peer.diagnostics[0].status[0].level == DiagnosticStatus.OK


def test_a_simulator_that_was_destroyed_leaves_no_world_to_the_garbage_collector(ros):
    node = SimulatorNode()
    world, itself = weakref.ref(node._world), weakref.ref(node)
    gc.collect()
    gc.disable()
    try:
        node.close()
        node.destroy_node()
        assert world() is None
        del node
        assert itself() is None
    finally:
        gc.enable()
