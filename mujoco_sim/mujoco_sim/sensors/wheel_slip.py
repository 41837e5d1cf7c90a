# SPDX-License-Identifier: Apache-2.0
"""How much the wheels of a robot slip, by the simulator's own truth."""

from typing import NamedTuple

import mujoco
import numpy as np
from robot_description.morphology.rollers import is_upright
from robot_description.robot import Robot

from mujoco_sim.sensors.mount import Snapshot
from mujoco_sim.world import World

# Below this speed [m/s] of tread and wheel alike, nothing is said to slip.
STANDSTILL = 0.001
# A cylinder does not roll if its axle is along the robot's z, within this angle [rad].
FLAT = 1e-6


class Slip(NamedTuple):
    """
    Slip of one wheel along its own rolling direction.

    `ratio` is 0 for a wheel that rolls, 1 for one that spins in place and -1 for one that slides
    without turning; `speed` [m/s] is how much faster its tread is than the ground below it,
    positive in the direction in which the joint's angle grows.
    """

    ratio: float
    speed: float


class _Wheel(NamedTuple):
    joint: str
    body: int
    axle: np.ndarray  # in the body's frame, shape (3,)
    radius: float  # [m]


class WheelSlip:
    """Compares how fast wheels turn with how fast they move; any number of them."""

    def __init__(self, world: World, robot: Robot, snapshot: Snapshot) -> None:
        self._model = world.model
        self._root = world.root
        self._snapshot = snapshot
        self._wheels = _find_wheels(world, robot)

    @property
    def joints(self) -> tuple[str, ...]:
        """The wheels' joints."""
        return tuple(wheel.joint for wheel in self._wheels)

    def measure(self) -> list[Slip]:
        """Return the slip of each wheel now, in the order of `joints`."""
        data = self._snapshot.take_whole()
        up = data.xmat[self._root].reshape(3, 3)[:, 2]
        slips = []
        for wheel in self._wheels:
            motion = np.empty(6)  # angular, then linear, of the wheel's centre in world axes
            kind = mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(self._model, data, kind, wheel.body, motion, False)
            axle = data.xmat[wheel.body].reshape(3, 3) @ wheel.axle
            ahead = np.cross(axle, up)
            length = float(np.linalg.norm(ahead))
            if length < FLAT:
                slips.append(Slip(0.0, 0.0))
                continue
            moving = float(ahead @ motion[3:]) / length
            slips.append(slip(wheel.radius * float(axle @ motion[:3]), moving))
        return slips


def slip(rolling: float, moving: float) -> Slip:
    """
    Return the slip of a wheel whose tread runs at `rolling` while its centre moves at `moving`.

    Both are in [m/s]. The ratio is their difference over the faster of the two, so a wheel that
    turns against its motion has up to 2.
    """
    reference = rolling if abs(rolling) >= abs(moving) else moving
    ratio = (rolling - moving) / reference if abs(reference) > STANDSTILL else 0.0
    return Slip(ratio, rolling - moving)


def _find_wheels(world: World, robot: Robot) -> list[_Wheel]:
    """Return the links that are cylinders turning about their own axis, which is not upright."""
    wheels = []
    for joint in robot.movable_joints:
        if is_upright(robot, joint):
            continue  # a turret, a lidar, a swivel
        body = world.parts.body(joint.child)
        for shape in robot.links[joint.child].collisions:
            along = shape.kind == 'cylinder' and abs(shape.pose.rotation[:, 2] @ joint.axis)
            if joint.kind == 'continuous' and body >= 0 and along > 1.0 - 1e-6:
                wheels.append(_Wheel(joint.name, body, joint.axis, shape.size[0]))
                break
    return wheels
