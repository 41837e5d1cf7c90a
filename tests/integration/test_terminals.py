# SPDX-License-Identifier: Apache-2.0
"""The bound of time that tests of terminals share: strict, and more tries on a busy machine."""

from cases import for_all
import pytest
from terminals import assert_soon


@for_all('taken', [[0.6], [1.7, 0.6], [0.7, 1.7, 0.7, 0.6]])
def test_in_time_or_a_little_late_three_times_passes(taken: list[float]) -> None:
    left = taken[:]
    assert_soon(lambda: left.pop(0), 0.6)
    assert not left


@for_all(('taken', 'tries'), [([1.9, 0.1], 1), ([*4 * [0.7], 0.1], 4)])
def test_far_too_late_once_or_a_little_late_each_time_fails(
    taken: list[float], tries: int
) -> None:
    left = taken[:]
    with pytest.raises(AssertionError, match='at most 0.600 s'):
        assert_soon(lambda: left.pop(0), 0.6)
    assert len(taken) - len(left) == tries
