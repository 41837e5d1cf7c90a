# SPDX-License-Identifier: Apache-2.0
"""The options of the commands that run robots, as argparse declares them."""

import argparse

from mujoco_sim.world_names import WORLD_NAMES
from teleop_keyboard.key_names import LAYOUTS

from wasd_bringup.discovery_range import RANGES
from wasd_bringup.options import PRESETS

MODES = ('sim', 'fake', 'float', 'arbotix')
VIEWERS = ('web', 'native', 'none')


def add_run_options(parser: argparse.ArgumentParser, robot: str) -> None:
    """Declare the options of a robot's command."""
    parser.set_defaults(robot=robot)
    parser.add_argument(
        '--description', default=robot, metavar='PATH', help='a xacro or URDF of your own'
    )
    parser.add_argument(
        '--package-path',
        action='append',
        default=[],
        metavar='DIR',
        help='where package:// and $(find) look first (repeatable)',
    )
    parser.add_argument(
        '--xacro-arg',
        action='append',
        default=[],
        metavar='NAME:=VALUE',
        help='an argument of the xacro file (repeatable)',
    )
    parser.add_argument(
        '--strict',
        action='store_true',
        help='refuse a description whose meshes are not where it says',
    )
    preset = PRESETS[robot]
    parser.add_argument(
        '--preset', default=preset, metavar='NAME', help=f'keymap (default: {preset})'
    )
    parser.add_argument('--twist', metavar='FILE', help='scripted velocities: "t vx vy wz"')
    parser.add_argument(
        '--push',
        action='append',
        default=[],
        metavar='"T FX FY FZ S"',
        help='a force on the robot, world frame [N] (repeatable)',
    )
    _add_shared_options(parser)


def add_both_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command for both robots, which are the built-in ones."""
    parser.set_defaults(
        robot='both',
        description='both',
        package_path=[],
        xacro_arg=[],
        strict=False,
        preset='',
        twist=None,
        push=[],
    )
    _add_shared_options(parser)


def _add_shared_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of a run, whoever runs."""
    parser.add_argument(
        '--viewer',
        choices=VIEWERS,
        help='web: a page on 127.0.0.1; native: a window (default: web on a terminal, else none)',
    )
    parser.add_argument(
        '--port', type=int, default=0, metavar='N', help='port of the page (default: 8080 or next)'
    )
    parser.add_argument(
        '--world', default='flat', metavar='NAME|FILE', help=f'{WORLD_NAMES}, or a model file'
    )
    parser.add_argument(
        '--layout', choices=LAYOUTS, default='qwerty', help='your keyboard (default: qwerty)'
    )
    parser.add_argument('--play', metavar='FILE', help='scripted keys: lines "t key [key ...]"')
    parser.add_argument('--duration', metavar='S', help='stop after S simulated seconds')
    parser.add_argument(
        '--speed',
        default='1',
        metavar='X',
        help='real-time factor aimed at; 0: as fast as it goes (default 1)',
    )
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='seed (default 0)')
    parser.add_argument(
        '--discovery',
        choices=RANGES,
        help='who may join over ROS: nobody, this machine, the network (default: localhost, or as '
        'ROS_AUTOMATIC_DISCOVERY_RANGE says; off for a script at --speed 0)',
    )
    parser.add_argument('--save-keys', metavar='FILE', help='write the keys, as --play reads them')
    parser.add_argument('--record', metavar='FILE.mcap', help='record every topic')
    parser.add_argument('--report', metavar='FILE', help='write what happened as JSON')


def add_replay_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of a replay."""
    parser.add_argument('file', metavar='FILE.mcap', help='what --record wrote')
    parser.add_argument(
        '--drive',
        action='store_true',
        help='simulate again with the recorded commands and compare the paths',
    )
    parser.add_argument('--viewer', choices=VIEWERS, help='default: web on a terminal, else none')
    parser.add_argument('--port', type=int, default=0, metavar='N', help='port of the page')
    parser.add_argument(
        '--speed', metavar='X', help='1 is as it was, 0 as fast as it goes (default 1; 0 unseen)'
    )


def add_wheeled_options(parser: argparse.ArgumentParser) -> None:
    """Declare what only a wheeled robot's command has."""
    parser.add_argument(
        '--mode',
        choices=MODES,
        help='fake: no physics, wheels do as told; sim: physics, a PID loop turns the wheels '
        '(float; default); arbotix: physics, and the integer loop of the ArbotiX board',
    )
    parser.add_argument(
        '--controller',
        metavar='FILE',
        help="YAML with the drive's parameters: arbotix's, ros2_controllers' or your own",
    )


def add_tuning_option(parser: argparse.ArgumentParser) -> None:
    """Declare the option that gives one legged robot other parameters."""
    parser.add_argument(
        '--controller', metavar='FILE', help="YAML with the leg controller's parameters"
    )


def add_legged_options(parser: argparse.ArgumentParser) -> None:
    """Declare what only a legged robot's command has."""
    parser.add_argument(
        '--estimator',
        choices=('kalman', 'truth'),
        default='kalman',
        help='what feeds the controller: IMU and legs (default), or the simulator without noise',
    )
    parser.add_argument(
        '--limits',
        choices=('sport', 'guide'),
        help="full stick: what the controller is good for (default), or unitree_guide's",
    )
