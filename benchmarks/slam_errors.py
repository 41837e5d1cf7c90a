# SPDX-License-Identifier: Apache-2.0
"""How far off a way is that was found."""

import math

import numpy as np


def error_of(poses: np.ndarray, truth: np.ndarray) -> float:
    """Return the root of the mean squared distance of poses from the truth, not aligned [m]."""
    return float(np.sqrt(np.mean(np.sum((poses[:, :2] - truth[:, :2]) ** 2, axis=1))))


def trajectory_error(poses: np.ndarray, truth: np.ndarray) -> float:
    """
    Return the absolute trajectory error [m]: `error_of` poses that are turned and shifted.

    That is its definition [Sturm2012]: where a map's frame lies is what the first scan knows of
    itself, which no later scan can better. Turn and shift are those of least squares [Horn1987].
    """
    middle, true_middle = poses[:, :2].mean(axis=0), truth[:, :2].mean(axis=0)
    away, true_away = poses[:, :2] - middle, truth[:, :2] - true_middle
    across = away[:, 0] * true_away[:, 1] - away[:, 1] * true_away[:, 0]
    turn = math.atan2(float(across.sum()), float((away * true_away).sum()))
    cos, sin = math.cos(turn), math.sin(turn)
    turned = away @ np.array(((cos, sin), (-sin, cos)))
    return error_of(turned + true_middle, truth)
