# SPDX-License-Identifier: Apache-2.0
"""Boxes in a world that are put into robots' way."""

from collections.abc import Sequence
import math

import mujoco

from mujoco_sim.parameters import BoxSize

# Under any floor and out of any light: where a box is that stands nowhere [m].
NOWHERE = -10.0
RGBA = (0.85, 0.50, 0.15, 1.0)


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
