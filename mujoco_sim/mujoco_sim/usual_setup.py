# SPDX-License-Identifier: Apache-2.0
"""How a robot is usually put into the simulator, judged by what it is."""

from robot_description.urdf import Robot

from mujoco_sim.robot_setup import RobotSetup
from mujoco_sim.robot_setup import SensorNoise

# Joints of one leg from the trunk on, by Unitree's names, and their angles when the robot lies on
# its belly with its legs folded [rad]; unitree_sdk2's stand example begins there.
LYING_ANGLES = {'hip': 0.0, 'thigh': 1.36, 'calf': -2.65}
LYING_HEIGHT = 0.12
LEGS = 4
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

    Without `noise` its sensors tell the truth; motors and delay stay real.
    """
    if not is_quadruped(robot):
        return RobotSetup()
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
