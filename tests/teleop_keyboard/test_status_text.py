# SPDX-License-Identifier: Apache-2.0
from cases import for_all
from teleop_keyboard.dashboard import Status, status_line

CLOCK = '12.3 s x1.00'
STATUS = Status('passive', ('now +0.00 m/s', 'full 0.20 m/s'), 'press 2 (w does nothing here)')


@for_all(
    ('width', 'line'),
    [
        (
            200,
            'passive  now +0.00 m/s  full 0.20 m/s  12.3 s x1.00  press 2 (w does nothing here)',
        ),
        (70, 'passive  now +0.00 m/s  full 0.20 m/s  12.3 s x1.00  press 2'),
        (50, 'passive  full 0.20 m/s  12.3 s x1.00  press 2'),
        (40, 'passive  12.3 s x1.00  press 2'),
        (28, 'passive  12.3 s x1.00  press'),
        (27, 'passive  12.3 s x1.00'),
        (21, 'passive  12.3 s x1.00'),
        (20, 'passive  12.3 s'),
        (5, 'passi'),
        (0, ''),
    ],
)
def test_state_and_time_come_before_the_message_and_the_message_before_facts(width, line):
    assert status_line(STATUS, CLOCK, width) == line


def test_it_is_never_wider_than_the_window_and_never_loses_what_would_fit():
    for width in range(200):
        line = status_line(STATUS, CLOCK, width)
        assert len(line) <= width
        assert ('12.3 s x1.00' in line) == (width >= len('passive  12.3 s x1.00'))
        assert ('press 2' in line) == (width >= len('passive  12.3 s x1.00  press 2'))


def test_without_a_message_all_facts_are_there_that_fit():
    status = STATUS._replace(message='')
    assert status_line(status, CLOCK, 60).count('m/s') == 2
    assert status_line(status, CLOCK, 40).count('m/s') == 1
    assert not status_line(status, CLOCK, 60).endswith(' ')
