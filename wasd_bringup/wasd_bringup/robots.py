# SPDX-License-Identifier: Apache-2.0
"""
The robots with a command of their own: each is a row of ROBOTS.

A robot needs only its row: `wasd NAME` with options and help, its nodes, its keys and its place
beside others follow. This module loads neither ROS nor the simulator.
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
    '2 stand   4 trot   5 move base (cmd_vel)   1 passive   {e} eyes',
    '6 get up   7 lie down   {v} jump   3 free stand   0 9 8 tests   {n} next gait',
    '{w}/{s} forward, back   {a}/{d} left, right   {j}/{l} turn   {i}/{k} height   space: centre',
    'First 2, then 4, then {w}.',
)
UNITREE_FIRST_KEYS = (
    'press 2 to stand, 4 to trot; then {w} {s} {a} {d} walk, {j} {l} turn, space stops'
)
# `sim` is another name of the first mode, for beginners.
MODES = ('sim', *DRIVE_MODES)

# Groups of options that a kind of robots has; LEGS_ALONE: only in a run of one robot.
LEGS, LEGS_ALONE, POLICY, WHEELS = 'legs', 'legs alone', 'policy', 'wheels'


@dataclass(frozen=True)
class Kind:
    """
    Robots of one build: their classes as `module:name`, and the options of their commands.

    A run loads `robot`; ROS needs `face`; the page shows `view`. `controller` is the name of the
    controller in a log.
    """

    robot: str
    options: tuple[str, ...] = ()  # see `Option.of`
    face: str = 'wasd_bringup.ros.controllers:ControllerFace'
    view: str = 'wasd_bringup.page.robot_view:RobotView'
    controller: str = 'controller'
    pad_preset: str = 'mbot'  # preset of a gamepad
    state_help: tuple[str, ...] = ()  # help lines of keys that are not in its preset


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
        'It begins on the hoist. Press 2, then p, then h, then drive.',
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

    `description` is a built-in name or a file, `preset` the default keymap, `examples` are words
    after `wasd` with their effect. `place` is the start [m] in a world of several robots, as for
    `wasd both`; a robot without one is not part of such a world.
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
        ('go2 --world stairs:0.1', 'walk up and down steps of 10 cm'),
        ('go2 --preset wasd', '2 stand, 5 drive: a key drives while it is down'),
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
    summary='make a humanoid stand, and walk with your network',
    description='g1',
    preset='wasd',
    examples=(
        ('g1', '2 stand, h releases it from the hoist'),
        ('g1 --policy policy.onnx', '2 stand, p walk, h releases it, w a s d drive'),
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


def preset_help(preset: str) -> tuple[str, ...]:
    """Return the keys of a preset on qwerty in words; those of `unitree` are no keymap's."""
    return unitree_help('qwerty') if preset == UNITREE_PRESET else load_preset(preset).help_lines


def unitree_help(layout: str) -> tuple[str, ...]:
    """Return unitree_guide's keys in words; the first two lines are those of the states."""
    return tuple(line.format_map(_names(layout)) for line in UNITREE_HELP)


def unitree_first_keys(layout: str) -> str:
    """Return the keys to press first."""
    return UNITREE_FIRST_KEYS.format_map(_names(layout))


def _names(layout: str) -> dict[str, str]:
    keys = (*STICK_KEYS, *GAIT_KEYS, EYES_KEY, *STATE_KEYS)
    return {key: on_layout(key, layout) for key in keys}
