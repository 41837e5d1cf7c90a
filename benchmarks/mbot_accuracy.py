# SPDX-License-Identifier: Apache-2.0
"""How exact mbot is: odometry, calibration, lidar and cameras, all against the physics' truth."""

import json
import math
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from environment import alone
from mujoco_sim.scene import ROOM_SIZE
from mujoco_sim.sensors.camera import Camera, CameraTag, Offscreen
from mujoco_sim.sensors.lidar import Lidar, LidarTag
from mujoco_sim.sensors.mount import Site
from mujoco_sim.sensors.table import read_sensor_tags
from mujoco_sim.world import build_world
import numpy as np
from robot_description.description import load_robot
from table import at_most, Row
from wasd_core.errors import SimulationError
import yaml

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
SQUARE = '\n'.join(
    f'{7 * side} 0.25 0 0\n{7 * side + 4} 0 0 0\n'
    f'{7 * side + 4.5} 0 0 {math.pi / 4}\n{7 * side + 6.5} 0 0 0'
    for side in range(4)
)
# By whole encoder ticks, a quarter of a millimetre each, instead of the wheels' true angles.
TICKS = 'odometry_feedback: ticks\n'


def simulate(
    folder: Path, option: str, script: str, duration: float, controller: str = ''
) -> dict[str, Any]:
    """Run `wasd mbot` on a script at full speed and return its report."""
    (folder / 'script').write_text(script)
    (folder / 'controller.yaml').write_text(controller)
    report = folder / 'report.json'
    words = ['mbot', option, str(folder / 'script'), '--duration', str(duration), '--speed', '0']
    if controller:
        words += ['--controller', str(folder / 'controller.yaml')]
    run_quietly([*words, '--report', str(report)])
    loaded: dict[str, Any] = json.loads(report.read_text())
    return loaded


def run_quietly(words: list[str]) -> None:
    """Run `wasd` with these words."""
    subprocess.run(
        [*WASD, *words],
        env=alone(),
        check=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def odometry_error(report: dict[str, Any]) -> tuple[float, float]:
    """Return the largest error at any time: distance [mm], yaw [degrees]."""
    samples = report['samples']
    rows = zip(samples['position'], samples['rpy'], samples['odom'], strict=True)
    errors = [
        (math.dist(p[:2], o[:2]), abs(math.remainder(r[2] - o[2], 2 * math.pi)))
        for p, r, o in rows
    ]
    return 1e3 * max(e[0] for e in errors), math.degrees(max(e[1] for e in errors))


def odometry(folder: Path) -> list[Row]:
    """Measure odometry against the truth at any time of three courses."""
    spin = f'0 0 0 1\n{2 * math.pi} 0 0 0'
    straight = simulate(folder, '--twist', '0 0.5 0 0\n4 0 0 0', 6.0)
    turn = simulate(folder, '--twist', spin, 8.0)
    square = simulate(folder, '--twist', SQUARE, 29.0)
    ticks = simulate(folder, '--twist', SQUARE, 29.0, controller=TICKS)
    return [
        at_most('odometry, 2 m straight', odometry_error(straight)[0], 'mm', 0.5),
        at_most('odometry, 360 degrees on the spot', odometry_error(turn)[1], 'deg', 0.05),
        at_most('odometry, 4 x 1 m square', odometry_error(square)[0], 'mm', 1.0),
        at_most('the same by encoder ticks of 0.24 mm', odometry_error(ticks)[0], 'mm', 2.0),
    ]


def calibration(folder: Path, runs: int) -> list[Row]:
    """Drive squares both ways, with right and with wrong wheels, and see what is found."""
    right, wrong = folder / 'right.yaml', folder / 'wrong.yaml'
    words = ['calibrate', '--runs', str(runs), '--output']
    run_quietly([*words, str(right)])
    injected = ['--wheel-separation', '0.26', '--right-radius', '0.0612']
    run_quietly([*words, str(wrong), *injected])
    before, _ = return_errors(right)
    _, after = return_errors(wrong)
    found = yaml.safe_load(wrong.read_text())['diff_drive_controller']['ros__parameters']
    separation = 0.26 * found['wheel_separation_multiplier'] / 0.38
    radii = [found[f'{side}_wheel_radius_multiplier'] for side in ('left', 'right')]
    return [
        at_most('UMBmark, squares both ways: largest return error', before, 'mm', 2.0),
        at_most('calibrate, 0.26 for 0.38 m: found within', 100 * abs(separation - 1), '%', 0.2),
        at_most(
            'calibrate, 2 % on one radius: found within',
            100 * max(abs(radius - 1) for radius in radii),
            '%',
            0.2,
        ),
        at_most('UMBmark with what was found', after, 'mm', 2.0),
    ]


def return_errors(file: Path) -> tuple[float, float]:
    """Return the largest return errors that a calibration says in its first line [mm]."""
    words = file.read_text().splitlines()[0].split()
    numbers = [float(words[index - 1]) for index, word in enumerate(words) if word == 'mm']
    return numbers[0], numbers[1]


def sensors(scans: int) -> list[Row]:
    """Measure the wall ahead with lidar and depth camera, and how long pictures take."""
    loaded = load_robot('mbot')
    world = build_world(loaded, 'room')
    ((lidar_tag,), (colour_tag, depth_tag), _), _ = read_sensor_tags(loaded.robot)
    assert isinstance(lidar_tag, LidarTag)
    assert isinstance(colour_tag, CameraTag)
    assert isinstance(depth_tag, CameraTag)
    site = Site(world, loaded.robot)
    lidar = Lidar(lidar_tag, site)
    wall = 0.5 * ROOM_SIZE
    ray = round((0.0 - lidar_tag.min_angle) / lidar_tag.angle_increment)
    angle = lidar_tag.min_angle + ray * lidar_tag.angle_increment
    seen = [lidar.scan(np.random.default_rng([11, number]))[ray] for number in range(scans)]
    seen = [length for length in seen if math.isfinite(length)]  # one ray in a hundred is lost
    error = 1e3 * abs(float(np.mean(seen)) - wall / math.cos(angle))
    rows = [at_most(f'lidar, wall at 3 m: mean error of {scans} scans', error, 'mm', 10.0)]
    try:
        offscreen = Offscreen(world, colour_tag.width, colour_tag.height)
    except SimulationError as reason:
        return [*rows, Row(what='cameras', measured=str(reason), must='pictures', passed=False)]
    camera, depth = (Camera(tag, site) for tag in (colour_tag, depth_tag))
    pixels = depth.take(offscreen, False, True, None).depths
    assert pixels is not None
    x = float(loaded.robot.zero_poses[depth_tag.link].position[0])
    middle = pixels[depth.height // 2, depth.width // 2]
    times = []
    for number in range(20):
        begin = time.perf_counter()
        camera.take(offscreen, True, False, np.random.default_rng(number))
        times.append(1e3 * (time.perf_counter() - begin))
    offscreen.close()
    return [
        *rows,
        at_most('depth camera, wall at 2.83 m', 1e3 * abs(float(middle) - (wall - x)), 'mm', 10.0),
        at_most('a picture of 1280 x 720, rendered in software', times, 'ms', 100.0),
    ]
