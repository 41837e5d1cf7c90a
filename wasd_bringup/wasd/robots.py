# SPDX-License-Identifier: Apache-2.0
"""A robot, its world and its controller as one object that a script steps."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import logging
import os
from pathlib import Path
import threading
import time
from types import MappingProxyType
from typing import Any

from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.drive import DiffDrive
from diff_drive_sim.parameters import DiffDriveParameters
from mujoco_sim.parameters import NOTHING, Untold
from mujoco_sim.pictures import take_picture, Viewpoint
from mujoco_sim.robot_setup import randomise, usual_setup
from mujoco_sim.simulation import Simulation
from mujoco_sim.world import build_world
import numpy as np
from quadruped_sim.keys import STATE_KEYS
from quadruped_sim.leg_controller import LegController
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import JointMap, RobotModel
from quadruped_sim.tuning import CommandParameters, GaitParameters
from robot_description.description import load_robot
from robot_description.morphology.wheels import ANY_WHEELS, WheelChoice
from teleop_keyboard.keymap_file import load_preset
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_core.errors import UserError
from wasd_core.robot_io import BaseOdometry, BaseState, JointCommand, LEG_RATE

# Without a handler Python writes warnings to standard error, a line each.
LOGGER = logging.getLogger(__name__)
# Where a picture is taken from: distance as a multiple of the robot's [m], angles [degrees].
AZIMUTH, ELEVATION = 130.0, -20.0


class Robot:
    """
    What both robots have: a world that is stepped, pressed keys, a commanded velocity.

    Everything happens inside `run`: between two calls simulated time stands still. The same seed
    and the same calls give the same bits. A velocity holds until the next, since who commands it
    is known to be alive: it is this process that steps the robot. One thread at a time may use it;
    a call from another meanwhile is refused.

    Raises:
        UserError: the seed is no whole number from 0 on.
    """

    _distance = 1.8
    _with_noise = True

    def __init__(
        self,
        description: str,
        world: str,
        seed: int,
        package_path: Sequence[str | os.PathLike[str]],
        xacro_arguments: Mapping[str, str],
        wheels: WheelChoice = ANY_WHEELS,
        untold: Untold = NOTHING,
    ) -> None:
        if not isinstance(seed, (int, np.integer)) or seed < 0:
            raise UserError(f'seed: got {seed!r}, wanted a whole number >= 0')
        search = [Path(folder) for folder in package_path]
        self._loaded = load_robot(description, search, xacro_arguments, wheels=wheels)
        setup = usual_setup(self._loaded, self._with_noise, untold)
        setup = randomise(setup, seed, self._loaded)
        self._world = build_world(self._loaded, world, seed, setup, visuals=True)
        self._simulation = Simulation(self._world, speed=0.0)
        self._window: Any = None
        self._lock = threading.RLock()

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self._world.time

    @property
    def truth(self) -> BaseState:
        """Where the base really is: position [m], quaternion w x y z, velocities."""
        return self._world.base()

    def run(self, seconds: float) -> None:
        """
        Simulate for so long [s], as fast as it goes; with a window, at its pace.

        Raises:
            UserError: the time is negative or not finite.
        """
        if not 0.0 <= seconds < float('inf'):
            raise UserError(f'run: got {seconds} s, wanted a finite time >= 0')
        with self._alone('run'):
            end = self._world.tick + round(seconds / self._world.time_step)
            self._simulation.run(
                stop=lambda: self._world.tick >= end,
                poll=self._show,
                duration=end * self._world.time_step,
            )

    def push(
        self, force: Sequence[float], seconds: float, point: Sequence[float] | None = None
    ) -> None:
        """
        Push the base with a world-frame force [N], shape (3,), for so long [s].

        It acts at a point of the base's frame [m], shape (3,), or else at the centre of mass.

        Raises:
            UserError: not three finite numbers, or a time that is not above 0.
        """
        with self._alone('push'):
            is_taken = seconds > 0.0 and self._world.push(force, seconds, point)
        if not is_taken:
            at = '' if point is None else f' at {point!r}'
            raise UserError(
                f'push: got {force!r} for {seconds!r} s{at}, '
                'wanted three finite numbers, for a time > 0'
            )

    def reset(self) -> None:
        """Put the robot back to its start, controller included; time goes on."""
        with self._alone('reset'):
            self._simulation.reset()

    def picture(self, path: str | os.PathLike[str]) -> None:
        """
        Write what the robot looks like now as a picture of 1280 x 720, a PNG by its name.

        Raises:
            UserError: it cannot be written there, or its name ends as none of a picture.
        """
        with self._alone('picture'):
            view = Viewpoint(self.truth.position.tolist(), self._distance, AZIMUTH, ELEVATION)
            try:
                take_picture(self._world, view, Path(path))
            except (OSError, ValueError) as error:
                raise UserError(f'picture: {error}') from error

    def show(self) -> None:
        """
        Open MuJoCo's window; from now on `run` keeps pace with wall time.

        Raises:
            SimulationError: there is no display.
        """
        from mujoco_sim.viewer.page import CameraView
        from mujoco_sim.viewer.views import NativeView

        self._window = NativeView(self._world, CameraView(self._distance, AZIMUTH, ELEVATION))
        self._simulation.pacer.speed = 1.0
        self._simulation.pacer.restart()

    @contextlib.contextmanager
    def _alone(self, what: str) -> Iterator[None]:
        """
        Keep other threads out: two that step one world corrupt its memory.

        Raises:
            UserError: another thread is inside.
        """
        if not self._lock.acquire(blocking=False):
            raise UserError(
                f'{what}: another thread uses this robot now; call it from one at a time'
            )
        try:
            yield
        finally:
            self._lock.release()

    def _show(self, timeout: float) -> None:
        if self._window is not None:
            self._window.sync()
        if timeout > 0.0:
            time.sleep(timeout)


def _check_key(key: str) -> None:
    if not isinstance(key, str):
        raise UserError(f"press: got {key!r}, wanted the name of a key, such as '2'")


class Go2(Robot):
    """
    A Unitree Go2, or any quadruped, with its leg controller: keys 2 stand, 4 trot, 5 move base.

    `drive` commands a velocity in the state move base. `estimator` is `kalman` (IMU with noise
    and legs) or `truth`; `limits` is `sport`, `guide` or `race`, what full stick means; `gait`
    is the order in which the feet step. The controller is not told of `untold`: friction, payload,
    and how much the robot differs at random.

    Raises:
        UserError: what is wrong with the description, the world or an option, in one line.
    """

    def __init__(
        self,
        world: str = 'flat',
        seed: int = 0,
        *,
        description: str = 'go2',
        package_path: Sequence[str | os.PathLike[str]] = (),
        xacro_arguments: Mapping[str, str] = MappingProxyType({}),
        estimator: str = 'kalman',
        limits: str = 'sport',
        gait: str = 'trot',
        untold: Untold = NOTHING,
    ) -> None:
        self._with_noise = estimator == 'kalman'
        super().__init__(description, world, seed, package_path, xacro_arguments, untold=untold)
        parameters = LegControllerParameters(
            command=CommandParameters(limits=limits), gait=GaitParameters(name=gait)
        )
        model = RobotModel(self._loaded)
        self._controller = LegController(model, parameters, estimator)
        for note in self._controller.notes:
            LOGGER.warning('legs: %s', note)
        self._distance *= model.scale.of('m')
        names = self._world.joint_names, self._world.motor_names
        self._joints = JointMap(model.quadruped, *names)
        self._velocity: tuple[float, float, float] | None = None
        self._simulation.schedule.every(1.0 / LEG_RATE, self._control)
        self._simulation.on_reset.append(self._forget)

    @property
    def state(self) -> str:
        """The controller's state, such as `trotting`."""
        return self._controller.state

    @property
    def odometry(self) -> BaseOdometry:
        """Where the robot believes it is: pose, velocities and their covariances."""
        odometry = self._controller.odometry
        if odometry is None:
            raise UserError('odometry: there is none before the first run')
        return odometry

    @property
    def full_stick(self) -> tuple[float, float, float]:
        """The fastest it walks ahead and sideways [m/s] and turns [rad/s]; more is clamped."""
        limits = self._controller.command_filter.limits
        return limits.forward, limits.lateral, limits.yaw

    def press(self, key: str) -> str | None:
        """
        Press a key of the Go2: a state (0 to 9, v) or a stick (w a s d j l i k, space).

        Return what the status line would say to it, if anything: a key that does nothing in this
        state says what to press, and that of the present state that it is there already.

        Raises:
            UserError: the state cannot follow the present one, and what to press; or no text.
        """
        _check_key(key)
        with self._alone('press'):
            said = self._controller.press(key)
            state = self._controller.coming_state
        if said is not None and key in STATE_KEYS and STATE_KEYS[key] != state:
            raise UserError(said)
        return said

    def drive(self, vx: float, vy: float = 0.0, wz: float = 0.0) -> None:
        """
        Command a velocity [m/s], [m/s], [rad/s] in the state move base, until the next or its end.

        Raises:
            UserError: not finite, or the robot is in another state.
        """
        if not np.isfinite((vx, vy, wz)).all():
            raise UserError(f'drive: got {(vx, vy, wz)}, wanted finite numbers')
        with self._alone('drive'):
            if self._controller.coming_state != 'move base':
                raise UserError(f'drive: needs the state move base (2, then 5), not {self.state}')
            self._velocity = (vx, vy, wz)

    def _control(self) -> None:
        if self._controller.coming_state != 'move base':
            self._velocity = None  # who comes back to move base stands until it is driven
        if self._velocity is not None and self._controller.state == 'move base':
            self._controller.set_velocity(*self._velocity)
        reading = self._joints.reading(self._world.read())
        truth = self._world.base_since_start()
        command = self._controller.step(reading, 1.0 / LEG_RATE, truth)
        self._world.apply(self._joints.command(command))

    def _forget(self) -> None:
        self._velocity = None
        self._controller.reset()


class Mbot(Robot):
    """
    mbot, or any robot with two driven wheels, with its drive controller: keys u i o j k l m , .

    `drive` commands a velocity; a key takes over from it, as long as it is held. `controller` is a
    YAML file with the drive's parameters.

    Raises:
        UserError: what is wrong with the description, the world or an option, in one line.
    """

    _distance = 1.6

    def __init__(
        self,
        world: str = 'flat',
        seed: int = 0,
        *,
        description: str = 'mbot',
        package_path: Sequence[str | os.PathLike[str]] = (),
        xacro_arguments: Mapping[str, str] = MappingProxyType({}),
        preset: str = 'mbot',
        controller: str | os.PathLike[str] = '',
    ) -> None:
        parameters = DiffDriveParameters()
        if controller:
            parameters = read_controller_file(str(controller)).parameters
        if parameters.mode != 'float':
            raise UserError(f"mode: got {parameters.mode!r}, a script drives mode 'float' only")
        choice = parameters.wheel_choice()
        super().__init__(description, world, seed, package_path, xacro_arguments, choice)
        self._period = 1.0 / parameters.update_rate
        self._unit = DiffDrive(self._loaded.robot, parameters)
        for note in self._unit.notes:
            LOGGER.warning('wheels: %s', note)
        self._unit.say = lambda text: LOGGER.warning('wheels: %s', text)
        self._keys = KeysToTwist(load_preset(preset))
        geometry = self._unit.controller.geometry
        wheels = (geometry.left_joint, geometry.right_joint)
        self._motors = [self._world.motor_names.index(name) for name in wheels]
        self._wheels = [self._world.joint_names.index(name) for name in wheels]
        self._velocity = (0.0, 0.0)
        self._is_driven_by_keys = False
        schedule = self._simulation.schedule
        schedule.every(1.0 / self._keys.rate, self._take_keys)
        schedule.at_rate('update_rate', parameters.update_rate, self._control)
        self._simulation.on_reset.append(self._forget)

    @property
    def state(self) -> str:
        """`driving`, `stopped` or `timed out`."""
        return self._unit.controller.state

    @property
    def odometry(self) -> Any:
        """Where the wheels say it is: x, y [m], yaw [rad], and the velocities."""
        return self._unit.controller.odometry_state

    def press(self, key: str) -> None:
        """
        Press a key of the keymap; held keys are pressed again, 30 times a second.

        Raises:
            UserError: no text.
        """
        _check_key(key)
        with self._alone('press'):
            self._is_driven_by_keys = True
            self._keys.press(key)

    def drive(self, vx: float, wz: float = 0.0) -> None:
        """
        Command a velocity ahead [m/s] and a turn [rad/s], until the next.

        Raises:
            UserError: not finite.
        """
        if not np.isfinite((vx, wz)).all():
            raise UserError(f'drive: got {(vx, wz)}, wanted finite numbers')
        with self._alone('drive'):
            self._is_driven_by_keys = False
            self._velocity = (vx, wz)

    def _take_keys(self) -> None:
        velocity = self._keys.step(1.0 / self._keys.rate)
        if velocity is not None and self._is_driven_by_keys:
            self._velocity = (velocity.vx, velocity.wz)

    def _control(self) -> None:
        self._unit.controller.command(*self._velocity)
        left, right = self._world.joints().position[self._wheels].tolist()
        speeds = self._unit.step(left, right, self._period)
        ahead, _, turn = self.truth.planar_velocity.tolist()
        self._unit.watch(ahead, turn, self._period)
        command = np.zeros((len(JointCommand._fields), len(self._world.motor_names)))
        command[1, self._motors] = speeds
        command[4, self._motors] = self._unit.motor.damping
        self._world.apply(JointCommand(*command))

    def _forget(self) -> None:
        self._velocity = (0.0, 0.0)
        self._keys.reset()
        self._unit.reset()
