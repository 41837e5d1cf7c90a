# SPDX-License-Identifier: Apache-2.0
"""Who publishes at one rate from messages of another: the same instants for all."""

from cases import for_all
import numpy as np
import pytest
from wasd_core.timing import Beat

TIMES = [round(0.002 * i, 9) for i in range(2000)]


def picked(times, rate):
    beat = Beat()
    return [time for time in times if beat.is_due(time, rate)]


def test_two_that_begin_at_different_times_pick_the_same_instants():
    first, second = picked(TIMES[3:], 50.0), picked(TIMES[41:], 50.0)
    assert second[1:] == first[-len(second) + 1 :]
    np.testing.assert_allclose(np.diff(first[1:]), 0.02, atol=1e-9)


@for_all('rate', [10.0, 30.0, 50.0, 60.0])
def test_the_mean_rate_is_the_one_asked_for(rate):
    assert len(picked(TIMES, rate)) == pytest.approx(4.0 * rate, abs=1)


def test_nothing_is_doubled_where_messages_are_rarer():
    assert picked([0.0, 0.0, 0.1, 0.1, 0.2], 50.0) == [0.0, 0.1, 0.2]


def test_a_jump_back_is_no_silence():
    assert picked([5.0, 5.001, 1.0], 50.0) == [5.0, 1.0]
