# SPDX-License-Identifier: Apache-2.0
"""`wasd demo`: a scripted, headless tour; writes pictures and a table."""

from collections import deque
import json
import math
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from mujoco_sim.pictures import take_film, take_picture, take_strip, Trace, Viewpoint
import numpy as np
from robot_description.mujoco import choose_renderer, why_no_renderer
from teleop_keyboard.key_script import parse_key_script
from wasd_core.errors import one_line, UserError
from wasd_core.output_file import OutputFile
from wasd_core.signals import StopSignals

from wasd_bringup.cli.drawings import draw_elevation, draw_navigation
from wasd_bringup.robots import GO2, MBOT, RobotRow
from wasd_bringup.run.go2 import Go2
from wasd_bringup.run.inputs import Goal, parse_push, parse_twist_script, ScriptedPush
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run

WHITE = (1.0, 1.0, 1.0, 1.0)
ORANGE = (1.0, 0.45, 0.0, 1.0)
SQUARE = '\n'.join(
    f'{7.0 * side} 0.25 0 0\n{7.0 * side + 4.0} 0 0 0\n'
    f'{7.0 * side + 4.5} 0 0 {math.pi / 4.0}\n{7.0 * side + 6.5} 0 0 0'
    for side in range(4)
)


class Stop(NamedTuple):
    """One stop of the tour: scripts of keys and velocities, and what to look at."""

    name: str
    title: str
    duration: float  # [s]
    keys: str | None = None
    twist: str | None = None
    viewpoint: Viewpoint | None = None
    robot: RobotRow = MBOT
    world: str = 'flat'
    strip: Viewpoint | None = None  # of the last gait period, seen along with the robot
    film: Viewpoint | None = None  # of the whole stop, seen along with the robot
    pushes: tuple[ScriptedPush, ...] = ()
    goals: tuple[Goal, ...] = ()  # of a navigator, which maps
    eyes: bool = False  # whether it walks by sight; then its elevation is drawn, too


TOUR = (
    Stop(
        'mbot_keys',
        'mbot, keys: hold i, then u',
        duration=6.5,
        keys='0.5 i*60\n2.5 u*75',
        viewpoint=Viewpoint((0.4, 0.2, 0.05), 1.5, 70.0, -28.0),
    ),
    Stop('mbot_straight', 'mbot, cmd_vel: 2 m straight', 6.0, twist='0 0.5 0 0\n4 0 0 0'),
    Stop(
        'mbot_spin',
        'mbot, cmd_vel: 360 degrees on the spot',
        8.0,
        twist=f'0 0 0 1\n{2 * math.pi} 0 0 0',
    ),
    Stop(
        'mbot_square',
        'mbot, cmd_vel: a square of 1 m',
        29.0,
        twist=SQUARE,
        viewpoint=Viewpoint((0.5, 0.5, 0.0), 2.4, 90.0, -70.0),
    ),
    Stop(
        'mbot_flat',
        'mbot, --map: maps a flat on the way to two goals',
        24.0,
        goals=((0.0, 0.8, 3.0), (-4.5, 0.1, math.pi)),
        world='flat:3',
        viewpoint=Viewpoint((-5.5, 0.0, 0.0), 15.0, 90.0, -89.0),
    ),
    Stop(
        'go2_tour',
        'Go2, keys: stand up, trot, turn, take a push, gallop, pronk, fall and slide, get up',
        20.0,
        robot=GO2,
        keys='0.3 2\n2.5 4\n2.8 w*10\n4.6 l*8\n5.6 j*16\n6.6 l*8\n8.4 N\n10 N\n11.6 n n\n'
        '12.8 SPACE\n16 2',
        film=Viewpoint((0.0, 0.0, 0.2), 1.7, 120.0, -16.0),
        # 15 N s, and 30 that tip it over; how far it slides then, its feet cannot tell.
        pushes=(parse_push('7.4 0 150 0 0.1'), parse_push('13.6 0 300 0 0.1 0 0 0.4')),
    ),
    Stop(
        'go2_trot',
        'Go2, keys: 2, 4, ten times w, then l',
        10.0,
        robot=GO2,
        keys='0.3 2\n2.8 4\n3.2 w*10\n6 l*4',
        strip=Viewpoint((0.0, 0.0, 0.22), 1.3, 60.0, -14.0),
    ),
    Stop(
        'go2_move_base',
        'Go2, keys 2, 5, cmd_vel: 0.8 m/s and 0.8 rad/s',
        12.0,
        robot=GO2,
        keys='0.3 2\n2.8 5',
        twist='3.2 0.8 0 0\n7 0.8 0 0.8',
    ),
    Stop(
        'go2_boxes',
        'Go2, blind over boxes of up to 5 cm',
        10.0,
        robot=GO2,
        world='boxes:0.05',
        keys='0.3 2\n2.8 5',
        twist='3.2 0.5 0 0',
        viewpoint=Viewpoint((2.6, 0.0, 0.15), 3.0, 125.0, -22.0),
    ),
    Stop(
        'go2_stairs',
        'Go2, --eyes: up stairs of 15 cm by sight',
        7.6,
        robot=GO2,
        world='stairs:0.15',
        keys='0.3 2\n2.8 5',
        twist='3.2 0.4 0 0',
        viewpoint=Viewpoint((1.7, 0.0, 0.45), 2.1, 60.0, -20.0),
        eyes=True,
    ),
)
# A strip shows so many instants of one gait period [s].
STRIP_FRAMES = 6
GAIT_PERIOD = 0.45
FILM_PERIOD = 0.08  # [s]


class Result(NamedTuple):
    """A row of the table; odometry against truth at the end of the run."""

    run: str
    seconds: float
    real_time_factor: float
    path: float  # [m]
    position_error_mm: float
    yaw_error_deg: float


def demo_command(output: str, only: str = '') -> int:
    """
    Run the tour and write its pictures, `table.txt` and `demo.json` to a folder.

    Raises:
        UserError: the folder cannot be made, or no stop's name has the text that it is to have.
    """
    tour = [stop for stop in TOUR if only in stop.name]
    if not tour:
        names = ', '.join(stop.name for stop in TOUR)
        raise UserError(f'--only {only}: no stop has that in its name; there are {names}')
    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f'--output {output}: {one_line(error)}') from None
    files = [OutputFile(folder / name, '--output') for name in ('table.txt', 'demo.json')]
    pictures = choose_renderer()
    if not pictures:
        print(f'no pictures: {why_no_renderer()}')
    results = []
    with StopSignals() as signals:
        for stop in tour:
            print(f'{stop.title} ...', flush=True)
            # A signal may end us while we draw: what is there stays until all is drawn.
            try:
                with tempfile.TemporaryDirectory() as drawn:
                    result = _visit(stop, Path(drawn), pictures, signals)
                    for path in Path(drawn).iterdir():
                        OutputFile(folder / path.name, '--output').write(path.read_bytes())
            except OSError as error:
                raise UserError(f'{stop.name}: no picture: {one_line(error)}') from None
            if result is None:
                break
            results.append(result)
    status = (signals.exit_status or 130) if signals.requested else 0
    if not results:
        return status
    table = format_table(results)
    rows = [result._asdict() for result in results]
    texts = (table, json.dumps(rows, indent=2) + '\n')
    for file, text in zip(files, texts, strict=True):
        file.write(text.encode())
    print(f'\n{table}\nin {folder}: {", ".join(sorted(path.name for path in folder.iterdir()))}')
    return status


def _visit(stop: Stop, folder: Path, pictures: bool, signals: StopSignals) -> Result | None:
    """Run a stop and draw it; None if a signal cut it short, which is then not drawn."""
    options = RunOptions(
        robot=stop.robot.name,
        description=stop.robot.description,
        world=stop.world,
        preset=stop.robot.preset,
        keys=tuple(parse_key_script(stop.keys, stop.name)) if stop.keys else None,
        twists=tuple(parse_twist_script(stop.twist, stop.name)) if stop.twist else None,
        pushes=stop.pushes,
        duration=stop.duration,
        map='' if stop.goals else None,
        goals=stop.goals,
        eyes=stop.eyes,
        speed=0.0,
        samples=True,
    )
    run = Run(options, visuals=pictures)
    frames: deque[np.ndarray] = deque(maxlen=STRIP_FRAMES if stop.film is None else None)
    spacing = GAIT_PERIOD / STRIP_FRAMES if stop.film is None else FILM_PERIOD
    try:
        if stop.strip is not None or stop.film is not None:
            positions = run.world.data.qpos
            run.simulation.schedule.every(spacing, lambda: frames.append(positions.copy()))
        run.run(signals)
        if signals.requested:
            return None
        report = run.report()
        if pictures and stop.viewpoint is not None:
            path = folder / f'{stop.name}.png'
            # Odometry white and, just above it, the true path orange, thinner in time. Traces lie
            # on the floor.
            samples = report['samples']
            odometry = np.array([[x, y, 0.002] for x, y, _ in samples['odom'][::5]])
            truth = np.array([[x, y, 0.006] for x, y, _ in samples['position'][::15]])
            traces = () if stop.eyes else (Trace(odometry, WHITE), Trace(truth, ORANGE))
            take_picture(run.world, stop.viewpoint, path, traces)
        for navigation in run.navigations:
            draw_navigation(navigation, report, folder / f'{stop.name}_map.png')
        if stop.eyes and isinstance(run.robot, Go2):
            draw_elevation(run.robot, folder / f'{stop.name}_elevation.png')
        if pictures and stop.strip is not None:
            take_strip(run.world, frames, stop.strip, folder / f'{stop.name}_strip.png')
        if pictures and stop.film is not None:
            path = folder / f'{stop.name}.webp'
            take_film(run.world, frames, stop.film, path, FILM_PERIOD)
        return summarise(stop.title, report)
    finally:
        run.close()


def summarise(title: str, report: dict[str, Any]) -> Result:
    """Return the row of a run's report."""
    samples = report['samples']
    truth = np.array(samples['position'])[:, :2]
    odometry = np.array(samples['odom'])
    yaw_error = math.remainder(samples['rpy'][-1][2] - odometry[-1, 2], 2.0 * math.pi)
    return Result(
        run=title,
        seconds=report['sim_time'],
        real_time_factor=report['real_time_factor'],
        path=round(float(np.linalg.norm(np.diff(truth, axis=0), axis=1).sum()), 4),
        position_error_mm=round(1e3 * float(np.linalg.norm(truth[-1] - odometry[-1, :2])), 3),
        yaw_error_deg=round(math.degrees(abs(yaw_error)), 4),
    )


def format_table(results: list[Result]) -> str:
    """Return the results as text."""
    width = max(len(result.run) for result in results)
    lines = [
        f'{"run":{width}}  sim time  real-time factor    path  odom error  yaw error',
        f'{"-" * width}  --------  ----------------  ------  ----------  ---------',
    ]
    lines += [
        f'{row.run:{width}}  {row.seconds:6.1f} s  {row.real_time_factor:16.1f}  '
        f'{row.path:4.2f} m  {row.position_error_mm:7.2f} mm  {row.yaw_error_deg:5.3f} deg'
        for row in results
    ]
    return '\n'.join(lines) + '\n'
