# SPDX-License-Identifier: Apache-2.0
"""What a navigator and a guard get of a robot of a run: its lidar, its odometry, its size."""

from collections.abc import Callable
from functools import partial
from typing import Any

from mujoco_sim.robot_parts import outline_of
from mujoco_sim.sensors.lidar import LidarTag
import numpy as np
from wasd_core.errors import UserError
from wasd_navigation.guard_parameters import GuardParameters
from wasd_navigation.planning.motion import HARD
from wasd_navigation.senses import Senses

from wasd_bringup.run.robot import Robot

# The topic of the lidar that is used where there are several.
SCAN = 'scan'
# Room around a robot that walks [m]: the trunk sways, and feet land beside their places.
SWAY = 0.06
# A walk drifts: so much more room for each metre of the way ahead [m/m].
DRIFT = 0.05
# A lidar's noise may show the guard an obstacle this much nearer than the map has it [m].
NOISE = 0.015
# A robot whose corners stand out no farther than this is called round.
ROUND = 1.1
SENSOR_NEEDED = (
    '{option}: {robot} has no planar lidar: give its description a <gazebo reference="LINK">'
    '<sensor type="ray">'
)


def lidar_of(robot: Robot, option: str = '--map') -> LidarTag:
    """
    Return the lidar to map with: the one that publishes `scan`, or else the first.

    Raises:
        UserError: there is none, which the `option` needs.
    """
    lidars = [tag for tag in robot.sensors.tags if isinstance(tag, LidarTag)]
    if not lidars:
        raise UserError(SENSOR_NEEDED.format(option=option, robot=robot.description.robot.name))
    return next((tag for tag in lidars if tag.topic == SCAN), lidars[0])


def guard_parameters_of(robot: Robot, enabled: bool = True) -> GuardParameters:
    """Return the parameters of a robot's guard: more room around legs."""
    room: dict[str, Any] = {'footprint_padding': SWAY, 'drift': DRIFT} if len(robot.feet) else {}
    return GuardParameters(enabled=enabled, **room)


def margin_of(robot: Robot) -> float | None:
    """Return the margin of a navigator [m]: a way has as much room as the guard keeps."""
    if len(robot.feet):
        return SWAY / HARD
    if robot.options.guard:
        return (guard_parameters_of(robot).footprint_padding + NOISE) / HARD
    return None


def listen_to_lidar(robot: Robot, tag: LidarTag, senses: Senses, first: Callable[[], Any]) -> None:
    """Give `senses` what a robot's lidar measures; `first` is called before each scan."""
    prefix = robot.world.prefix
    for joint in robot.description.robot.joints.values():
        if joint.kind == 'fixed':
            senses.place_frame(prefix + joint.child, prefix + joint.parent, joint.pose)
    frame = f'{prefix}{tag.link} of the lidar'
    senses.place_frame(frame, prefix + tag.link, tag.pose)
    robot.sensors.listen(tag.topic, lambda now, fields: first())
    robot.sensors.listen(tag.topic, partial(senses.take_measured, frame))


def size_of(robot: Robot) -> dict[str, float]:
    """Return the navigator's parameters of a robot's size [m]; of legs only the feet count."""
    feet = robot.feet
    world = robot.world
    outline = outline_of(world.model, world.data, world.root, is_whole=not len(feet))
    points = np.concatenate((outline, feet))
    half_length, half_width = np.abs(points).max(axis=0).tolist()
    radius = float(np.hypot(points[:, 0], points[:, 1]).max())
    if radius <= ROUND * min(half_length, half_width):
        return {'robot_radius': radius}
    return {'footprint_length': 2.0 * half_length, 'footprint_width': 2.0 * half_width}
