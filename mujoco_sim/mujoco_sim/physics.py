# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's model and state, stepped for all the robots in it, and boxes that move."""

from collections.abc import Sequence
import math
import sys
from typing import TYPE_CHECKING

import mujoco
from wasd_core.errors import one_line, SimulationError

from mujoco_sim.parameters import BoxSize
from mujoco_sim.robot_parts import Actuation

if TYPE_CHECKING:
    pass

# The warnings of MuJoCo that say so, of positions to accelerations.
_DIVERGED = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
# How these begin; `Physics.step` says it in words of its own.
_UNSTABLE = 'Nan, Inf or huge value'
# Under any floor and out of any light: where a box is that stands nowhere [m].
NOWHERE = -10.0
RGBA = (0.85, 0.50, 0.15, 1.0)


def _warn(text: str) -> None:
    """Say a warning as MuJoCo does, which would write MUJOCO_LOG.TXT where the user is, too."""
    if not text.startswith(_UNSTABLE):
        print(f'WARNING: {text}', file=sys.stderr)


class Physics:
    """
    A compiled model, its state, its `boxes`, and `tick`, the number of physics steps so far.

    Commands and pushes of the robots begin and end between steps; in between, MuJoCo runs alone.
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
            self.model = spec.compile()
        except ValueError as error:
            raise SimulationError(f'MuJoCo: {one_line(error)}') from None
        self.data = mujoco.MjData(self.model)
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
        Advance by `count` physics steps.

        Raises:
            SimulationError: what acts is more than can be solved; MuJoCo has put all back then.
        """
        last = self.tick + count
        while self.tick < last:
            until = last
            for robot in self.robots:
                until = min(until, robot.take_due(self.tick, last))
            self._advance(until - self.tick)
            for robot in self.robots:
                robot.drop_ended(self.tick)
        if any(self._divergences.tolist()):
            raise SimulationError(
                f'the physics diverged at {self.tick * self.time_step:.3f} s: '
                'a push, a load, a speed or a mass is too large for the simulation'
            )

    def _advance(self, count: int) -> None:
        self.tick += count
        if all(robot.is_kinematic for robot in self.robots):
            return
        changing = [robot for robot in self.robots if robot.changes_each_step]
        if not changing:
            mujoco.mj_step(self.model, self.data, count)
            return
        for robot in changing:
            robot.begin_steps()
        for _ in range(count):
            mujoco.mj_step(self.model, self.data)
            for robot in changing:
                robot.end_step()


def add_boxes(spec: mujoco.MjSpec, sizes: Sequence[BoxSize]) -> None:
    """Add boxes that stand nowhere yet; what runs into one does not move it."""
    for index, size in enumerate(sizes):
        body = spec.worldbody.add_body(name=_name(index), mocap=True, pos=[0.0, 0.0, NOWHERE])
        half = [0.5 * length for length in size]
        # Its origin is where it stands, in the middle.
        body.add_geom(
            name=_name(index),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[0.0, 0.0, half[2]],
            size=half,
            rgba=RGBA,
        )


class MovingBoxes:
    """The boxes of a model, by their numbers; a reset of the physics puts all of them nowhere."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        kind = mujoco.mjtObj.mjOBJ_BODY
        bodies = [mujoco.mj_name2id(model, kind, _name(index)) for index in range(model.nmocap)]
        self._mocap = [int(model.body_mocapid[body]) for body in bodies if body >= 0]
        self._geoms = [int(model.body_geomadr[body]) for body in bodies if body >= 0]
        self._aside: mujoco.MjData | None = None

    def __len__(self) -> int:
        """How many there are."""
        return len(self._mocap)

    def put(self, index: int, x: float, y: float, yaw: float = 0.0) -> bool:
        """
        Put a box on the floor of the world [m], [rad]; return if it stands there now.

        It stays where it was if something that moves is in the place, or a number is not finite.
        """
        if not all(map(math.isfinite, (x, y, yaw))):
            return False
        if self._aside is None:
            self._aside = mujoco.MjData(self._model)
        mujoco.mj_copyData(self._aside, self._model, self._data)
        self._place(self._aside, index, (x, y, 0.0), yaw)
        mujoco.mj_forward(self._model, self._aside)
        if self._geoms[index] in self._aside.contact.geom:
            return False
        self._place(self._data, index, (x, y, 0.0), yaw)
        return True

    def _place(
        self, data: mujoco.MjData, index: int, place: tuple[float, float, float], yaw: float
    ) -> None:
        mocap = self._mocap[index]
        data.mocap_pos[mocap] = place
        data.mocap_quat[mocap] = math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)


def _name(index: int) -> str:
    # No robot's link has a slash in its name.
    return f'moving/box{index}'
