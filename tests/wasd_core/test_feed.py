# SPDX-License-Identifier: Apache-2.0
"""A stream of readings is slow by its intervals, not by gaps among them."""

from cases import for_all
import numpy as np
import pytest
from wasd_core.feed import Feed, Feeds, FEWEST, INTERVALS


def fed(feed, rate, seconds, begin=0.0):
    """Feed stamps at a rate [Hz] for a time [s]; return the last stamp [s]."""
    stamps = begin + np.arange(round(seconds * rate) + 1) / rate
    for stamp in stamps.tolist():
        feed.take(stamp)
    return float(stamps[-1])


@for_all('rate', [1.0, 50.0, 250.0, 333.3, 399.0])
def test_less_than_four_fifths_of_the_rate_is_slow(rate):
    feed = Feed(500.0)
    fed(feed, rate, INTERVALS / rate)
    assert feed.is_slow
    assert feed.rate == pytest.approx(rate)


@for_all('rate', [401.0, 500.0, 1000.0])
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


@for_all(('rate', 'is_slow'), [(30.0, True), (39.0, True), (45.0, False)])
def test_what_is_slow_depends_on_the_rate_that_is_wanted(rate, is_slow):
    """50 Hz, as a network wants them."""
    feed = Feed(50.0)
    fed(feed, rate, 1.0)
    assert feed.is_slow == is_slow


def test_one_at_rest_is_told_later_than_one_that_moves_and_both_in_a_line():
    feeds = Feeds(('joint_states', 'imu/data'), 50.0, "the network's rate")
    told = {}
    for rests in (False, True):
        for index in range(100):
            feeds.take('joint_states', 0.02 * index)
            feeds.take('imu/data', 0.1 * index)
            feeds.judge(0.02, rests)
            if feeds.hindrance:
                told.setdefault(rests, index)
        assert feeds.hindrance == (
            "imu/data comes at 10 Hz, wanted 50 (the network's rate): it does not move; "
            'start the simulator with state_rate:=50.0'
        )
        for index in range(INTERVALS + 1):
            feeds.take('imu/data', 20.0 + 0.02 * index)
        feeds.judge(0.02, rests)
        assert feeds.hindrance == ''
    assert told[False] + 30 < told[True]
