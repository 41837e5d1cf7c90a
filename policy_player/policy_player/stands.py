# SPDX-License-Identifier: Apache-2.0
"""How robots stand by PD alone: pose, and gains that hold it."""

from collections.abc import Iterable, Sequence

import numpy as np
from robot_description.description import Description, OTHER, QUADRUPED
from wasd_core.errors import UserError
from wasd_core.robot_io import JointTargets

from policy_player.player import Player
from policy_player.spec import MOTOR_ORDER

G1_JOINTS = MOTOR_ORDER[29]
# The pose in which unitree_rl_lab's policies begin [rad]; all other joints are at zero.
_POSE = {
    'hip_pitch': -0.1,
    'knee': 0.3,
    'ankle_pitch': -0.2,
    'shoulder_pitch': 0.3,
    'left_shoulder_roll': 0.25,
    'right_shoulder_roll': -0.25,
    'elbow': 0.97,
    'left_wrist_roll': 0.15,
    'right_wrist_roll': -0.15,
}
# [N m/rad], [N m s/rad]. A policy's own are softer: 33 kg with the centre 0.7 m up tip over where
# both ankles together have less than 230 N m/rad.
_GAINS = {
    'hip': (150.0, 4.0),
    'knee': (200.0, 5.0),
    'ankle': (300.0, 3.0),
    'waist': (200.0, 5.0),
    'shoulder': (60.0, 3.0),
    'elbow': (60.0, 3.0),
    'wrist': (20.0, 1.0),
}
# A quadruped's own weight turns a joint by no more than this while its motor can hold it [rad];
# damping is so much of stiffness [s]. Policies of Go2s have 20 to 40 N m/rad, and sag.
_SAG, _DAMPING = 0.4, 0.03


def is_g1(joints: Iterable[str]) -> bool:
    """Whether joints are those of a G1, and no others."""
    return set(joints) == set(G1_JOINTS)


def g1_stand(joints: Sequence[str]) -> JointTargets:
    """Return the stand of a G1, in the order of its joints."""
    pose = [next((a for part, a in _POSE.items() if part in name), 0.0) for name in joints]
    gains = [next(pair for part, pair in _GAINS.items() if part in name) for name in joints]
    return JointTargets(np.array(pose), *np.array(gains).T)


def stand_of(loaded: Description, joints: Sequence[str], player: Player | None) -> JointTargets:
    """
    Return the stand's joint angles, in the order of its joints: of a G1, or of its policy.

    Raises:
        UserError: neither is so; says what the robot is, and what to do with it.
    """
    if is_g1(joints):
        return g1_stand(joints)
    what, cure = loaded.nature
    if player is None or loaded.kind not in (OTHER, QUADRUPED):
        raise UserError(
            f'{loaded.path}: how {loaded.robot.name!r} stands is not known'
            f'{f": it is {what}: {cure}" if what else "; give --policy FILE"}'
        )
    missing = [name for name in joints if name not in player.joints]
    if missing:
        raise UserError(
            f'policy: {len(missing)} joints of {loaded.robot.name!r} are none of it, '
            f'{missing[0]} among them'
        )
    order = [player.joints.index(name) for name in joints]
    spec = player.spec
    parts = (spec.default_position, spec.stiffness, spec.damping)
    pose, stiffness, damping = (np.array(part)[order] for part in parts)
    if loaded.kind == QUADRUPED:
        stiff = np.array([loaded.robot.joints[name].effort for name in joints]) / _SAG
        stiffness, damping = np.maximum(stiffness, stiff), np.maximum(damping, _DAMPING * stiff)
    return JointTargets(pose, stiffness, damping)
