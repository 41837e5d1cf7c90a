# SPDX-License-Identifier: Apache-2.0
"""What a walking Go2 knows of stairs ahead, by its own lidar and its own odometry."""

import importlib
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow
BENCHMARKS = Path(__file__).parents[2] / 'benchmarks'


@pytest.fixture(scope='module')
def look_at_stairs():
    """Return the benchmark's walk towards stairs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield importlib.import_module('seen_stairs').look_at_stairs


def test_after_3_m_edges_are_within_4_cm_and_heights_within_15_mm(look_at_stairs):
    seen = look_at_stairs(0.10, 120, 1.4)
    assert seen.state == 'move base'
    assert seen.edges
    for errors in seen.edges.values():
        assert abs(np.median(errors)) <= 0.04
    assert seen.rmse <= 0.015
    assert seen.known > 0.4
