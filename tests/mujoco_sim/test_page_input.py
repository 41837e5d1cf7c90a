# SPDX-License-Identifier: Apache-2.0
"""The gate of everything that a page commands: only of a browser that is known to be alive."""

import random

from mujoco_sim.viewer.clicks import (
    CHANGE_PATIENCE,
    IDLE,
    KEY_PATIENCE,
    MOST_CHANGES,
    Mouse,
    NOWHERE,
)
from mujoco_sim.viewer.input import GONE, LOSS, MARK, PageInput, SEVERAL, SILENCE
from mujoco_sim.viewer.strokes import Stroke
from page_puppet import code
import pytest
from wasd_core.timing import LOST

W = frozenset({code('W')})
NONE: frozenset[int] = frozenset()


class Clock:
    """A clock that is set."""

    now = 100.0

    def __call__(self) -> float:
        """Return the time [s]."""
        return self.now


@pytest.fixture
def clock() -> Clock:
    """Return the clock of the page."""
    return Clock()


@pytest.fixture
def page(clock: Clock) -> PageInput:
    """Return the input of a page that nobody has opened."""
    return PageInput(clock)


def draw(page: PageInput, clock: Clock, source: str, down: frozenset[int], seconds: float) -> None:
    """Have a browser draw 50 pictures a second with keys down."""
    for _ in range(round(seconds * 50)):
        clock.now += 0.02
        page.hear(source, down)


def test_a_page_that_nobody_has_opened_is_not_alive(page):
    assert not page.is_alive
    assert page.take_keys() == []


def test_life_ends_with_silence_and_keys_are_released(page, clock):
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 0.1)
    clock.now += SILENCE - 0.01
    assert page.is_alive
    page.take_keys()
    clock.now += 0.02
    assert not page.is_alive
    assert page.is_present
    assert page.take_keys() == []
    clock.now += LOSS - SILENCE
    assert not page.is_present
    assert page.take_keys() == [LOST, 'RELEASE+w']
    clock.now += 10.0
    assert page.take_keys() == []


def test_life_that_ended_unseen_has_ended(page, clock):
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 0.1)
    page.take_keys()
    clock.now += LOSS + 0.01
    draw(page, clock, 'tab', W, 2.0)  # nobody has asked in between
    assert page.take_keys() == [LOST, 'RELEASE+w']
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 0.02)
    assert page.take_keys() == ['w', 'HELD+w']


def test_life_ends_at_once_when_the_connection_ends(page, clock):
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 0.1)
    page.take_keys()
    page.lose('tab')
    assert not page.is_alive
    assert page.take_keys() == [LOST, 'RELEASE+w']


def test_a_spectator_that_leaves_ends_nothing(page, clock):
    draw(page, clock, 'tab', NONE, 0.1)
    page.lose('spectator')
    assert page.is_alive
    assert page.take_keys() == []


def test_keys_of_a_browser_before_do_not_count_for_the_next(page, clock):
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 0.1)
    page.take_keys()
    draw(page, clock, 'other tab', W, 0.1)
    assert page.take_keys() == [LOST, 'RELEASE+w']


def test_keys_are_for_a_field_of_text_while_there_is_one(page, clock):
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 0.1)
    page.take_keys()
    page.set_typing(True)
    draw(page, clock, 'tab', NONE, 0.1)
    draw(page, clock, 'tab', W, 1.0)
    page.set_typing(False)
    draw(page, clock, 'tab', W, 1.0)
    assert page.take_keys() == ['RELEASE+w']


def test_a_picture_is_drawn_once_for_each_that_the_browser_has_drawn(page, clock):
    assert not page.wait_for_picture(0.0)
    draw(page, clock, 'tab', NONE, 0.1)
    assert page.wait_for_picture(0.0)
    assert not page.wait_for_picture(0.0)


@pytest.mark.parametrize(('rate', 'is_slow'), [(4, True), (9, True), (12, False), (60, False)])
def test_a_page_that_draws_fewer_than_ten_pictures_a_second_is_slow(page, clock, rate, is_slow):
    for _ in range(3 * rate):
        clock.now += 1.0 / rate
        page.hear('tab', NONE)
    assert page.is_slow == is_slow


@pytest.mark.parametrize(('rate', 'can_hold'), [(1, False), (2, False), (5, True), (60, True)])
def test_a_page_holds_what_it_draws_twice_in_a_silence(page, clock, rate, can_hold):
    assert page.can_hold  # as far as is known of one that is new
    for _ in range(3 * rate):
        clock.now += 1.0 / rate
        page.hear('tab', NONE)
    assert page.can_hold == can_hold


def names(page: PageInput) -> list[str]:
    """Return what came without HELD and RELEASE."""
    return [key for key in page.take_keys() if '+' not in key]


def watch(page: PageInput, clock: Clock, seconds: float) -> list[str]:
    """Let time pass as the simulation sees it, which asks 50 times a second; return what came."""
    came = []
    for _ in range(round(seconds * 50)):
        clock.now += 0.02
        came += page.take_keys()
    return came


@pytest.mark.parametrize('rate', [1.5, 2.0, 3.0])
def test_a_page_that_draws_slowly_taps_once_a_tap_and_is_not_lost(page, clock, rate):
    came = []
    # As ImGui has it, a tap that is shorter than a picture is down in one and up in the next.
    for down in (NONE, W, NONE, W, NONE, NONE, W, W, NONE):
        page.hear('tab', down)
        came += watch(page, clock, 1.0 / rate)
    assert [key for key in came if '+' not in key] == ['w', 'w', 'w']
    assert came.count('RELEASE+w') == 3


def test_a_page_that_is_lost_between_two_pictures_taps_once_a_tap(page, clock):
    came = []
    for down in (NONE, W, NONE, W, NONE):
        page.hear('tab', down)
        came += watch(page, clock, 1.0)
    assert [key for key in came if '+' not in key] == [LOST, 'w', LOST, LOST, 'w', LOST, LOST]


def test_what_is_held_down_is_told_only_for_a_while_after_a_picture(page, clock):
    page.hear('tab', NONE)
    page.hear('tab', W)
    assert watch(page, clock, SILENCE - 0.05).count('HELD+w') >= 4
    clock.now += 0.05
    page.take_keys()
    assert watch(page, clock, LOSS - SILENCE - 0.05) == []


def test_a_key_that_went_down_in_a_long_silence_counts_after_it_was_up(page, clock):
    page.hear('tab', NONE)
    clock.now += GONE + 0.1
    page.hear('tab', W)
    assert names(page) == [LOST]
    clock.now += 0.1
    page.hear('tab', NONE)
    page.hear('tab', W)
    assert names(page) == ['w']


def test_a_connection_that_ends_is_lost_at_once_however_slow_it_was(page, clock):
    page.hear('tab', NONE)
    page.hear('tab', W)
    page.take_keys()
    clock.now += SILENCE + 0.1
    page.lose('tab')
    assert page.take_keys() == [LOST, 'RELEASE+w']
    page.hear('next', W)
    assert page.take_keys() == []


def test_a_button_that_went_down_on_a_page_that_is_gone_is_up_before_the_next_presses(page, clock):
    see(page, 1)
    page.lose('tab')

    def shown(told: Mouse) -> Mouse:
        clock.now += 0.05
        return page.hear('next', NONE, told)

    for _ in range(3):  # until a frame of panels has seen it
        assert shown(Mouse(0, C)) == (1, NOWHERE)
        assert page.silence > LOSS
    page.see(1)
    assert shown(Mouse(0, C)) == (0, NOWHERE)
    page.see(0)
    assert shown(Mouse(0, C)) == (0, C)
    assert shown(Mouse(1, C)) == (1, C)
    assert page.silence <= SILENCE


def test_a_key_that_was_down_on_a_page_that_is_gone_is_up_for_the_panels_of_the_next(page):
    page.hear('tab', W)
    page.type(Stroke(W))
    page.lose('tab')

    def shown() -> frozenset[int]:
        page.hear('next', NONE)
        return page.type(Stroke()).keys

    for _ in range(3):  # until a frame of panels has seen it
        told = shown()
        assert told - MARK == W
    page.see(0, told >= MARK)
    assert shown() - MARK == NONE


def see(page: PageInput, buttons: int) -> None:
    """Have a page tell of its mouse's buttons, and a frame of panels see them."""
    page.see(page.hear('tab', NONE, Mouse(buttons)).buttons)


def test_what_the_pointer_holds_counts_only_if_it_went_down_while_the_page_was_alive(page, clock):
    see(page, 1)
    assert page.silence > SILENCE
    see(page, 0)
    see(page, 1)
    assert page.silence <= SILENCE
    clock.now += SILENCE + 0.01
    assert page.silence > SILENCE
    for _ in range(3):
        see(page, 1)
        assert page.is_alive
        assert page.silence > SILENCE
    see(page, 0)
    assert page.silence <= SILENCE


@pytest.mark.parametrize(
    ('before', 'after', 'counts'),
    [
        (SILENCE + 0.01, SILENCE + 0.01, True),
        (GONE - 0.01, LOSS - 0.01, True),
        (GONE + 0.01, 0.1, False),
        (0.1, LOSS + 0.01, False),
    ],
)
def test_a_click_of_a_slow_page_counts_and_one_while_it_was_lost_does_not_and_none_holds(
    page, clock, before, after, counts
):
    see(page, 0)
    clock.now += before
    see(page, 1)
    clock.now += after
    see(page, 1)
    assert page.silence > SILENCE
    assert (page.silence <= LOSS) == counts
    see(page, 0)
    assert page.silence == 0.0


def test_a_press_from_before_a_pause_that_no_frame_has_seen_does_not_count(page, clock):
    see(page, 0)
    clock.now += 0.1
    page.hear('tab', NONE, Mouse(1))
    clock.now += LOSS + 0.01
    see(page, 1)
    assert page.silence > LOSS


def test_a_click_of_a_page_that_comes_with_its_button_down_does_not_count(page):
    see(page, 0)
    page.lose('tab')
    page.hear('next', NONE, Mouse(1))
    assert page.silence > LOSS


def test_a_press_after_one_that_does_not_count_does_though_no_frame_came_between(page, clock):
    tell(page, clock, (1, A), (0, A), (1, B))
    assert page.silence > SILENCE
    assert changes_seen(page, clock, (1, B)) == [(1, A), (0, A), (1, B)]
    assert page.silence <= SILENCE


def test_a_click_is_known_until_a_frame_was_begun_for_it(page):
    page.hear('tab', NONE, Mouse(0))
    assert not page.has_clicked
    page.hear('tab', NONE, Mouse(1))
    page.hear('tab', NONE, Mouse(1))
    assert page.has_clicked


A, B, C = (10, 20), (30, 40), (50, 60)


def tell(page: PageInput, clock: Clock, *mice: tuple[int, tuple[int, int]]) -> None:
    """Have a page tell of a mouse 250 times a second, faster than any frame is drawn."""
    for mouse in mice:
        clock.now += 0.004
        page.hear('tab', NONE, Mouse(*mouse))


def changes_seen(page: PageInput, clock: Clock, mouse: tuple[int, tuple[int, int]]) -> list[Mouse]:
    """Return what 20 frames of panels see of the buttons while a mouse stays as it is."""
    seen: list[Mouse] = []
    for _ in range(20):
        clock.now += 0.02
        shown = page.hear('tab', NONE, Mouse(*mouse))
        page.see(shown.buttons)
        if not seen or seen[-1].buttons != shown.buttons:
            seen.append(shown)
    return seen


def test_a_click_shorter_than_a_frame_is_seen_where_it_was_made(page, clock):
    tell(page, clock, (0, A), (1, B), (0, B), (0, C))
    assert page.is_click_unseen
    assert changes_seen(page, clock, (0, C)) == [(1, B), (0, B)]
    assert not page.is_click_unseen
    assert page.hear('tab', NONE, Mouse(0, C)) == (0, C)


def test_a_press_is_seen_where_it_was_made_though_the_pointer_has_gone_on(page, clock):
    tell(page, clock, (0, A), (1, B), (1, C))
    assert changes_seen(page, clock, (1, C)) == [(1, B)]
    assert page.hear('tab', NONE, Mouse(1, C)) == (1, C)


def test_the_pointer_moves_at_once_while_nothing_is_unseen(page, clock):
    tell(page, clock, (0, A))
    assert page.hear('tab', NONE, Mouse(0, B)) == (0, B)
    assert page.hear('tab', NONE, Mouse(1, B)) == (1, B)
    page.see(1)
    assert page.hear('tab', NONE, Mouse(1, C)) == (1, C)


def test_of_clicks_faster_than_frames_the_first_and_the_last_are_seen_whole(page, clock):
    tell(page, clock, (0, A), (1, A), (0, A))
    tell(page, clock, *(mouse for _ in range(200) for mouse in ((1, C), (0, C))))
    tell(page, clock, (1, B), (0, B))
    seen = changes_seen(page, clock, (0, B))
    assert seen[:2] == [(1, A), (0, A)]
    assert seen[-2:] == [(1, B), (0, B)]
    assert len(seen) <= MOST_CHANGES + 1


def test_a_button_that_stays_down_after_a_rain_of_clicks_is_down(page, clock):
    tell(page, clock, (0, A), *(mouse for _ in range(50) for mouse in ((1, C), (0, C))), (1, B))
    assert changes_seen(page, clock, (1, B))[-1] == (1, B)


def test_whatever_buttons_do_few_changes_wait_and_the_last_is_seen(page, clock):
    chance = random.Random(4)
    tell(page, clock, *((chance.randrange(32), A) for _ in range(500)), (5, B))
    seen = changes_seen(page, clock, (5, B))
    assert len(seen) <= MOST_CHANGES + 1
    assert seen[-1] == (5, B)


def test_what_no_frame_sees_for_long_gives_way(page, clock):
    tell(page, clock, (0, A), (1, A), (0, B))
    for _ in range(round((CHANGE_PATIENCE + 0.1) / 0.02)):
        clock.now += 0.02
        last = page.hear('tab', NONE, Mouse(0, C))
    assert last.buttons == 0


def test_keys_and_life_wait_for_no_click(page, clock):
    page.hear('tab', NONE)
    page.hear('tab', W)
    page.take_keys()
    for _ in range(10):
        for buttons in (1, 0):
            page.hear('tab', W, Mouse(buttons, A))
    page.hear('tab', NONE, Mouse(1, A))
    assert page.take_keys() == ['RELEASE+w']
    page.lose('tab')
    assert not page.is_present
    assert page.take_keys() == [LOST]


def test_clicks_of_a_page_that_fell_silent_or_left_are_forgotten(page, clock):
    tell(page, clock, (0, A), (1, A), (0, A), (1, B), (0, B))
    clock.now += SILENCE + 0.01
    assert changes_seen(page, clock, (0, C)) == [(0, C)]
    tell(page, clock, (1, A), (0, A), (1, B))
    page.lose('tab')
    assert not page.is_click_unseen
    assert not page.has_clicked
    assert page.hear('next', NONE, Mouse(0, C)) == (0, C)


def hear_several(page: PageInput, buttons: int, are_several: bool) -> bool:
    """Have a page tell of a pointer, and of several; return whether a click is of one alone."""
    page.hear('tab', SEVERAL if are_several else NONE, Mouse(buttons))
    return not page.are_several


def test_no_click_is_of_one_pointer_alone_from_a_second_one_on_until_all_were_seen_to_leave(page):
    assert hear_several(page, 1, are_several=False)
    page.see(1)
    assert not hear_several(page, 0, are_several=True)
    page.see(0)
    assert not hear_several(page, 1, are_several=True)
    assert not hear_several(page, 0, are_several=False)
    page.see(1)
    assert not hear_several(page, 0, are_several=False)
    page.see(0)
    assert hear_several(page, 0, are_several=False)
    assert hear_several(page, 1, are_several=False)
    assert page.take_keys() == []


def test_several_pointers_of_a_page_that_left_are_none_of_the_next(page):
    hear_several(page, 1, are_several=True)
    page.lose('tab')
    assert not page.are_several


def test_a_button_that_no_mouse_has_waits_for_no_frame(page):
    assert page.hear('tab', NONE, Mouse(1 << 40 | 1 << 5)) == (0, (0, 0))
    assert not page.is_click_unseen


ENTER = frozenset({code('Enter')})


def entered(page: PageInput, clock: Clock, strokes: list[Stroke], pictures: int) -> str:
    """
    Return what a field of text holds when ENTER is seen; a frame comes every so many pictures.

    As NetImgui does, a frame sees the last keys alone, and then the text of all pictures.
    """
    field, text = '', ''
    for count, stroke in enumerate([*strokes, *[Stroke()] * 40 * pictures], 1):
        clock.now += 0.02
        page.hear('tab', stroke.keys)
        shown = page.type(stroke)
        text += shown.text
        if count % pictures == 0:
            if shown.keys & ENTER:
                return field
            page.see(0, bool(shown.keys & MARK))
            field, text = field + text, ''
    return f'{field}, not entered'


ONE_BY_ONE = [*(Stroke(NONE, character) for character in '1.25'), Stroke(ENTER), Stroke()]


@pytest.mark.parametrize('typed', [ONE_BY_ONE, [Stroke(ENTER, '1.25')]])
@pytest.mark.parametrize('pictures', [1, 2, 3, 7])
def test_what_is_typed_is_entered_whole_however_seldom_a_frame_comes(page, clock, typed, pictures):
    page.set_typing(True)
    assert entered(page, clock, typed, pictures) == '1.25'


def typed(page: PageInput, clock: Clock, stroke: Stroke, mouse: Mouse = IDLE) -> Mouse:
    """Tell a stroke in a picture; return the mouse that the next frame shall see."""
    clock.now += 0.02
    shown = page.hear('tab', stroke.keys, mouse)
    page.type(stroke)
    return shown


@pytest.mark.parametrize(
    ('keys', 'is_down', 'heard'),
    [
        (W, True, ['w', 'HELD+w']),
        (W, False, []),
        (frozenset({code('Escape')}), False, ['ESC']),
    ],
)
@pytest.mark.parametrize('pictures', [0, 1, 2])
def test_what_is_pressed_after_enter_is_for_the_robot_though_no_frame_has_seen_enter(
    page, clock, keys, is_down, heard, pictures
):
    page.set_typing(True)
    for stroke in (Stroke(NONE, '1'), Stroke(ENTER), Stroke(NONE), Stroke(keys)):
        typed(page, clock, stroke)
    held = Stroke(keys if is_down else NONE)
    typed(page, clock, held)
    assert page.take_keys() == []
    page.see(0, is_marked=True)  # the text, after which ENTER is shown
    typed(page, clock, held)
    page.see(0, is_marked=False)
    for _ in range(pictures):
        typed(page, clock, held)  # while panels are drawn
    page.set_typing(False)
    typed(page, clock, held)
    assert page.take_keys() == heard


def test_a_key_that_a_field_was_shown_drives_nothing_until_it_is_pressed_again(page, clock):
    page.set_typing(True)
    for _ in range(2):
        typed(page, clock, Stroke(W, 'w'))
        page.see(0, is_marked=True)
    page.set_typing(False)
    typed(page, clock, Stroke(W))
    assert page.take_keys() == []


@pytest.mark.parametrize(('silence', 'keys'), [(GONE + 0.1, W), (0.02, W | {code('LeftCtrl')})])
def test_what_would_be_ignored_otherwise_is_ignored_after_enter_too(page, clock, silence, keys):
    page.set_typing(True)
    for stroke in (Stroke(NONE, '1'), Stroke(ENTER), Stroke(NONE)):
        typed(page, clock, stroke)
    clock.now += silence
    typed(page, clock, Stroke(keys))
    page.see(0, is_marked=True)
    typed(page, clock, Stroke(keys))
    page.set_typing(False)
    typed(page, clock, Stroke(W))
    assert set(page.take_keys()) <= {LOST}


def test_a_click_waits_until_a_frame_has_seen_what_was_typed_before_it_but_not_for_ever(
    page, clock
):
    page.set_typing(True)
    press = Mouse(1, (5, 5))
    typed(page, clock, Stroke(NONE, '1'))
    for stroke in (Stroke(ENTER), Stroke(), Stroke()):
        assert typed(page, clock, stroke, press).buttons == 0
    for is_marked in (True, False):
        page.see(0, is_marked)
        assert typed(page, clock, Stroke(), press).buttons == 0
    page.see(0, is_marked=True)
    assert typed(page, clock, Stroke(), press) == press
    page.see(1, is_marked=True)
    typed(page, clock, Stroke(NONE, '2'), press)
    waited = 0.0
    while typed(page, clock, Stroke(), IDLE).buttons:
        waited += 0.02
    assert waited == pytest.approx(KEY_PATIENCE, abs=0.05)


@pytest.mark.parametrize('before', [(), (Mouse(1, (50, 5)), Mouse(0, (50, 5)))])
def test_a_press_on_the_e_stop_waits_for_nothing_that_was_typed_before_it(page, clock, before):
    page.set_typing(True)
    page.e_stop = (0.0, 0.0, 10.0, 10.0)
    for stroke in (Stroke(NONE, '1'), Stroke(ENTER)):
        typed(page, clock, stroke)
    for mouse in before:
        assert typed(page, clock, Stroke(), mouse).buttons == 0
    seen = []
    for _ in range(5):
        seen.append(typed(page, clock, Stroke(), Mouse(1, (5, 5))))
        page.see(seen[-1].buttons, is_marked=False)
    assert seen[: len(before) + 1] == [*before, Mouse(1, (5, 5))]


def test_keys_that_are_for_no_field_are_seen_at_once(page, clock):
    page.hear('tab', W)
    assert page.type(Stroke(W)) == Stroke(W)
    assert page.type(Stroke(ENTER)) == Stroke(ENTER)


def test_what_a_browser_typed_that_is_lost_is_not_entered_by_the_next(page, clock):
    page.set_typing(True)
    for source, told in (('tab', Stroke(NONE, '1')), ('tab', Stroke(ENTER, '2'))):
        page.hear(source, told.keys)
        page.type(told)
    page.lose('tab')
    clock.now += 3.0
    page.see(0, is_marked=True)
    page.hear('next', NONE)
    shown = page.type(Stroke())
    assert (shown.text, shown.keys - MARK) == ('', NONE)


def test_a_field_is_not_behind_by_a_frame_for_each_letter_and_each_end_of_a_press(page, clock):
    page.set_typing(True)
    typed = [Stroke(down, text) for text in 'abcdefgh' for down, text in ((W, text), (NONE, ''))]
    for told in typed:
        page.hear('tab', told.keys)
        page.type(told)
    seen = ''
    for _ in range(4):
        clock.now += 0.02
        page.hear('tab', NONE)
        shown = page.type(Stroke())
        seen += shown.text
        page.see(0, bool(shown.keys & MARK))
    assert seen == 'bcdefgh'  # the first was seen when it came


def struck(page: PageInput, clock: Clock, keys: frozenset[int]) -> frozenset[int]:
    """Tell keys in a picture; return those that the next frame shall see."""
    clock.now += 0.02
    page.hear('tab', keys)
    return page.type(Stroke(keys)).keys - MARK


def test_strokes_wait_for_frames_of_panels_that_come_late_and_none_is_lost(page, clock):
    page.set_typing(True)
    shown = [struck(page, clock, keys) for keys in (W, NONE, ENTER)]
    for _ in range(300):
        shown.append(struck(page, clock, NONE))
    assert shown == [W] * 303
    later = []
    for is_marked in (True, False, True):
        page.see(0, is_marked)
        later.append(struck(page, clock, NONE))
    assert later == [NONE, ENTER, NONE]


def test_more_strokes_than_a_hand_makes_do_not_gather_and_no_key_stays_down(page, clock):
    page.set_typing(True)
    for number in range(500):
        struck(page, clock, (NONE, W)[number % 2])
    shown = []
    for number in range(200):
        page.see(0, is_marked=number % 2 == 0)
        shown.append(struck(page, clock, NONE))
    assert shown == [NONE, W] * 32 + [NONE] * 136
