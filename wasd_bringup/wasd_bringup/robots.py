# SPDX-License-Identifier: Apache-2.0
"""
The robots that have a command of their own: a row each in ROBOTS.

A row is all that such a robot needs: `wasd NAME` with its options and help, its nodes, its keys,
its place beside others. This module loads neither ROS nor the simulator.
"""

from dataclasses import dataclass
import importlib
from typing import Any

from quadruped_sim.keys import EYES_KEY, GAIT_KEYS, STATE_KEYS, STICK_KEYS
from teleop_keyboard.keymap import on_layout
from teleop_keyboard.keymap_file import load_preset

from diff_drive_sim import MODES as DRIVE_MODES

UNITREE_PRESET = 'unitree'
UNITREE_HELP = (
    '2 stand   4 trot   5 move base (cmd_vel)   1 passive',
    '6 get up   7 lie down   {v} jump   3 free stand   0 9 8 tests   {n} next gait   {e} eyes',
    '{w}/{s} forward, backward   {a}/{d} left, right   {j}/{l} turn   {i}/{k} height'
    '   space: centre',
    'First 2, then 4, then {w}.',
)
UNITREE_FIRST_KEYS = (
    'press 2 to stand, 4 to trot; then {w} {s} {a} {d} walk, {j} {l} turn, space stops'
)
# `sim` is the first of them, as a word for beginners.
MODES = ('sim', *DRIVE_MODES)

# What kinds of robots call the options of their own; of one robot alone.
LEGS, LEGS_ALONE, POLICY, WHEELS = 'legs', 'legs alone', 'policy', 'wheels'


@dataclass(frozen=True)
class Kind:
    """
    What robots of one build share: classes as `module:name`, and options of their commands.

    `robot` is loaded when such a robot runs, `face` when ROS is to see it, `view` is what a
    page shows. `controller` names its controller in a log.
    """

    robot: str
    options: tuple[str, ...] = ()  # see `Option.of`
    face: str = 'wasd_bringup.ros.controllers:ControllerFace'
    view: str = 'wasd_bringup.page.robot_view:RobotView'
    controller: str = 'controller'
    pad_preset: str = 'mbot'  # what a gamepad means to it
    state_help: tuple[str, ...] = ()  # keys beside those of its preset, in words


LEGGED = Kind(
    robot='wasd_bringup.run.go2:Go2',
    options=(LEGS, LEGS_ALONE, POLICY),
    face='wasd_bringup.ros.controllers:LegsFace',
    view='wasd_bringup.page.legs:LegsView',
    controller='leg_controller',
    pad_preset='go2',
)
WHEELED = Kind(
    robot='wasd_bringup.run.mbot:Mbot',
    options=(WHEELS,),
    face='wasd_bringup.ros.controllers:WheelsFace',
    view='wasd_bringup.page.wheels:WheelsView',
    controller='diff_drive_controller',
)
HUMANOID = Kind(
    robot='wasd_bringup.run.legged:Legged',
    options=(POLICY,),
    face='wasd_bringup.ros.controllers:JointsFace',
    view='wasd_bringup.page.legged:LeggedView',
    controller='joint_controller',
    state_help=(
        '2 stand   p policy (--policy FILE)   1 passive   h hoist on, off',
        'The hoist bears it at first. First 2, then p, then h, then drive.',
    ),
)


def load_class(name: str) -> Any:
    """Return the class that a row names as `module:class`."""
    module, _, found = name.partition(':')
    return getattr(importlib.import_module(module), found)


@dataclass(frozen=True, kw_only=True)
class RobotRow:
    """
    One robot: `wasd NAME` runs it.

    `description` is a built-in name or a file, `preset` its usual keymap, `examples` are words
    after `wasd` and what they do. `place` is where it starts [m] in a world that several robots
    share, as those of `wasd both`; without one it is none of these.
    """

    name: str
    kind: Kind
    summary: str
    description: str
    preset: str
    examples: tuple[tuple[str, str], ...] = ()
    place: tuple[float, float] | None = None


GO2 = RobotRow(
    name='go2',
    kind=LEGGED,
    summary='drive the legged robot',
    description='go2',
    preset=UNITREE_PRESET,
    examples=(
        ('go2', '2 stand, 4 trot, w walk'),
        ('go2 --world stairs:0.1', 'up and down steps of 10 cm'),
        ('go2 --preset wasd', '2 stand, 5 drive: a key counts while it is down'),
    ),
    place=(0.0, 0.6),
)
MBOT = RobotRow(
    name='mbot',
    kind=WHEELED,
    summary='drive the wheeled robot',
    description='mbot',
    preset='mbot',
    examples=(
        ('mbot', "the tutorial's keys: i , j l"),
        ('mbot --preset wasd', 'w a s d drive'),
        ('mbot --description my_robot.urdf.xacro', 'a robot of your own'),
    ),
    place=(0.0, -0.6),
)
G1 = RobotRow(
    name='g1',
    kind=HUMANOID,
    summary='have a humanoid stand, and walk by a network of yours',
    description='g1',
    preset='wasd',
    examples=(
        ('g1', '2 stand, h lets go of the hoist'),
        ('g1 --policy policy.onnx', '2 stand, p walk, h lets go, w a s d drive'),
    ),
)
ROBOTS: dict[str, RobotRow] = {row.name: row for row in (GO2, MBOT, G1)}
# The command that runs all robots with a place, and what reports and recordings call these.
BOTH = 'both'


def robots_of(command: str) -> list[RobotRow]:
    """Return the robots that a command runs."""
    if command != BOTH:
        return [ROBOTS[command]]
    return [row for row in ROBOTS.values() if row.place is not None]


def preset_help(preset: str, layout: str = 'qwerty') -> tuple[str, ...]:
    """Return the keys of a preset in words; those of `unitree` are no keymap's."""
    return unitree_help(layout) if preset == UNITREE_PRESET else load_preset(preset).help_lines


def unitree_help(layout: str) -> tuple[str, ...]:
    """Return unitree_guide's keys in words; the first two lines are those of the states."""
    return tuple(line.format_map(_names(layout)) for line in UNITREE_HELP)


def unitree_first_keys(layout: str) -> str:
    """Return the keys to press first."""
    return UNITREE_FIRST_KEYS.format_map(_names(layout))


def _names(layout: str) -> dict[str, str]:
    keys = (*STICK_KEYS, *GAIT_KEYS, EYES_KEY, *STATE_KEYS)
    return {key: on_layout(key, layout) for key in keys}
