# SPDX-License-Identifier: Apache-2.0
"""One robot in MuJoCo's model: what of it is its own, its start, its outline."""

import math

import mujoco
import numpy as np
from robot_description.mujoco.builder import lowest_geom_point

from mujoco_sim.robot_setup import RobotSetup

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
        # By the tree of bodies, not by names: a world's file may have joints of its own.
        own = [
            joint
            for joint in joints
            if joint.type[0] != free and model.body_rootid[joint.bodyid[0]] == self.root
        ]
        self.joint_names = tuple(self._own_name(joint.name) for joint in own)
        self.position = np.array([joint.qposadr[0] for joint in own], dtype=int)
        self.velocity = np.array([joint.dofadr[0] for joint in own], dtype=int)
        self.motors = self._find_motors([joint.id for joint in own])
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

    def _find_motors(self, joints: list[int]) -> slice:
        moved = np.where(
            self._model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT,
            self._model.actuator_trnid[:, 0],
            -1,
        )
        own = np.flatnonzero(np.isin(moved, joints)).tolist()
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
        place[2] += max(0.0, -setup.sink - lowest_geom_point(model, data, parts.root))


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
