# SPDX-License-Identifier: Apache-2.0
"""Sets up a robot in a world: start pose, motors, noise, load; default, given or random."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
import math

import mujoco
import numpy as np
from robot_description.description import Description
from robot_description.morphology.equip_wheels import held_joints, lowest_point, rotors
from robot_description.morphology.quadruped import (
    find_imu,
    FOLDED,
    NotAQuadruped,
    Quadruped,
    REFLECTED_INERTIA,
    scale_of,
    similar_pose,
)
from robot_description.mujoco.builder import add_imu, hold_joints, to_mujoco
from wasd_core.errors import DescriptionError

from mujoco_sim.noise import SensorNoise
from mujoco_sim.parameters import Drawn, NOTHING, Payload, Untold

# Height of the base of a Go2 that lies on its belly with its legs folded [m], and how deep in the
# floor its feet are.
LYING_HEIGHT = 0.12
LYING_SINK = 0.008
# A description that is off the floor by less than this [m] means to be on it.
ROUNDING = 1e-6
# From a command to its torque, as on real robots of this size [s].
COMMAND_DELAY = 0.002
# Of a payload, a bag of sand [kg/m^3].
PAYLOAD_DENSITY = 1600.0
# Where a range shrinks to at level 0, and its bounds at level 1, of a robot of the Go2's size.
MASS = (0.0, -1.0, 3.0)  # added to the base [kg]
CENTRE = (0.0, -0.05, 0.05)  # of the base's mass, along each axis of its frame [m]
FRICTION = (0.6, 0.5, 1.25)
STRENGTH = (1.0, 0.9, 1.1)  # of each motor: its torque over what it was told
DELAY = (0.0, 0.0, 0.004)  # of commands, beyond the usual, and of what sensors say [s]
NOISE = (1.0, 1.0, 5.0)  # over the usual
# Terrain and noise of the same seed have streams of their own.
STREAM = 14


@dataclass(frozen=True)
class RobotSetup:
    """
    How a robot is put into a world.

    `joint_positions` [rad], `place` (x, y) and `height` [m] of the root are where it starts;
    `speed_limits` [rad/s] are the no-load speeds of its motors; a command takes effect
    `command_delay` [s] after it was given; without `noise` sensors tell the truth.

    A robot that would begin more than `sink` [m] below z = 0 is raised out of the floor.
    `reflected_inertia` [kg m^2] is what rotors add to joints, instead of the usual. With `imu`
    the robot has one even when its description names none.

    `held` joints [rad] or [m] stay there until a command names them.

    `untold` holds what the controller is not told, `drawn` how the robot differs at random.
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
    if description.why_no_quadruped:
        robot, drive = description.robot, description.drive
        resting = robot.rest_positions
        lowest = lowest_point(robot, poses=robot.link_poses(resting))
        return RobotSetup(
            joint_positions=resting,
            height=-lowest if -math.inf < lowest < -ROUNDING else 0.0,
            reflected_inertia=rotors(robot, drive),
            held=held_joints(robot, drive),
            untold=untold,
        )
    quadruped = description.quadruped
    scale = scale_of(quadruped)
    inertia = REFLECTED_INERTIA * scale.of('kg m^2')
    lying = quadruped.sign * (similar_pose(quadruped, *FOLDED) - quadruped.zero)
    hips = sum(float(leg.hip[2]) for leg in quadruped.legs) / len(quadruped.legs)
    return RobotSetup(
        joint_positions=description.robot.all_positions(
            dict(zip(quadruped.joint_names, lying.tolist(), strict=True))
        ),
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


def upright_setup(
    description: Description,
    positions: Mapping[str, float],
    untold: Untold = NOTHING,
    noise: bool = True,
) -> RobotSetup:
    """
    Return a robot on its feet with joints at positions [rad], with real motors and sensors.

    `positions` are of joints that it has. It stands by nothing: something has to hold it.
    """
    joints = description.robot.movable_joints
    return RobotSetup(
        joint_positions=positions,
        sink=0.0,
        speed_limits={joint.name: joint.velocity for joint in joints},
        command_delay=COMMAND_DELAY,
        noise=SensorNoise().drifting(untold.imu_drift) if noise else None,
        imu=True,
        untold=untold,
    )


def foot_links(description: Description) -> tuple[str, ...]:
    """Return the links on which a quadruped stands; none of another robot."""
    return () if description.why_no_quadruped else description.quadruped.feet


def robot_spec(loaded: Description, setup: RobotSetup, visuals: bool = False) -> mujoco.MjSpec:
    """
    Return a robot with what its setup adds to it, nothing around it.

    Raises:
        DescriptionError: MuJoCo cannot read the robot.
    """
    try:
        spec = to_mujoco(loaded.robot, visuals)
    except DescriptionError as error:
        raise DescriptionError(f'{loaded.path}: {error}') from None
    for joint, inertia in setup.reflected_inertia.items():
        spec.joint(joint).armature = inertia
    hold_joints(spec, loaded.robot, setup.held)
    friction = setup.drawn.friction if setup.untold.friction is None else setup.untold.friction
    if friction is not None:
        _set_friction(spec, foot_links(loaded), friction)
    if setup.untold.payload is not None:
        _add_payload(spec.body(loaded.robot.base), setup.untold.payload)
    if setup.imu and find_imu(loaded.robot) is None:
        add_imu(spec, loaded.robot)
    return spec


def _set_friction(spec: mujoco.MjSpec, feet: Sequence[str], friction: float) -> None:
    """Let this friction count on any ground, of the feet, or of what is not free of friction."""
    for geom in spec.geoms:
        if geom.name.partition('/')[0] in feet or (not feet and geom.condim > 1):
            geom.priority = 1
            geom.friction[0] = friction


def _add_payload(base: mujoco.MjsBody, payload: Payload) -> None:
    """Weld a cube of the payload's mass to the base; it is visible and touches nothing."""
    edge = (payload.mass / PAYLOAD_DENSITY) ** (1.0 / 3.0)
    load = base.add_body(pos=payload.place)  # a link may have any name, also `payload`
    load.explicitinertial = True
    load.mass, load.ipos = payload.mass, np.zeros(3)
    load.inertia = np.full(3, payload.mass * edge**2 / 6.0)
    load.add_geom(
        name=f'{base.name}/payload',
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=np.full(3, edge / 2.0),
        contype=0,
        conaffinity=0,
        mass=0.0,
        rgba=[0.85, 0.65, 0.25, 1.0],
    )


def draw(level: float, seed: int, quadruped: Quadruped) -> Drawn:
    """
    Return how a robot differs at a level in [0, 1]; the same seed draws the same.

    Ranges at level 1 are what policies for robots of the Go2's size are trained with: friction
    [Rudin2021], mass [Margolis2023], motor strength [Kumar2021]; the centre of mass as in public
    trainings of the Go2. Delays are of the order of that measured between a computer and its
    motors, 3 ms [Tan2018]; noise is up to five times that of the sensors as they are. At level 0
    nothing differs; between, ranges shrink linearly.
    """
    random, scale = np.random.default_rng((seed, STREAM)), scale_of(quadruped)

    def one(limits: tuple[float, float, float], unit: float = 1.0) -> float:
        neutral, low, high = limits
        return float(neutral + level * (random.uniform(low, high) - neutral)) * unit

    return Drawn(
        mass=one(MASS, scale.of('kg')),
        centre=(
            one(CENTRE, scale.of('m')),
            one(CENTRE, scale.of('m')),
            one(CENTRE, scale.of('m')),
        ),
        friction=one(FRICTION),
        command_delay=one(DELAY),
        sensor_delay=one(DELAY),
        noise=one(NOISE),
        strength={name: one(STRENGTH) for name in quadruped.joint_names},
    )


def randomise(setup: RobotSetup, seed: int, description: Description) -> RobotSetup:
    """
    Return a setup whose robot differs as its `untold.randomise` says.

    Raises:
        NotAQuadruped: it does differ, and its ranges are for quadrupeds.
    """
    level = setup.untold.randomise
    if level == 0.0:
        return setup
    try:
        drawn = draw(level, seed, description.quadruped)
    except NotAQuadruped as error:
        raise NotAQuadruped(f'randomise: {error}') from None
    noise = setup.noise
    if noise is not None:
        names = [each.name for each in fields(noise)]
        noise = replace(noise, **{name: drawn.noise * getattr(noise, name) for name in names})
    delay = setup.command_delay + drawn.command_delay
    return replace(setup, drawn=drawn, noise=noise, command_delay=delay)
