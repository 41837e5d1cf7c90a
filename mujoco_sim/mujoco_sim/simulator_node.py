# SPDX-License-Identifier: Apache-2.0
"""The simulator's face on ROS: clock, joint states, truth, joint commands, services."""

import math
import sys
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import Description, load_robot
from robot_description.morphology.wheel_file import read_wheel_choice
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from trajectory_msgs.msg import JointTrajectory
from wasd_core.errors import InvalidMessage, SimulationError
from wasd_core.messages import (
    from_joint_commands,
    to_diagnostics,
    to_imu,
    to_joint_state,
    to_seconds,
    to_stamp,
)
from wasd_core.node import MessagePump, run_node
from wasd_core.parameters import Parameters
from wasd_core.robot_io import LEG_RATE
from wasd_core.ros_parameters import declare_parameters
from wasd_core.services import offer
from wasd_core.signals import StopSignals
from wasd_core.streams import visible
from wasd_core.topics import has_listener, RELIABLE, SENSOR_DATA

from mujoco_sim.hoist import Hoist
from mujoco_sim.parameters import SHOWN_RATE, simulator, SimulatorParameters, STATE_RATE, Untold
from mujoco_sim.robot_setup import foot_links, randomise, upright_setup, usual_setup
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.sensors.publisher import publish_sensors
from mujoco_sim.sensors.table import has_camera
from mujoco_sim.simulation import AnswerHold, Simulation, TickStatistics
from mujoco_sim.truth_publisher import TruthPublisher
from mujoco_sim.world import build_world, World

# A real-time factor below this share of the speed asked for is worth a warning.
SLOW = 0.9
# A controller that has commanded for less than this [s] may still be loading what it needs.
SETTLED = 0.5


class SimulatorNode(Node):
    """
    Publishes a World, takes joint commands for it, offers reset, pause and step.

    A given `simulation` and `sensors` are stepped by their owner; the controller is in the same
    process, and the node does not subscribe to `joint_commands`. Several robots in one model have
    a node each, with the world's prefix as namespace and before frames; the node of the
    simulation's own world has the clock.
    """

    def __init__(
        self,
        robot: Description | None = None,
        world: World | None = None,
        *,
        simulation: Simulation | None = None,
        sensors: Sensors | None = None,
        parameter_overrides: list[Parameter] | None = None,
    ) -> None:
        """
        Take a robot, its world and the simulation that steps it, or load what parameters name.

        Raises:
            InvalidParameter, DescriptionError, SimulationError: what is wrong, in one line.
        """
        super().__init__(
            'simulator',
            namespace=world.prefix.rstrip('/') if world is not None else '',
            parameter_overrides=parameter_overrides or [],
        )
        self.settings = declare_parameters(self, SimulatorParameters, self._on_change)
        if robot is None:
            wheels = read_wheel_choice(self.settings.controller)
            robot = load_robot(self.settings.description, wheels=wheels)
        world = world or self._build_world(robot)
        self.simulation = simulation or Simulation(world, self.settings.speed)
        self._world = world
        self._root = world.prefix + robot.robot.root
        self._commanded_at = self._commanded_since = 0.0
        self._hold = AnswerHold()
        self._is_braking = True
        # Instants that have been published: a step by hand may end where one is due.
        self._clock_tick = self._states_tick = -1
        self._told: list[tuple[Any, Any]] = []  # of the last state
        # In a world of several robots one tells the time.
        has_clock = self.simulation.world is world
        self._clock_publisher = has_clock and self.create_publisher(Clock, '/clock', RELIABLE)
        self._joint_states = self.create_publisher(JointState, 'joint_states', RELIABLE)
        self.truth = TruthPublisher(self, world, robot.robot)
        self._feet = foot_links(robot)
        self.state_rate = self._usual_rate(is_alone=simulation is None)
        if self._feet:
            self._contacts = self.create_publisher(JointState, 'foot_contacts', RELIABLE)
        if world.has_imu:
            self._imu = self.create_publisher(Imu, 'imu/data', RELIABLE)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        self._steps_sensors = sensors is None
        self.sensors = sensors or Sensors(robot, world, self.settings, self.get_logger().error)
        self.sensors.tune(self.settings)
        publish_sensors(self, self.sensors)
        if self._steps_sensors:
            self.simulation.on_reset.append(self.sensors.reset)
        self.simulation.on_step += [self._publish_clock, self._publish_states, self.sensors.step]
        offer(self, '~/reset', self._on_reset)
        offer(self, '~/pause', self._on_pause, sets=True)
        offer(self, '~/step', self._on_step)
        self._rivals: dict[str, list[str]] = {}  # who publishes on a topic
        self._hoist: Hoist | None = None
        if simulation is None:
            command = self._on_command
            self.create_subscription(JointTrajectory, 'joint_commands', command, SENSOR_DATA)
            self.simulation.schedule.every(world.time_step, self._watch_commands)
            self.simulation.schedule.every(world.time_step, self.truth.remember)
            self._hang()

    def _hang(self) -> None:
        """Hold the robot by a hoist, where the parameter says so, until the service lets go."""
        offer(self, '~/hoist', self._on_hoist, sets=True)
        if self.settings.hoist:
            hoist, period = Hoist(self._world), 1.0 / LEG_RATE
            self.simulation.schedule.every(period, lambda: hoist.step(period))
            self.simulation.on_reset.append(hoist.reset)
            self._hoist = hoist

    def _usual_rate(self, is_alone: bool) -> float:
        """Return how often the state is published [Hz]; unless set, the robot's own rate."""
        if not math.isnan(self.settings.state_rate):
            return self.settings.state_rate
        if not is_alone:
            return SHOWN_RATE
        return LEG_RATE if self._feet or self.settings.hoist else STATE_RATE

    def schedule_publishing(self) -> None:
        """
        Publish clock and states at this place of the schedule: after what is there before.

        Raises:
            SimulationError: a rate does not fit the physics step.
        """
        schedule = self.simulation.schedule
        schedule.at_rate('clock_rate', self.settings.clock_rate, self._publish_clock)
        schedule.at_rate('state_rate', self.state_rate, self._publish_states)
        if self._steps_sensors:
            # As often as possible without making physics stop more often.
            schedule.every(schedule.stride * self._world.time_step, self.sensors.step)

    def each_second(self) -> None:
        """Publish diagnostics, and look for others who command the motors or have a clock."""
        self.publish_diagnostics(self.state)
        self._look_for_rivals('joint_commands', 'let one of them command the motors')
        self.look_for_clocks()

    def look_for_clocks(self) -> None:
        """Say that another simulator of this domain sets the time, too."""
        if self._clock_publisher:
            domain = self.context.get_domain_id()
            cure = f'time jumps; stop one, or give it another ROS_DOMAIN_ID than {domain}'
            self._look_for_rivals(self._clock_publisher.topic_name, cure)

    def _look_for_rivals(self, topic: str, cure: str) -> None:
        """Say that several nodes publish on a topic, once of each set of nodes."""
        names = sorted(end.node_name for end in self.get_publishers_info_by_topic(topic))
        before, self._rivals[topic] = self._rivals.get(topic), names
        if len(names) > 1 and names != before:
            self.get_logger().warning(
                f'{topic} comes from {", ".join(names)}: {cure} (a node that was killed counts '
                'for 20 s)'
            )

    def publish_diagnostics(self, state: str, ticks: TickStatistics | None = None) -> None:
        """Publish the real-time factor, how long ticks take, and the state, or that it pauses."""
        speed = self.simulation.pacer.speed
        factor, paused = self.simulation.pacer.real_time_factor, self.simulation.paused
        if paused:
            state, factor = 'paused', 0.0
        slow = not paused and factor < SLOW * speed
        values = {'real_time_factor': f'{factor:.2f}', 'state': state}
        if ticks is not None:
            summary = ticks.summary(last=1000)
            values['tick_p99_us'] = f'{summary.p99_us:.0f}'
            values['overruns'] = str(summary.overruns)
        values['rejected_commands'] = str(self._world.actuation.rejected_commands)
        text = 'slower than asked for' if slow else state
        stamp, name = self.stamp, self.get_fully_qualified_name().strip('/')
        self._diagnostics.publish(to_diagnostics(name, text, values, stamp, slow))

    @property
    def stamp(self) -> Time:
        """Simulated time as a stamp."""
        return to_stamp(self._world.time)

    def close(self) -> None:
        """Leave the motors braking."""
        self._world.brake()
        self.sensors.close()

    def destroy_node(self) -> None:
        """
        Leave ROS, and let go of the world: ROS' own circles keep a node for a while.

        `close` comes before.
        """
        super().destroy_node()
        for name in ('_world', 'simulation', 'truth', 'sensors'):
            self.__dict__.pop(name, None)

    def _build_world(self, robot: Description) -> World:
        untold = Untold.from_parameters(self.settings)
        noise = self.settings.sensor_noise
        if self.settings.hoist:
            setup = upright_setup(robot, robot.robot.rest_positions, untold, noise)
        else:
            setup = usual_setup(robot, noise, untold)
        setup = randomise(setup, self.settings.seed, robot)
        try:
            visuals = has_camera(robot.robot)
            return build_world(robot, self.settings.world, self.settings.seed, setup, visuals)
        except SimulationError as error:
            # What is an option of the `wasd` command is a parameter of the same name here.
            raise SimulationError(str(error).removeprefix('--')) from None

    def _publish_clock(self) -> None:
        if not self._clock_publisher or self._clock_tick == self._world.tick:
            return
        self._clock_tick = self._world.tick
        if has_listener(self._clock_publisher):
            self._clock_publisher.publish(Clock(clock=self.stamp))

    def _publish_states(self) -> None:
        if self._states_tick == self._world.tick:
            return
        self._states_tick = self._world.tick
        # Read in any case: noise must not depend on who listens.
        reading = self._world.read()
        stamp = self.stamp
        self._told.clear()
        if reading.imu is not None and has_listener(self._imu):
            self._tell(self._imu, to_imu(reading.imu, self._root, stamp))
        if self._feet and has_listener(self._contacts):
            forces = self._world.contact_forces(self._feet)
            self._tell(self._contacts, to_joint_state(self._feet, stamp, effort=forces))
        if has_listener(self._joint_states):
            names = self._world.joint_names
            self._tell(self._joint_states, to_joint_state(names, stamp, *reading.joints))
        self.truth.publish(self._tell)

    def _tell(self, publisher: Any, message: Any) -> None:
        publisher.publish(message)
        self._told.append((publisher, message))

    def _on_command(self, message: JointTrajectory) -> None:
        try:
            command = from_joint_commands(message, self._world.motor_names)
        except InvalidMessage as error:
            self.get_logger().warning(visible(str(error)), throttle_duration_sec=5.0)
            return
        if self._world.apply(command):
            self._commanded_at = self._world.time
            stamp = message.header.stamp
            self._hold.answer(to_seconds(stamp), self._world.time)
            if self._is_braking:
                self._commanded_since = self._world.time
            self._is_braking = False
        else:
            self.get_logger().warning(
                'joint_commands is not finite: refused, motors brake', throttle_duration_sec=5.0
            )

    def may_advance(self) -> bool:
        """Whether physics may go on, or has to wait for the controller to answer."""
        may = self._is_braking or self._hold.may_advance(
            self._world.time,
            self.state_rate,
            self.settings.answer_patience,
            lambda: self.count_publishers('joint_commands') > 0,
        )
        if not may and self._hold.repeats():
            for publisher, message in self._told:  # the last state, as it was
                publisher.publish(message)
        return may

    @property
    def state(self) -> str:
        """What the simulation does: it runs, or waits for a controller that is late."""
        return 'waiting for joint_commands' if self._hold.is_holding else 'running'

    def _watch_commands(self) -> None:
        silent = self._world.time - self._commanded_at
        if silent > self.settings.command_timeout and not self._is_braking:
            self._is_braking = True
            self._world.brake()
            text = f'joint_commands silent for {self.settings.command_timeout} s: motors brake'
            if self._commanded_at - self._commanded_since < SETTLED:
                self.get_logger().info(f'{text}, the controller is starting')
            else:
                self.get_logger().warning(text, throttle_duration_sec=5.0)

    def _on_reset(self) -> tuple[bool, str]:
        self.simulation.reset()
        return True, f'robot back at its start, time goes on at {self._world.time:.3f} s'

    def _on_pause(self, pauses: bool) -> tuple[bool, str]:
        self.simulation.paused = pauses
        return True, 'paused' if pauses else 'running'

    def _on_hoist(self, holds: bool) -> tuple[bool, str]:
        if self._hoist is None:
            return False, 'there is no hoist: start the simulator with hoist:=true'
        if holds:
            self._hoist.take()
        else:
            self._hoist.let_go()
        return True, 'the hoist holds it' if holds else 'the hoist has let go'

    def _on_step(self) -> tuple[bool, str]:
        if not self.simulation.paused:
            return False, 'not paused: call ~/pause with data: true first'
        self.simulation.step()
        return True, f'time is {self._world.time:.3f} s'

    def _on_change(self, changed: Parameters) -> None:
        assert isinstance(changed, SimulatorParameters)
        self.settings = changed
        self.sensors.tune(changed)
        self.simulation.pacer.speed = changed.speed
        self.simulation.pacer.restart()


def simulate(node: SimulatorNode, stop: StopSignals) -> None:
    """Step a node's simulation, and handle messages between the steps, until a stop signal."""
    node.schedule_publishing()
    pump = MessagePump()
    pump.add_node(node)
    try:
        node.simulation.run(
            stop=lambda: stop.requested or not rclpy.ok(),
            poll=pump.handle,
            each_second=node.each_second,
            may_advance=node.may_advance,
        )
    finally:
        pump.shutdown(timeout_sec=0.0)


def main(args: list[str] | None = None) -> int:
    """Run the simulator as a process of its own; controllers talk to it over topics."""
    return run_node(SimulatorNode, args, simulate)


if __name__ == '__main__':
    sys.exit(simulator())
