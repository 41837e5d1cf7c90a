# SPDX-License-Identifier: Apache-2.0
"""
Writes topics.md, parameters.md and each package's config/*.yaml from the nodes themselves.

    python docs/reference.py

It makes every node once and asks it; a test compares the files with the answers. This file has
only the purpose of each topic and service, in words.
"""

from collections.abc import Iterable, Iterator
import math
from pathlib import Path
from typing import Any

from ask_nodes import ask, End, Entry, NodeFacts, NODES, VARIANTS
import rclpy
from wasd_core.node import init_ros
import yaml

ROOT = Path(__file__).resolve().parents[1]
COMMAND = 'python docs/reference.py'

TOPICS = {
    '/clock': 'simulated time; nodes follow it with `use_sim_time:=true`',
    '/tf': 'odom to base from the controllers, map to odom from the navigator, joints',
    '/tf_static': 'fixed joints, stamp 0',
    '~/cmd_vel_out': 'the velocity within the limits, with `publish_limited_velocity:=true`',
    '~/state': 'action of the guard on the present command, and its reason',
    'cmd_vel_smoothed': 'velocity for the guard, by its parameter `cmd_vel_in_topic`',
    '~/set_odometry': 'new pose of odometry',
    'cmd_vel': 'velocity command; TwistStamped with the parameter `stamped`',
    'cmd_vel_out': 'the velocity of the source that drives',
    '/diagnostics': 'state, real-time factor, overruns, at 1 Hz; the namespace is in the name',
    'elevation': 'heights around the robot in `odom`: see [sensors](sensors.md#an-elevation)',
    'driver': 'who drives, since when, by which right, who else asks ([drivers](drivers.md))',
    'e_stop': 'true stops every source of a run, and closes the lock of the mux',
    'foot_contacts': 'force on each foot, as `effort` [N]',
    'ground_truth/odom': 'true pose of the base in the frame `world`, velocity in the base',
    'global_costmap/costmap': 'the costmap of the navigator, only for subscribers',
    'goal_pose': 'goal of the navigator: see [navigation](navigation.md)',
    'height_scan': 'the heights that policies are trained with: see there, too',
    'imu/data': 'orientation, angular velocity and acceleration in the IMU frame',
    'joint_commands': 'two points per message: positions, velocities, efforts; kp, kd',
    'joint_states': 'position, velocity and effort of every moving joint',
    'joy': 'axes and buttons of a gamepad: see [gamepad](gamepad.md)',
    'joy_priority': 'lock of the mux: true stops sources below the joystick',
    'joy_vel': 'velocity from a joystick',
    'key_vel': 'velocity from a keyboard',
    'keys': 'one key: `w`, `UP`, `ESC`, `CTRL+c`',
    'camera/depth/camera_info': 'intrinsics of the depth camera',
    'camera/depth/image_raw': 'depth [m], 32FC1',
    'camera/camera_info': 'intrinsics of the colour camera',
    'camera/image_raw': 'colour, rgb8',
    'camera/image_raw/compressed': 'the same as JPEG',
    'initialpose': 'pose of the robot in the map',
    'keepout_filter_mask': "the navigator's keepout areas, where it has any",
    'local_plan': 'the motion that the navigator follows',
    'map': 'free, occupied and unknown cells; at most once a second',
    'map_metadata': 'size and origin of the map',
    'plan': 'the path to the goal',
    'pose': 'pose of the robot in the map at each scan, under the name of slam_toolbox',
    'nav_vel': 'velocity from navigation',
    'odom': 'odometry, with the stamp of its /tf',
    'odom_error': 'error of `odom` against the truth at its stamp',
    'pause_navigation': 'lock of the mux: true stops navigation',
    'robot_description': 'the URDF',
    'kinect/depth/camera_info': 'intrinsics of the depth camera of mbot_kinect',
    'kinect/depth/image_raw': 'depth [m] from mbot_kinect, 32FC1',
    'kinect/rgb/camera_info': 'intrinsics of the colour camera of mbot_kinect',
    'kinect/rgb/image_raw': 'colour from mbot_kinect, rgb8',
    'kinect/rgb/image_raw/compressed': 'the same as JPEG',
    'points': 'cloud of the 3D lidar: see [sensors](sensors.md)',
    'scan': 'ranges of the lidar by REP 117',
    'selected': 'name of the source that drives, or nothing',
    'state': "the controller's state: passive, fixed stand, trotting, ...",
    'stop_closing_loop': 'lock of the mux: true stops sources below 200',
    'tab_vel': 'velocity from a tablet',
    'twist_marker': 'the velocity as an arrow for RViz',
    'utlidar/cloud': 'the same as `points`, under its name on a Go2',
    'wheel_slip': 'slip of each wheel: ratio as `position`, [m/s] as `velocity`',
}
SERVICES = {
    'simulator ~/reset': 'put the robot back at its start; time goes on',
    'simulator ~/hoist': 'hold the robot by the hoist, or let go (with `hoist:=true`)',
    'simulator ~/pause': 'stop physics and /clock, or continue',
    'simulator ~/step': 'one physics step while paused',
    'leg_controller ~/e_stop': 'make the legs passive at once',
    'policy_player ~/e_stop': 'make the joints passive at once',
    'drivers ~/e_stop': 'stop every robot of the run; with `--latched` until it is released',
    'drivers ~/release_e_stop': 'release a latched stop',
    'navigator ~/explore': 'map all that the robot can reach, then return to the start',
    'navigator ~/save_map': 'write the map as the parameter `save_map`: .yaml, .pgm, .places.npz',
    'navigator ~/reset': 'begin a new map',
    'navigator ~/cancel': 'cancel the goal and those after it',
    'diff_drive_controller ~/reset_odometry': 'set odometry back to the origin',
}


TOPICS_PAGE = f"""# Topics and services

Written by `{COMMAND}` from the nodes themselves.

A name without a slash in front is relative: in the namespace `robot` (`-r __ns:=/robot`), `odom`
is `/robot/odom`. `~` is the name of the node. The robot's description names the topics of lidars
and cameras; the table has those of the built-in robots.

## Topics

%s

*Quality*: every publisher offers reliable delivery, so every tool gets every topic, with either
reliability. Send commands reliably: `cmd_vel` and `keys` take no best effort. *Best effort* is
the request of our subscriber: it must not wait for lost sensor data (REP 2003). A *latched*
topic (transient local) gives its last message to late subscribers. The profiles are in
`wasd_core/topics.py`.

`/tf` and `/tf_static` need the package tf2_msgs: see [install](install.md).

## Services

%s
"""
PARAMETERS_PAGE = f"""# Parameters

Written by `{COMMAND}` from the nodes themselves.

`share/PACKAGE/config/NODE.yaml` has the same defaults. Copy and change it, and give it with
`--ros-args --params-file FILE`; a single parameter is `--ros-args -p NAME:=VALUE`. You can set
*live* parameters while the node runs; the others are read-only. A node refuses a value out of
range and names the range. With any one parameter at either end of its range the Go2 still trots
(`python benchmarks/parameter_bounds.py`). Every node has `use_sim_time`, too.

Values of the leg controller are for the Go2, also those that you give: another robot uses them
scaled to its size and mass, by their units. `wasd go2 --controller FILE` reads such a file, or a
plain table of names and values. `--ros-args -p` overrides the file, `--estimator` overrides both.
%s"""


def topics_page(nodes: Iterable[NodeFacts]) -> str:
    """Return topics.md."""
    ends: dict[str, list[End]] = {}
    services: dict[str, str] = {}
    for node in nodes:
        for end in node.ends:
            ends.setdefault(end.topic, []).append(end)
        services |= {f'{node.name} {name}': kind for name, kind in node.services}
    unsaid = (set(ends) ^ set(TOPICS)) | (set(services) ^ set(SERVICES))
    if unsaid:
        raise SystemExit(f'error: {__file__}: who has these, and what are they for: {unsaid}')
    topic_rows = [[f'`{name}`', *_describe(ends[name]), TOPICS[name]] for name in sorted(ends)]
    service_rows = [
        [f'`{service}`', node, f'`{services[name]}`', SERVICES[name]]
        for name in sorted(services)
        for node, service in [name.split()]
    ]
    return TOPICS_PAGE % (
        _table(['topic', 'type', 'from', 'to', 'quality', 'content'], topic_rows),
        _table(['service', 'of', 'type', 'what it does'], service_rows),
    )


def _describe(ends: list[End]) -> list[str]:
    """Return type, senders, takers and quality of a topic."""
    types = ', '.join(sorted({f'`{end.type}`' for end in ends}))
    senders = sorted({end.node for end in ends if end.sends})
    takers = sorted({end.node for end in ends if not end.sends})
    quality = 'best effort' if any(end.is_best_effort for end in ends) else 'reliable'
    if any(end.is_latched for end in ends):
        quality = 'latched'
    return [types, ', '.join(senders) or '-', ', '.join(takers) or '-', quality]


def parameters_page(nodes: Iterable[NodeFacts]) -> str:
    """Return parameters.md."""
    text = ''
    for node in sorted(nodes, key=lambda node: node.name):
        rows = [
            [f'`{e.name}`', f'`{_written(e.value)}`', '' if e.is_fixed else 'live', _meaning(e)]
            for e in node.parameters
        ]
        if rows:
            head = ['parameter', 'default', '', 'meaning']
            text += f'\n## {node.name} ({node.package})\n\n{_table(head, rows)}\n'
    return PARAMETERS_PAGE % text


def parameter_file(node: NodeFacts) -> str:
    """Return the defaults of a node as a ROS 2 parameter file."""
    lines = [
        f'# Defaults of {node.name}; written by `{COMMAND}`.',
        f'/**/{node.name}:',
        '  ros__parameters:',
    ]
    for entry in node.parameters:
        # ROS' reader of these files knows no empty list.
        comment = '# ' if entry.value == [] else ''
        lines.append(f'    # {_meaning(entry)}.')
        lines.append(f'    {comment}{entry.name}: {_written(entry.value)}')
    return '\n'.join([*lines, ''])


def _table(heading: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = (heading, ['---'] * len(heading), *rows)
    return '\n'.join('| ' + ' | '.join(cells) + ' |' for cells in lines)


def _meaning(entry: Entry) -> str:
    """Return what a parameter means, with its range or choices."""
    if not entry.range or entry.range in entry.meaning:
        return entry.meaning
    return f'{entry.meaning} ({entry.range})'


def _written(value: Any) -> str:
    """Return a value as it stands in a parameter file."""
    text: str = yaml.safe_dump(value, default_flow_style=True, width=math.inf)
    return text.removesuffix('...\n').strip()


def pages() -> Iterator[tuple[Path, str]]:
    """Yield the path of each file and what is to be in it; rclpy must be initialised."""
    nodes = [ask(make_node, package) for make_node, package in NODES.items()]
    variants = [ask(make_node, package) for make_node, package in VARIANTS.items()]
    yield ROOT / 'docs/topics.md', topics_page([*nodes, *variants])
    yield ROOT / 'docs/parameters.md', parameters_page(nodes)
    for node in nodes:
        if node.parameters:
            yield ROOT / node.package / 'config' / f'{node.name}.yaml', parameter_file(node)


def main() -> None:
    """Write all files."""
    init_ros([])
    for path, text in pages():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        print(path.relative_to(ROOT))
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
