# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from wasd_core.timing import judge_stamp


def test_a_stamp_of_zero_is_none_and_said():
    assert judge_stamp(0.0, 50.0, 0.5) == (0.0, 'has no stamp: taken as of now')


def test_a_young_command_has_its_age():
    assert judge_stamp(49.7, 50.0, 0.5) == (pytest.approx(0.3), '')
    assert judge_stamp(50.0, 50.0, 0.5) == (0.0, '')


def test_one_older_than_the_time_out_is_dropped_and_both_are_named():
    age, note = judge_stamp(49.0, 50.0, 0.5)
    assert age is None
    assert note == 'is 1.000 s old, more than cmd_vel_timeout 0.5 s: dropped'


def test_without_a_time_out_none_is_too_old():
    assert judge_stamp(1.0, 50.0, 0.0).age == 49.0


@for_all(('ahead', 'is_said'), [(0.05, False), (3600.0, True)])
def test_one_from_the_future_is_of_now_so_that_it_times_out_like_any(ahead, is_said):
    age, note = judge_stamp(50.0 + ahead, 50.0, 0.5)
    assert age == 0.0
    assert bool(note) == is_said
    if is_said:
        assert note == 'is stamped 3600.000 s ahead of this clock: taken as of now'
