# SPDX-License-Identifier: Apache-2.0
"""A robot in a world: built, stepped, read, commanded, pushed, or put where it is to be."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
import math
import sys
from typing import NamedTuple, TYPE_CHECKING
import warnings

import mujoco
import numpy as np
from robot_description.description import Description
from robot_description.mujoco.builder import holding
from wasd_core.errors import one_line, SimulationError
from wasd_core.robot_io import (
    BaseState,
    ImuReading,
    is_finite,
    JointCommand,
    JointStates,
    MOST_CONTROL,
    Reading,
    TIME_STEP,
)

from mujoco_sim.boxes import add_boxes, MovingBoxes
from mujoco_sim.noise import NoisySensors
from mujoco_sim.parameters import BoxSize, Drawn, WORLD_FILES
from mujoco_sim.robot_parts import put_at_start, RobotParts
from mujoco_sim.robot_setup import robot_spec, RobotSetup
from mujoco_sim.scene import add_scene, lead_sun

if TYPE_CHECKING:
    from mujoco_sim.compiled import TorqueSpeedCurve

FALL_TILT = np.deg2rad(60.0)
# Of an IMU alone.
_UPRIGHT = Reading(
    JointStates(*np.zeros((3, 0))),
    ImuReading(np.array((1.0, 0.0, 0.0, 0.0)), np.zeros(3), np.zeros(3)),
)
# Damping of motors that brake without having been commanded any [N m s/rad]: a Go2 sinks down.
BRAKE_DAMPING = 3.0
# ... but at most this share of what stops a joint within one physics step: motor torques are
# integrated explicitly, which diverges beyond 2 and rings beyond 1.
STABLE_SHARE = 0.5
# A long step is so many time steps: half as many take half the time, and a robot whose targets
# hold for 10 ms, as a network's do, walks as well.
LONG_STEP = 2
# The warnings of MuJoCo that say so, of positions to accelerations.
_DIVERGED = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
# How these begin; `Physics.step` says it in words of its own.
_UNSTABLE = 'Nan, Inf or huge value'
_NO_SENSORS = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
# If no body has more geoms, trees of their bounds take longer than they save: a twentieth of a
# step. Contacts are the same, perhaps in another order.
_NO_TREES, _FEW_GEOMS = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE), 8


class Push(NamedTuple):
    """
    A world-frame force [N], shape (3,), and its duration [s].

    It acts at a point of the root's frame [m], shape (3,), or else at the centre of mass.
    """

    force: np.ndarray
    duration: float
    point: np.ndarray | None = None


class Actuation:
    """
    The actions on one robot in a model: its start, the command and the present pushes.

    It is told the tick; a command takes effect after the setup's delay. `rejected_commands` counts
    those that were refused. One that `is_kinematic` moves by `place_robot` only; one that
    `allows_long_steps` lets physics take them, until a reset.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, parts: RobotParts, setup: RobotSetup
    ) -> None:
        self._model, self._data = model, data
        self._parts, self._setup = parts, setup
        self._motors = parts.motors
        self._motor_velocity = parts.velocity[parts.motor_joint]
        self._holds = self._find_holds()
        self.rejected_commands = 0
        self.is_kinematic = self.allows_long_steps = False
        self._time_step = float(model.opt.timestep)
        self._command_shape = (5, len(parts.motor_names))
        self._delay = round(setup.command_delay / self._time_step)
        strength = setup.drawn.strength
        self._strength = np.array([strength.get(name, 1.0) for name in parts.motor_names])
        # Views on MuJoCo's own memory: to ask for them at every step costs more than to use them.
        self._velocities = data.qvel
        self._controls = data.ctrl[self._motors]
        self._gains = model.actuator_biasprm[self._motors, 1:3]  # -kp, -kd
        self._force_range = model.actuator_forcerange[self._motors]
        self._effort = data.actuator_force[self._motors]
        self._peak_effort, self._unread = np.zeros((2, len(parts.motor_names)))
        self._curve = self._torque_speed_curve()
        if self._curve is not None:
            memory = self._velocities, self._motor_velocity, self._force_range, self._effort
            self._limit = self._curve.follower(*memory, self._unread)
            self._limit_and_note = self._curve.follower(*memory, self._peak_effort)
        # The last command, if it cannot be written into, and as it was stacked.
        self._told: JointCommand | None = None
        self._stacked = np.zeros(self._command_shape)
        self._in_force: np.ndarray | None = None  # unknown: whatever comes changes it
        # Of a wheel in the air, the worst case: on the ground it has the robot to move, too.
        stopping = 1.0 / (model.dof_invweight0[self._motor_velocity] * self._time_step)
        self._brake_damping = np.minimum(BRAKE_DAMPING, STABLE_SHARE * stopping)
        self._most_damping = STABLE_SHARE * stopping / LONG_STEP
        self._bears_long_steps: bool | None = None  # unknown with new gains

    def reset(self) -> None:
        """Begin again at the start of the setup, with limp motors; the state is that of rest."""
        self.allows_long_steps = False
        put_at_start(self._model, self._data, self._parts, self._setup)
        self._pushes: list[tuple[int, Push]] = []  # each with the tick of its end
        self._kept_push = np.zeros(3)  # the force without an end
        self._hung, self._wrench = self._parts.root, np.zeros(6)
        self._pending: deque[tuple[int, np.ndarray]] = deque()
        self._put_in_force(np.zeros((5, len(self._parts.motor_names))))

    def take_due(self, tick: int, last: int) -> int:
        """Put in force the commands that are due; return when one or a push changes, or `last`."""
        pending = self._pending
        while pending and pending[0][0] <= tick:
            command = pending.popleft()[1]
            if command is not self._in_force:
                self._put_in_force(command)
        if pending and pending[0][0] < last:
            last = pending[0][0]
        return min((end for end, _ in self._pushes if end < last), default=last)

    def drop_ended(self, tick: int) -> None:
        """Drop the pushes that are over."""
        if self._pushes:
            self._pushes = [push for push in self._pushes if push[0] > tick]
            self._sum_pushes()

    def begin_steps(self) -> Callable[[], None] | None:
        """
        Limit the motors as their speeds allow, and turn pushes off the centre with the root.

        Return what has to be done after each step; None where nothing depends on how it moves.
        """
        if self._curve is not None:
            self._limit()
            if not self._pushes:
                return self._limit_and_note
        elif not any(push.point is not None for _, push in self._pushes):
            return None
        self._sum_pushes()
        return self._end_step

    def _end_step(self) -> None:
        """Note the largest efforts, and do what comes before the next step."""
        if self._curve is not None:
            self._limit_and_note()
        else:
            self._note_efforts()
        self._sum_pushes()

    def steps_long(self) -> bool:
        """Whether the next step may be a long one: no motor damps more than such a step bears."""
        if not self.allows_long_steps:
            return False
        if self._bears_long_steps is None:
            spare = self._most_damping + self._gains[:, 1]
            self._bears_long_steps = bool((spare >= 0.0).all())
        return self._bears_long_steps

    def take_peak_effort(self) -> np.ndarray:
        """Return the largest effort of each motor since the last call [N m], shape (m,)."""
        self._note_efforts()
        peak = self._peak_effort.copy()
        self._peak_effort[:] = 0.0
        return peak

    def _note_efforts(self) -> None:
        np.maximum(self._peak_effort, np.abs(self._effort), out=self._peak_effort)

    def apply(self, command: JointCommand, tick: int) -> bool:
        """Put a command in force once it is due; return if it was taken, see `World.apply`."""
        if command is not self._told:
            try:
                stacked = np.array(command, dtype=float)
            except ValueError:  # parts of different lengths
                stacked = np.empty(0)
            if stacked.shape != self._command_shape or not is_finite(stacked):
                self.rejected_commands += 1
                self.brake()
                return False
            self._stacked = stacked
            self._told = command if all(map(_is_fixed, command)) else None
        # A state that holds still sends the same command each tick: it is queued once.
        coming = self._pending[-1][1] if self._pending else self._in_force
        if self._stacked is not coming:
            if self._delay:
                self._pending.append((tick + self._delay, self._stacked))
            else:
                self._put_in_force(self._stacked)
        return True

    def brake(self) -> None:
        """Let the motors only resist motion; see `World.brake`."""
        self._pending.clear()
        self._in_force = self._bears_long_steps = None
        kept = -self._gains[:, 1]
        self._gains[:, 1] = -np.where(kept > 0.0, kept, self._brake_damping)
        self._gains[:, 0] = 0.0
        self._controls[:] = 0.0

    def push(self, push: Push, tick: int) -> None:
        """Add a push to those in force."""
        self._pushes.append((tick + max(1, round(push.duration / self._time_step)), push))
        self._sum_pushes()

    def keep_pushing(self, force: np.ndarray) -> None:
        """Replace the force [N], shape (3,), that has no end; see `World.keep_pushing`."""
        if not np.array_equal(force, self._kept_push):
            self._kept_push = force
            self._sum_pushes()

    def hang(self, body: int, wrench: np.ndarray) -> None:
        """
        Apply a world-frame force [N] and torque [N m], shape (6,), at a body's centre of mass.

        It replaces the last wrench given here, adds to all pushes, and ends at a reset. It must
        be finite.
        """
        self._data.xfrc_applied[self._hung] = 0.0
        self._hung, self._wrench = body, wrench
        self._sum_pushes()

    def _sum_pushes(self) -> None:
        data, root = self._data, self._parts.root
        total = np.zeros(6)
        total[:3] = self._kept_push
        for _, push in self._pushes:
            total[:3] += push.force
            if push.point is not None:
                place = data.xpos[root] + data.xmat[root].reshape(3, 3) @ push.point
                total[3:] += np.cross(place - data.xipos[root], push.force)
        if self._hung != root:
            data.xfrc_applied[root] = total
            total = np.zeros(6)
        data.xfrc_applied[self._hung] = total + self._wrench

    def _put_in_force(self, command: np.ndarray) -> None:
        self._in_force, self._bears_long_steps = command, None
        if self._curve is not None:
            self._curve.command(command, self._strength, self._gains, self._controls)
        else:  # the same without what compiles: wheels would wait for it at each start
            np.multiply(command[3:].T, -self._strength[:, None], out=self._gains)
            stiff, damped = command[3:] * command[:2]
            pulls = (command[2] + stiff + damped) * self._strength
            np.minimum(np.maximum(pulls, -MOST_CONTROL), MOST_CONTROL, out=self._controls)
        for motor, hold in self._holds:
            if command[:, motor].any():
                self._data.eq_active[hold] = False

    def _find_holds(self) -> list[tuple[int, int]]:
        """Return the motors of held joints, each with the constraint that holds it."""
        found = []
        for motor, joint in enumerate(self._parts.motor_names):
            if joint in self._setup.held:
                name = self._parts.prefix + holding(joint)
                found.append((motor, int(self._model.eq(name).id)))
        return found

    def _torque_speed_curve(self) -> 'TorqueSpeedCurve | None':
        limits, names = self._setup.speed_limits, self._parts.motor_names
        if not limits or not all(limits.get(name, math.inf) > 0.0 for name in names):
            return None
        # Here, because only legs have such motors, and what compiles takes a while to load.
        from mujoco_sim.compiled import TorqueSpeedCurve

        torque = self._model.actuator_forcerange[self._motors, 1] * self._strength
        return TorqueSpeedCurve(torque, np.array([limits.get(name, math.inf) for name in names]))


def _is_fixed(part: object) -> bool:
    """Whether a part of a command cannot be written into."""
    return isinstance(part, np.ndarray) and not part.flags.writeable


def _warn(text: str) -> None:
    """Say a warning as MuJoCo does, which would write MUJOCO_LOG.TXT where the user is, too."""
    if not text.startswith(_UNSTABLE):
        print(f'WARNING: {text}', file=sys.stderr)


class Physics:
    """
    A compiled model, its state, its `boxes`, and `tick`, the number of time steps so far.

    Commands and pushes of the robots begin and end between steps; in between, MuJoCo runs alone.
    Where all robots allow it, physics takes long steps, each of `LONG_STEP` time steps.
    """

    def __init__(self, spec: mujoco.MjSpec) -> None:
        """
        Compile the specification; what moves a robot in it is added to `robots`.

        Raises:
            SimulationError: what the compiler says, in one line.
        """
        if mujoco.get_mju_user_warning() is None:
            mujoco.set_mju_user_warning(_warn)
        try:
            with warnings.catch_warnings():
                # They have been said: Python would again, with a line of our source.
                warnings.filterwarnings('ignore', "Attach conflict|.*'world/")
                self.model = spec.compile()
        except ValueError as error:
            raise SimulationError(f'MuJoCo: {one_line(error)}') from None
        self.data, self._options = mujoco.MjData(self.model), self.model.opt
        if self.model.body_geomnum.max() <= _FEW_GEOMS:
            self._options.disableflags |= _NO_TREES
        self._divergences = self.data.warning.number[_DIVERGED]
        self.boxes = MovingBoxes(self.model, self.data)
        self.time_step = float(self.model.opt.timestep)
        self.tick = 0
        self.resets = 0
        # None of them knows us: without a circle, a model is freed with the last who uses it.
        self.robots: list[Actuation] = []

    def reset(self) -> None:
        """Put everything back to where it began, at rest; time goes on."""
        self.resets += 1
        mujoco.mj_resetData(self.model, self.data)
        for robot in self.robots:
            robot.reset()
        mujoco.mj_forward(self.model, self.data)

    def step(self, count: int) -> None:
        """
        Advance by `count` time steps.

        Raises:
            SimulationError: what acts is more than can be solved; MuJoCo has put all back then.
        """
        last = self.tick + count
        while self.tick < last:
            until = last
            for robot in self.robots:
                until = min(until, robot.take_due(self.tick, last))
            self._advance(until - self.tick, are_read=until == last)
            for robot in self.robots:
                robot.drop_ended(self.tick)
        if any(self._divergences.tolist()):  # faster than to ask numpy
            raise SimulationError(
                f'the physics diverged at {self.tick * self.time_step:.3f} s: '
                'a push, a load, a speed or a mass is too large for the simulation'
            )

    def _advance(self, count: int, *, are_read: bool) -> None:
        """Let MuJoCo step; it computes the sensors in the last step alone, if they `are_read`."""
        begin = self.tick
        self.tick += count
        if all(robot.is_kinematic for robot in self.robots):
            return
        follow = [after for robot in self.robots if (after := robot.begin_steps()) is not None]
        lengths = self._long_steps(begin, count)
        unread = (len(lengths) or count) - are_read
        if unread:
            flags = self._options.disableflags
            self._options.disableflags = flags | _NO_SENSORS
            try:
                self._step_each(unread, lengths[:unread], follow)
            finally:  # also after Ctrl-C in somebody's notebook, who goes on
                self._options.disableflags = flags
        if are_read:
            self._step_each(1, lengths[unread:], follow)

    def _long_steps(self, begin: int, count: int) -> list[float]:
        """Return how long each step is [s] where some are long, which begin at an even tick."""
        if count < LONG_STEP or not all(robot.steps_long() for robot in self.robots):
            return []
        lead = -begin % LONG_STEP
        whole, rest = divmod(count - lead, LONG_STEP)
        short, long = [self.time_step], [LONG_STEP * self.time_step]
        return short * lead + long * whole + short * rest

    def _step_each(
        self, count: int, lengths: list[float], follow: list[Callable[[], None]]
    ) -> None:
        """Let MuJoCo take steps, of `lengths` [s] if given, and do the work after each step."""
        model, data, step = self.model, self.data, mujoco.mj_step
        if not (lengths or follow):
            step(model, data, count)
            return
        try:
            for index in range(count):
                if lengths:
                    self._options.timestep = lengths[index]
                step(model, data)
                for act in follow:
                    act()
        finally:
            if lengths:
                self._options.timestep = self.time_step


class World:
    """
    One robot in a compiled model, which it may share with others.

    Its `actuation` keeps the command and the pushes in force; MuJoCo's state and `tick`, the
    number of time steps so far, are those of its `physics`. Before any command motors are limp.
    Same seed and same calls give the same bits.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec | Physics,
        root: str,
        seed: int = 0,
        setup: RobotSetup | None = None,
        prefix: str = '',
    ) -> None:
        """
        Compile the specification; `root` is the body on the free joint, or held in place.

        A robot that shares a compiled model has a `prefix` there before all its names; here it
        has not. The caller that compiled the model resets it after all robots are in it.

        Raises:
            SimulationError: what the compiler says, in one line.
        """
        self.physics = spec if isinstance(spec, Physics) else Physics(spec)
        self.model, self.data = self.physics.model, self.physics.data
        self.prefix = prefix
        self.parts = RobotParts(self.model, prefix, root)
        self.root = self.parts.root
        self.joint_names, self.motor_names = self.parts.joint_names, self.parts.motor_names
        self.seed = seed
        self.setup = setup or RobotSetup()
        self._place = np.array((*self.setup.place, 0.0))
        self.time_step = self.physics.time_step
        gyro = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SENSOR, f'{prefix}gyro')
        self.has_imu = gyro >= 0
        self._views = _Views(self.data, self.parts, prefix if self.has_imu else None)
        self._sensors: NoisySensors | None = None
        strength = self.setup.drawn.strength
        self._strength = np.array([strength.get(name, 1.0) for name in self.joint_names])
        self._link_numbers: dict[tuple[str, ...], list[int]] = {}
        # Readings, each with its tick, that are not yet known; the first is.
        self._late: deque[tuple[int, Reading]] = deque()
        if self.has_imu and self.setup.noise is not None:
            NoisySensors(self.setup.noise, seed).measure(_UPRIGHT)  # loads what compiles
        # How old a reading is [ticks]; who reads less often reads so long before, too.
        self.sensor_delay = round(self.setup.drawn.sensor_delay / self.time_step)
        _change_base(self.model, self.data, self.root, self.setup.drawn)
        # How often was reset, and the tick, when the sensors were read last.
        self._read_at = (-1, -1)
        self.actuation = Actuation(self.model, self.data, self.parts, self.setup)
        self.physics.robots.append(self.actuation)
        if self.physics is not spec:
            self.reset()

    @property
    def tick(self) -> int:
        """The number of time steps so far."""
        return self.physics.tick

    @property
    def time(self) -> float:
        """Simulated time since construction [s]; `reset` does not turn it back."""
        return self.physics.tick * self.time_step

    def reset(self) -> None:
        """Put all robots back to where they began, at rest, random numbers, too; time goes on."""
        self.physics.reset()

    def step(self, count: int = 1) -> None:
        """Advance by `count` time steps; commands and pushes begin and end within them."""
        self.physics.step(count)

    def read(self) -> Reading:
        """Return what the sensors measure now; asked twice in one instant, they say the same."""
        now, before = (self.physics.resets, self.physics.tick), self._read_at
        elapsed = (now[1] - before[1]) * self.time_step
        if now[0] != before[0]:
            noise, elapsed = self.setup.noise, 0.0
            self._sensors = NoisySensors(noise, self.seed) if noise is not None else None
            self._late.clear()
        if now != before:
            self._late.append((now[1], self._measure(elapsed)))
            while len(self._late) > 1 and self._late[1][0] <= now[1] - self.sensor_delay:
                self._late.popleft()
            self._read_at = now
        return self._late[0][1]

    def _measure(self, elapsed: float) -> Reading:
        sensors, imu, joints = self._sensors, self._views.imu, self._views.joints
        if joints is None or sensors is None:
            joints = self.joints()
        # A motor knows its current: what its torque would be if it were as strong as it says.
        effort = joints.effort / self._strength
        joints = JointStates(joints.position, joints.velocity, effort)
        if sensors is not None:
            return sensors.measure(Reading(joints, imu), elapsed)
        return Reading(joints, imu and ImuReading(*[part.copy() for part in imu]))

    def joints(self) -> JointStates:
        """Return the joints without noise; the efforts are those in the last physics step."""
        views, parts = self._views, self.parts
        return JointStates(
            views.qpos.take(parts.position), views.qvel.take(parts.velocity), self.effort()
        )

    def effort(self) -> np.ndarray:
        """Return the joints' efforts in the last physics step [N m], shape (n,)."""
        effort = np.zeros(len(self.joint_names))
        effort[self.parts.motor_joint] = self._views.effort
        return effort

    def base(self) -> BaseState:
        """Return the root frame as it is, without noise."""
        return BaseState(*[part.copy() for part in self._views.base])

    def base_since_start(self) -> BaseState:
        """Return `base` as a perfect odometry has it: counted from the place of the start."""
        position, *rest = self._views.base
        return BaseState(position - self._place, *[part.copy() for part in rest])

    def apply(self, command: JointCommand) -> bool:
        """
        Put a command in force, after the setup's delay and until the next; return if it was taken.

        A command that is not finite or of the wrong length is refused and the motors brake.
        """
        return self.actuation.apply(command, self.tick)

    def brake(self) -> None:
        """
        Let the motors only resist motion, now and until the next command.

        A motor keeps the damping it was commanded; one without gets BRAKE_DAMPING, or less.
        """
        self.actuation.brake()

    def push(
        self, force: Sequence[float], duration: float, point: Sequence[float] | None = None
    ) -> bool:
        """
        Apply a world-frame force [N], shape (3,), to the root, so long [s].

        It acts at a point of the root's frame [m], shape (3,), and moves with it; without one at
        the centre of mass. It adds to the pushes in force. Return if it was taken: it must be
        finite.
        """
        vector = np.array(force, dtype=float)
        arm = None if point is None else np.array(point, dtype=float)
        numbers = [*vector, duration, *([] if arm is None else arm)]
        shapes = {vector.shape, (3,) if arm is None else arm.shape}
        if shapes != {(3,)} or not np.isfinite(numbers).all():
            return False
        self.actuation.push(Push(vector, duration, arm), self.tick)
        return True

    def keep_pushing(self, force: Sequence[float]) -> bool:
        """
        Apply a world-frame force [N], shape (3,), at the root's centre of mass from now on.

        It takes the place of the last one given here, and adds to the pushes in force; zero or a
        reset ends it. Return if it was taken: what is not finite is not.
        """
        vector = np.array(force, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            return False
        self.actuation.keep_pushing(vector)
        return True

    def contact_forces(self, links: Sequence[str]) -> np.ndarray:
        """
        Return the sum of the normal forces on each link [N], shape (len(links),).

        They belong to the beginning of the last physics step, as contacts are found then.
        """
        numbers = self._numbers_of(tuple(links))
        forces = [0.0] * (len(links) + 1)  # and that on all other links
        others, wrench = len(links), np.zeros(6)
        for index, (one, other) in enumerate(self.data.contact.geom.tolist()):
            touching = {numbers[one], numbers[other]}
            if touching != {others}:
                mujoco.mj_contactForce(self.model, self.data, index, wrench)
                for number in touching:
                    forces[number] += float(wrench[0])
        return np.array(forces[:others])

    def _numbers_of(self, links: tuple[str, ...]) -> list[int]:
        """Return for each geom which of these links it is part of, their count if of none."""
        if links not in self._link_numbers:
            number = {link: n for n, link in enumerate(links)}
            of_geoms = [number.get(link, len(links)) for link in self.parts.link_of_geom]
            self._link_numbers[links] = of_geoms
        return self._link_numbers[links]


class _Views:
    """
    Views on what MuJoCo knows of one robot: to ask for one again costs more than to read it.

    `base` are the parts of a `BaseState`; `imu` is None without an IMU, and `joints` where these
    are not one after the other in MuJoCo's memory.
    """

    def __init__(self, data: mujoco.MjData, parts: RobotParts, imu: str | None) -> None:
        self.qpos, self.qvel = data.qpos, data.qvel
        self.effort = data.actuator_force[parts.motors]
        if parts.pose is None or parts.twist is None:
            still = np.zeros(3), np.zeros(3)
            self.base = (data.xpos[parts.root], data.xquat[parts.root], *still)
        else:
            pose, twist = data.qpos[parts.pose], data.qvel[parts.twist]
            self.base = (pose[:3], pose[3:], twist[:3], twist[3:])
        self.imu: ImuReading | None = None
        if imu is not None:
            sensors = [data.sensor(imu + name).data for name in ('gyro', 'accelerometer')]
            self.imu = ImuReading(self.base[1], *sensors)
        self.joints: JointStates | None = None
        count, motors = len(parts.joint_names), len(parts.motor_names)
        orders = parts.position, parts.velocity, parts.motor_joint
        in_a_row = all((np.diff(order) == 1).all() for order in orders)
        if count == motors > 0 and in_a_row:
            at, moving = int(parts.position[0]), int(parts.velocity[0])
            self.joints = JointStates(
                self.qpos[at : at + count], self.qvel[moving : moving + count], self.effort
            )


def _change_base(model: mujoco.MjModel, data: mujoco.MjData, root: int, drawn: Drawn) -> None:
    """Make a body heavier and move its centre of mass; its radii of gyration stay."""
    if not (drawn.mass or any(drawn.centre)):
        return
    ratio = 1.0 + drawn.mass / float(model.body_mass[root])
    model.body_mass[root] *= ratio
    model.body_inertia[root] *= ratio
    model.body_ipos[root] += drawn.centre
    mujoco.mj_setConst(model, data)


def build_world(
    loaded: Description,
    world: str = 'flat',
    seed: int = 0,
    setup: RobotSetup | None = None,
    visuals: bool = False,
    boxes: Sequence[BoxSize] = (),
    time_step: float = TIME_STEP,
) -> World:
    """
    Put a robot into a world; with `visuals`, its meshes are there to be drawn.

    `boxes` are the sizes of those that `Physics.boxes` puts into its way; `time_step` [s] is that
    of physics.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
        SimulationError: there is no such world, or the two do not compile.
    """
    setup = setup or RobotSetup()
    spec = robot_spec(loaded, setup, visuals)
    add_scene(spec, world, seed, time_step)
    # One robot is one island: to look for others takes 5 % of a step.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    add_boxes(spec, boxes)
    lead_sun(spec, loaded.robot.base)
    made = World(spec, loaded.robot.base, seed, setup)
    _tell_of_start(world, [made])
    return made


def _tell_of_start(world: str, robots: Sequence[World]) -> None:
    if not world.lower().endswith(WORLD_FILES):
        return
    from mujoco_sim.world_file import tell_of_start  # here, because few worlds are files

    for robot in robots:
        if robot.parts.pose is not None:
            tell_of_start(world, robot.model, robot.data, robot.root)


def build_shared_world(
    robots: Sequence[tuple[str, Description, RobotSetup]],
    world: str = 'flat',
    seed: int = 0,
    visuals: bool = False,
    boxes: Sequence[BoxSize] = (),
) -> list[World]:
    """
    Put several robots into one world, each with its prefix; their setups say where.

    `boxes` are as in `build_world`.

    Raises:
        DescriptionError: MuJoCo cannot read a robot.
        SimulationError: there is no such world, or they do not compile.
    """
    spec = mujoco.MjSpec()
    spec.compiler.fusestatic = True  # as in models that come from a URDF
    for prefix, loaded, setup in robots:
        body = robot_spec(loaded, setup, visuals).body(loaded.robot.base)
        spec.worldbody.add_frame().attach_body(body, prefix, '')
    add_scene(spec, world, seed)
    add_boxes(spec, boxes)
    first, loaded, _ = robots[0]
    lead_sun(spec, first + loaded.robot.base)
    physics = Physics(spec)
    worlds = [
        World(physics, loaded.robot.base, seed, setup, prefix) for prefix, loaded, setup in robots
    ]
    physics.reset()
    _tell_of_start(world, worlds)
    return worlds


class PlanarPose(NamedTuple):
    """Pose of the root on the floor [m], [rad], and its velocity in its own axes."""

    x: float
    y: float
    yaw: float
    linear: float  # [m/s], forward
    lateral: float  # [m/s], to the left
    angular: float  # [rad/s]


def pose_base(world: World, position: Sequence[float], orientation: Sequence[float]) -> None:
    """Put the root where it was: [m] from the place of its start, quaternion w, x, y, z."""
    if world.parts.pose is not None:
        start = (*world.setup.place, 0.0)
        pose = world.data.qpos[world.parts.pose]
        pose[:3] = [coordinate + begin for coordinate, begin in zip(position, start, strict=True)]
        pose[3:] = orientation


def pose_joints(world: World, names: Sequence[str], positions: Sequence[float]) -> None:
    """Put the joints that the model knows at positions [rad] or [m]."""
    known = dict(zip(world.joint_names, world.parts.position.tolist(), strict=True))
    for name, position in zip(names, positions, strict=True):
        if name in known:
            world.data.qpos[known[name]] = position


def update_bodies(world: World) -> None:
    """Compute where all bodies of the model are with the joints and bases as they were put."""
    mujoco.mj_forward(world.model, world.data)


def place_robot(world: World, pose: PlanarPose, joints: Mapping[str, tuple[float, float]]) -> None:
    """Put the robot at a pose, and joints at a position [rad] and velocity [rad/s]."""
    data = world.data
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    at, motion = data.qpos[world.parts.pose], data.qvel[world.parts.twist]
    at[0:2] = pose.x, pose.y
    at[3:7] = math.cos(0.5 * pose.yaw), 0.0, 0.0, math.sin(0.5 * pose.yaw)
    motion[:] = 0.0
    motion[0] = cos * pose.linear - sin * pose.lateral
    motion[1] = sin * pose.linear + cos * pose.lateral
    motion[5] = pose.angular
    for name, (position, velocity) in joints.items():
        joint = data.joint(world.prefix + name)
        joint.qpos[0], joint.qvel[0] = position, velocity
    mujoco.mj_forward(world.model, data)
