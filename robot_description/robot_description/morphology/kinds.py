# SPDX-License-Identifier: Apache-2.0
"""What a robot is that no controller here drives, by its shape, and what to do with it."""

import math
from typing import NamedTuple

from robot_description.morphology.equip_wheels import lowest_point
from robot_description.morphology.leg import LEG_JOINTS as WALKING_JOINTS
from robot_description.morphology.names import words
from robot_description.morphology.quadruped import find_quadruped, NotAQuadruped
from robot_description.morphology.rollers import find_rollers, is_on_leg, is_upright, Roller
from robot_description.morphology.tyre import turns_freely
from robot_description.morphology.wheels import Drive
from robot_description.robot import Joint, Robot

GO2, MBOT = 'drive it by wasd go2 --description', 'drive it by wasd mbot --description'
SIMULATE = (
    '`simulator --ros-args -p description:=FILE` simulates it, and a controller of your own moves '
    'its joints (docs/write_a_controller.md)'
)
ONE_PAIR = (
    'left_wheel_names, right_wheel_names in a --controller file of wasd mbot name one pair that '
    'drives it, the others slide'
)
HUMANOID = 'wasd g1 --description FILE --policy FILE walks it with your network, or ' + SIMULATE
# A chain of so many joints is an arm, or a leg.
ARM_JOINTS, LEG_JOINTS = 3, 2
FEWEST_PROPELLERS = 3
PROPELLER_WORDS = {'prop', 'props', 'propeller', 'propellers', 'rotor', 'rotors'}
# What is within this share of a robot's height of its lowest point stands on the ground.
ON_GROUND = 0.15
# A base that reaches so far down stands there itself, and what hangs on it are arms.
BASE_ON_GROUND = 0.05


class Kind(NamedTuple):
    """What a robot is, in words after `is`, and what to do with it; empty where nobody knows."""

    what: str = ''
    cure: str = ''


def name_kind(robot: Robot, drive: Drive) -> Kind:
    """Return what a robot is; `drive` is what `find_drive` said of it."""
    rollers = find_rollers(robot)
    try:
        find_quadruped(robot)
    except NotAQuadruped:
        pass
    else:
        return Kind('a quadruped', GO2)
    on_legs = _wheels_on_legs(robot, rollers)
    if len(on_legs) > 1:
        return _wheel_legged(on_legs)
    if drive.wheels:
        return Kind('a robot on two driven wheels', MBOT)
    if drive.what:
        return Kind(drive.what, _vehicle_cure(drive.what))
    return _standing(robot, [roller for roller in rollers if not is_on_leg(roller, robot)])


def _wheels_on_legs(robot: Robot, rollers: list[Roller]) -> list[Roller]:
    """Return the wheels at the ends of legs, which are lower than all else is."""
    lowest = min(float(pose.position[2]) for pose in robot.zero_poses.values())
    return [
        roller
        for roller in rollers
        if is_on_leg(roller, robot) and roller.bottom - roller.radius <= lowest
    ]


def _wheel_legged(wheels: list[Roller]) -> Kind:
    names = ', '.join(wheel.joint.name for wheel in wheels)
    walks = len(wheels) == 4 and all(len(wheel.above) == WALKING_JOINTS for wheel in wheels)
    cure = 'make these joints fixed, and wasd go2 --description walks it' if walks else SIMULATE
    return Kind(f'a wheel-legged robot ({names} turn at the ends of its legs)', cure)


def _vehicle_cure(what: str) -> str:
    if 'steers' in what:
        return f'wasd has no controller that steers wheels: {SIMULATE}'
    if 'mecanum' in what:
        return f'wasd cannot drive wheels sideways; {ONE_PAIR}'
    return ONE_PAIR


def _standing(robot: Robot, rollers: list[Roller]) -> Kind:
    """Return what a robot is that has no wheels to drive: by what stands, flies or reaches."""
    propellers = [] if rollers else _propellers(robot)
    if len(propellers) >= FEWEST_PROPELLERS:
        return Kind(
            f'a drone ({", ".join(propellers)} are propellers)',
            'wasd cannot fly: take a simulator with propellers, such as Gazebo with PX4',
        )
    legs, arms = ([] if rollers else _legs(robot)), _arms(robot)
    if len(legs) == 2:
        what = 'a humanoid' if len(arms) > 1 else 'a biped'
        return Kind(
            f'{what} (legs {legs[0]}, {legs[1]})',
            f'wasd has no controller of its own for two legs: {HUMANOID}',
        )
    if len(legs) > 2:
        return Kind(f'a robot on {len(legs)} legs ({", ".join(legs)})', SIMULATE)
    if arms and not rollers:
        many = f'a robot of {len(arms)} arms' if len(arms) > 1 else 'an arm'
        return Kind(f'{many} ({", ".join(arms)})', f'wasd has no controller for arms: {SIMULATE}')
    return Kind()


def _propellers(robot: Robot) -> list[str]:
    """Return what turns freely about an upright axis; of what has no joints, what says so."""
    if not robot.movable_joints:
        return [link for link in robot.links if PROPELLER_WORDS & {*words(link)}]
    carriers = {joint.parent for joint in robot.movable_joints}
    return [
        joint.name
        for joint in robot.movable_joints
        if turns_freely(joint) and is_upright(robot, joint) and joint.child not in carriers
    ]


def _chains(robot: Robot) -> list[list[Joint]]:
    """Return the joints that move from the root to each that carries no other."""
    carriers = {robot.carriers[joint.parent] for joint in robot.movable_joints}
    chains = []
    for joint in robot.movable_joints:
        if joint.child not in carriers:
            chain, above = [joint], robot.parent_joints.get(joint.parent)
            while above is not None:
                chain += [above] if above.is_movable else []
                above = robot.parent_joints.get(above.parent)
            chains.append(chain[::-1])
    return chains


def _bottom(robot: Robot, carrier: str) -> float:
    """Return the lowest point of what moves as one with a link [m]; its frames', too."""
    group = [link for link, holder in robot.carriers.items() if holder == carrier]
    return min(
        min(lowest_point(robot, link), float(robot.zero_poses[link].position[2])) for link in group
    )


def _on_ground(robot: Robot) -> list[list[Joint]]:
    """Return the chains that end on the ground; none where the base or one alone does."""
    chains = _chains(robot)
    heights = [float(pose.position[2]) for pose in robot.zero_poses.values()]
    ends = [_bottom(robot, chain[-1].child) for chain in chains]
    base = robot.carriers[robot.base]
    shapes = [
        lowest_point(robot, link) for link, carrier in robot.carriers.items() if carrier == base
    ]
    level = min([*ends, *shapes], default=0.0)
    height = max(heights, default=0.0) - level
    if min(shapes, default=math.inf) <= level + BASE_ON_GROUND * height:
        return []
    near = level + ON_GROUND * height
    standing = [chain for chain, end in zip(chains, ends, strict=True) if end <= near]
    return standing if len({chain[-1].parent for chain in standing}) > 1 else []


def _legs(robot: Robot) -> list[str]:
    """Return the first joint of each leg: what parts from the others and ends on the ground."""
    chains = _on_ground(robot)
    shared = 0
    while chains and all(len(c) > shared and c[shared] is chains[0][shared] for c in chains):
        shared += 1
    legs = {chain[shared].name: len(chain) - shared for chain in chains if len(chain) > shared}
    return [name for name, joints in legs.items() if joints >= LEG_JOINTS]


def _arms(robot: Robot) -> list[str]:
    """Return the first joint of each chain of joints that does not end on the ground."""
    standing = {joint.name for chain in _on_ground(robot) for joint in chain}
    arms: dict[str, int] = {}
    for chain in _chains(robot):
        free = [joint for joint in chain if joint.name not in standing]
        branched = [j for j in free if _branches(robot, j, standing)]
        first = branched[-1] if branched else free[0] if free else None
        if first is not None and len(free) - free.index(first) >= ARM_JOINTS:
            arms.setdefault(first.name, len(free))
    return list(arms)


def _branches(robot: Robot, joint: Joint, standing: set[str]) -> bool:
    """Whether further chains of several joints hang where a joint does."""
    holder = robot.carriers[joint.parent]
    beside = [
        other
        for other in robot.movable_joints
        if robot.carriers[other.parent] == holder and other.name not in standing
    ]
    return sum(_depth(robot, other) >= ARM_JOINTS for other in beside) > 1


def _depth(robot: Robot, joint: Joint) -> int:
    """Return how many joints in a row begin with one."""
    return max(len(chain) - chain.index(joint) for chain in _chains(robot) if joint in chain)
