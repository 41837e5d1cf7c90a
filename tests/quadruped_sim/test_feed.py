# SPDX-License-Identifier: Apache-2.0
"""A stream of readings is slow by its intervals, not by gaps among them."""

import numpy as np
import pytest
from quadruped_sim.feed import Feed, FEWEST, INTERVALS


def fed(feed, rate, seconds, begin=0.0):
    """Feed stamps at a rate [Hz] for a time [s]; return the last stamp [s]."""
    stamps = begin + np.arange(round(seconds * rate) + 1) / rate
    for stamp in stamps.tolist():
        feed.take(stamp)
    return float(stamps[-1])


@pytest.mark.parametrize('rate', [1.0, 50.0, 250.0, 333.3, 399.0])
def test_less_than_four_fifths_of_the_rate_is_slow(rate):
    feed = Feed(500.0)
    fed(feed, rate, INTERVALS / rate)
    assert feed.is_slow
    assert feed.rate == pytest.approx(rate)


@pytest.mark.parametrize('rate', [401.0, 500.0, 1000.0])
def test_more_is_not(rate):
    feed = Feed(500.0)
    fed(feed, rate, 1.0)
    assert not feed.is_slow


def test_few_readings_say_nothing():
    feed = Feed(500.0)
    fed(feed, 50.0, (FEWEST - 1) / 50.0)
    assert not feed.is_slow
    assert feed.rate == 0.0


def test_one_gap_of_any_length_is_not_slow():
    feed = Feed(500.0)
    last = fed(feed, 500.0, 1.0)
    feed.take(last + 1000.0)
    assert not feed.is_slow


def test_gaps_between_readings_that_come_often_are_not_slow():
    feed, last = Feed(500.0), 0.0
    for _ in range(20):
        last = fed(feed, 500.0, 0.02, last + 0.5)
        assert not feed.is_slow


def test_one_reading_in_twenty_may_be_lost_but_not_two_of_three():
    def stream(lost):
        feed, rng = Feed(500.0), np.random.default_rng(1)
        times_slow = 0
        for index in np.flatnonzero(rng.random(5000) > lost).tolist():
            feed.take(0.002 * index)
            times_slow += feed.is_slow
        return times_slow

    assert stream(0.05) == 0
    assert stream(0.66) > 1000


def test_it_is_seen_within_a_tenth_of_a_second_and_so_is_its_end():
    feed = Feed(500.0)
    last = fed(feed, 500.0, 1.0)
    last = fed(feed, 50.0, 0.1, last)
    assert feed.is_slow
    fed(feed, 500.0, 0.1, last + 0.002)
    assert not feed.is_slow


def test_a_stream_that_begins_again_is_judged_by_itself():
    feed = Feed(500.0)
    fed(feed, 50.0, 1.0, 100.0)
    fed(feed, 500.0, 0.1)
    assert not feed.is_slow
