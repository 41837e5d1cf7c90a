# SPDX-License-Identifier: Apache-2.0
from cases import for_all
from quadruped_sim.keys import (
    keys_between,
    STATE_KEYS,
    StateMachine,
    StateName,
    Sticks,
    SUCCESSORS,
)

P, F, FREE, T, M, B, SW, ST = (STATE_KEYS[key] for key in '12345098')

# unitree_guide's table: rows are states, columns keys 1 2 3 4 5 0 9 8; space changes no state.
KEYS = ('1', '2', '3', '4', '5', '0', '9', '8', ' ')
TABLE = {
    P: (P, F, P, P, P, P, P, P, P),
    F: (P, F, FREE, T, M, B, SW, ST, F),
    FREE: (P, F, FREE, T, FREE, FREE, FREE, FREE, FREE),
    T: (P, F, T, T, T, T, T, T, T),
    M: (P, F, M, M, M, M, M, M, M),
    B: (P, F, B, B, B, B, B, B, B),
    SW: (P, F, SW, SW, SW, SW, SW, SW, SW),
    ST: (P, F, ST, ST, ST, ST, ST, ST, ST),
}
PAIRS = [
    (state, key, wanted)
    for state, row in TABLE.items()
    for key, wanted in zip(KEYS, row, strict=True)
]


def machine_in(state: StateName) -> StateMachine:
    machine = StateMachine()
    machine.force(state)
    return machine


def test_there_are_72_pairs():
    assert len(PAIRS) == 72


@for_all(('state', 'key', 'wanted'), PAIRS)
def test_key_leads_where_the_table_says(state, key, wanted):
    machine = machine_in(state)
    if key == ' ':
        assert Sticks().press(key)
        is_taken = True
    else:
        is_taken = machine.press(key)
    for _ in range(3):
        machine.begin_tick()
    assert machine.state is wanted
    is_refused = key in STATE_KEYS and wanted is state and STATE_KEYS[key] is not state
    assert is_taken != is_refused


@for_all('wanted', list(StateName))
@for_all('state', list(StateName))
def test_the_path_from_each_state_to_each_is_legal_and_leads_there(state, wanted):
    stands = SUCCESSORS.get(state) is F and wanted is not state
    machine = machine_in(F if stands else state)  # which comes by itself
    keys = keys_between(state, wanted)
    assert len(keys) <= 2
    for key in keys:
        assert machine.press(key)
        machine.begin_tick()
        machine.begin_tick()
    assert machine.state is wanted


def test_change_takes_one_extra_tick():
    machine = machine_in(P)
    machine.press('2')
    assert machine.begin_tick() is None
    assert machine.state is P
    assert machine.begin_tick() is F


def test_keys_in_quick_succession_are_judged_from_the_state_that_is_due():
    machine = machine_in(P)
    assert machine.press('2')
    assert machine.coming is F
    assert machine.press('4')
    machine.begin_tick()
    machine.begin_tick()
    assert machine.state is T


def test_forced_change_is_immediate_and_forgets_what_was_due():
    machine = machine_in(F)
    machine.press('4')
    assert machine.force(P)
    machine.begin_tick()
    machine.begin_tick()
    assert machine.state is P
    assert not machine.force(P)
