# SPDX-License-Identifier: Apache-2.0
"""The leg controller: keys and velocity commands in, joint commands and odometry out."""

from dataclasses import replace
import math

import numpy as np
from wasd_core.errors import UserError
from wasd_core.parameters import numeric_ends
from wasd_core.robot_io import BaseOdometry, BaseState, ImuReading, JointCommand, Reading

from quadruped_sim.algebra import plain
from quadruped_sim.command_filter import CommandFilter, velocity_limits
from quadruped_sim.elevation import Elevation
from quadruped_sim.estimation.heading import Heading
from quadruped_sim.estimation.kalman import Footing, KalmanEstimator
from quadruped_sim.estimation.load import feel_ground, LoadObserver
from quadruped_sim.estimation.touch import ContactDetector
from quadruped_sim.keys import (
    DRIVEN,
    EYES_KEY,
    FOLLOWING,
    GAIT_KEYS,
    GET_UP_KEYS,
    KeyWords,
    STATE_KEYS,
    StateMachine,
    StateName,
    Sticks,
    SUCCESSORS,
    TRANSITIONS,
)
from quadruped_sim.locomotion.locomotion import Locomotion
from quadruped_sim.parameters import LegControllerParameters, scale_parameters
from quadruped_sim.presets import GAITS
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import make_odometry, read_legs, RobotState, turn_base
from quadruped_sim.safety import FallWatch, Safety
from quadruped_sim.states.driving import (
    ControllerParts,
    damping_command,
    FixedStand,
    FreeStand,
    MoveBase,
    Passive,
    State,
    Trotting,
)
from quadruped_sim.states.exercises import BalanceTest, StepTest, SwingTest
from quadruped_sim.states.jump import highest, Jump
from quadruped_sim.states.lying import GetUp, LieDown, obstacle
from quadruped_sim.states.policy import Policy, Walker
from quadruped_sim.tuning import JumpParameters

_UP = np.array((0.0, 0.0, 1.0))
_NO_FOOT = np.zeros(4)
# What a recovery from an error of our own says first.
BROKE = 'the controller broke'
# Answer to the key v on a robot that can hardly lift itself.
NO_JUMP = 'motors too weak or too slow to jump'
# States that need no fresh readings, and keys that lead to them.
_HELD = (StateName.PASSIVE, StateName.FIXED_STAND, StateName.LIE_DOWN, StateName.GET_UP)
_HELD_KEYS = '127'
# How high the hips of a Go2 are that lies [m], and how fast its estimate sinks to that [m/s].
_LYING_HEIGHT, _SINKING_SPEED = 0.06, 0.5
# A robot that is slower is at rest [m/s].
_AT_REST = 0.1
# A leg is sprawled whose thigh is farther than this from its folded angle; of a robot that stands
# it is 0.7 away [rad].
_SPRAWLED = 1.0
# One that leans more than this cosine tells, on a leg that it fell on, folds first.
_LEANING = 0.88


class LegController:
    """
    Walks a quadruped: one `step` per tick, at 500 Hz.

    A `model` serves one controller at a time. `params` are as for the Go2; they are scaled to the
    robot. Joints are leg angles, see `robot_description.morphology`.
    `estimator` is 'kalman' (IMU and joints only) or 'truth' (the base's state is told with each
    reading).
    While there is a `hindrance` it stands still, or lies. A `walker` walks in the state policy.
    Never raises for bad data: it falls back to damping and says so in `event`.
    """

    def __init__(
        self,
        model: RobotModel,
        params: LegControllerParameters | None = None,
        estimator: str = 'kalman',
        walker: Walker | None = None,
    ) -> None:
        if estimator not in ('kalman', 'truth'):
            raise UserError(f"estimator must be 'kalman' or 'truth', got {estimator!r}")
        self._uses_truth = estimator == 'truth'
        self.model = model
        scale = model.scale
        self._given = params or LegControllerParameters()
        self._params = self._scaled(self._given)
        self._first_gait = self._left = self.gait  # what the legs leave on the way to another
        self.sticks = Sticks()
        self.words = KeyWords()
        self.command_filter = CommandFilter(
            self._params.command,
            scale,
            self.model.agility,
            self.model.turning,
            self._params.gait.name,
        )
        self.locomotion = Locomotion(self.model, self._params)
        self._solvers = (self.locomotion.mpc.solver, self.locomotion.whole_body.solver)
        self.safety = Safety(self._params.safety, self.model.limits)
        self._falls = FallWatch(scale.of('s'))
        self._detector = ContactDetector()
        self._load = LoadObserver()
        self._kalman = KalmanEstimator(
            self._params.kalman, self.model.geometry.foot_radius, self.model.imu_offset
        )
        self._heading = Heading(self._params.kalman, scale.of('m'))
        self._parts = ControllerParts(
            self.model, self._params, self.locomotion, self.command_filter, self.sticks
        )
        self._passive = Passive(self._parts)
        self._states: dict[StateName, State] = {
            StateName.PASSIVE: self._passive,
            StateName.FIXED_STAND: FixedStand(self._parts),
            StateName.FREE_STAND: FreeStand(self._parts),
            StateName.TROTTING: Trotting(self._parts),
            StateName.MOVE_BASE: MoveBase(self._parts),
            StateName.BALANCE_TEST: BalanceTest(self._parts),
            StateName.SWING_TEST: SwingTest(self._parts),
            StateName.STEP_TEST: StepTest(self._parts),
            StateName.GET_UP: GetUp(self._parts),
            StateName.LIE_DOWN: LieDown(self._parts),
            StateName.JUMP: Jump(self._parts),
        }
        self.has_policy = walker is not None
        if walker is not None:
            self._policy = self._states[StateName.POLICY] = Policy(self._parts, walker)
        self._robot, self._geometry = RobotState.blank(), plain(model.geometry)
        # As bytes: NumPy copies a record field by field, which takes 7 us.
        self._robot_bytes = self._robot.flat.view(np.uint8)
        self._last_sound = self._robot_bytes.copy()
        self._measured = np.empty((3, 3))  # from base axes to the world's, as the IMU says
        least, _ = numeric_ends(JumpParameters.__dataclass_fields__['height'])
        self._can_jump = highest(model) >= least * scale.of('m')
        self.obstacle = obstacle(model)  # what keeps it from getting up, '' if nothing does
        self._eyes, self._terrain = False, None  # type: tuple[bool, Elevation | None]
        self.reset()

    def tune(self, params: LegControllerParameters) -> None:
        """Go on with other parameters, as for the Go2, from the next step; what it does stays."""
        self._given, own = params, self._scaled(params)
        self._params = self._parts.params = own
        self._tune_filter()
        self.locomotion.tune(_in_gait(own, self._left))
        self._change_gait()
        self.safety.params = own.safety
        self._kalman.tune(own.kalman)
        self._heading.tune(own.kalman)

    def take_remark(self) -> str:
        """Return what the present state has to tell the driver, once; '' for nothing."""
        remark, self._parts.remark = self._parts.remark, ''
        return remark

    @property
    def eyes(self) -> bool:
        """Whether it walks by what it sees of the ground."""
        return self._eyes

    @eyes.setter
    def eyes(self, is_on: bool) -> None:
        self._eyes = is_on
        self.locomotion.sight.terrain = self._terrain if is_on else None

    def see(self, terrain: Elevation | None) -> None:
        """Take the map, in odometry's frame, by which it walks with its eyes open, or None."""
        self._terrain = terrain
        self.eyes = self._eyes

    @property
    def gait(self) -> str:
        """Name of the gait that is chosen."""
        return self._given.gait.name

    def choose_gait(self, name: str) -> None:
        """Step as a row of `GAITS` says; legs that move slow down first, then glide into it."""
        if name == self.gait:
            return
        self._given = _in_gait(self._given, name)
        # The name alone differs: all that `tune` would do beside this is done already.
        self._params = self._parts.params = _in_gait(self._params, name)
        self._tune_filter()
        if self.locomotion.gait.params.name != self._left:
            self.locomotion.tune(_in_gait(self._params, self._left))
        self._change_gait()

    def _change_gait(self) -> None:
        """Take the chosen gait once the legs are slow, and speed up once they have it."""
        if self._left == self.gait:
            return
        legs = self.locomotion.gait
        if legs.params.name != self.gait and self.command_filter.is_within:
            self.locomotion.tune(self._params)
        if legs.params.name == self.gait and legs.has_changed:
            self._left = self.gait
            self._tune_filter()

    def _tune_filter(self) -> None:
        """Keep the command within what the gait allows; a network's within a trot's, the most."""
        gaits = ('trot',) if self._entered is StateName.POLICY else (self.gait, self._left)
        self.command_filter.tune(self._params.command, *gaits)

    def _scaled(self, params: LegControllerParameters) -> LegControllerParameters:
        """Return the Go2's parameters as they are on this robot."""
        model = self.model
        return scale_parameters(params, model.scale, model.friction, model.motor_speed)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the driver should know of the motors, a line each."""
        limits, gait = self._params.command.limits, self._params.gait.name
        usual = velocity_limits(limits, self.model.scale, gait=gait)
        notes = self.model.motor_notes(self.command_filter.limits.forward, usual.forward)
        asked, able = self._params.jump.height, highest(self.model)
        if asked <= able:
            return notes
        lowered = f'motors allow jumps of {able:.2g} m, not {asked:.2g} m; lowered'
        return (*notes, lowered if self._can_jump else NO_JUMP)

    def reset(self) -> None:
        """Passive, at the origin, as after construction; the next reading starts the estimate."""
        self.command_filter.reset()
        self.choose_gait(self._first_gait)
        self._machine = StateMachine()
        self._entered: StateName | None = None
        self.sticks.zero()
        self.safety.reset()
        self._falls.reset()
        self._detector.reset()
        self._load.reset()
        self.locomotion.forget_grip()
        self.locomotion.sight.reset()
        self.locomotion.step_height.reset()
        self.locomotion.ground.reset(np.zeros((4, 3)))
        self._is_started = False
        self._is_down = False  # lies on something else than its feet, and has since it fell
        self.robot: RobotState | None = None
        self.hindrance = ''  # why it must not move now, '' if it may
        self.is_fallen = False  # whether it lies on its side or back, or has since it stood
        self.event: str | None = None
        self._odometry: BaseOdometry | None = None
        # The last state's command, and the same within the limits: None if not finite.
        self._wanted: JointCommand | None = None
        self._command: JointCommand | None = None

    @property
    def state(self) -> str:
        """Name of the present state."""
        return self._machine.state._value_  # at each step of control: faster than `value`

    @property
    def rests(self) -> bool:
        """Whether it does what needs no fresh readings: it lies, stands, or is about to."""
        return self._machine.coming in _HELD

    @property
    def coming_state(self) -> str:
        """Name of the state that a pressed key leads to, or of the present one."""
        return self._machine.coming.value

    @property
    def odometry(self) -> BaseOdometry | None:
        """Estimated pose and velocity of the base; None before the first reading."""
        if self._odometry is None and self.robot is not None:
            variances = (1e-9, 1e-9, 0.0)
            if not self._uses_truth:
                variances = (*self._kalman.variances, self._heading.variance)
            self._odometry = make_odometry(self.robot, *variances)
        return self._odometry

    def press(self, key: str) -> str | None:
        """Take a key; return a text for the driver if it has no effect, or another one."""
        if key in STATE_KEYS and self.words.is_for_legs(key):
            refusal = self.refusal(key)
            if not refusal:
                self._machine.press(self._meaning(key))
                self.sticks.begin_anew()
            return refusal or None
        state = self._machine.coming
        if self.lies_fallen:
            return self.words.to_fallen(self.obstacle)
        if key in (*GAIT_KEYS, EYES_KEY) and state is StateName.POLICY:
            return self.words.to_drive(state, key)
        if key in GAIT_KEYS and self.words.is_for_legs(key):
            gaits = tuple(GAITS)
            self.choose_gait(gaits[(gaits.index(self.gait) + GAIT_KEYS[key]) % len(gaits)])
            return self.words.to_gait(self.gait, self.command_filter.limits)
        if key == EYES_KEY and self.words.is_for_legs(key):
            self.eyes = not self.eyes
            return self.words.to_eyes(self.eyes, self._terrain is not None)
        before = self.sticks.pressed
        if not self.sticks.press(key):
            return self.words.to_other(state, key)
        return self.words.to_stick(state, key, has_moved=self.sticks.pressed != before)

    def refusal(self, key: str) -> str:
        """Return why a state's key does nothing now; '' if it does something."""
        if self.lies_fallen and (self.obstacle or key not in GET_UP_KEYS) and key != '1':
            return self.words.to_fallen(self.obstacle)
        state, meant = self._machine.coming, self._meaning(key)
        if STATE_KEYS[meant] is StateName.POLICY and not self.has_policy:
            return self.words.to_no_policy()
        if STATE_KEYS[meant] is StateName.JUMP and not self._can_jump:
            return NO_JUMP
        if self.hindrance and meant not in _HELD_KEYS:
            return self.hindrance
        is_legal = state is not STATE_KEYS[meant] and meant in TRANSITIONS[state]
        return '' if is_legal else self.words.to_state(state, STATE_KEYS[meant])

    @property
    def lies_fallen(self) -> bool:
        """Whether it has fallen and lies: keys do not move its sticks then."""
        return self.is_fallen and self._machine.coming is StateName.PASSIVE

    @property
    def _lies_sprawled(self) -> bool:
        """
        Whether a straight way up may tip it over.

        It lies with a foot above its trunk, at its hips, or with a thigh far from where it folds,
        or leans on a leg.
        """
        if self.robot is None or self._machine.coming is not StateName.PASSIVE or self.obstacle:
            return False
        up = self.robot.base.R[2]
        heights = self.robot.motion.position @ up
        apart = np.abs(self.robot.joint_position - self.model.folded_pose)[1::3]
        is_above = float(heights.max()) > float(self.model.hips @ up)
        return is_above or float(apart.max()) > _SPRAWLED or float(up[2]) < _LEANING

    def _meaning(self, key: str) -> str:
        """Return what a state's key stands for: a robot that has fallen must get up to stand."""
        must_fold = self.lies_fallen or self._lies_sprawled
        return GET_UP_KEYS[-1] if must_fold and key in GET_UP_KEYS else key

    def set_velocity(self, vx: float, vy: float, yaw_rate: float) -> str | None:
        """Velocity command for move base [m/s, m/s, rad/s]; a text when not driven so."""
        if self._machine.state not in FOLLOWING:
            if vx == vy == yaw_rate == 0.0:
                return None  # it moves as it is asked to
            if self.lies_fallen:
                return self.words.to_fallen(self.obstacle)
            if self.hindrance:
                return self.hindrance
            return self.words.to_velocity(self._machine.coming)
        refusal, limits = self.command_filter.request(vx, vy, yaw_rate), self.command_filter.limits
        by_gait = self.gait != 'trot' and self._machine.state is StateName.MOVE_BASE
        if refusal is None and by_gait and not limits.hold(vx, vy, yaw_rate):
            return self.words.to_gait(self.gait, limits)
        return refusal

    def e_stop(self, reason: str = 'emergency stop') -> None:
        """Go passive at once."""
        for solver in self._solvers:
            solver.restart_count()
        self._passive.be_limp()
        if self._machine.force(StateName.PASSIVE):
            self.event = reason

    @property
    def due_after(self) -> float:
        """How long after the last step the next one is due [s]; motors hold the command."""
        machine, policy = self._machine, StateName.POLICY
        walks = machine.state is policy and machine.coming is policy and self._entered is policy
        return self._policy.due_after if walks else 0.0

    def step(self, reading: Reading, dt: float, truth: BaseState | None = None) -> JointCommand:
        """Joint command for this reading of leg angles, `dt` [s] after the one before."""
        self._odometry = None
        good = self.safety.filter_reading(reading)
        if good is None or (self._uses_truth and truth is None):
            self.e_stop('no usable sensor reading')
            return damping_command(self.model.scale, np.zeros(12))
        try:
            return self._answer(good, dt, truth)
        except (ArithmeticError, TypeError, ValueError) as error:
            return self._recover(good, f'{BROKE}: {error}')

    def _answer(self, good: Reading, dt: float, truth: BaseState | None) -> JointCommand:
        """Estimate, change the state if that is due, and take a step of it."""
        robot, height = self._estimate(good, dt, truth)
        if math.isnan(height):
            return self._recover(good, 'the estimate is not finite')
        self._last_sound[:] = self._robot_bytes
        self.robot = robot
        model, name = self.model, self._machine.state
        share = model.risen(model.geometry.foot_radius + height, robot.base.R)
        down = self._falls.step(share, self._states[name].may_be_low, dt)
        still_lies, tilts = name is StateName.PASSIVE, self.safety.is_fallen(robot.base.R)
        self.is_fallen = (self.is_fallen and still_lies) or down is not None or tilts
        self._change_gait()
        self._change_state(robot, down, tilts)
        state = self._states[self._machine.state]
        wanted = state.step(robot, dt)
        if wanted is not self._wanted:  # else it holds the last one
            self._wanted, self._command = wanted, self.safety.filter_command(wanted)
        if self._command is None:
            self.e_stop('a command to the motors is not finite')
            return damping_command(self.model.scale, robot.joint_position)
        return self._command

    def _recover(self, reading: Reading, reason: str) -> JointCommand:
        """Damp; begin the estimate again from where the robot was, whatever broke it."""
        self.e_stop(reason)
        self._detector.reset()
        self._load.reset()
        offset = self._heading.offset
        self._heading.reset(offset if math.isfinite(offset) else 0.0)
        self.command_filter.reset()
        self._robot_bytes[:] = self._last_sound
        robot = self._robot
        robot.base.velocity[:] = 0.0
        self.locomotion.reset(robot)
        level = float(robot.feet[:, 2].min()) - self.model.geometry.foot_radius
        self._kalman.reset(robot.base.position.copy(), robot.feet.copy(), level)
        self._is_started = self.robot is not None
        self._is_down = False
        return damping_command(self.model.scale, reading.joints.position)

    def _change_state(self, robot: RobotState, down: str | None, tilts: bool) -> None:
        """Enter the state that a guard, the end of the present one or a key leads to."""
        self._parts.is_fed_slowly = bool(self.hindrance)
        state = self._states[self._machine.state]
        may_lie = state.is_lying or self._machine.state is StateName.PASSIVE
        reason = (
            state.failure
            or down
            or self.safety.reason_to_let_go(
                robot.base.R if tilts and not may_lie else None,
                robot.joint_position,
                max(solver.failures_in_a_row for solver in self._solvers),
            )
        )
        if reason is not None:
            self.e_stop(reason)
        elif state.is_over and self._machine.coming is self._machine.state:
            self._machine.force(SUCCESSORS[self._machine.state])
        elif self.hindrance and not self.rests:
            self._machine.force(StateName.FIXED_STAND)
        due = self._machine.begin_tick()
        if due is not None:  # maybe the same again, by two keys
            self.sticks.meet()
            self.command_filter.forget_request()
        if self._entered is not self._machine.state:
            if self._machine.state is not StateName.PASSIVE:
                self.event = None
            if due is None:
                self.sticks.zero()
            self._parts.walks_on = self._entered is StateName.POLICY and _is_moving(robot)
            self._states[self._machine.state].enter(robot)
            self._entered = self._machine.state
            self._tune_filter()
        if due is StateName.PASSIVE:
            self._passive.go_down(robot)

    def _estimate(
        self, reading: Reading, dt: float, truth: BaseState | None
    ) -> tuple[RobotState, float]:
        """Base, feet, contacts and dynamics at this reading; the base's `sound_height` [m]."""
        robot, base, joints = self._robot, self._robot.base, reading.joints
        assert reading.imu is not None  # `filter_reading` lets none without one through
        measured = reading.imu.orientation, self._measured
        read_legs(self._geometry, robot.flat, joints.position, joints.velocity, *measured)
        is_walking = self._machine.state in DRIVEN
        normal = self.locomotion.normal() if is_walking else _UP
        if truth is None or not self._uses_truth:
            self._filter(reading.imu, normal, is_walking, dt)
        else:
            base.position[:], robot.orientation[:], base.velocity[:], base.omega[:] = truth
        return robot, self._feel(joints.effort, normal, dt)

    def _feel(self, efforts: np.ndarray, normal: np.ndarray, dt: float) -> float:
        """
        Dynamics, and forces, contacts and the load by the joints' torques (12,) [N m].

        Return the base's `sound_height` [m].
        """
        state = self._machine.state
        is_up = not (state is StateName.PASSIVE or self._states[state].is_lying)
        if not is_up:
            self._load.reset()
        stages, seen, tick = (self._detector.flat, self._load.flat), (efforts, normal), (dt, is_up)
        return feel_ground(
            self._robot.flat, self.model.rigid, stages, seen, self.locomotion.rules, tick
        )

    def _filter(self, imu: ImuReading, normal: np.ndarray, is_walking: bool, dt: float) -> None:
        """Base by the Kalman filter; orientation by the IMU, less the drift known."""
        robot, base, motion = self._robot, self._robot.base, self._robot.motion
        name, kalman, R = self._machine.state, self._kalman, self._measured
        state, is_passive = self._states[name], name is StateName.PASSIVE
        lies = state.is_lying or (is_passive and (self._is_down or self._rests_on_trunk(R)))
        self._is_down = lies
        stands = _NO_FOOT if lies else state.trust
        self._heading.step(R, motion.position, stands, dt)
        if not self._is_started:
            self._start(motion.position @ R.T)
        drift = self._heading.drift
        if lies:
            turn_base(robot.flat, imu.orientation, imu.angular_velocity, drift)
            self._rest(motion.position @ base.R.T, dt)
            base.position[:], base.velocity[:] = kalman.position, kalman.velocity
        else:
            plane, roughness = self.locomotion.ground.flat, self.locomotion.step_height.roughness
            may_land = not (is_walking or is_passive)
            is_broken = self.locomotion.sight.is_broken
            footing = Footing(
                state.trust, normal, plane, is_walking, may_land, roughness, is_broken
            )
            kalman.step(robot.flat, imu, drift, footing, dt)

    def _rests_on_trunk(self, R: np.ndarray) -> bool:
        """Whether something else than the feet carries the robot; `R` turns base axes to world."""
        carried = float(self._detector.normal_forces.sum())
        return self.safety.is_fallen(R) or carried < 0.5 * self.model.weight

    def _rest(self, relative: np.ndarray, dt: float) -> None:
        """
        Take a robot that lies or rolls to be at rest, sinking to the ground that it stood on.

        Its feet are in the air or under it and tell nothing; the accelerometer alone would drift.
        """
        position = self._kalman.position.copy()
        most = _SINKING_SPEED * self.model.scale.of('m/s') * dt
        height = self._kalman.level + self._height_over(relative)
        position[2] += min(max(height - position[2], -most), most)
        self._kalman.hold(position, position + relative)

    def _height_over(self, relative: np.ndarray) -> float:
        """
        Height of the base above the ground on which the lowest foot is, or the trunk [m].

        `relative` (4, 3) are the foot centres from the base, world axes.
        """
        on_feet = self.model.geometry.foot_radius - float(relative[:, 2].min())
        lying = _LYING_HEIGHT * self.model.scale.of('m') - float(self.model.hips[2])
        return max(on_feet, lying)

    def _start(self, relative: np.ndarray) -> None:
        """Start the filter at x = y = 0 on ground at height 0."""
        position = np.array((0.0, 0.0, self._height_over(relative)))
        self._kalman.reset(position, position + relative)
        self._heading.reset()
        self._is_started = True


def _in_gait(params: LegControllerParameters, name: str) -> LegControllerParameters:
    return replace(params, gait=replace(params.gait, name=name))


def _is_moving(robot: RobotState) -> bool:
    """Whether a robot moves so that stiff legs would tip it over, or has a foot in the air."""
    speed = float(np.abs(robot.base.velocity).max() + 0.2 * np.abs(robot.base.omega).max())
    return speed > _AT_REST or not robot.is_contact.all()
