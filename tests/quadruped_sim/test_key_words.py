# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
import pytest
from quadruped_sim.keys import (
    ARROWS,
    keys_between,
    KeyWords,
    STATE_KEYS,
    StateMachine,
    StateName,
    STICK_KEYS,
    SUCCESSORS,
    TRANSITIONS,
)
from quadruped_sim.leg_controller import LegController
from teleop_keyboard.dashboard import Status, status_line
from wasd_core.timing import brief

WORDS = KeyWords(reset_key='BACKSPACE', help_key='?')
DRIVE_KEYS = (*STICK_KEYS, ' ', 'SPACE', *ARROWS)
OTHER_KEYS = (
    'x',
    'Q',
    '7',
    'é',
    'CTRL+ALT+SHIFT+DOWN',
    'F12',
    'ENTER',
    'PGUP',
    '',
    '\x1b]0;title\x07' * 99,
)
KEYS = (*STATE_KEYS, *DRIVE_KEYS, *(key.upper() for key in STICK_KEYS), *OTHER_KEYS)
STATES = tuple(StateName)
# What shares the line with a text: the longest of each.
CLOCK = '1234.5 s x10.00'
COMMAND = 'command +0.00 +0.00 m/s +0.00 rad/s'
LEGAL = {(state, key) for state, keys in TRANSITIONS.items() for key in keys}


@pytest.fixture(scope='module')
def legs(model, walker):
    return LegController(model, estimator='truth', walker=walker)


@pytest.fixture
def in_state(legs):
    """Return a function that puts the controller into a state, with its words."""

    def put(state, words=WORDS, is_fallen=False):
        legs.reset()
        legs.words = words
        legs._machine.force(state)
        legs.is_fallen = is_fallen
        return legs

    yield put
    legs.reset()


def answers(in_state):
    """Yield what is said to every key in every state: state, key, text."""
    for state in STATES:
        for key in KEYS:
            yield state, key, in_state(state).press(key)


def test_no_key_is_answered_by_silence_unless_it_acts(in_state):
    driven = (StateName.TROTTING, StateName.POLICY)
    drives = {(state, key) for state in driven for key in 'wsadjlWSADJL'}
    silent = {(state, key) for state, key, text in answers(in_state) if not text}
    assert silent == LEGAL | drives


def test_every_text_fits_a_line_of_80_columns_beside_state_and_time(in_state):
    for state, key, text in answers(in_state):
        for who in ('', '[go2] '):
            status = Status(who + state.value, (COMMAND,), text or '')
            line = status_line(status, CLOCK, 79)
            assert len(line) <= 79
            assert line.isprintable()
            assert line.startswith(who + state.value)
            assert CLOCK in line
            assert brief(text or '') in line, (state, key, line)


def test_every_text_is_whole_at_120_columns(in_state):
    for state, key, text in answers(in_state):
        if state not in (StateName.TROTTING, StateName.MOVE_BASE, StateName.POLICY):
            assert text is None or text in status_line(Status(state.value, (), text), CLOCK, 119)
        else:
            line = status_line(Status(state.value, (COMMAND,), text or ''), CLOCK, 119)
            assert brief(text or '') in line, key
            assert COMMAND in line


DRIVEN = (StateName.TROTTING, StateName.POLICY)


@for_all('state', [s for s in STATES if s not in DRIVEN])
def test_w_says_which_keys_lead_to_a_trot_and_they_do(in_state, state):
    said = in_state(state).press('w')
    keys = [word for word in said.replace(':', ' ').split() if word in STATE_KEYS]
    machine = StateMachine()
    machine.force(SUCCESSORS.get(state, state))
    for key in keys:
        assert machine.press(key)
        machine.begin_tick()
        machine.begin_tick()
    assert machine.state is StateName.TROTTING


def test_w_in_the_states_one_meets_first(in_state):
    said = {state: brief(in_state(state).press('w') or '') for state in STATES}
    assert said == {
        StateName.PASSIVE: 'press 2 to stand, then 4 to trot',
        StateName.FIXED_STAND: 'press 4 to trot',
        StateName.FREE_STAND: 'w: nose down',
        StateName.TROTTING: '',
        StateName.MOVE_BASE: 'press 2 to stand, then 4 to trot',
        StateName.BALANCE_TEST: 'w: body forward',
        StateName.SWING_TEST: 'w: front right foot forward',
        StateName.STEP_TEST: 'press 2 to stand, then 4 to trot',
        StateName.GET_UP: 'press 4 to trot when it stands',
        StateName.LIE_DOWN: 'press 2 to stand, then 4 to trot',
        StateName.JUMP: 'press 4 to trot when it stands',
        StateName.POLICY: '',
    }


def test_a_refused_state_begins_with_the_keys_that_lead_there(in_state):
    for state in STATES:
        for key, wanted in STATE_KEYS.items():
            said = in_state(state).press(key)
            if (state, key) in LEGAL:
                assert said is None
            elif wanted is state:
                assert said == f'{state.value} already'
            elif wanted is SUCCESSORS.get(state):
                assert said == f'wait: {wanted.value} follows {state.value} by itself'
            else:
                assert said.startswith(f'press {keys_between(state, wanted)[0]} ')
                assert said.endswith(f'({wanted.value} cannot follow {state.value})')


def test_a_stick_at_its_end_says_so(in_state):
    legs = in_state(StateName.TROTTING)
    said = [legs.press('w') for _ in range(25)]
    assert said == [None] * 20 + ['w: full stick'] * 5


@for_all('key', ['3', '4', '7', 'w', ' ', 'UP', 'x'])
def test_a_fallen_robot_names_the_keys_that_raise_and_reset_it(in_state, key):
    text = in_state(StateName.PASSIVE, is_fallen=True).press(key)
    assert text == 'press 2 to get up, or BACKSPACE to reset (the robot has fallen)'
    bare = in_state(StateName.PASSIVE, KeyWords(), is_fallen=True)
    assert bare.press(key) == 'press 2 to get up (the robot has fallen)'
    assert bare.set_velocity(0.1, 0.0, 0.0) == bare.press(key)


@pytest.mark.parametrize('key', ['2', '6'])
def test_a_fallen_robot_gets_up_at_these_keys_and_never_stands_up_as_it_lies(in_state, key):
    legs = in_state(StateName.PASSIVE, is_fallen=True)
    assert legs.press(key) is None
    assert legs.coming_state == StateName.GET_UP
    assert legs.press('2') == 'wait: fixed stand follows get up by itself'
    assert legs.press('1') is None
    assert legs.coming_state == StateName.PASSIVE


def test_cmd_vel_says_which_keys_lead_to_move_base(in_state):
    for state in STATES:
        said = in_state(state).set_velocity(0.1, 0.0, 0.0)
        if state in (StateName.MOVE_BASE, StateName.POLICY):
            assert said is None
        else:
            assert said.startswith(f'press {keys_between(state, StateName.MOVE_BASE)[0]} ')
            assert len(brief(said)) <= 42
    assert in_state(StateName.MOVE_BASE).set_velocity(math.nan, 0.0, 0.0)


def test_keys_of_a_keymap_drive_in_move_base_and_are_not_called_unknown(in_state):
    words = KeyWords(StateName.MOVE_BASE, frozenset('wqxv'), 'BACKSPACE', '?')
    for key in 'wqxv':
        assert in_state(StateName.MOVE_BASE, words).press(key) is None
        said = in_state(StateName.PASSIVE, words).press(key)
        assert brief(said) == 'press 2 to stand, then 5 to drive'


def test_keys_are_called_as_on_the_drivers_keyboard(in_state):
    words = KeyWords(name=lambda key: {'w': 'z', 'W': 'Z'}.get(key, key))
    said = in_state(StateName.PASSIVE, words).press('w')
    assert said == 'press 2 to stand, then 4 to trot (z does nothing here)'
    assert in_state(StateName.FREE_STAND, words).press('W').startswith('Z: nose down')


@for_all('state', StateName)
def test_a_stop_that_nobody_pressed_names_no_key_to_press(state):
    assert KeyWords().to_stick(state, 'STOP', has_moved=False) in (None, 'sticks centred')
