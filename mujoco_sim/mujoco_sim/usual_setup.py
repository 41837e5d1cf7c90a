# SPDX-License-Identifier: Apache-2.0
"""How a robot is usually put into the simulator, judged by what it is."""

import math

from robot_description.drive_wheels import lowest_point
from robot_description.urdf import Robot

from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.robot_setup import SensorNoise

# Joints of one leg from the trunk on, by Unitree's names, and their angles when the robot lies on
# its belly with its legs folded [rad]; unitree_sdk2's stand example begins there.
LYING_ANGLES = {'hip': 0.0, 'thigh': 1.36, 'calf': -2.65}
LYING_HEIGHT = 0.12
LEGS = 4
# A description that is off the floor by less than this [m] means to be on it.
ROUNDING = 1e-6
# From a command to its torque, as on real robots of this size [s].
COMMAND_DELAY = 0.002


def is_quadruped(robot: Robot) -> bool:
    """Whether the robot has four legs of a hip, a thigh and a calf joint."""
    names = [joint.name for joint in robot.movable_joints]
    return all(
        sum(name.endswith(f'_{part}_joint') for name in names) == LEGS for part in LYING_ANGLES
    )


def usual_setup(robot: Robot, noise: bool = True) -> RobotSetup:
    """
    Return a quadruped that lies on the floor, with real motors and sensors; others as they are.

    One whose root is above what touches the floor is lifted so that it stands there.

    Without `noise` its sensors tell the truth; motors and delay stay real.
    """
    if not is_quadruped(robot):
        lowest = lowest_point(robot)
        return RobotSetup(height=-lowest if -math.inf < lowest < -ROUNDING else 0.0)
    return RobotSetup(
        joint_positions={
            joint.name: angle
            for joint in robot.movable_joints
            for part, angle in LYING_ANGLES.items()
            if joint.name.endswith(f'_{part}_joint')
        },
        height=LYING_HEIGHT,
        speed_limits={joint.name: joint.velocity for joint in robot.movable_joints},
        command_delay=COMMAND_DELAY,
        noise=SensorNoise() if noise else None,
    )
