# SPDX-License-Identifier: Apache-2.0
"""A robot, its world and its controller as one object that a script steps."""

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import os
from pathlib import Path
import threading
import time
from types import MappingProxyType
from typing import Any

import mujoco
from mujoco_sim.parameters import NOTHING, SimulatorParameters, Untold
from mujoco_sim.pictures import take_picture, Viewpoint
from quadruped_sim.keys import FOLLOWING, KeyWords, STATE_KEYS, StateName
from quadruped_sim.states.policy import Walker
from wasd_bringup.cli.options import LONGEST_RUN, read_folders
from wasd_bringup.robots import G1 as G1_ROW
from wasd_bringup.robots import GO2, MBOT, RobotRow
from wasd_bringup.run.options import MAPPED_SCAN, RunOptions, SCANS
from wasd_bringup.run.robot import Velocity
from wasd_bringup.run.worlds import build_robots
from wasd_core.arguments import checked
from wasd_core.errors import one_line, UserError
from wasd_core.parameters import shown
from wasd_core.robot_io import BaseOdometry, BaseState

# Where a picture is taken from: distance as a multiple of the robot's [m], angles [degrees].
AZIMUTH, ELEVATION = 130.0, -20.0


class Robot:
    """
    The common part of all robots: a world, pressed keys, a commanded velocity.

    Simulated time passes only inside `run`. The same seed and the same calls give the same bits. A
    velocity holds until the next, without a time-out: the process that commands it also steps the
    robot. Only one thread may use it at a time; a call from another thread is refused.

    Raises:
        UserError: the seed is below 0 or has more than 63 bits.
    """

    def __init__(
        self,
        row: RobotRow,
        world: str | os.PathLike[str],
        seed: int,
        description: str | os.PathLike[str],
        package_path: Sequence[str | os.PathLike[str]],
        **others: Any,
    ) -> None:
        SimulatorParameters.checked('seed', int(seed))
        options = RunOptions(
            robot=row.name,
            world=os.fspath(world),
            seed=seed,
            description=os.fspath(description),
            package_path=read_folders(package_path, 'package_path'),
            speed=0.0,
            **{'preset': row.preset} | others,
        )
        (robot,) = build_robots(options, visuals=True)
        self._robot: Any = robot
        for note in robot.notes:
            robot.log.warning(note)
        robot.prepare()
        self._velocity: Velocity | None = None
        self._part_of_a_step = 0.0  # that `run` has yet to simulate, in time steps
        robot.on_e_stop = self._e_stop
        self._world, self._simulation = robot.world, robot.simulation
        # What holds a velocity is the step of the controller alone.
        schedule = self._simulation.schedule
        schedule.at_rate('update_rate', 1.0 / robot.period, self._repeat, robot.rest)
        self._simulation.on_reset.append(self._forget)
        robot.schedule_control(schedule)
        stride = schedule.stride * self._world.time_step
        schedule.every(stride, robot.sensors.step, robot.sensors.rest)
        self._distance = robot.camera.distance
        self._window: Any = None
        self._lock, self._is_running = threading.RLock(), False

    def __reduce__(self) -> Any:
        """Refuse to be copied or pickled: half of it would belong to the first."""
        raise UserError(f'{type(self).__name__} cannot be copied or pickled: make another')

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self._world.time

    @property
    def state(self) -> str:
        """The controller's state, such as `trotting`, `policy` or `driving`."""
        state: str = self._robot.state
        return state

    @property
    def truth(self) -> BaseState:
        """The true state of the base: position [m], quaternion w x y z, velocities."""
        return self._world.base()

    @checked
    def run(self, seconds: float) -> None:
        """
        Simulate a time [s], as fast as possible; with a window, in real time.

        It takes whole time steps; the next call adds the rest of one.

        Raises:
            UserError: the time is negative or longer than a run can be.
        """
        if not 0.0 <= seconds <= LONGEST_RUN:
            raise UserError(f'run: got {seconds} s, wanted a time >= 0 and <= {LONGEST_RUN:g}')
        with self._alone('run'):
            if self._is_running:
                raise UserError('run: it is running: what it calls cannot let time pass')
            wanted = seconds / self._world.time_step + self._part_of_a_step
            steps = round(wanted)
            self._part_of_a_step = wanted - steps
            end = self._world.tick + steps
            self._is_running = True
            try:
                self._simulation.run(
                    stop=lambda: self._world.tick >= end,
                    poll=self._show,
                    duration=end * self._world.time_step,
                )
            finally:
                self._is_running = False

    @checked
    def push(
        self, force: Sequence[float], seconds: float, point: Sequence[float] | None = None
    ) -> None:
        """
        Push the base with a world-frame force [N], shape (3,), for so long [s].

        It acts at a point of the base's frame [m], shape (3,), or else at the centre of mass.

        Raises:
            UserError: not three finite numbers, or a time that is not above 0.
        """
        if not 0.0 < seconds <= LONGEST_RUN:
            raise UserError(f'push: got {seconds} s, wanted a time > 0 and <= {LONGEST_RUN:g}')
        with self._alone('push'):
            is_taken = self._world.push(force, seconds, point)
        if not is_taken:
            at = '' if point is None else f' at {shown(point)}'
            raise UserError(f'push: got {shown(force)}{at}, wanted three numbers')

    def reset(self) -> None:
        """Put the robot back to its start, controller included; time goes on."""
        with self._alone('reset'):
            self._part_of_a_step = 0.0
            self._simulation.reset()

    @checked
    def picture(self, path: str | os.PathLike[str]) -> None:
        """
        Write a picture of the present scene, 1280 x 720, for instance a PNG.

        Raises:
            UserError: the file cannot be written, has no ending of a picture, or nothing draws.
        """
        with self._alone('picture'):
            view = Viewpoint(self.truth.position.tolist(), self._distance, AZIMUTH, ELEVATION)
            try:
                take_picture(self._world, view, Path(path))
            except (OSError, ValueError) as error:
                raise UserError(f'picture: {path}: {one_line(error)}') from error
            except mujoco.FatalError as error:
                cure = 'import wasd before mujoco, or set MUJOCO_GL=egl or osmesa'
                raise UserError(f'picture: {one_line(error)}: {cure}') from error

    def show(self) -> None:
        """
        Open MuJoCo's window; from now on `run` keeps pace with wall time.

        Raises:
            SimulationError: there is no display.
        """
        from mujoco_sim.viewer.camera import CameraView
        from mujoco_sim.viewer.views import NativeView

        self._window = NativeView(self._world, CameraView(self._distance, AZIMUTH, ELEVATION))
        self._simulation.pacer.speed = 1.0
        self._simulation.pacer.restart()

    @contextlib.contextmanager
    def _alone(self, what: str) -> Iterator[None]:
        """Keep other threads out: two that step one world corrupt its memory."""
        if not self._lock.acquire(blocking=False):
            raise UserError(
                f'{what}: another thread uses this robot now; call it from one at a time'
            )
        try:
            yield
        finally:
            self._lock.release()

    def _repeat(self) -> None:
        """Command the velocity that is in force again."""
        if self._velocity is not None:
            self._robot.command(self._velocity)

    def _forget(self) -> None:
        self._velocity = None

    def _e_stop(self, by: str) -> None:
        """Stop the robot; no key is refused after it, as a script holds none down."""
        self._velocity = None
        self._robot.stop()
        self._robot.let_go()

    def _show(self, timeout: float) -> None:
        if self._window is not None:
            self._window.sync()
        if timeout > 0.0:
            time.sleep(timeout)


class Go2(Robot):
    """
    A Unitree Go2, or any quadruped, with its leg controller: keys 2 stand, 4 trot, 5 move base.

    `drive` commands a velocity in the state move base. `estimator` is `kalman` (IMU with noise
    and legs) or `truth`; `limits` (`sport`, `guide` or `race`) sets the speeds at full stick;
    `gait` is the first gait. With `eyes` it walks by sight, with heights from its lidar, as after
    the key e. `policy` is a network's file, or any `Walker`, for the state policy (2, then p);
    `policy_config` has its training settings, `height_scan` the source of its heights, `map` or
    `truth`, if it was trained with them. `untold` has values that the controller does not know:
    friction, payload, random differences of the robot.

    Raises:
        UserError: the description, the world or an option is wrong; one line says how.
    """

    @checked
    def __init__(
        self,
        world: str | os.PathLike[str] = 'flat',
        seed: int = 0,
        *,
        description: str | os.PathLike[str] = 'go2',
        package_path: Sequence[str | os.PathLike[str]] = (),
        xacro_arguments: Mapping[str, str] = MappingProxyType({}),
        estimator: str = 'kalman',
        limits: str = 'sport',
        gait: str = 'trot',
        eyes: bool = False,
        policy: str | os.PathLike[str] | Walker | None = None,
        policy_config: str | os.PathLike[str] | None = None,
        height_scan: str = MAPPED_SCAN,
        untold: Untold = NOTHING,
    ) -> None:
        if height_scan not in SCANS:
            wanted = ' or '.join(SCANS)
            raise UserError(f'height_scan: got {height_scan!r}, wanted {wanted}')
        super().__init__(
            GO2,
            world,
            seed,
            description,
            package_path,
            xacro_arguments=xacro_arguments,
            estimator=estimator,
            limits=limits,
            gait=gait,
            eyes=eyes,
            policy=os.fspath(policy) if isinstance(policy, (str, os.PathLike)) else policy,
            policy_config=None if policy_config is None else os.fspath(policy_config),
            height_scan=height_scan,
            untold=untold,
        )
        self._robot.legs.controller.words = KeyWords(policy='policy=FILE')

    @property
    def odometry(self) -> BaseOdometry:
        """The robot's odometry: pose, velocities and their covariances."""
        odometry: BaseOdometry | None = self._robot.odometry
        if odometry is None:
            raise UserError('odometry: there is none before the first run')
        return odometry

    @property
    def full_stick(self) -> tuple[float, float, float]:
        """The highest speeds ahead and sideways [m/s] and of turning [rad/s]; more is clamped."""
        limits = self._robot.legs.controller.command_filter.limits
        return limits.forward, limits.lateral, limits.yaw

    @checked
    def press(self, key: str) -> str | None:
        """
        Press a key of the Go2: a state (0 to 9, v, p), a stick (w a s d j l i k, space), a gait
        (n, N), e, which opens and shuts its eyes, or ESC, the E-STOP.

        Return the answer of the status line, if any: for a key without effect, what to press
        instead; for the key of the present state, that the robot is in it already.

        Raises:
            UserError: the state cannot follow the present one, and what to press; or no text.
        """
        with self._alone('press'):
            if self._robot.heeds_e_stop(key, 'script'):
                return None
            controller = self._robot.legs.controller
            before = controller.coming_state
            said: str | None = controller.press(key)
            state = controller.coming_state
            if state != before:
                self._velocity = None  # also where further keys lead back to this state
        if said is not None and key in STATE_KEYS and STATE_KEYS[key] != state:
            raise UserError(said)
        return said

    @checked
    def drive(self, vx: float, vy: float = 0.0, wz: float = 0.0) -> None:
        """
        Command a velocity [m/s], [m/s], [rad/s] until the next, or the end of the state.

        It is followed in the states move base and policy.

        Raises:
            UserError: not finite, or the robot is in another state.
        """
        with self._alone('drive'):
            if self._robot.legs.controller.coming_state not in FOLLOWING:
                raise UserError(f'drive: needs the state move base (2, then 5), not {self.state}')
            self._velocity = (vx, vy, wz)

    def _repeat(self) -> None:
        if self._robot.legs.controller.coming_state not in FOLLOWING:
            self._velocity = None  # who comes back to such a state stands until it is driven
        if self.state in FOLLOWING:
            super()._repeat()


class G1(Robot):
    """
    A Unitree G1, or a biped that a network walks, on a hoist: keys 1 passive, 2 stand, p, h hoist.

    `drive` commands a velocity in the state policy (2, then p). `policy` is the file of a network,
    `policy_config` has its training settings; without a network it stands.

    Raises:
        UserError: the description, the world or an option is wrong; one line says how.
    """

    @checked
    def __init__(
        self,
        world: str | os.PathLike[str] = 'flat',
        seed: int = 0,
        *,
        description: str | os.PathLike[str] = 'g1',
        package_path: Sequence[str | os.PathLike[str]] = (),
        policy: str | os.PathLike[str] | None = None,
        policy_config: str | os.PathLike[str] | None = None,
        untold: Untold = NOTHING,
    ) -> None:
        super().__init__(
            G1_ROW,
            world,
            seed,
            description,
            package_path,
            policy=None if policy is None else os.fspath(policy),
            policy_config=None if policy_config is None else os.fspath(policy_config),
            untold=untold,
        )
        from policy_player.joint_controller import Means

        self._robot.controller.means = Means('policy=FILE', "press('h')", 'reset()')

    @property
    def is_held(self) -> bool:
        """Whether the hoist holds it."""
        is_on: bool = self._robot.hoist.is_on
        return is_on

    @checked
    def press(self, key: str) -> None:
        """
        Press 1, 2 or p for a state, h for the hoist, or ESC, the E-STOP.

        Raises:
            UserError: another key, or the state cannot follow the present one, and what to press.
        """
        # Here, because a G1 alone needs it.
        from wasd_bringup.run.legged import HOIST_KEY

        with self._alone('press'):
            if self._robot.heeds_e_stop(key, 'script'):
                return
            refusals = {choice.key: choice.refusal for choice in self._robot.choices()}
            if key not in refusals:
                raise UserError(f'press: got {key!r}, wanted {", ".join(refusals)}')
            if refusals[key]:
                raise UserError(refusals[key])
            if key != HOIST_KEY:  # that one keeps it
                self._velocity = None
            self._robot.press_state(key)

    @checked
    def drive(self, vx: float, vy: float = 0.0, wz: float = 0.0) -> None:
        """
        Command a velocity [m/s], [m/s], [rad/s] until the next, or the end of the state.

        Raises:
            UserError: not finite, or the robot is in another state than policy.
        """
        with self._alone('drive'):
            if self.state != StateName.POLICY:
                raise UserError(f'drive: needs the state policy (2, then p), not {self.state}')
            self._velocity = (vx, vy, wz)

    def _repeat(self) -> None:
        if self.state != StateName.POLICY:
            self._velocity = None
        super()._repeat()


class Mbot(Robot):
    """
    mbot, or any robot with two driven wheels, with its drive controller: keys u i o j k l m , .

    `drive` commands a velocity; a key takes over from it, as long as it is held. `controller` is a
    YAML file with the drive's parameters.

    Raises:
        UserError: the description, the world or an option is wrong; one line says how.
    """

    @checked
    def __init__(
        self,
        world: str | os.PathLike[str] = 'flat',
        seed: int = 0,
        *,
        controller: str | os.PathLike[str] | None = None,
        preset: str = 'mbot',
        description: str | os.PathLike[str] = 'mbot',
        package_path: Sequence[str | os.PathLike[str]] = (),
        xacro_arguments: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        super().__init__(
            MBOT,
            world,
            seed,
            description,
            package_path,
            preset=preset,
            xacro_arguments=xacro_arguments,
            controller=None if controller is None else Path(controller),
        )
        mode = self._robot.settings.mode
        if mode != 'float':
            raise UserError(f"mode: got {mode!r}, a script drives mode 'float' only")
        self._velocity = (0.0, 0.0, 0.0)

    @property
    def odometry(self) -> Any:
        """Odometry of the wheels: x, y [m], yaw [rad], and the pose and velocities of a Go2's."""
        return self._robot.drive_unit.controller.odometry_state

    @checked
    def press(self, key: str) -> None:
        """
        Press a key of the keymap, or ESC; held keys are pressed again, 30 times a second.

        Raises:
            UserError: no text.
        """
        with self._alone('press'):
            self._velocity = None
            self._robot.mute(False)
            self._robot.press(key, 'keys')

    @checked
    def drive(self, vx: float, wz: float = 0.0) -> None:
        """
        Command a velocity ahead [m/s] and a turn [rad/s], until the next.

        Raises:
            UserError: not finite.
        """
        with self._alone('drive'):
            self._robot.mute(True)
            self._velocity = (vx, 0.0, wz)

    def _forget(self) -> None:
        self._velocity = (0.0, 0.0, 0.0)
