# SPDX-License-Identifier: Apache-2.0
"""What --help and --version tell beyond the options: keys, examples, which version this is."""

from importlib import metadata

from teleop_keyboard.keymap_file import load_preset

from wasd_bringup.key_switch import SWITCH_LINE
from wasd_bringup.options import PRESETS
from wasd_bringup.run_keys import KEY_LINE
from wasd_bringup.unitree_keys import unitree_help

# One wheel holds all packages; in a ROS workspace each is by itself.
DISTRIBUTIONS = ('wasd', 'wasd_bringup')
EXAMPLES = {
    '': (
        ('go2', 'stand, trot and walk a Unitree Go2'),
        ('mbot --preset wasd', 'drive a small wheeled robot'),
        ('demo', 'watch both, without a key'),
    ),
    'go2': (
        ('go2', '2 stand, 4 trot, w walk'),
        ('go2 --world stairs:0.1', 'up and down steps of 10 cm'),
        ('go2 --preset wasd', '2 stand, 5 drive: a key counts while it is down'),
    ),
    'mbot': (
        ('mbot', "the tutorial's keys: i , j l"),
        ('mbot --preset wasd', 'w a s d drive'),
        ('mbot --description my_robot.urdf.xacro', 'a robot of your own'),
    ),
    'both': (
        ('both', 'TAB goes from one to the other'),
        ('both --world room', 'in a room'),
        ('both --record run.mcap', 'to be shown again: wasd replay run.mcap'),
    ),
}
ROS = '--ros-args ... goes to the nodes: -r __ns:=/robot1, -r odom:=wheel_odom, -p name:=value'


def examples(command: str) -> list[str]:
    """Return the examples of a command, or of the whole ('')."""
    rows = EXAMPLES[command]
    width = max(len(words) for words, _ in rows)
    return ['examples:', *(f'  wasd {words:{width}}  {what}' for words, what in rows)]


def run_epilog(robot: str, ros: bool = True) -> str:
    """Return what stands below the options of a command that runs robots."""
    lines = examples(robot)
    for name, preset in PRESETS.items():
        if robot in (name, 'both'):
            lines += ['', f'keys of {name}, --preset {preset} (others: wasd keys):']
            lines += [f'  {line}' for line in _keys(preset) if line]
    switch = [SWITCH_LINE] if robot == 'both' else []
    lines += [f'  {line}' for line in (*switch, KEY_LINE)]
    return '\n'.join([*lines, '', ROS] if ros else lines)


def version() -> str:
    """Return the version that is installed."""
    for name in DISTRIBUTIONS:
        try:
            return metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return 'of unknown version'


def _keys(preset: str) -> tuple[str, ...]:
    return unitree_help('qwerty') if preset == 'unitree' else load_preset(preset).help_lines
