# SPDX-License-Identifier: Apache-2.0
"""Which state follows which key: unitree_guide's table."""

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


def path(state: StateName, wanted: StateName) -> tuple[str, ...]:
    """Return the fewest keys that lead from a state to another; none when it is the same."""
    ways: dict[StateName, tuple[str, ...]] = {state: ()}
    for source in (queue := [state]):
        for key in TRANSITIONS[source]:
            if STATE_KEYS[key] not in ways:
                ways[STATE_KEYS[key]] = (*ways[source], key)
                queue.append(STATE_KEYS[key])
    return ways[wanted]


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

    @property
    def coming(self) -> StateName:
        """The state that is due, else the present one: keys are judged from it."""
        return self._due or self.state

    def press(self, key: str) -> bool:
        """Take a state key; False when its state cannot follow."""
        wanted, origin = STATE_KEYS[key], self.coming
        if wanted is origin:
            return True
        if key not in TRANSITIONS[origin]:
            return False
        self._due = wanted
        self._is_armed = False
        return True

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
