# SPDX-License-Identifier: Apache-2.0
"""A quadruped of a run: keys are states and sticks, or velocities with a preset."""

from collections.abc import Callable, Sequence
from functools import partial
import math
from typing import Any

from mujoco_sim.sensors.heights import true_heights
from mujoco_sim.simulation import Simulation
from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.world import LONG_STEP, World
import numpy as np
from policy_player.loading import load_policy
from quadruped_sim.height_scan import known_scan
from quadruped_sim.keys import (
    DRIVEN,
    FOLLOWING,
    KeyWords,
    STATE_KEYS,
    StateName,
    STICK_KEYS,
    ZERO_KEYS,
)
from quadruped_sim.leg_kinematics import LegGeometry
from quadruped_sim.legs import Legs
from quadruped_sim.parameters import LegNodeParameters
from quadruped_sim.presets import LIMITS
from robot_description.description import Description
from teleop_keyboard.dashboard import Axis, driving_keys, HELP_KEY, KeyHints, Status
from teleop_keyboard.keymap import on_qwerty
from wasd_cockpit.link import Choice
from wasd_core.errors import UserError
from wasd_core.robot_io import BaseOdometry
from wasd_core.rotations import yaw_of
from wasd_core.timing import is_press, ROUNDING, STOP_KEY

from wasd_bringup.robots import unitree_first_keys, unitree_help, UNITREE_PRESET
from wasd_bringup.run.elevation import RobotElevation
from wasd_bringup.run.inputs import RESET_KEY
from wasd_bringup.run.options import RunOptions, TRUE_SCAN
from wasd_bringup.run.report import Sample, TrunkWatch
from wasd_bringup.run.robot import axes_of, Robot, Velocity

LIDAR_NEEDED = (
    '{option}: {robot} has no lidar of points: give its description a '
    '<gazebo reference="LINK"><sensor type="ray"><model>l1</model> (docs/sensors.md)'
)
# A pit has no ground: its height is told as this far below the base [m].
PIT = 2.0
# The keys of the states policy and passive.
POLICY = next(key for key, state in STATE_KEYS.items() if state is StateName.POLICY)
PASSIVE = next(key for key, state in STATE_KEYS.items() if state is StateName.PASSIVE)


class Go2(Robot):
    """
    A quadruped with its leg controller.

    With the preset `unitree` keys are states and sticks; with any other they also become
    velocities, which the state move base (2, then 5) follows.
    """

    has_states = True
    other_presets = (UNITREE_PRESET,)

    def __init__(
        self, options: RunOptions, loaded: Description, world: World, simulation: Simulation
    ) -> None:
        super().__init__(options, loaded, world, simulation)
        given = self.given
        settings = LegNodeParameters.from_file(given.get('controller', '')).changed(given)
        walker = options.policy
        if walker is None or isinstance(walker, str):
            config = settings.policy_config or options.policy_config
            walker = load_policy(settings.policy or walker, config, loaded.robot)
        self.legs = Legs(loaded, settings, self.log.info, walker)
        quadruped = self.legs.model.quadruped
        self._touching = (*quadruped.feet, *quadruped.trunk)
        size = self.legs.model.scale.of('m')
        self.camera = CameraView(distance=1.8 * size, azimuth=130.0, elevation=-20.0)
        self._hints = None if self.logic is None else KeyHints(self.logic, HELP_KEY)
        self.notice = self.legs.notice
        self._trunk = TrunkWatch()
        # The `UnitreeDriver`, where there is one: its program may command the motors.
        self.outside: Any = None
        self._stepped = self._before_now()  # the tick of the last step of control
        self.elevation = RobotElevation(self)
        mapper = self.elevation.mapper
        if options.eyes and mapper is None:
            raise UserError(LIDAR_NEEDED.format(option='--eyes', robot=loaded.robot.name))
        if getattr(walker, 'has_height_scan', False):
            if options.height_scan == TRUE_SCAN:
                walker.heights = partial(_true_scan, world)
            elif mapper is None:
                said = LIDAR_NEEDED.format(option='--policy', robot=loaded.robot.name)
                raise UserError(f'{said}; or give --height-scan truth')
        self.elevation.wanted_by.append(lambda: self.legs.wants_map)
        self.legs.see(None if mapper is None else mapper.elevation)

    def prepare(self) -> None:
        """Apply the settings, before anything is scheduled."""
        super().prepare()
        # Sensors that are late are read so long before a step of the controller [s]: whole ticks.
        delay = self.world.sensor_delay * self.world.time_step
        self._lead = math.ceil(delay / self.period - ROUNDING) * self.period
        self.feet = _feet(self.legs.controller.model.geometry)
        keys = () if self.logic is None else self.logic.keymap.keys
        self.legs.controller.words = KeyWords(
            drive=StateName.TROTTING if self.logic is None else StateName.MOVE_BASE,
            elsewhere=frozenset(on_qwerty(key, self.options.layout) for key in keys),
            reset_key=RESET_KEY,
            help_key=HELP_KEY,
            policy='--policy FILE',
            name=self.named,
        )

    @property
    def given(self) -> dict[str, Any]:
        """The controller's parameters from the options, by name."""
        options, world = self.options, self.world
        names = ('description', 'estimator', 'limits', 'gait', 'controller')
        given: dict[str, Any] = {
            name: str(value) for name in names if (value := getattr(options, name))
        }
        for name in ('policy', 'policy_config'):
            if isinstance(value := getattr(options, name), str):
                given[name] = value
        if options.eyes:
            given['eyes'] = True
        if world.prefix:
            given['odom_frame'] = f'{world.prefix}odom'
            given['base_frame'] = world.prefix + self.description.robot.root
        return given

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the robot's oddities."""
        return tuple(self.legs.controller.notes)

    @property
    def state(self) -> str:
        """The controller's state."""
        return self.legs.state

    @property
    def _refusal(self) -> str:
        if self.state in FOLLOWING:
            return ''
        first = '' if self.state == StateName.FIXED_STAND else '2 to stand, then '
        return f'press {first}5 to move: it is {self.state}'

    @property
    def drive_limits(self) -> dict[str, float]:
        """A navigator's speed limits: those of unitree_guide, within the legs' limits."""
        able, guide = self.legs.controller.command_filter.limits, LIMITS['guide']
        return {
            'forward': min(guide.forward, able.forward),
            'backward': min(0.3, able.backward),
            'lateral': min(guide.lateral, able.lateral),
            'yaw': min(guide.yaw, able.yaw),
            'lag': 0.3,
        }

    @property
    def braking(self) -> tuple[float, float, float]:
        """The sure deceleration: a Go2 of 3 m/s stands after 2.5 m."""
        unit = self.legs.model.scale.of('m/s^2')
        return (1.6 * unit, 1.0 * unit, 3.0 * self.legs.model.scale.of('1/s^2'))

    def hold_back(self, limit: Callable[[Sequence[float]], np.ndarray]) -> None:
        """Limit each velocity (vx, vy, wz) that the legs follow by a guard."""
        self.legs.controller.command_filter.hold_back = lambda asked: limit(asked.tolist())

    @property
    def period(self) -> float:
        """The controller's period [s]."""
        return 1.0 / self.legs.settings.update_rate

    @property
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""
        lines = unitree_help(self.options.layout)
        if self.logic is not None:
            ours = map(self._without_own_keys, lines[:2])
            return (*self.logic.keymap.help_lines, *ours, 'First 2, then 5, then drive.')
        if self.legs.controller.has_policy:
            lines = (*lines[:2], f'{self.named(POLICY)} policy, from the stand', *lines[2:])
        return lines

    def _without_own_keys(self, line: str) -> str:
        """Return a line of help without the keys that the keymap takes: all but digits."""
        gap, taken = '   ', {key for key in self.own_keys if not key.isdigit()}
        return gap.join(part for part in line.split(gap) if part.split()[0] not in taken)

    @property
    def first_keys(self) -> str:
        """The keys to press first."""
        if self.logic is None:
            return unitree_first_keys(self.options.layout)
        keys = driving_keys(self.logic.keymap)
        return f'press 2 to stand, 5 to drive; then {keys} (forward, back, left, right)'

    @property
    def stop_key(self) -> str:
        """The key that ends every motion by keys."""
        return ZERO_KEYS[0] if self.logic is None else STOP_KEY

    @property
    def stop_keys(self) -> tuple[str, ...]:
        """The keys that stop it and end every motion."""
        return tuple(dict.fromkeys((self.named(PASSIVE), self.stop_key)))

    @property
    def odometry(self) -> BaseOdometry | None:
        """The odometry of its legs; None before the first reading."""
        return self.legs.odometry

    @property
    def frames(self) -> tuple[str, str]:
        """The frames of odometry and of the base."""
        settings = self.legs.settings
        return settings.odom_frame, settings.base_frame or self.legs.base_frame

    def stops(self, key: str) -> bool:
        """Whether a press of this key ends every motion by keys."""
        is_zero = key in ZERO_KEYS
        return is_zero if self.logic is None else is_zero and super().stops(key)

    def latches(self, key: str) -> bool:
        """Whether the motion of this key continues after its release."""
        return on_qwerty(key, self.options.layout).lower() in STICK_KEYS or super().latches(key)

    def choices(self) -> tuple[Choice, ...]:
        """Return the states with keys."""
        controller = self.legs.controller
        return tuple(
            Choice(state.value, key, state.value == self.state, self._refusal_of(key))
            for key, state in STATE_KEYS.items()
            if controller.has_policy or state is not StateName.POLICY
        )

    def _refusal_of(self, key: str) -> str:
        """Return why a state's key does nothing now; '' if it does something."""
        controller = self.legs.controller
        if not controller.words.is_for_legs(key):
            return f"the key {self.named(key)} is the preset's"
        return controller.refusal(key)

    def command(self, velocity: Velocity, age: float = 0.0) -> None:
        """Give the controller a velocity [m/s], [m/s], [rad/s] of any source."""
        self.legs.command(*velocity)

    def control(self) -> None:
        """Step the controller on the present state, and give its command to the world."""
        if self.world.tick == self._stepped:
            return  # this instant again, after Ctrl-C in somebody's notebook
        world, dt, self._stepped = self.world, self._waited(), self.world.tick
        truth = world.base_since_start() if self.options.estimator == 'truth' else None
        if self.outside is not None:
            self.outside.step(dt)
        self.elevation.prepare()
        own = self.legs.control(world.read(), world.joint_names, world.motor_names, dt, truth)
        theirs = None if self.outside is None else self.outside.motors()
        world.apply(own if theirs is None else theirs)
        if self.legs.controller.has_policy:
            # Physics must never stop within a long step, however its run is paced.
            is_even = self.simulation.schedule.stride % LONG_STEP == 0
            world.actuation.allows_long_steps = self.rest() > 0.0 and is_even
        self.elevation.step()

    def _timed_control(self) -> None:
        if self.rest() < ROUNDING:
            super()._timed_control()
        elif -self.period < self._until_read() - ROUNDING < 0.0:
            self.world.read()

    def _before_now(self) -> int:
        return self.world.tick - round(self.period / self.world.time_step)

    def _waited(self) -> float:
        return (self.world.tick - self._stepped) * self.world.time_step

    def rest(self) -> float:
        """Return for how long from now [s] the controller has nothing to do: motors hold."""
        if self.outside is not None or self.options.interface is not None:
            return 0.0
        until_read = self._until_read()
        return until_read if until_read > ROUNDING else until_read + self._lead

    def _until_read(self) -> float:
        """Return the time from now [s] to the reading for the controller's next step."""
        return self.legs.controller.due_after - self._waited() - self._lead

    def stop(self) -> None:
        """Command standstill, now and in the last message on cmd_vel, until the next key."""
        self.legs.controller.sticks.zero()
        super().stop()

    def reset(self) -> None:
        """Forget the past: state, estimate, commands."""
        self._trunk, self._stepped = TrunkWatch(), self._before_now()
        self.legs.reset()
        super().reset()

    def close(self) -> None:
        """Leave the legs passive."""
        super().close()
        self.legs.controller.e_stop()

    def sample(self) -> Sample:
        """Return the present sample of the report."""
        controller = self.legs.controller
        robot = controller.robot  # `odometry` computes covariances, too: slower
        pose = (0.0, 0.0, 0.0)
        if robot is not None:
            x, y, _ = robot.base.position.tolist()
            pose = (x, y, yaw_of(robot.orientation))
        forces = self.world.contact_forces(self._touching)
        touching = [int(force > 0.0) for force in forces.tolist()]
        is_down = self._trunk.is_down(
            any(touching[4:]) or controller.is_fallen, controller.state, controller.event
        )
        return Sample(controller.state, self.commanded(), pose, touching[:4], is_down)

    def commanded(self) -> Velocity:
        """Return the velocity that it follows [m/s], [m/s], [rad/s]."""
        if self.state not in DRIVEN:
            return 0.0, 0.0, 0.0
        vx, vy, wz = self.legs.controller.command_filter.command
        return float(vx), float(vy), float(wz)

    def _status(self) -> Status:
        vx, vy, wz = self.commanded()
        command = (f'command {vx:+.2f} {vy:+.2f} m/s {wz:+.2f} rad/s',)
        has_fallen = self.legs.controller.is_fallen and self.state == StateName.PASSIVE
        state = 'fallen' if has_fallen else self.state
        facts = command if self.state in DRIVEN else ()
        return Status(state, facts, self.notice.text, self._axes((vx, vy, wz)))

    def _axes(self, command: Velocity) -> tuple[Axis, ...]:
        """Return the speeds commanded, and measured by the legs."""
        controller = self.legs.controller
        limits, odometry = controller.command_filter.limits, controller.odometry
        measured = (0.0, 0.0, 0.0)
        if odometry is not None:
            ahead, left, _ = odometry.linear_velocity.tolist()
            measured = (ahead, left, float(odometry.angular_velocity[2]))
        return axes_of(command, measured, (limits.forward, limits.lateral, limits.yaw))

    @property
    def _keys_are_velocities(self) -> bool:
        return self.options.preset != UNITREE_PRESET

    def let_go(self, why: str = 'emergency stop') -> None:
        """Make the legs limp at once; after a key the robot squats first."""
        self.legs.e_stop(why)

    def press_state(self, key: str) -> str:
        """Handle a key for the legs, by its name on the layout; return its name on qwerty."""
        legs_key = on_qwerty(key, self.options.layout)
        self.legs.press(legs_key)
        return legs_key

    def _press(self, key: str, is_pressed: bool) -> None:
        self.legs.answers = is_pressed
        legs_key = self.press_state(key)
        super()._press(key, is_pressed)
        is_ours = legs_key not in STATE_KEYS and is_press(key)
        if self._hints and self.state in FOLLOWING and is_ours and is_pressed:
            self.notice.say(self._hints.press(key))


def _true_scan(world: World) -> np.ndarray:
    """Return the true height scan of now, (187,) [m]."""
    base = world.base()
    heights = partial(true_heights, world)
    return known_scan(heights, base.position, base.orientation, PIT)


def _feet(legs: LegGeometry) -> np.ndarray:
    """Return the corners of squares around the feet below their hips, shape (16, 2) [m]."""
    places = legs.hip[:, :2] + np.column_stack((np.zeros(4), legs.offset))
    corners = legs.foot_radius * np.array([(x, y) for x in (-1, 1) for y in (-1, 1)])
    return np.asarray((places[:, None] + corners).reshape(-1, 2))
