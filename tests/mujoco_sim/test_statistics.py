# SPDX-License-Identifier: Apache-2.0
from mujoco_sim.simulation import TickStatistics, TickSummary
import pytest


def filled(durations, period=0.005):
    statistics = TickStatistics(period)
    for duration in durations:
        statistics.add(duration)
    return statistics


def test_before_the_first_run_all_is_zero():
    assert TickStatistics(0.005).summary() == TickSummary(0.0, 0.0, 0.0, 0)


def test_figures_are_in_microseconds():
    summary = filled([0.001] * 99 + [0.009]).summary()
    assert summary.median_us == 1000.0
    assert summary.max_us == 9000.0
    # Linear between the 99th value and the 100th, at 0.01 of the way.
    assert summary.p99_us == pytest.approx(1000.0 + 0.01 * 8000.0, abs=0.1)


def test_a_run_longer_than_the_period_is_an_overrun_and_one_just_as_long_is_not():
    assert filled([0.004, 0.005, 0.006, 0.1]).summary().overruns == 2


def test_only_the_last_runs_may_be_asked_for():
    summary = filled([1.0] * 10 + [0.002] * 5).summary(last=5)
    assert summary == TickSummary(2000.0, 2000.0, 2000.0, 0)
