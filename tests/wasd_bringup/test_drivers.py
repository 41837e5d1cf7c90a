# SPDX-License-Identifier: Apache-2.0
"""Who drives is known; what a source held when it was stopped counts after a new press alone."""

from pathlib import Path

from cases import for_all
import pytest
from wasd_bringup.run.drivers import Drivers, E_STOP, Held, right_of, SILENCE

FAST, STILL = (0.5, 0.0, 0.1), (0.0, 0.0, 0.0)
DOCS = Path(__file__).parents[2] / 'docs/drivers.md'
SOURCES = ('keys', 'page', 'gamepad', 'foxglove 1', 'topic', 'script', 'navigator', 'sine')


def make(holds_stops: bool = False) -> Drivers:
    """Return the drivers of a robot whose w and s stay, and whose blank ends them."""
    return Drivers(lambda key: key == ' ', lambda key: key in 'ws', holds_stops)


@pytest.fixture
def drivers() -> Drivers:
    """Return the drivers of a robot that nobody drives."""
    return make()


def wait(drivers, seconds=2.0 * SILENCE):
    for _ in range(round(seconds / 0.05)):
        drivers.step(0.05)


def test_a_key_that_latches_moves_the_robot_after_it_is_let_go(drivers):
    drivers.take('page', key='w')
    drivers.take('page', key='RELEASE+w')
    assert any(drivers.held('page'))
    assert not any(drivers.held('keys'))


def test_a_key_that_is_down_moves_it_until_it_is_up(drivers):
    drivers.take('page', key='i')
    drivers.take('page', key='HELD+i')
    assert any(drivers.held('page'))
    drivers.take('page', key='RELEASE+i')
    assert not any(drivers.held('page'))


@pytest.mark.parametrize('source', ['page', 'keys'])
def test_who_ever_presses_the_stop_key_stops_what_keys_have_latched(drivers, source):
    drivers.take('page', key='w')
    drivers.take(source, key=' ')
    assert not any(drivers.held('page'))


@pytest.mark.parametrize(
    ('source', 'counts'),
    [('sine', False), ('page', False), ('script', True), ('navigator', True)],
)
def test_a_silence_lasts_by_wall_time_but_that_of_a_script_or_a_plan_by_simulated_time(
    source, counts
):
    drivers = make()
    drivers.take(source, key='w')
    drivers.take(source, velocity=FAST)
    drivers.stop('page')
    drivers.step(2.0 * SILENCE, haste=20.0)
    assert drivers.take(source, key='w') == counts
    assert drivers.take(source, velocity=FAST) == counts


def test_a_key_without_a_name_is_nothing_not_even_a_velocity_of_zero(drivers):
    told = []
    drivers.on_take.append(lambda *taken: told.append(taken))
    assert not drivers.take('topic', key='')
    assert told == []
    drivers.take('topic', velocity=FAST)
    drivers.stop('page')
    assert not drivers.take('topic', key='')
    assert not drivers.take('topic', velocity=FAST)


def test_a_source_that_is_released_tells_what_it_moved(drivers):
    drivers.take('page', key='w')
    drivers.take('gamepad', velocity=FAST)
    assert drivers.release('page') == Held(keys=True, velocity=False)
    assert drivers.release('gamepad') == Held(keys=False, velocity=True)
    assert drivers.release('gamepad') == Held(keys=False, velocity=False)


def test_the_last_that_takes_it_drives_and_the_others_ask(drivers):
    drivers.time = 3.0
    drivers.take('navigator', velocity=FAST)
    drivers.time = 5.0
    drivers.take('keys', key='HELD+i')
    state = drivers.state
    assert (state.driver, state.since, state.right) == ('keys', 5.0, 'hand')
    assert state.asks == ('navigator',)
    wait(drivers)
    drivers.take('keys', key='RELEASE+i')
    assert drivers.state.driver == ''


@pytest.mark.parametrize('take', [{'velocity': FAST}, {'key': 'i'}])
def test_who_drives_again_after_nobody_drove_does_so_since_then(drivers, take):
    for drivers.time in (1.0, 1.5):
        assert drivers.take('topic', **take)
        assert drivers.state.since == 1.0
    wait(drivers)
    assert drivers.state.driver == ''
    drivers.time = 10.0
    assert drivers.take('topic', **take)
    assert drivers.state.since == 10.0


def test_who_drives_again_after_a_latched_stop_does_so_since_then():
    drivers = make(holds_stops=True)
    drivers.take('topic', velocity=FAST)
    drivers.stop('page')
    drivers.release(E_STOP)
    wait(drivers)
    drivers.time = 7.0
    assert drivers.take('topic', velocity=FAST)
    assert drivers.state.since == 7.0


def test_what_drives_by_itself_is_told_who_takes_over(drivers):
    told = []
    drivers.on_take.append(lambda *taken: told.append(taken))
    drivers.take('topic', velocity=FAST, what='somebody on /cmd_vel')
    drivers.take('keys', key='RELEASE+i')
    assert [tuple(take) for take in told] == [('topic', 'somebody on /cmd_vel')]


@pytest.mark.parametrize('source', SOURCES)
def test_a_velocity_that_was_disarmed_counts_after_a_zero(drivers, source):
    assert drivers.take(source, velocity=FAST)
    assert drivers.disarm().velocity
    assert not drivers.take(source, velocity=FAST)
    assert drivers.take(source, velocity=STILL)
    assert drivers.take(source, velocity=FAST)


@pytest.mark.parametrize('source', SOURCES)
def test_a_velocity_that_was_disarmed_counts_after_a_silence(drivers, source):
    drivers.take(source, velocity=FAST)
    drivers.disarm()
    for _ in range(100):  # it goes on
        assert not drivers.take(source, velocity=FAST)
        drivers.step(0.05)
    wait(drivers)
    assert drivers.take(source, velocity=FAST)


def test_a_key_that_was_disarmed_counts_after_it_was_let_go(drivers):
    drivers.take('keys', key='HELD+i')
    drivers.disarm()
    assert not drivers.take('keys', key='HELD+i')
    assert not drivers.take('keys', key='i')
    drivers.take('keys', key='RELEASE+i')
    assert drivers.take('keys', key='i')


def test_repeats_of_a_key_without_releases_count_after_they_have_ended(drivers):
    drivers.take('keys', key='i')
    drivers.disarm()
    for _ in range(100):
        assert not drivers.take('keys', key='i')
        drivers.step(1.0 / 30.0)
    wait(drivers)
    assert drivers.take('keys', key='i')


def test_the_late_first_repeat_of_a_slow_keyboard_is_no_new_press(drivers):
    drivers.take('keys', key='i')
    drivers.disarm()
    wait(drivers, 1.0)  # some wait so long before the first repeat
    assert not drivers.take('keys', key='i')


def test_the_page_says_who_drives_by_which_right_and_how_long_a_silence_is():
    page = DOCS.read_text()
    assert f'{SILENCE:g} s of silence' in page
    rows = dict(line.strip('| ').split(' | ') for line in page.splitlines() if ' | ' in line)
    assert rows['keys, page, gamepad'] == right_of('keys') == right_of('page') == 'hand'
    assert right_of('gamepad') == 'hand'
    programs = "scripts, topics, Foxglove's clients, Unitree's SDK, programs of your own"
    assert rows[programs] == right_of('script') == right_of('unitree')
    assert right_of('foxglove 3') == right_of('topic') == right_of('sine') == 'program'
    assert rows['navigator'].startswith(f'{right_of("navigator")}:')
    assert rows['a stop that holds'].startswith(f'{right_of(E_STOP)}:')


def test_a_stop_key_always_counts(drivers):
    drivers.take('keys', key=' ')
    drivers.disarm()
    assert drivers.take('keys', key=' ')


@for_all('source', SOURCES)
def test_nothing_counts_while_a_stop_holds_and_nothing_held_counts_after_it(source):
    drivers = make(holds_stops=True)
    drivers.stop('page')
    for _ in range(100):
        assert not drivers.take(source, velocity=FAST)
        assert not drivers.take(source, key='HELD+i')
        assert not drivers.take(source, key='2')
        drivers.step(0.05)
    assert drivers.state[:1] + drivers.state[2:3] == (E_STOP, 'stop')
    assert drivers.state.stopped_by == 'page'
    drivers.release(E_STOP)
    assert not drivers.take(source, velocity=FAST)
    assert not drivers.take(source, key='HELD+i')
    wait(drivers)
    assert drivers.take(source, velocity=FAST)
    assert drivers.take(source, key='HELD+i')


def test_a_stop_that_does_not_hold_lets_a_new_press_count():
    drivers = make()
    drivers.take('keys', key='HELD+i')
    drivers.stop('page')
    assert not drivers.take('keys', key='HELD+i')
    assert drivers.take('keys', key='2')


@for_all('holds', [False, True])
def test_who_stopped_it_is_told_until_somebody_drives(holds):
    drivers = make(holds_stops=holds)
    drivers.stop('topic e_stop')
    for source in (E_STOP, 'lost'):
        drivers.take(source, key=' ')
    drivers.take('topic', velocity=(0.0, 0.0, 0.0))
    assert drivers.state.last_stop_by == 'topic e_stop'
    drivers.release(E_STOP)
    assert drivers.state.last_stop_by == 'topic e_stop'
    drivers.take('page', key='2')
    assert drivers.state.driver == 'page'
    assert drivers.state.last_stop_by == drivers.state.stopped_by == ''


def test_a_reset_of_the_robot_ends_no_stop():
    drivers = make(holds_stops=True)
    drivers.stop('keys')
    drivers.reset()
    assert not drivers.take('page', velocity=FAST)


def test_the_first_source_of_a_stop_is_told():
    drivers = make(holds_stops=True)
    drivers.stop('page')
    drivers.stop('topic e_stop')
    assert drivers.state.stopped_by == 'page'
