# SPDX-License-Identifier: Apache-2.0
"""One robot in MuJoCo's model: what of it is its own, its start, and what acts on it."""

from collections import deque
import math
from typing import NamedTuple, TYPE_CHECKING

import mujoco
import numpy as np
from robot_description.mujoco.builder import holding
from wasd_core.robot_io import JointCommand

from mujoco_sim.robot_setup import RobotSetup

if TYPE_CHECKING:
    from mujoco_sim.compiled import TorqueSpeedCurve

# Points on a rim, and where its ends are along z.
_RIM = np.array(
    [
        (math.cos(angle), math.sin(angle), end)
        for angle in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        for end in (-1.0, 1.0)
    ]
)
_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_CYLINDER, _MESH = int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_MESH)
# Damping of motors that brake without having been commanded any [N m s/rad]: a Go2 sinks down.
BRAKE_DAMPING = 3.0
# ... but at most this share of what stops a joint within one physics step: motor torques are
# integrated explicitly, which diverges beyond 2 and rings beyond 1.
STABLE_SHARE = 0.5


class RobotParts:
    """
    Names without, and numbers with the robot's prefix in the model.

    `joint_names` and `motor_names` give the order of all else: `position` and `velocity` (n,) are
    the joints' addresses in qpos and qvel, `motors` is the slice of the actuators, `motor_joint`
    (m,) tells the joint of each motor. `pose` and `twist` are the slices of the root's free joint,
    None where it is held in place; `prefix` is what the names have in the model.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str, root: str) -> None:
        self._model = model
        self.prefix = prefix
        self.root = int(model.body(prefix + root).id)
        self.pose: slice | None = None
        self.twist: slice | None = None
        free = mujoco.mjtJoint.mjJNT_FREE
        joints = [model.joint(i) for i in range(model.njnt)]
        for joint in joints:
            if joint.bodyid[0] == self.root and joint.type[0] == free:
                at, moving = int(joint.qposadr[0]), int(joint.dofadr[0])
                self.pose, self.twist = slice(at, at + 7), slice(moving, moving + 6)
        own = [
            joint for joint in joints if joint.type[0] != free and joint.name.startswith(prefix)
        ]
        self.joint_names = tuple(self._own_name(joint.name) for joint in own)
        self.position = np.array([joint.qposadr[0] for joint in own], dtype=int)
        self.velocity = np.array([joint.dofadr[0] for joint in own], dtype=int)
        self.motors = self._find_motors()
        names = [model.actuator(i).name for i in range(model.nu)]
        self.motor_names = tuple(map(self._own_name, names[self.motors]))
        self.motor_joint = np.array(
            [self.joint_names.index(name) for name in self.motor_names], dtype=int
        )
        self.link_of_geom = [
            self._own_name(model.geom(i).name).partition('/')[0] for i in range(model.ngeom)
        ]

    def body(self, link: str) -> int:
        """Return the number of the body that is a link; -1 where it is welded into another."""
        kind = mujoco.mjtObj.mjOBJ_BODY
        return int(mujoco.mj_name2id(self._model, kind, self.prefix + link))

    def _find_motors(self) -> slice:
        names = [self._model.actuator(i).name for i in range(self._model.nu)]
        own = [index for index, name in enumerate(names) if name.startswith(self.prefix)]
        # Those of one robot follow each other, as its specification was attached in one piece.
        return slice(own[0], own[-1] + 1) if own else slice(0, 0)

    def _own_name(self, name: str) -> str:
        """Return a name of the model without the prefix; '' where it is another robot's."""
        return name.removeprefix(self.prefix) if name.startswith(self.prefix) else ''


def put_at_start(
    model: mujoco.MjModel, data: mujoco.MjData, parts: RobotParts, setup: RobotSetup
) -> None:
    """Put a robot where its setup says; a floating one relative to where it is now in x and y."""
    for name, position in setup.joint_positions.items():
        data.joint(parts.prefix + name).qpos[0] = position
    if parts.pose is None:
        return
    place = data.qpos[parts.pose][:3]
    place[:2] += setup.place
    place[2] = setup.height
    if setup.sink < math.inf:
        place[2] += max(0.0, -setup.sink - lowest_point(model, data, parts.root))


def lowest_point(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> float:
    """
    Return the height of the lowest point of what collides on a robot [m]; inf if nothing does.

    `root` is its first body, `data` holds its pose. Boxes around shapes stand for the shapes,
    so that it may be a little lower than they are; spheres are taken as they are.
    """
    mujoco.mj_kinematics(model, data)
    geoms = np.flatnonzero(
        (model.body_rootid[model.geom_bodyid] == root)
        & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    )
    up = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
    centre, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
    reach = (np.abs(up) * half).sum(axis=1) - (up * centre).sum(axis=1)
    is_round = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE
    reach = np.where(is_round, model.geom_rbound[geoms], reach)
    return float((data.geom_xpos[geoms, 2] - reach).min(initial=math.inf))


def outline_of(
    model: mujoco.MjModel, data: mujoco.MjData, root: int, is_whole: bool = True
) -> np.ndarray:
    """
    Return points around what collides of a robot, as seen from above, shape (n, 2) [m].

    They are in the frame of its base, the body `root`, as it is now; of that alone unless
    `is_whole`.
    """
    own = model.geom_bodyid == root
    if is_whole:
        own = model.body_rootid[model.geom_bodyid] == model.body_rootid[root]
    rotation = data.xmat[root].reshape(3, 3)
    parts = []
    for geom in np.flatnonzero(own & (model.geom_contype != 0)):
        corners = _surface(model, int(geom))
        placed = data.geom_xpos[geom] + corners @ data.geom_xmat[geom].reshape(3, 3).T
        parts.append((placed - data.xpos[root]) @ rotation)
    return np.asarray(np.concatenate(parts)[:, :2])


def _surface(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return points around a geom, in its axes, (n, 3)."""
    size = model.geom_size[geom]
    if model.geom_type[geom] == _CYLINDER:
        return np.asarray(_RIM * (size[0], size[0], size[1]))
    if model.geom_type[geom] == _MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        return np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]])
    return np.asarray(model.geom_aabb[geom, :3] + _CORNERS * model.geom_aabb[geom, 3:])


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

    It is told the tick; a command takes effect after the setup's delay.
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
        self.is_kinematic = False
        self._time_step = float(model.opt.timestep)
        self._command_shape = (5, len(parts.motor_names))
        self._delay = round(setup.command_delay / self._time_step)
        strength = setup.drawn.strength
        self._strength = np.array([strength.get(name, 1.0) for name in parts.motor_names])
        self._curve = self._torque_speed_curve()
        # Views on MuJoCo's own memory: to ask for them at every step costs more than to use them.
        self._velocities = data.qvel
        self._controls = data.ctrl[self._motors]
        self._gains = model.actuator_biasprm[self._motors, 1:3]  # -kp, -kd
        self._force_range = model.actuator_forcerange[self._motors]
        self._effort = data.actuator_force[self._motors]
        self._peak_effort, self._unread = np.zeros((2, len(parts.motor_names)))
        # Of a wheel in the air, the worst case: on the ground it has the robot to move, too.
        stopping = 1.0 / (model.dof_invweight0[self._motor_velocity] * self._time_step)
        self._brake_damping = np.minimum(BRAKE_DAMPING, STABLE_SHARE * stopping)

    def reset(self) -> None:
        """Begin again at the start of the setup, with limp motors; the state is that of rest."""
        put_at_start(self._model, self._data, self._parts, self._setup)
        self._pushes: list[tuple[int, Push]] = []  # each with the tick of its end
        self._kept_push = np.zeros(3)  # the force without an end
        self._hung, self._wrench = self._parts.root, np.zeros(6)
        self._pending: deque[tuple[int, np.ndarray]] = deque()
        self._put_in_force(np.zeros((5, len(self._parts.motor_names))))

    def take_due(self, tick: int, last: int) -> int:
        """Put in force the commands that are due; return when one or a push changes, or `last`."""
        while self._pending and self._pending[0][0] <= tick:
            self._put_in_force(self._pending.popleft()[1])
        if self._pending:
            last = min(last, self._pending[0][0])
        return min((end for end, _ in self._pushes), default=last) if self._pushes else last

    def drop_ended(self, tick: int) -> None:
        """Drop the pushes that are over."""
        if self._pushes:
            self._pushes = [push for push in self._pushes if push[0] > tick]
            self._sum_pushes()

    @property
    def changes_each_step(self) -> bool:
        """Whether the motors' limits, or the moment of a push, depend on how the robot moves."""
        return self._curve is not None or any(push.point is not None for _, push in self._pushes)

    def begin_steps(self) -> None:
        """Limit the motors as their speeds allow, and turn pushes off the centre with the root."""
        if self._curve is not None:
            self._follow(self._curve, self._unread)
        if self._pushes:
            self._sum_pushes()

    def end_step(self) -> None:
        """Note the largest efforts, and do what comes before the next step."""
        if self._curve is not None:
            self._follow(self._curve, self._peak_effort)
        else:
            self._note_efforts()
        if self._pushes:
            self._sum_pushes()

    def _follow(self, curve: 'TorqueSpeedCurve', peak: np.ndarray) -> None:
        velocities, motors = self._velocities, self._motor_velocity
        curve.follow(velocities, motors, self._force_range, self._effort, peak)

    def take_peak_effort(self) -> np.ndarray:
        """Return the largest effort of each motor since the last call [N m], shape (m,)."""
        self._note_efforts()
        peak, self._peak_effort = self._peak_effort, np.zeros_like(self._peak_effort)
        return peak

    def _note_efforts(self) -> None:
        np.maximum(self._peak_effort, np.abs(self._effort), out=self._peak_effort)

    def apply(self, command: JointCommand, tick: int) -> bool:
        """Put a command in force once it is due; return if it was taken, see `World.apply`."""
        try:
            stacked = np.array(command, dtype=float)
        except ValueError:  # parts of different lengths
            stacked = np.empty(0)
        if stacked.shape != self._command_shape or not _is_finite(stacked):
            self.rejected_commands += 1
            self.brake()
            return False
        if self._delay == 0:
            self._put_in_force(stacked)
        else:
            self._pending.append((tick + self._delay, stacked))
        return True

    def brake(self) -> None:
        """Let the motors only resist motion; see `World.brake`."""
        self._pending.clear()
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
        """Replace the wrench that a hoist applies to a body; see `World.hang`."""
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
        if self._curve is not None:
            self._curve.command(command, self._strength, self._gains, self._controls)
        else:  # the same without what compiles: wheels would wait for it at each start
            np.multiply(command[3:].T, -self._strength[:, None], out=self._gains)
            stiff, damped = command[3:] * command[:2]
            np.multiply(command[2] + stiff + damped, self._strength, out=self._controls)
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


def _is_finite(numbers: np.ndarray) -> bool:
    # A product tells in one call of most, but overflows where numbers are large.
    return math.isfinite(float(np.vdot(numbers, numbers))) or bool(np.isfinite(numbers).all())
