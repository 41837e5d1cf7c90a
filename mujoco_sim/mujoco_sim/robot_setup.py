# SPDX-License-Identifier: Apache-2.0
"""How a robot is put into a world: start pose, motors, delay, noise; as given, or as usual."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import math

from robot_description.description import Description
from robot_description.morphology.equip_wheels import held_joints
from robot_description.morphology.equip_wheels import lowest_point
from robot_description.morphology.equip_wheels import rotors
from robot_description.morphology.quadruped import FOLDED
from robot_description.morphology.quadruped import NotAQuadruped
from robot_description.morphology.quadruped import Quadruped
from robot_description.morphology.quadruped import REFLECTED_INERTIA
from robot_description.morphology.quadruped import scale_of
from robot_description.morphology.quadruped import similar_pose

from mujoco_sim.sensors.noise import SensorNoise
from mujoco_sim.untold import Drawn
from mujoco_sim.untold import NOTHING
from mujoco_sim.untold import Untold

# Height of the base of a Go2 that lies on its belly with its legs folded [m], and how deep in the
# floor its feet are.
LYING_HEIGHT = 0.12
LYING_SINK = 0.008
# A description that is off the floor by less than this [m] means to be on it.
ROUNDING = 1e-6
# From a command to its torque, as on real robots of this size [s].
COMMAND_DELAY = 0.002


@dataclass(frozen=True)
class RobotSetup:
    """
    How a robot is put into a world.

    `joint_positions` [rad], `place` (x, y) and `height` [m] of the root are where it starts;
    `speed_limits` [rad/s] are the no-load speeds of its motors; a command takes effect
    `command_delay` [s] after it was given; without `noise` sensors tell the truth.

    A robot of which more than `sink` [m] would begin below z = 0 is raised out of the floor.
    `reflected_inertia` [kg m^2] is what rotors add to joints, instead of the usual. With `imu`
    the robot has one even when its description names none.

    `held` joints [rad] or [m] stay there until a command names them.

    `untold` is what the controller is not told, `drawn` how the robot differs at random.
    """

    joint_positions: Mapping[str, float] = field(default_factory=dict)
    place: tuple[float, float] = (0.0, 0.0)
    height: float = 0.0
    speed_limits: Mapping[str, float] = field(default_factory=dict)
    command_delay: float = 0.0
    noise: SensorNoise | None = None
    sink: float = math.inf
    reflected_inertia: Mapping[str, float] = field(default_factory=dict)
    imu: bool = False
    held: Mapping[str, float] = field(default_factory=dict)
    untold: Untold = NOTHING
    drawn: Drawn = Drawn()


def usual_setup(
    description: Description, noise: bool = True, untold: Untold = NOTHING
) -> RobotSetup:
    """
    Return a quadruped that lies on the floor, with real motors and sensors; others as they are.

    What else motors move on a wheeled robot is held.

    One whose root is above what touches the floor is lifted so that it stands there.

    Without `noise` its sensors tell the truth; motors and delay stay real. `untold` is what the
    controller is not told; what is drawn at random is another's to draw.
    """
    try:
        quadruped = description.quadruped
    except NotAQuadruped:
        robot, drive = description.robot, description.drive
        lowest, held = lowest_point(robot), held_joints(robot, drive)
        return RobotSetup(
            joint_positions=held,
            height=-lowest if -math.inf < lowest < -ROUNDING else 0.0,
            reflected_inertia=rotors(robot, drive),
            held=held,
            untold=untold,
        )
    scale = scale_of(quadruped)
    inertia = REFLECTED_INERTIA * scale.of('kg m^2')
    hips = sum(float(leg.hip[2]) for leg in quadruped.legs) / len(quadruped.legs)
    return RobotSetup(
        joint_positions=lying_positions(quadruped) | dict(quadruped.held),
        height=LYING_HEIGHT * scale.of('m') - hips,
        sink=LYING_SINK * scale.of('m'),
        speed_limits={joint.name: joint.velocity for joint in quadruped.joints},
        command_delay=COMMAND_DELAY,
        noise=SensorNoise().drifting(untold.imu_drift) if noise else None,
        reflected_inertia=dict.fromkeys(quadruped.joint_names, inertia),
        imu=True,
        held=quadruped.held,
        untold=untold,
    )


def lying_positions(quadruped: Quadruped) -> dict[str, float]:
    """Return the joint positions [rad] of a quadruped that lies with its legs folded."""
    angles = similar_pose(quadruped, *FOLDED)
    positions = quadruped.sign * (angles - quadruped.zero)
    return dict(zip(quadruped.joint_names, positions.tolist(), strict=True))


def foot_links(description: Description) -> tuple[str, ...]:
    """Return the links on which a quadruped stands; none of another robot."""
    try:
        return description.quadruped.feet
    except NotAQuadruped:
        return ()
