# SPDX-License-Identifier: Apache-2.0
"""A quadruped's nodes in one process: leg controller, and keys to velocity where a preset asks."""

from collections.abc import Callable

from mujoco_sim.simulation import Schedule
from mujoco_sim.viewer.page import CameraView
from mujoco_sim.world import World
import numpy as np
from quadruped_sim.keys import KeyWords, STATE_KEYS, StateName, STICK_KEYS, ZERO_KEYS
from quadruped_sim.leg_controller_node import LegControllerNode
from quadruped_sim.leg_kinematics import LegGeometry
from quadruped_sim.legs import Legs
from quadruped_sim.presets import LIMITS
from rclpy.logging import get_logger, LoggingSeverity
from rclpy.parameter import Parameter
from robot_description.description import Description
from std_msgs.msg import String
from teleop_keyboard.dashboard import Axis, driving_keys, HELP_KEY, KeyHints, Status
from teleop_keyboard.keymap import on_layout, on_qwerty
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import matrix_from_quaternion, rpy_from_matrix
from wasd_core.timing import is_press, STOP_KEY
from wasd_core.topics import LoopbackSubscription

from wasd_bringup.inputs import RESET_KEY
from wasd_bringup.options import RunOptions
from wasd_bringup.report import Sample, TrunkWatch
from wasd_bringup.robots import unitree_first_keys, unitree_help, UNITREE_PRESET
from wasd_bringup.stack import ControlStack

# States in which the robot is being driven.
DRIVEN = ('trotting', 'move base')
# The key that lets go of the legs.
PASSIVE = next(key for key, state in STATE_KEYS.items() if state is StateName.PASSIVE)


class Go2Stack(ControlStack):
    """
    What walks a quadruped: `press` takes keys, `drive` velocities; `schedule` has it stepped.

    With the preset `unitree` keys are states and sticks; with any other they also become
    velocities on cmd_vel, which the state move base (2, then 5) follows.
    """

    has_states = True
    other_presets = (UNITREE_PRESET,)

    def __init__(self, loaded: Description, world: World, options: RunOptions) -> None:
        self.layout = options.layout
        self.start = world.setup.place
        legs = Legs(loaded, inform=get_logger('leg_controller').info)
        self._node = _make_node(legs, loaded, world, options)
        self._legs = self._node.legs
        super().__init__(world, options, self._node)
        quadruped = legs.model.quadruped
        self._touching = (*quadruped.feet, *quadruped.trunk)
        size = self._legs.controller.model.scale.of('m')
        self.feet = _feet(self._legs.controller.model.geometry)
        self.camera = CameraView(distance=1.8 * size, azimuth=130.0, elevation=-20.0)
        self._legs.controller.words = self._key_words()
        self._hints = None if self._teleop is None else KeyHints(self._teleop.logic, HELP_KEY)
        self.notice = self._legs.notice
        if options.interactive:
            # What it refuses is in the status line; a log would break that line.
            self._node.get_logger().set_level(LoggingSeverity.ERROR)
        self._trunk = TrunkWatch()

    @property
    def legs(self) -> Legs:
        """What walks."""
        return self._legs

    @property
    def logic(self) -> KeysToTwist | None:
        """What makes keys velocities, None where they are sticks."""
        return None if self._teleop is None else self._teleop.logic

    @property
    def refusal(self) -> str:
        """Why it follows no velocity now, with what is to be done; '' where it does."""
        if self.state == StateName.MOVE_BASE:
            return ''
        first = '' if self.state == StateName.FIXED_STAND else '2 to stand, then '
        return f'press {first}5 to move: it is {self.state}'

    @property
    def drive_limits(self) -> dict[str, float]:
        """How fast a navigator may drive it: unitree_guide's speeds, where its legs can."""
        able, guide = self._legs.controller.command_filter.limits, LIMITS['guide']
        return {
            'forward': min(guide.forward, able.forward),
            'backward': min(0.3, able.backward),
            'lateral': min(guide.lateral, able.lateral),
            'yaw': min(guide.yaw, able.yaw),
            'lag': 0.3,
        }

    @property
    def period(self) -> float:
        """The controller's period [s]."""
        return 1.0 / self._legs.settings.update_rate

    @property
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""
        lines = unitree_help(self.layout)
        if self._teleop is None:
            return lines
        return (*self._teleop.logic.keymap.help_lines, *lines[:2], 'First 2, then 5, then drive.')

    @property
    def first_keys(self) -> str:
        """The keys to press first."""
        if self._teleop is None:
            return unitree_first_keys(self.layout)
        keys = driving_keys(self._teleop.logic.keymap)
        return f'press 2 to stand, 5 to drive; then {keys} (forward, back, left, right)'

    def press(self, key: str, is_pressed: bool = True) -> None:
        """Take a key; the leg controller knows those of qwerty."""
        legs_key = key if self.layout == 'qwerty' else on_qwerty(key, self.layout)
        self._legs.answers = is_pressed
        # What is published, and comes back, is the key as it was pressed.
        self._node.keys.put(String(data=legs_key), published=String(data=key))
        if self._teleop is None or self._hints is None:
            return
        self._teleop.keys.put(String(data=key))
        is_ours = legs_key not in STATE_KEYS and is_press(key)
        if self.state == StateName.MOVE_BASE and is_ours and is_pressed:
            self.notice.say(self._hints.press(key))

    @property
    def stop_key(self) -> str:
        """The key that ends every motion that keys have set going."""
        return ZERO_KEYS[0] if self._teleop is None else STOP_KEY

    @property
    def stop_keys(self) -> tuple[str, ...]:
        """The keys that stop it for good, and end every motion."""
        return tuple(dict.fromkeys((on_layout(PASSIVE, self.layout), self.stop_key)))

    def on_e_stop(self, stop: Callable[[], None]) -> None:
        """Let the controller's own e-stop service stop the run."""
        self._node.on_e_stop = stop

    def e_stop(self) -> None:
        """Let go of the legs in this instant."""
        self._legs.e_stop()

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion that keys have set going."""
        is_zero = key in ZERO_KEYS
        return is_zero if self._teleop is None else is_zero and super().stops(key)

    def latches(self, key: str) -> bool:
        """Whether what a press of this key sets moving goes on when the key is let go."""
        return on_qwerty(key, self.layout).lower() in STICK_KEYS or super().latches(key)

    def reset(self) -> None:
        """Forget the past: state, estimate, commands."""
        self._trunk = TrunkWatch()
        self._legs.reset()
        super().reset()

    @property
    def base_odometry(self) -> BaseOdometry | None:
        """Where its legs say it is; None before the first reading."""
        return self._legs.odometry

    def sample(self) -> Sample:
        """Return this instant for the report."""
        controller = self._legs.controller
        odometry = controller.odometry
        pose = (0.0, 0.0, 0.0)
        if odometry is not None:
            yaw = rpy_from_matrix(matrix_from_quaternion(odometry.orientation))[2]
            pose = (float(odometry.position[0]), float(odometry.position[1]), float(yaw))
        vx, vy, wz = self.command()
        forces = self._world.contact_forces(self._touching)
        touching = (forces > 0.0).astype(int).tolist()
        event = controller.event
        is_down = self._trunk.is_down(
            any(touching[4:]) or controller.is_fallen, controller.state, event
        )
        return Sample(controller.state, (vx, vy, wz), pose, touching[:4], is_down)

    def status(self) -> Status:
        """Return what a driver wants to see."""
        vx, vy, wz = self.command()
        command = (f'command {vx:+.2f} {vy:+.2f} m/s {wz:+.2f} rad/s',)
        has_fallen = self._legs.controller.is_fallen and self.state == StateName.PASSIVE
        state = 'fallen' if has_fallen else self.state
        facts = command if self.state in DRIVEN else ()
        return Status(state, facts, self.notice.text, self._axes((vx, vy, wz)))

    def _axes(self, command: tuple[float, float, float]) -> tuple[Axis, ...]:
        """Return the speeds commanded, and measured by the legs."""
        controller = self._legs.controller
        limits, odometry = controller.command_filter.limits, controller.odometry
        measured = (0.0, 0.0, 0.0)
        if odometry is not None:
            ahead, left, _ = odometry.linear_velocity.tolist()
            measured = (ahead, left, float(odometry.angular_velocity[2]))
        full = (limits.forward, limits.lateral, limits.yaw)
        names = (('forward', 'm/s'), ('left', 'm/s'), ('turn', 'rad/s'))
        rows = zip(names, command, measured, full, strict=True)
        return tuple(Axis(*name, wanted, now, most) for name, wanted, now, most in rows)

    def stop(self) -> None:
        """Command standstill, now and in the last word on cmd_vel, until the next key."""
        self._legs.controller.sticks.zero()
        super().stop()

    @property
    def _key_inputs(self) -> list[LoopbackSubscription[String]]:
        return [self._node.keys, *super()._key_inputs]

    def _keys_are_velocities(self, options: RunOptions) -> bool:
        return options.preset != UNITREE_PRESET

    def _schedule_publishing(self, schedule: Schedule) -> None:
        schedule.every(1.0 / self._legs.settings.publish_rate, self._node.publish)

    def _key_words(self) -> KeyWords:
        """Return what the legs tell of keys, some of which may be the keymap's."""
        keys = () if self._teleop is None else self._teleop.logic.keymap.keys
        return KeyWords(
            drive=StateName.TROTTING if self._teleop is None else StateName.MOVE_BASE,
            elsewhere=frozenset(on_qwerty(key, self.layout) for key in keys),
            reset_key=RESET_KEY,
            help_key=HELP_KEY,
            name=lambda key: on_layout(key, self.layout),
        )

    def command(self) -> tuple[float, float, float]:
        """Return the velocity that is commanded [m/s], [m/s], [rad/s]."""
        if self.state not in DRIVEN:
            return 0.0, 0.0, 0.0
        vx, vy, wz = self._legs.controller.command_filter.command
        return float(vx), float(vy), float(wz)

    def _control(self) -> None:
        world = self._world
        truth = world.base_since_start() if self.estimator == 'truth' else None
        names = world.joint_names, world.motor_names
        command = self._legs.control(world.read(), *names, self.period, truth)
        world.apply(command)


def _feet(legs: LegGeometry) -> np.ndarray:
    """Return the corners of squares around the feet below their hips, shape (16, 2) [m]."""
    places = legs.hip[:, :2] + np.column_stack((np.zeros(4), legs.offset))
    corners = legs.foot_radius * np.array([(x, y) for x in (-1, 1) for y in (-1, 1)])
    return np.asarray((places[:, None] + corners).reshape(-1, 2))


def _make_node(
    legs: Legs, loaded: Description, world: World, options: RunOptions
) -> LegControllerNode:
    """Return the face of a robot's legs, with what the command line says of them."""
    names = ('description', 'estimator', 'limits', 'gait', 'controller')
    given = {name: getattr(options, name) for name in names}
    overrides = [Parameter(name, value=str(value)) for name, value in given.items() if value]
    if world.prefix:
        overrides.append(Parameter('odom_frame', value=f'{world.prefix}odom'))
        overrides.append(Parameter('base_frame', value=world.prefix + loaded.robot.root))
    return LegControllerNode(legs, namespace=options.namespace, parameter_overrides=overrides)
