# SPDX-License-Identifier: Apache-2.0
"""The error that the benchmark says of a map: of the shape of a way, and of where it lies."""

from collections.abc import Iterator
import importlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'


@pytest.fixture(scope='module')
def errors() -> Iterator[Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield importlib.import_module('slam_errors')


def turned(poses, angle, shift):
    cos, sin = math.cos(angle), math.sin(angle)
    places = poses[:, :2] @ np.array(((cos, sin), (-sin, cos))) + shift
    return np.column_stack((places, poses[:, 2] + angle))


@pytest.fixture
def truth():
    return np.random.default_rng(4).uniform(-8.0, 8.0, (200, 3))


@pytest.mark.parametrize('angle', [0.0, 0.4, -3.0, math.pi])
def test_a_way_that_is_turned_and_shifted_has_no_error_of_its_shape(errors, truth, angle):
    moved = turned(truth, angle, (3.0, -1.0))
    assert errors.trajectory_error(moved, truth) < 1e-12
    assert errors.error_of(moved, truth) > 3.0


def test_a_way_that_is_too_long_by_a_share_is_off_by_that_share_of_its_spread(errors, truth):
    spread = math.sqrt(truth[:, :2].var(axis=0).sum())
    longer = turned(truth * 1.01, 1.0, (5.0, 2.0))
    assert errors.trajectory_error(longer, truth) == pytest.approx(0.01 * spread)


def test_no_turn_and_shift_fit_better(errors, truth):
    found = truth + np.random.default_rng(5).normal(0.0, 0.1, truth.shape)
    least = errors.trajectory_error(found, truth)
    for angle, shift in ((0.0, (0.0, 0.0)), (0.002, (0.0, 0.0)), (-0.002, (0.0, 0.01))):
        assert least <= errors.error_of(turned(found, angle, shift), truth)
