# SPDX-License-Identifier: Apache-2.0
"""One robot of a session: its part of the world, its nodes, its scripts, its report."""

import dataclasses
import functools
import math
from typing import Any

from builtin_interfaces.msg import Time
from mujoco_sim.robot_setup import randomise, RobotSetup, usual_setup
from mujoco_sim.sensors.table import has_camera
from mujoco_sim.simulation import Schedule, Simulation
from mujoco_sim.simulator_node import SimulatorNode
from mujoco_sim.truth_publisher import WORLD_FRAME
from mujoco_sim.world import build_shared_world, build_world, World
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_description.description import Description, load_robot
from robot_description.morphology.wheels import ANY_WHEELS
from robot_description.state_publisher_node import StatePublisherNode
from teleop_keyboard.dashboard import board, Line, Status, status_line
from teleop_keyboard.key_publisher_node import KeyPublisherNode
from teleop_keyboard.screen import StatusLine
from wasd_core.messages import to_transform
from wasd_core.rotations import Pose
from wasd_core.topics import TfBroadcaster

from wasd_bringup.drivers_node import DriversNode
from wasd_bringup.inputs import Player, TWIST_RATE, TwistPlayer
from wasd_bringup.options import RunOptions
from wasd_bringup.report import build_report, Recorder, SAMPLE_PERIOD
from wasd_bringup.robots import LEGGED, ROBOTS
from wasd_bringup.run.drivers import Drivers, E_STOP, Held, LOST
from wasd_bringup.stack import make_stack, Velocity

STANDSTILL = (0.0, 0.0, 0.0)
# Who sends it may not know that the robot was stopped.
REFUSED = 'end who sends on {}, or send a zero (refused since E-STOP)'
HOLDS = 'ENTER releases E-STOP (by the {})'


class SessionRobot:
    """
    A robot with the nodes that simulate and drive it.

    Who drives, wherever their keys and velocities come from, has `press` and `drive`; `drivers`
    says whether they count, `stack` does what they ask for, and `keys` tells of it. The session
    steps it: `begin_instant` first, then what was scheduled.
    """

    def __init__(
        self,
        options: RunOptions,
        loaded: Description,
        world: World,
        simulation: Simulation | None = None,
    ) -> None:
        self.options = options
        self.world = world
        self.description = loaded
        self.simulator = SimulatorNode(
            loaded,
            world,
            simulation=simulation or Simulation(world, options.speed),
            parameter_overrides=_overrides(options),
        )
        self.stack = make_stack(loaded, world, options)
        self._states = StatePublisherNode(loaded, prefix=world.prefix)
        self.keys = KeyPublisherNode(namespace=options.namespace)
        self.driver_topic = DriversNode(options.namespace)
        self.nodes: list[Node] = [
            *(self.simulator, *self.stack.nodes, self._states, self.keys, self.driver_topic)
        ]
        self._recorder = Recorder(world, keep=options.keeps_samples)
        self._pushes = Player(options.pushes)
        self._script: TwistPlayer | None = None
        stack = self.stack
        self.drivers = Drivers(stack.stops, stack.latches, holds_stops=options.latched)
        stack.admit_topics(self._take_topic)
        if world.prefix:
            self._say_where_it_begins()

    @property
    def name(self) -> str:
        """What the robot is called."""
        return self.options.robot

    @property
    def key_topic(self) -> str:
        """Where its keys are, by the full name."""
        topic: str = self.keys.resolve_topic_name('keys')
        return topic

    def status(self) -> Status:
        """Return what a driver wants to see."""
        status = self.stack.status()
        if not self.drivers.stopped_by:
            return status
        words = status.message or HOLDS.format(self.drivers.stopped_by)
        return status._replace(state='E-STOP', message=words)

    @property
    def refusal(self) -> str:
        """Why it follows no velocity now, with what is to be done; '' where it does."""
        stopped_by = self.drivers.stopped_by
        return HOLDS.format(stopped_by) if stopped_by else self.stack.refusal

    def press(self, key: str, by: str) -> bool:
        """Press a key for a source, in this instant, and tell listeners; False: it is refused."""
        if not self.drivers.take(by, key=key):
            self._say_that_it_holds()
            return False
        self._obey(key, is_pressed=by not in (E_STOP, LOST))
        return True

    def drive(self, velocity: Velocity, by: str) -> bool:
        """Command a source's velocity [m/s], [m/s], [rad/s]; False: it is refused."""
        if not self.drivers.take(by, velocity=velocity):
            self._say_that_it_holds()
            return False
        self.stack.drive(velocity)
        return True

    def release(self, by: str) -> bool:
        """End what a source moves: it is gone, or has let go; return whether it moved anything."""
        held = self.drivers.release(by)
        self._end(held)
        return held.keys or held.velocity

    def disarm(self, by: str = '') -> None:
        """Let nothing that a source, or any, holds now count, and end what it moves."""
        self._end(self.drivers.disarm(by))

    def e_stop(self, by: str) -> None:
        """Stop for good, after `disarm`: the controller lets go, and a script ends."""
        self.drivers.stop(by)
        if self._script is not None:
            self._script.end()
        self.stack.e_stop()

    def end_e_stop(self) -> None:
        """End a stop that holds: who wants to drive presses again."""
        if self.drivers.stopped_by:
            self.drivers.release(E_STOP)
            self.stack.say('E-STOP released: drive again')

    def _end(self, held: Held) -> None:
        if held.velocity:
            self.stack.drive(STANDSTILL)
        if held.keys:
            self._obey(self.stack.stop_key, is_pressed=False)

    def _obey(self, key: str, is_pressed: bool) -> None:
        self.stack.press(key, is_pressed)
        self.keys.publish_key(key)

    def _take_topic(self, topic: str, **taken: Any) -> bool:
        """Return whether what has come on a topic counts; say why it does not."""
        if self.drivers.take('topic', **taken, what=f'somebody on {topic}'):
            return True
        self.stack.say(REFUSED.format(topic))
        self._say_that_it_holds()
        return False

    def _say_that_it_holds(self) -> None:
        """Tell a driver why a source does not count, if a stop holds."""
        if self.drivers.stopped_by:
            self.stack.say(HOLDS.format(self.drivers.stopped_by))

    def schedule_control(self, schedule: Schedule) -> None:
        """Step scripts and controllers on a schedule."""
        options = self.options
        if options.twists is not None:
            drive = functools.partial(self.drive, by='script')
            twists = self._script = TwistPlayer(options.twists, drive)
            schedule.every(1.0 / TWIST_RATE, lambda: twists.step(self.world.time))
        self.stack.schedule(schedule)

    def schedule_publishing(self, schedule: Schedule) -> None:
        """Publish and sample the state on a schedule."""
        self.simulator.schedule_publishing()
        state_period = 1.0 / self.simulator.state_rate
        schedule.every(state_period, self._publish_transforms)
        schedule.every(state_period, lambda: self.simulator.truth.compare(self.stack.odometry))
        schedule.every(SAMPLE_PERIOD, lambda: self._recorder.sample(self.stack.sample()))

    def begin_instant(self) -> None:
        """Put the pushes in force that are due."""
        self.drivers.time = self.world.time
        for push in self._pushes.due(self.world.time):
            self.world.push(push.force, push.duration, push.point)

    def show(self, line: StatusLine, name: str, now: float, is_told: bool) -> None:
        """
        Show in a terminal how it is, by a `name` where that helps; `now` in [s].

        `is_told` is whether somebody reads what is written where nothing can be drawn.
        """
        simulation = self.simulator.simulation
        line.show(
            lambda width: say_status(self.status(), name, simulation, width),
            now,
            lambda *size: draw_board(self.status(), self.world, self.stack.first_keys, *size),
            lambda: say_plainly(self.status(), name) if is_told else '',
        )

    def publish_diagnostics(self) -> None:
        """Tell how the controller does."""
        self.simulator.publish_diagnostics(self.stack.state, self.stack.ticks)

    def report(self, wall_time: float, **parts: Any) -> dict[str, Any]:
        """Return what happened in the `wall_time` [s] so far, and `parts` that others tell."""
        options = self.options
        asked: dict[str, Any] = {
            'robot': options.robot,
            'description': self.description.record(),
            'world': options.world,
            'seed': options.seed,
            'estimator': self.stack.estimator,
        }
        if options.untold.randomise:
            asked['drawn'] = dataclasses.asdict(self.world.setup.drawn)
        asked |= parts
        ticks = self.stack.ticks.summary()
        return build_report(self._recorder, asked, self.world.time, wall_time, ticks)

    def close(self) -> None:
        """End the physics."""
        self.simulator.close()

    def _publish_transforms(self) -> None:
        joints = self.world.joints()
        stamp = self.simulator.stamp
        self._states.publish(self.world.joint_names, joints.position, stamp)

    def _say_where_it_begins(self) -> None:
        start = Pose(np.array([*self.world.setup.place, 0.0]), np.eye(3))
        # A frame has one parent: that of odometry is a navigator's map, where there is one.
        frame = f'{self.world.prefix}{"map" if self.options.navigates else "odom"}'
        self._static = TfBroadcaster(self.simulator, static=True)
        self._static.send([to_transform(start, WORLD_FRAME, frame, Time())])


def build_robots(options: RunOptions, visuals: bool) -> list[SessionRobot]:
    """
    Load what the options name into one world, with its nodes.

    Raises:
        UserError: what is wrong with what was asked for, in one line.
    """
    robots: list[SessionRobot] = []
    for part, loaded, world in build_worlds(options, visuals):
        shared = robots[0].simulator.simulation if robots else None
        robots.append(SessionRobot(part, loaded, world, shared))
    return robots


def build_worlds(
    options: RunOptions, visuals: bool
) -> list[tuple[RunOptions, Description, World]]:
    """
    Load what the options name into one world; return each robot's options and part of it.

    Raises:
        UserError: what is wrong with what was asked for, in one line.
    """
    parts = options.per_robot()
    loaded = [_load(part) for part in parts]
    setups = [_setup(part, robot) for part, robot in zip(parts, loaded, strict=True)]
    visuals = visuals or any(has_camera(robot.robot) for robot in loaded)
    boxes = [box.size for box in options.boxes]
    if len(parts) == 1:
        built = loaded[0].with_stand_in_masses() if options.is_fake else loaded[0]
        world = build_world(built, options.world, options.seed, setups[0], visuals, boxes)
        return [(options, loaded[0], world)]
    prefixes = [f'{part.namespace}/' for part in parts]
    members = list(zip(prefixes, loaded, setups, strict=True))
    worlds = build_shared_world(members, options.world, options.seed, visuals, boxes)
    return list(zip(parts, loaded, worlds, strict=True))


def _load(options: RunOptions) -> Description:
    file = options.drive_file
    return load_robot(
        options.description,
        options.package_path,
        options.xacro_arguments,
        options.strict,
        options.urdfs.get(options.namespace),
        wheels=file.parameters.wheel_choice() if file is not None else ANY_WHEELS,
    )


def _setup(options: RunOptions, loaded: Description) -> RobotSetup:
    setup = usual_setup(loaded, options.estimator == 'kalman', options.untold)
    if ROBOTS[options.robot].kind is LEGGED:
        setup = randomise(setup, options.seed, loaded)
    place = ROBOTS[options.robot].place
    if not options.namespace or place is None:
        return setup
    return dataclasses.replace(setup, place=place)


def _overrides(options: RunOptions) -> list[Parameter]:
    return [
        Parameter('description', value=options.description),
        Parameter('world', value=options.world),
        Parameter('seed', value=options.seed),
        Parameter('speed', value=options.speed),
    ]


def say_status(status: Status, name: str, simulation: Simulation, width: int) -> str:
    """Return a terminal's line on the robot that the keys drive, by its name where that helps."""
    pace = f'x{simulation.pacer.real_time_factor:.2f}' if not simulation.paused else 'paused'
    if name:
        status = status._replace(state=f'[{name}] {status.state}')
    return status_line(status, f'{simulation.world.time:.1f} s {pace}', width)


def say_plainly(status: Status, name: str) -> str:
    """Return what seldom changes of a status, for an output in which nothing is rewritten."""
    words = f'[{name}] {status.state}' if name else status.state
    return f'{words}: {status.message}' if status.message else words


def draw_board(
    status: Status, world: World, first_keys: str, width: int, height: int
) -> list[Line]:
    """Return what a window with room for it shows above that line."""
    if status.axes:
        base = world.base()
        lift = round(float(base.position[2]), 2) + 0.0  # no -0.00
        body = f'height {lift:.2f} m   tilt {math.degrees(base.tilt):.1f} deg'
        status = status._replace(body=body)
    return board(status, first_keys, width, height)
