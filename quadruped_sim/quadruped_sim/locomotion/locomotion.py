# SPDX-License-Identifier: Apache-2.0
"""Walking: gait, footholds, swing feet, MPC forces and whole-body torques put together."""

import math

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY, JointCommand
from wasd_core.rotations import cross, yaw_matrix

from quadruped_sim.algebra import plain
from quadruped_sim.estimation.grip import Grip
from quadruped_sim.estimation.ground import Ground
from quadruped_sim.locomotion.convex_mpc import ConvexMpc, MpcProblem
from quadruped_sim.locomotion.feedback import (
    base_acceleration,
    BaseTracking,
    joint_command,
    standing_forces,
)
from quadruped_sim.locomotion.footwork import blank_feet, FootStages, step_feet, StepHeight
from quadruped_sim.locomotion.gait import Gait
from quadruped_sim.locomotion.reference import (
    BaseReference,
    blank_reference,
    horizon,
    Reference,
    STEEP,
    travel,
    turned,
)
from quadruped_sim.locomotion.sight import Sight
from quadruped_sim.locomotion.swing import blank_targets, SwingTargets
from quadruped_sim.locomotion.whole_body import WholeBody, WholeBodyTask
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.robot_state import RobotState
from quadruped_sim.rules import flat_rules

# On the Go2: how fast the base sinks or rises to its height on entry [m/s],
_HEIGHT_RATE = 0.15
# the speed [m/s] that turning at 1 rad/s counts as,
_TURNING_RADIUS = 0.15
# speed [m/s] and distance [m] of a foot from its place up to which it may end stepping,
_REST = (0.08, 0.05)
# and beyond which it begins to step.
_UNREST = (0.25, 0.10)
# Below this share of its height a robot is still standing up, and goes nowhere.
_UP = 0.85


class Locomotion:
    """
    Turns a velocity command into joint commands, one `step` per tick.

    State: gait phase, reference, the feet's last lift-off points, MPC forces and the time since
    they were found. `ground` is shared with the estimator.
    """

    def __init__(self, model: RobotModel, params: LegControllerParameters) -> None:
        self._model = model
        scale = model.scale
        self._height_rate = _HEIGHT_RATE * scale.of('m/s')
        self._turning_radius = _TURNING_RADIUS * scale.of('m')
        self._rest = _REST[0] * scale.of('m/s'), _REST[1] * scale.of('m')
        self._unrest = _UNREST[0] * scale.of('m/s'), _UNREST[1] * scale.of('m')
        self.gait = Gait(params.gait, scale.of('m/s'), model.slimness)
        self.ground = Ground()
        self.reference = Reference()
        inertia, _ = model.inertia_about_com(model.walking_pose)
        self.mpc = ConvexMpc(params.mpc, inertia)
        self.whole_body = WholeBody(params.whole_body, params.mpc, model.limits)
        self._tracking = BaseTracking(params.whole_body, inertia)
        self.step_height = StepHeight()
        self.grip = Grip(params.mpc.friction)
        self.sight = Sight()
        self._params = params
        self._nominal_height = self._height_of(params)
        self.schedule = self.gait.state()
        self._flat_feet, self._feet = blank_feet()
        self.is_stance, self.trust = self._feet.is_stance, self._feet.trust
        self.landing = self._feet.landing  # where feet in the air are to, (4, 3), world [m]
        # What base and feet shall do in a tick is written over that of the one before.
        self._wanted, self._targets = blank_reference(), blank_targets(self.is_stance)
        stages = FootStages(
            self.ground.flat,
            self.reference.flat,
            self.grip.flat,
            self.step_height.flat,
            self.sight.flat,
        )
        self._stages = plain(stages)
        self.rules = flat_rules(params, model)
        self._forces = np.zeros((4, 3))
        self._since_solution = math.inf
        self._height = self._nominal_height

    def tune(self, params: LegControllerParameters) -> None:
        """Go on with other parameters, from the next step."""
        self._params, self.rules = params, flat_rules(params, self._model)
        self._nominal_height = self._height_of(params)
        self.gait.tune(params.gait)
        self.grip.guess = params.mpc.friction
        self.mpc.tune(params.mpc)
        self.whole_body.tune(params.whole_body, params.mpc)
        self._tracking.tune(params.whole_body)

    def _height_of(self, params: LegControllerParameters) -> float:
        """Return the height of the base that puts the hips where they are to be [m]."""
        return params.reference.height - float(self._model.hips[2])

    @property
    def is_up(self) -> bool:
        """Whether the hips have risen far enough for the feet to reach where they step."""
        hips = float(self._model.hips[2])
        return self._height + hips > _UP * (self._nominal_height + hips)

    def reset(self, state: RobotState, feet: np.ndarray | None = None) -> None:
        """Stand where the robot is, on level ground under its feet, or `feet` (4, 3) [m]."""
        feet = state.feet if feet is None else feet
        self.gait.reset()
        self.reference.reset(state)
        self.ground.reset(feet - (0.0, 0.0, self._model.geometry.foot_radius))
        self._height = float(state.base.position[2]) - self.ground.height
        self.schedule = self.gait.state()
        self.is_stance[:], self._feet.is_early[:], self._feet.has_touched[:] = True, False, True
        self._feet.lift_off[:] = state.feet
        self.step_height.reset()
        self.sight.reset()
        self.forget_grip()
        self._forces = standing_forces(GRAVITY * state.mass, self.is_stance)
        self._since_solution = math.inf

    def step(
        self, state: RobotState, command: np.ndarray, dt: float, *, is_halting: bool = False
    ) -> JointCommand:
        """
        Joint command for (vx, vy, yaw rate), base axes, after `dt` [s].

        `is_halting` ends stepping in place as soon as the robot may stand.
        """
        self.sight.look(state.base.position, dt)
        vx, vy, yaw_rate = command.tolist()
        speed = math.hypot(vx, vy) + self._turning_radius * abs(yaw_rate)
        in_place = self._params.gait.step_in_place and not is_halting
        is_driven = in_place or max(abs(vx), abs(vy), abs(yaw_rate)) > 1e-3
        wants_steps = is_driven or self._is_unsteady(state)
        error = self._velocity_error(state, command)
        stepped = self.gait.is_stepping
        self.schedule = self.gait.step(dt, speed, wants_steps, error, is_ending=not is_driven)
        if stepped and not self.gait.is_stepping:
            self.reference.stay(state)
        reference, swing = self._step_feet(state, command, dt)
        self._use_grip()
        if self.gait.is_stepping:
            self._plan_forces(state, reference, dt)
            acceleration = self._tracking.acceleration(state, reference, self._forces)
        else:
            self._forces = standing_forces(GRAVITY * state.mass, self.is_stance)
            pose = reference.position, reference.rpy
            acceleration = base_acceleration(self.rules, state, *pose)
            self._since_solution = math.inf
        task = WholeBodyTask(
            acceleration, self.is_stance, self._forces, swing.acceleration, self.frame()
        )
        result = self.whole_body.solve(task, state)
        return joint_command(
            self._params.whole_body, self._model, state, reference, swing, result.torque
        )

    def normal(self) -> np.ndarray:
        """Unit normal (3,), world axes, of what feet stand on: treads that are seen, or all."""
        tread = self.sight.tread
        return self.ground.normal() if tread is None else tread.normal

    def frame(self) -> np.ndarray:
        """Rotation (3, 3) from the axes in which feet have friction to the world."""
        tread = self.sight.tread
        return self.ground.frame() if tread is None else tread.frame

    def forget_grip(self) -> None:
        """Believe the guess of the friction again, from now on."""
        self.grip.reset()
        self._use_grip()

    def _use_grip(self) -> None:
        self.mpc.pyramids.friction = self.whole_body.pyramids.friction = self.grip.friction

    def _velocity_error(self, state: RobotState, command: np.ndarray) -> float:
        """Return how far the velocity is off the commanded [m/s]."""
        yaw = state.base.rpy.item(2)
        c, s = math.cos(yaw), math.sin(yaw)
        vx, vy, _ = state.base.velocity.tolist()
        ahead, left = c * vx + s * vy, c * vy - s * vx
        return math.hypot(ahead - command.item(0), left - command.item(1))

    def _settle_height(self, dt: float) -> float:
        """Height of the base above the ground, on its way to that which the ground asks for."""
        most = dt * self._height_rate
        raised = self.step_height.raised(self.rules)
        if raised > 0.0:  # rough ground alone asks for the slope
            raised *= max(1.0 - self.ground.slope / STEEP, 0.0)
        ahead = self._nominal_height + raised - self._height
        self._height += min(max(ahead, -most), most)
        return self._height

    def _is_unsteady(self, state: RobotState) -> bool:
        """Whether it was pushed, or feet and base are not yet where they rest well."""
        limits = self._rest if self.gait.is_stepping else self._unrest
        return _is_beyond(state.flat, self.rules, self.schedule.footprint, limits)

    def _footprint(self) -> np.ndarray:
        """Where feet stand below a base at rest, yaw frame (4, 3) [m]."""
        return np.asarray(self.rules['nominal'][0] * (*self.schedule.footprint, 0.0))

    def _step_feet(
        self, state: RobotState, command: np.ndarray, dt: float
    ) -> tuple[BaseReference, SwingTargets]:
        """Find which feet stand, on what, and the motion of the base and of feet in the air."""
        wanted, targets = self._wanted._replace(yaw_rate=float(command[2])), self._targets
        aims, stages = (plain(wanted), plain(targets)), (self._stages, self.rules)
        asked = command, self._settle_height(dt), dt, self.gait.is_stepping
        if step_feet(state.flat, self._flat_feet, plain(self.schedule), stages, aims, asked):
            self._since_solution = math.inf
        return wanted, targets

    def _plan_forces(self, state: RobotState, reference: BaseReference, dt: float) -> None:
        """Ask the MPC when its time has come; a foot that has just lifted pushes no more."""
        self._since_solution += dt
        if self._since_solution >= self._params.mpc.period - 0.5 * dt:
            self._solve_mpc(state, reference)
            self._forces[~self.is_stance] = 0.0

    def _solve_mpc(self, state: RobotState, reference: BaseReference) -> None:
        """New forces from the MPC; the old ones stay when it fails."""
        yaw = float(state.base.rpy[2])
        Rz = yaw_matrix(yaw)
        base, com = state.base, state.base.R @ state.com
        spin = base.R @ base.omega
        about_com = reference._replace(
            position=reference.position + com,
            velocity=reference.velocity + reference.yaw_rate * np.array((-com[1], com[0], 0.0)),
        )
        pose_reference, rate_reference = horizon(
            about_com, yaw, base.position + com, self.mpc.times + self._params.mpc.step
        )
        pose = np.zeros(6)
        pose[:2] = base.rpy[:2]
        rates = np.concatenate((spin @ Rz, (base.velocity + cross(spin, com)) @ Rz))
        stance, arms = self._contact_plan(state, about_com, Rz)
        problem = MpcProblem(
            state.mass,
            pose,
            rates,
            pose_reference,
            rate_reference,
            stance,
            arms,
            Rz.T @ self.frame(),
        )
        forces = self.mpc.solve(problem)
        if forces is not None:
            self._forces = forces @ Rz.T
        self._since_solution = 0.0

    def _contact_plan(
        self, state: RobotState, reference: BaseReference, Rz: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """
        Stance flags (N, 4) and contact points relative to the CoM (N, 4, 3), yaw frame.

        `reference` is that of the CoM.
        """
        times = self.mpc.times + 0.5 * self._params.mpc.step
        stance, phase = self.gait.forecast(times)
        stance[0] = self.is_stance
        com = state.base.R @ state.com
        here = (state.feet - state.base.position - com) @ Rz
        here[:, 2] -= self._model.geometry.foot_radius
        velocity, rate = (reference.velocity @ Rz)[:2], reference.yaw_rate
        arms = np.empty((len(times), 4, 3))
        moves = float(velocity[0]), float(velocity[1]), rate, self.schedule.stance_time
        feet = here, self._footprint(), com @ Rz
        _place_arms(feet, (stance, phase), times, moves, arms)
        return stance, arms


@jit
def _is_beyond(
    robot: np.ndarray,
    rules: np.ndarray,
    footprint: tuple[float, float],
    limits: tuple[float, float],
) -> bool:
    """Whether the base is faster [m/s], or a foot farther from its place [m], than `limits`."""
    base, feet, nominal = robot[0].base, robot[0].feet, rules[0].nominal
    length, width = footprint
    fastest, farthest = limits
    if math.hypot(base.velocity[0], base.velocity[1]) > fastest:
        return True
    for leg in range(4):
        x, y = turned(length * nominal[leg, 0], width * nominal[leg, 1], base.rpy[2])
        x, y = feet[leg, 0] - base.position[0] - x, feet[leg, 1] - base.position[1] - y
        if math.hypot(x, y) > farthest:
            return True
    return False


@jit
def _place_arms(
    feet: tuple[np.ndarray, np.ndarray, np.ndarray],
    plan: tuple[np.ndarray, np.ndarray],
    times: np.ndarray,
    moves: tuple[float, float, float, float],
    arms: np.ndarray,
) -> None:
    """
    Write where feet touch at `times`, from a body that moves on, yaw frame (N, 4, 3) [m].

    `feet` are where they are now and where they rest below the base (4, 3), and the centre of mass
    (3,) of the body; `plan` is which stand, and their phases (N, 4); the body `moves`
    at vx, vy and a yaw rate, with so long a stance [s].
    """
    here, footprint, com = feet
    stance, phase = plan
    vx, vy, rate, stance_time = moves
    height = 0.25 * (here[0, 2] + here[1, 2] + here[2, 2] + here[3, 2])
    for leg in range(4):
        has_lifted = False
        for n in range(len(times)):
            has_lifted = has_lifted or not stance[n, leg]
            if not has_lifted:  # keeps its place
                x, y = travel(vx, vy, rate, times[n])
                arms[n, leg, 0], arms[n, leg, 1] = here[leg, 0] - x, here[leg, 1] - y
                arms[n, leg, 2] = here[leg, 2]
                continue
            # Lands around its nominal place, ahead of it first, behind it last.
            left = (0.5 - phase[n, leg]) * stance_time
            x, y = turned(footprint[leg, 0], footprint[leg, 1], rate * (times[n] + left))
            dx, dy = turned(left * vx, left * vy, rate * (times[n] + 0.5 * left))
            arms[n, leg, 0], arms[n, leg, 1] = x + dx - com[0], y + dy - com[1]
            arms[n, leg, 2] = height
