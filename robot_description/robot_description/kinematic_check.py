# SPDX-License-Identifier: Apache-2.0
"""Whether MuJoCo, Pinocchio and yourdfpy put the links of a robot where its URDF says."""

from collections.abc import Mapping
import io
import logging
import math
from typing import NamedTuple, Protocol

import mujoco
import numpy as np
import yourdfpy

from robot_description.description import Description
from robot_description.forward_kinematics import link_poses
from robot_description.mujoco.builder import compile_model
from robot_description.mujoco.builder import to_mujoco
from robot_description.pinocchio_model import bare_urdf
from robot_description.pinocchio_model import configuration
from robot_description.pinocchio_model import link_positions
from robot_description.pinocchio_model import to_pinocchio
from robot_description.urdf import Joint
from robot_description.urdf import parse_urdf

Positions = Mapping[str, float]
Places = dict[str, np.ndarray]
# Joints without limits are tried so far to both sides [rad], sliding ones so far [m].
FULL_TURN = math.pi
SLIDE = 0.5


class Deviation(NamedTuple):
    """How far a library's links are at most from where the URDF's own arithmetic has them [m]."""

    library: str
    distance: float
    link: str


def check_kinematics(
    description: Description, poses: int = 5, seed: int = 0
) -> tuple[Deviation, ...]:
    """
    Compare the places of all links in random poses within the joint limits.

    Mimicking joints are moved like others, each by itself.

    Raises:
        DescriptionError: a library cannot read the robot.
    """
    random = np.random.default_rng(seed)
    robot, text = description.robot, bare_urdf(description.urdf)
    libraries: dict[str, _Library] = {
        'MuJoCo': _Mujoco(text),
        'Pinocchio': _Pinocchio(description),
        'yourdfpy': _Yourdfpy(text),
    }
    worst = {name: Deviation(name, 0.0, robot.root) for name in libraries}
    for _ in range(poses):
        positions = {joint.name: _any_position(joint, random) for joint in robot.movable_joints}
        expected = link_poses(robot, positions)
        for name, library in libraries.items():
            for link, place in library.places(positions).items():
                distance = float(np.linalg.norm(place - expected[link].position))
                if distance > worst[name].distance:
                    worst[name] = Deviation(name, distance, link)
    return tuple(worst.values())


def _any_position(joint: Joint, random: np.random.Generator) -> float:
    reach = SLIDE if joint.kind == 'prismatic' else FULL_TURN
    return float(random.uniform(max(joint.lower, -reach), min(joint.upper, reach)))


class _Library(Protocol):
    def places(self, positions: Positions) -> Places:
        """Return where the links are in the root [m]."""


class _Mujoco:
    def __init__(self, urdf: str) -> None:
        spec = to_mujoco(parse_urdf(urdf))
        spec.compiler.fusestatic = False  # every link stays a body
        self._model = compile_model(spec)

    def places(self, positions: Positions) -> Places:
        data = mujoco.MjData(self._model)
        for name, position in positions.items():
            data.joint(name).qpos[0] = position
        mujoco.mj_kinematics(self._model, data)
        bodies = [self._model.body(index).name for index in range(1, self._model.nbody)]
        return {name: data.body(name).xpos.copy() for name in bodies}


class _Pinocchio:
    def __init__(self, description: Description) -> None:
        self._model = to_pinocchio(description)

    def places(self, positions: Positions) -> Places:
        return link_positions(self._model, configuration(self._model, positions))


class _Yourdfpy:
    def __init__(self, urdf: str) -> None:
        logging.getLogger('yourdfpy.urdf').setLevel(logging.ERROR)
        self._model = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False)

    def places(self, positions: Positions) -> Places:
        self._model.update_cfg(dict(positions))
        return {name: self._model.get_transform(name)[:3, 3] for name in self._model.link_map}
