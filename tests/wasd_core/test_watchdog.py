# SPDX-License-Identifier: Apache-2.0
"""A command counts only while its source is known to be alive."""

import math

from cases import for_all
import pytest
from wasd_core.timing import Watchdog


def test_a_source_that_was_never_heard_is_dead_whatever_the_time_out():
    assert not Watchdog(0.5).is_alive
    assert not Watchdog(0.0).is_alive


@for_all('dt', [1e-4, 0.1, 0.25, 7.0])
def test_the_time_out_is_the_same_however_long_the_steps_are(dt):
    watchdog = Watchdog(0.5)
    watchdog.hear()
    alive = 0.0
    while watchdog.is_alive:
        watchdog.step(dt)
        alive += dt
    assert 0.5 < alive <= 0.5 + dt + 1e-9


def test_what_arrives_late_has_used_up_some_of_its_time():
    watchdog = Watchdog(0.5)
    watchdog.hear(age=0.4)
    watchdog.step(0.2)
    assert not watchdog.is_alive


def test_time_that_runs_backwards_makes_nothing_younger():
    watchdog = Watchdog(0.5)
    watchdog.hear()
    watchdog.step(0.4)
    watchdog.step(-10.0)
    assert watchdog.age == pytest.approx(0.4)


def test_without_a_time_out_a_source_lives_until_it_is_reset():
    watchdog = Watchdog(0.0)
    watchdog.hear()
    watchdog.step(1e6)
    assert watchdog.is_alive
    watchdog.reset()
    assert not watchdog.is_alive
    assert math.isinf(watchdog.age)
