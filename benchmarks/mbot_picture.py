# SPDX-License-Identifier: Apache-2.0
"""A picture of mbot's square: what was commanded, what odometry says, where the robot was."""

import math
from pathlib import Path
from typing import Any

from chart import Axes, INK, Sheet
import numpy as np

COMMAND, ODOMETRY, TRUTH = (150, 158, 170), (32, 104, 196), (226, 92, 16)
NAMES = (('command', COMMAND), ('odometry', ODOMETRY), ('truth', TRUTH))
# Places on the sheet [pixels] and what they show, along x and y alike.
PATHS_FRAME, PATHS_RANGE = (64, 44, 504, 484), (-0.15, 1.15)  # [m]
ENDS_FRAME, ENDS_RANGE = (600, 44, 850, 294), (-1.5, 1.5)  # [mm]


def draw_square(report: dict[str, Any], path: Path) -> None:
    """Draw the report of a square of 1 m: its paths, their ends enlarged, the error over time."""
    samples = report['samples']
    times = np.array(samples['t'])
    odometry = np.array(samples['odom'])[:, :2]
    truth = np.array(samples['position'])[:, :2]
    command = commanded_path(times, np.array(samples['command']))
    sheet = Sheet(1200, 530)
    _draw_paths(sheet, command, odometry, truth)
    _draw_ends(sheet, command, odometry, truth)
    _draw_errors(sheet, times, odometry, truth)
    for index, (name, colour) in enumerate(NAMES):
        y = 60 + 28 * index
        sheet.line(np.array([[880, y], [910, y]]), colour, (7.0, 3.5, 2.0)[index])
        sheet.text((922, y), name, 14, 'lm')
    sheet.save(path)


def commanded_path(times: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Return where the commands lead, shape (n, 2): each is in force until the next sample."""
    steps = np.diff(times)
    turns = steps * velocities[:-1, 2]
    yaw = np.concatenate(([0.0], np.cumsum(turns)))
    chords = steps * velocities[:-1, 0] * np.sinc(0.5 * turns / math.pi)
    heading = yaw[:-1] + 0.5 * turns
    moves = np.column_stack((chords * np.cos(heading), chords * np.sin(heading)))
    return np.concatenate((np.zeros((1, 2)), np.cumsum(moves, axis=0)))


def _draw_paths(sheet: Sheet, *paths: np.ndarray) -> None:
    axes = Axes(sheet, PATHS_FRAME, PATHS_RANGE, PATHS_RANGE)
    axes.grid([0.0, 0.25, 0.5, 0.75, 1.0], [0.0, 0.25, 0.5, 0.75, 1.0])
    axes.name('mbot drives a square of 1 m', 'x [m]', 'y [m]')
    for path, (_, colour), width in zip(paths, NAMES, (9.0, 4.5, 1.6), strict=True):
        axes.line(path, colour, width)
    axes.dot(paths[0][0], INK, 5.0)
    sheet.text((284, 254), 'true to scale: three lines, one on the other', 13, 'mm')
    sheet.text((284, 274), '(drawn thinner and thinner)', 13, 'mm')


def _draw_ends(sheet: Sheet, *paths: np.ndarray) -> None:
    """Show the last millimetre around where it began and should end."""
    axes = Axes(sheet, ENDS_FRAME, ENDS_RANGE, ENDS_RANGE)
    axes.grid([-1, -0.5, 0, 0.5, 1], [-1, -0.5, 0, 0.5, 1])
    shown = (PATHS_FRAME[2] - PATHS_FRAME[0]) / (PATHS_RANGE[1] - PATHS_RANGE[0])
    enlarged = 1e3 * (ENDS_FRAME[2] - ENDS_FRAME[0]) / (ENDS_RANGE[1] - ENDS_RANGE[0])
    axes.name(f'its start and end, {enlarged / shown:.0f} times larger', 'x [mm]', 'y [mm]')
    for path, (_, colour), width in zip(paths, NAMES, (7.0, 3.5, 2.0), strict=True):
        axes.line(1e3 * path, colour, width)
    for path, (_, colour) in zip(paths, NAMES, strict=True):
        axes.dot(1e3 * path[-1], colour, 6.0)
    sheet.text((880, 152), 'dots: where each of them ends;', 13)
    sheet.text((880, 172), 'the command ends where it began', 13)


def _draw_errors(sheet: Sheet, times: np.ndarray, odometry: np.ndarray, truth: np.ndarray) -> None:
    errors = 1e3 * np.linalg.norm(truth - odometry, axis=1)
    axes = Axes(sheet, (600, 360, 1170, 484), (0.0, times[-1]), (0.0, 1.2))
    axes.grid([0, 5, 10, 15, 20, 25], [0, 0.5, 1.0])
    axes.name('distance from odometry to the truth', 't [s]', '')
    sheet.text((560, 352), '[mm]', 12, 'ls')
    axes.line(np.array([[0.0, 1.0], [times[-1], 1.0]]), INK, 1.2, dash=5.0)
    axes.line(np.column_stack((times, errors)), TRUTH, 2.0)
    sheet.text((606, 384), "the benchmark's bound", 11)
    sheet.text((880, 212), f'largest error of odometry: {errors.max():.2f} mm', 14)
    sheet.text((880, 234), f'after {_length(truth):.1f} m and 4 turns of 90 degrees', 14)


def _length(path: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
