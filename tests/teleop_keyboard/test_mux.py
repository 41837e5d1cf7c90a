# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import pytest
from teleop_keyboard.mux import DEFAULT_LOCKS, DEFAULT_SOURCES, Mux, MuxInput
from wasd_core.parameters import InvalidParameter


def source(name, priority, timeout=0.5):
    return MuxInput(name=name, topic=name, timeout=timeout, priority=priority)


def test_the_defaults_are_those_of_twist_mux():
    rows = [(s.name, s.topic, s.timeout, s.priority) for s in DEFAULT_SOURCES]
    assert rows == [
        ('navigation', 'nav_vel', 0.5, 10),
        ('keyboard', 'key_vel', 0.5, 90),
        ('joystick', 'joy_vel', 0.5, 100),
        ('tablet', 'tab_vel', 0.5, 100),
    ]
    locks = [(lock.topic, lock.timeout, lock.priority) for lock in DEFAULT_LOCKS]
    assert locks[:3] == [
        ('pause_navigation', 0.0, 100),
        ('stop_closing_loop', 0.0, 200),
        ('joy_priority', 0.0, 100),
    ]


def test_the_highest_priority_that_is_alive_drives():
    mux = Mux()
    assert mux.offer('navigation', 0.0)
    assert mux.offer('keyboard', 0.1)
    assert not mux.offer('navigation', 0.2)
    assert mux.selected == 'keyboard'
    assert not mux.step(0.6)
    # 0.5 s after the keyboard's last word.
    assert mux.offer('navigation', 0.61)
    assert mux.selected == 'navigation'


def test_a_source_that_falls_silent_ends_with_one_zero():
    mux = Mux()
    mux.offer('keyboard', 0.0)
    zeros = [mux.step(0.02 * index) for index in range(100)]
    assert zeros.count(True) == 1
    assert zeros.index(True) == 26  # the first cycle after 0.5 s
    assert mux.selected == ''


def test_losing_the_selected_source_to_a_lower_one_sends_a_zero_first():
    mux = Mux()
    mux.offer('keyboard', 0.0)
    assert not mux.offer('navigation', 0.4)
    assert mux.step(0.6)
    assert mux.selected == 'navigation'
    assert not mux.step(0.7)


def test_a_higher_source_takes_over_without_a_zero():
    mux = Mux()
    mux.offer('navigation', 0.0)
    mux.offer('keyboard', 0.1)
    assert not mux.step(0.1)


def test_a_message_in_the_cycle_of_the_loss_makes_the_zero_needless():
    mux = Mux()
    mux.offer('keyboard', 0.0)
    assert mux.offer('navigation', 0.6)
    assert not mux.step(0.6)


@for_all(
    ('lock', 'source_name', 'masked'),
    [
        ('pause', 'navigation', True),
        ('pause', 'keyboard', True),
        ('pause', 'joystick', False),  # equal priority passes, as in twist_mux
        ('loop_closure', 'joystick', True),
        ('e_stop', 'tablet', True),
    ],
)
def test_a_lock_masks_what_is_below_it_and_sends_one_zero(lock, source_name, masked):
    mux = Mux()
    mux.offer(source_name, 0.0)
    mux.lock(lock, True, 0.1)
    assert mux.step(0.1) == masked
    assert not mux.step(0.12)
    assert mux.offer(source_name, 0.2) != masked
    mux.lock(lock, False, 0.3)
    assert mux.offer(source_name, 0.4)


def test_an_e_stop_keeps_its_last_word_when_its_publisher_dies():
    mux = Mux()
    mux.lock('e_stop', True, 0.0)
    assert not mux.offer('joystick', 1e6)
    assert not mux.offer('joystick', 2e6)


def test_a_lock_with_a_time_out_locks_when_it_is_not_heard():
    heartbeat = MuxInput(name='e_stop', topic='e_stop', timeout=0.3, priority=255)
    mux = Mux(locks=[heartbeat])
    assert not mux.offer('keyboard', 0.0)
    mux.lock('e_stop', False, 0.1)
    assert mux.offer('keyboard', 0.2)
    assert mux.step(0.45)
    assert mux.selected == ''


def test_among_equals_the_first_of_the_table_drives():
    mux = Mux()
    assert mux.offer('tablet', 0.0)
    assert mux.offer('joystick', 0.1)
    assert not mux.offer('tablet', 0.2)


def test_priority_zero_never_drives_and_time_out_zero_never_ends():
    mux = Mux([source('never', 0), source('always', 5, timeout=0.0)], [])
    assert not mux.offer('never', 0.0)
    assert mux.offer('always', 0.0)
    assert not mux.step(1e6)
    assert mux.selected == 'always'


def test_a_clock_that_jumps_back_leaves_nothing_selected_for_ever():
    mux = Mux()
    mux.offer('keyboard', 1000.0)
    assert mux.step(0.0)
    assert mux.selected == ''


def test_the_table_may_change_while_it_runs():
    mux = Mux()
    mux.offer('navigation', 0.0)
    mux.offer('keyboard', 0.0)
    mux.configure([source('navigation', 95), source('keyboard', 90)], [])
    assert mux.offer('navigation', 0.1)
    assert mux.selected == 'navigation'


@for_all(
    'field',
    [{'name': ''}, {'topic': ''}, {'timeout': -1.0}, {'timeout': float('nan')}, {'priority': 256}],
)
def test_a_row_that_cannot_be_is_rejected(field):
    with pytest.raises(InvalidParameter, match=next(iter(field))):
        MuxInput(**{'name': 'x', 'topic': 'x', **field})


def test_two_rows_of_one_name_are_rejected():
    with pytest.raises(InvalidParameter, match='appears twice'):
        Mux([source('x', 1), source('x', 2)], [])
