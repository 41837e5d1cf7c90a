# SPDX-License-Identifier: Apache-2.0
"""A run's face on ROS: its nodes, their clocks, and who drives over them."""

from collections.abc import Callable
import functools
import logging
from typing import Any, cast, TYPE_CHECKING

from builtin_interfaces.msg import Time as TimeMessage
from mujoco_sim.parameters import SimulatorParameters, Untold
from mujoco_sim.simulation import Schedule
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.truth_publisher import WORLD_FRAME
import numpy as np
from rclpy.clock import ClockType, ROSClock
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from rclpy.time_source import TimeSource
from robot_description.state_publisher_node import StatePublisherNode
from teleop_keyboard.key_publisher_node import KeyPublisherNode
from wasd_core.errors import UserError
from wasd_core.messages import to_transform
from wasd_core.node import MessagePump
from wasd_core.ros_parameters import misspelt_parameters, vain_parameters
from wasd_core.rotations import Pose
from wasd_core.signals import letting_go
from wasd_core.streams import say_vain, visible
from wasd_core.topics import PublisherWatch, TfBroadcaster

from wasd_bringup.robots import HUMANOID, load_class
from wasd_bringup.ros.controllers import ControllerFace, overrides
from wasd_bringup.ros.drivers_node import DriversNode
from wasd_bringup.run.face import Face
from wasd_bringup.run.robot import Robot
from wasd_bringup.run.run import Run

if TYPE_CHECKING:
    from wasd_bringup.ros.foxglove import FoxgloveServer
    from wasd_bringup.run.navigation import NavigationDriver
    from wasd_bringup.tools.recording.recorder import BagRecorder

NO_KEYS = 'nobody publishes its keys any more'


class RosFace:
    """
    One robot on ROS: publishes to subscribers, and passes messages to the robot.

    The nodes configure what the robot consists of by their parameters: simulator, controller,
    keys to velocities, state publisher, key publisher, drivers.
    """

    def __init__(self, robot: Robot, command: str) -> None:
        """Take a robot, and the command that runs it: its words are named."""
        self.robot = robot
        options, world = robot.options, robot.world
        names = ('description', 'world', 'seed', 'speed', 'lidar')
        built = {name: getattr(options, name) for name in names}
        built |= {'hoist': robot.kind is HUMANOID, **options.untold.as_parameters()}
        self.simulator = SimulatorNode(
            robot.description,
            world,
            simulation=robot.simulation,
            sensors=robot.sensors,
            parameter_overrides=overrides(built),
        )
        _refuse_vain(self.simulator, command)
        self.controller: ControllerFace = load_class(robot.kind.face)(robot)
        self._states = StatePublisherNode(robot.description, prefix=world.prefix)
        self.keys = KeyPublisherNode(namespace=options.namespace)
        self.drivers = DriversNode(options.namespace)
        self.nodes: list[Node] = [
            *(self.simulator, *self.controller.nodes, self._states, self.keys, self.drivers)
        ]
        # Those that look at their clocks only as they handle messages.
        self.idle_nodes: list[Node] = [self.simulator, self._states, self.keys, self.drivers]
        self.idle_nodes += [] if self.controller.needs_clock else self.controller.nodes
        self.controller.admit()
        robot.on_key.append(self._tell_key)
        if world.prefix:
            self._say_where_it_begins()

    def watch_keyboards(self, lose: Callable[[], None]) -> None:
        """Call `lose` when the last keyboard of others is gone and its keys move the robot."""

        def on_lost() -> None:
            if self.robot.drivers.held('topic').keys:
                lose()

        self._keyboards = PublisherWatch(self.keys, 'keys', on_lost, own=1)

    def schedule_sensing(self, schedule: Schedule) -> None:
        """Publish the state on a schedule."""
        self.simulator.schedule_publishing()
        state_period = 1.0 / self.simulator.state_rate
        schedule.every(state_period, self._publish_transforms)
        odometry = self.controller.odometry
        schedule.every(state_period, lambda: self.simulator.truth.compare(odometry))

    def _tell_key(self, key: str) -> None:
        self.controller.expect_key(key)
        self.keys.publish_key(key)

    def _publish_transforms(self) -> None:
        if not self._states.is_heard:
            return
        joints = self.robot.world.joints()
        self._states.publish(self.robot.world.joint_names, joints.position, self.simulator.stamp)

    def _say_where_it_begins(self) -> None:
        options, world = self.robot.options, self.robot.world
        start = Pose(np.array([*world.setup.place, 0.0]), np.eye(3))
        # A frame has one parent: that of odometry is a navigator's map, where there is one.
        frame = f'{world.prefix}{"odom" if options.map is None else "map"}'
        self._static = TfBroadcaster(self.simulator, static=True)
        self._static.send([to_transform(start, WORLD_FRAME, frame, TimeMessage())])


def _refuse_vain(simulator: SimulatorNode, command: str) -> None:
    """Refuse a parameter that is neither its default nor what the robot was built with."""

    def said(parameters: SimulatorParameters) -> dict[str, Any]:
        untold = vars(Untold.from_parameters(parameters))
        return {**untold, 'lidar': parameters.lidar, 'hoist': parameters.hoist}

    usual = SimulatorParameters()
    built, default = said(simulator.settings), said(usual)
    given = simulator.handle.get_parameters(Parameter)
    asked = usual.changed({name: given[name].value for name in default if name in given})
    for name, value in said(asked).items():
        if value not in (built[name], default[name]):
            # Here, because only a mistake needs it.
            from wasd_bringup.cli.options import options_of

            word = f'--{name.replace("_", "-")}'
            has_it = any(option.word == word for option in options_of(command))
            cure = f'leave it out{f", or say {word}" if has_it else ""}'
            raise UserError(f'simulator: {name} has no effect in a run: {cure}')


class RosFaces(Face):
    """
    All robots of a run on ROS; rclpy must be initialised.

    `recorder` and `foxglove` are told the simulated time; their maker closes them afterwards.
    """

    def __init__(
        self,
        run: Run,
        recorder: 'BagRecorder | None' = None,
        foxglove: 'FoxgloveServer | None' = None,
    ) -> None:
        self._run, self._bag, self._foxglove = run, recorder, foxglove
        self.faces = [RosFace(robot, run.options.robot) for robot in run.robots]
        self.nodes: list[Node] = [node for face in self.faces for node in face.nodes]
        self._pump = MessagePump()
        # Of the nodes that stamp by their clocks in any instant, and of those that do not.
        self._clocks: list[ROSClock] = []
        self._idle_clocks: list[ROSClock] = []

    def show_navigation(self, navigation: 'NavigationDriver') -> None:
        """Show a robot's navigator; its parameters configure it."""
        from wasd_navigation.navigator_node import NavigatorNode

        node = NavigatorNode(
            navigation.unit,
            namespace=navigation.robot.options.namespace,
            parameter_overrides=overrides(navigation.given),
        )
        navigation.on_step.append(node.publish)
        self.nodes.append(node)

    def begin(self) -> None:
        """Obey e-stops of others, let pad and Foxglove drive, and take messages."""
        run = self._run
        for face in self.faces:
            # An e-stop of one robot, by topic or service, stops all robots.
            face.drivers.on_stop, face.drivers.on_release = run.e_stop, run.end_e_stop
            face.controller.on_e_stop(functools.partial(run.e_stop, 'service e_stop'))
            face.watch_keyboards(functools.partial(run.lose, 'topic', face.robot, NO_KEYS))
        self._let_drive()
        for text in misspelt_parameters(*self.nodes):
            self.nodes[0].get_logger().warning(visible(text))
        say_vain([f'-p {name}' for name in vain_parameters(*self.nodes)])
        time_source = TimeSource()
        time_source.ros_time_is_active = True
        idle = [node for face in self.faces for node in face.idle_nodes]
        for node in self.nodes:
            clock = cast(ROSClock, node.get_clock())
            self._pump.add_node(node)
            # A parameter `use_sim_time` that changes leaves the clock alone.
            node._time_source._associated_clocks.clear()
            time_source.attach_clock(clock)
            (self._idle_clocks if node in idle else self._clocks).append(clock)
        if self._bag is not None:
            bag = self._bag
            bag.now = self._nanoseconds
            run.simulation.on_reset.append(lambda: bag.event('reset'))
            run.simulation.on_step.append(lambda: bag.event('step'))
            run.on_e_stop.append(lambda: bag.event('e-stop'))
            for interface in run.interfaces:
                interface.on_deed = functools.partial(bag.event, 'program')

    def _let_drive(self) -> None:
        run = self._run
        if run.options.gamepad is not None:
            from wasd_bringup.ros.pad import PadDriver

            press = functools.partial(run.press, by='gamepad')
            pad = PadDriver(run.options.gamepad, run.robots, lambda: run.active, press)
            self.nodes.append(pad.node)
            run.join(pad)
        if self._foxglove is not None:
            # Here, because few runs need it.
            from wasd_bringup.ros.foxglove_inbox import Target

            self._foxglove.now = self._nanoseconds
            targets = [
                Target(
                    face.robot,
                    face.controller.command_topic,
                    face.keys.resolve_topic_name('keys'),
                )
                for face in self.faces
            ]
            self._foxglove.drive(targets, self.nodes)
            run.join(self._foxglove)

    def _nanoseconds(self) -> int:
        return round(self._run.world.time * 1e9)

    def begin_instant(self) -> None:
        """Set the nodes' clocks to the simulated time."""
        self._set(self._clocks)

    def _set(self, clocks: list[ROSClock]) -> None:
        if clocks:
            now = Time(nanoseconds=self._nanoseconds(), clock_type=ClockType.ROS_TIME)
            for clock in clocks:
                clock.set_ros_time_override(now)

    def look_who_drives(self) -> None:
        """Publish who drives each robot, where that has changed."""
        for face in self.faces:
            face.drivers.tell(face.robot.drivers.state)

    def schedule_control(self, robot: Robot, schedule: Schedule) -> None:
        """Publish on a schedule what a robot's controller knows."""
        self._of(robot).controller.schedule(schedule)

    def schedule_sensing(self, robot: Robot, schedule: Schedule) -> None:
        """Publish on a schedule what the simulator knows of a robot."""
        self._of(robot).schedule_sensing(schedule)

    def each_second(self) -> None:
        """Publish how the controllers do, and look for other simulators."""
        for face in self.faces:
            face.simulator.look_for_clocks()
            face.simulator.publish_diagnostics(face.robot.state, face.robot.ticks)

    def handle(self, timeout: float) -> None:
        """Take messages, waiting for them up to `timeout` [s]."""
        self._set([*self._clocks, *self._idle_clocks])
        self._pump.handle(timeout)

    def save(self) -> None:
        """Bring a recording up to date."""
        if self._bag is not None:
            self._bag.save_if_due()

    def flush(self) -> None:
        """Give the last velocities the time to leave the process."""
        for face in self.faces:
            face.controller.flush()

    def close(self) -> None:
        """End all nodes."""
        self.flush()
        self._pump.shutdown(timeout_sec=0.0)
        with letting_go():
            for node in self.nodes:
                node.destroy_node()

    def _of(self, robot: Robot) -> RosFace:
        return next(face for face in self.faces if face.robot is robot)


class _ToRos(logging.Handler):
    """Says on ROS what the run's objects log."""

    def emit(self, record: logging.LogRecord) -> None:
        """Say one record by the logger of the node that it is named after."""
        logger = get_logger(record.name.removeprefix('wasd.'))
        words = visible(record.getMessage())
        # A place in the code says one severity only.
        if record.levelno >= logging.ERROR:
            logger.error(words)
        elif record.levelno >= logging.WARNING:
            logger.warning(words)
        else:
            logger.info(words)


def make_ros_run(
    options: Any,
    reader: Any = None,
    visuals: bool = False,
    recorder: 'BagRecorder | None' = None,
    foxglove: 'FoxgloveServer | None' = None,
) -> Run:
    """
    Return a run with its nodes in this process; rclpy must be initialised.

    Raises:
        UserError: an option is wrong; the text says how, in one line.
    """
    log = logging.getLogger('wasd')
    if not any(isinstance(handler, _ToRos) for handler in log.handlers):
        log.addHandler(_ToRos())
        log.setLevel(logging.INFO)
        log.propagate = False
    return Run(
        options,
        reader,
        visuals,
        lambda run: RosFaces(run, recorder=recorder, foxglove=foxglove),
    )
