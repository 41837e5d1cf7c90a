# SPDX-License-Identifier: Apache-2.0
"""Which state follows which key: unitree_guide's table, with reasons for what it refuses."""

from enum import StrEnum


class StateName(StrEnum):
    """The eight states, in words."""

    PASSIVE = 'passive'
    FIXED_STAND = 'fixed stand'
    FREE_STAND = 'free stand'
    TROTTING = 'trotting'
    MOVE_BASE = 'move base'
    BALANCE_TEST = 'balance test'
    SWING_TEST = 'swing test'
    STEP_TEST = 'step test'


STATE_KEYS = {
    '1': StateName.PASSIVE,
    '2': StateName.FIXED_STAND,
    '3': StateName.FREE_STAND,
    '4': StateName.TROTTING,
    '5': StateName.MOVE_BASE,
    '0': StateName.BALANCE_TEST,
    '9': StateName.SWING_TEST,
    '8': StateName.STEP_TEST,
}

# Keys that leave each state.
TRANSITIONS = {
    StateName.PASSIVE: '2',
    StateName.FIXED_STAND: '1345098',
    StateName.FREE_STAND: '124',
    StateName.TROTTING: '12',
    StateName.MOVE_BASE: '12',
    StateName.BALANCE_TEST: '12',
    StateName.SWING_TEST: '12',
    StateName.STEP_TEST: '12',
}


def explain_refusal(state: StateName, key: str) -> str:
    """Why `key` does nothing in `state`, and what is legal there."""
    wanted = STATE_KEYS[key]
    legal = ', '.join(f'{key} {STATE_KEYS[key].value}' for key in TRANSITIONS[state])
    sources = [source.value for source, keys in TRANSITIONS.items() if key in keys]
    return (
        f'{wanted.value} cannot follow {state.value}: '
        f'it is entered from {" or ".join(sources)}. Legal now: {legal}'
    )


class StateMachine:
    """
    Present state and the change that is due.

    A legal key is due for the next tick: `begin_tick` returns the new state once, when the old one
    shall be left and the new one entered. `force` is due at once.
    """

    def __init__(self) -> None:
        self.state = StateName.PASSIVE
        self._due: StateName | None = None
        self._is_armed = False

    def press(self, key: str) -> str | None:
        """
        Take a state key; a text when it is refused.

        A key that comes while a change is due is judged from the state that is due.
        """
        wanted = STATE_KEYS[key]
        origin = self._due or self.state
        if wanted is origin:
            return None
        if key not in TRANSITIONS[origin]:
            return explain_refusal(origin, key)
        self._due = wanted
        self._is_armed = False
        return None

    def force(self, state: StateName) -> bool:
        """Be in `state` now, forgetting what was due; True when that is a change."""
        is_change = self.state is not state
        self._due = None
        self.state = state
        return is_change

    def begin_tick(self) -> StateName | None:
        """State to enter in this tick, if any: a key pressed before tick n acts in tick n + 1."""
        if self._due is None:
            return None
        if not self._is_armed:
            self._is_armed = True
            return None
        self.state, self._due = self._due, None
        return self.state
