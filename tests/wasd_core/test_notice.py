# SPDX-License-Identifier: Apache-2.0
from cases import for_all
from wasd_core.timing import brief, Notice


def test_a_text_stands_for_three_seconds_however_they_pass():
    for steps in (3, 30, 3000):
        notice = Notice()
        notice.say('press 2')
        for _ in range(steps - 1):
            notice.step(3.0 / steps)
        assert notice.text == 'press 2'
        notice.step(3.1 / steps)
        assert notice.text == ''


def test_a_text_goes_when_the_next_thing_is_said_or_nothing():
    notice = Notice()
    notice.say('press 2')
    notice.say('press 4')
    assert notice.text == 'press 4'
    notice.say(None)
    assert notice.text == ''


def test_a_text_is_new_again_once_it_was_gone():
    notice = Notice()
    assert notice.say('press 2')
    assert not notice.say('press 2')
    notice.step(4.0)
    assert notice.say('press 2')
    assert not notice.say(None)


def test_said_again_it_stands_as_long_again():
    notice = Notice()
    for _ in range(5):
        notice.say('press 2')
        notice.step(2.0)
    assert notice.text == 'press 2'


@for_all(
    ('text', 'short'),
    [
        ('press 2 (w does nothing here)', 'press 2'),
        ('press 2', 'press 2'),
        ('drive (or not) with w', 'drive (or not) with w'),
        ('(all)', '(all)'),
        ('', ''),
    ],
)
def test_what_is_brief_leaves_out_the_explanation_at_the_end(text, short):
    assert brief(text) == short
