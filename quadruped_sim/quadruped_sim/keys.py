# SPDX-License-Identifier: Apache-2.0
"""Meaning of keys: states, the two sticks, and the answers to other keys."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from wasd_core.timing import STOP_KEY

from quadruped_sim.presets import VelocityLimits


class StateName(StrEnum):
    """unitree_guide's eight states and four of ours, in words."""

    PASSIVE = 'passive'
    FIXED_STAND = 'fixed stand'
    FREE_STAND = 'free stand'
    TROTTING = 'trotting'
    MOVE_BASE = 'move base'
    BALANCE_TEST = 'balance test'
    SWING_TEST = 'swing test'
    STEP_TEST = 'step test'
    GET_UP = 'get up'
    LIE_DOWN = 'lie down'
    JUMP = 'jump'
    POLICY = 'policy'


STATE_KEYS = {
    '1': StateName.PASSIVE,
    '2': StateName.FIXED_STAND,
    '3': StateName.FREE_STAND,
    '4': StateName.TROTTING,
    '5': StateName.MOVE_BASE,
    '0': StateName.BALANCE_TEST,
    '9': StateName.SWING_TEST,
    '8': StateName.STEP_TEST,
    '6': StateName.GET_UP,
    '7': StateName.LIE_DOWN,
    'v': StateName.JUMP,
    'p': StateName.POLICY,
}

# States that follow velocities.
FOLLOWING = (StateName.MOVE_BASE, StateName.POLICY)
# States in which it is driven, and in which its feet tell how the ground rises on its way.
DRIVEN = (StateName.TROTTING, *FOLLOWING)
# Keys that leave each state.
TRANSITIONS = {
    StateName.PASSIVE: '26',
    StateName.FIXED_STAND: '13450987vp',
    StateName.FREE_STAND: '1247',
    StateName.TROTTING: '127',
    StateName.MOVE_BASE: '127',
    StateName.BALANCE_TEST: '127',
    StateName.SWING_TEST: '127',
    StateName.STEP_TEST: '127',
    StateName.GET_UP: '1',
    StateName.LIE_DOWN: '12',
    StateName.JUMP: '1',
    StateName.POLICY: '127',
}
# States that end by themselves, and what follows.
SUCCESSORS = {
    StateName.GET_UP: StateName.FIXED_STAND,
    StateName.LIE_DOWN: StateName.PASSIVE,
    StateName.JUMP: StateName.FIXED_STAND,
}
# What raises a robot that has fallen.
GET_UP_KEYS = '26'


def keys_between(state: StateName, wanted: StateName) -> tuple[str, ...]:
    """
    Return the fewest keys that lead from a state to another; none when it is the same.

    Of a state that leads to a stand by itself, they are those that are pressed then.
    """
    stands = state is not wanted and SUCCESSORS.get(state) is StateName.FIXED_STAND
    ways: dict[StateName, tuple[str, ...]] = {StateName.FIXED_STAND if stands else state: ()}
    for source in (queue := list(ways)):
        for key in TRANSITIONS[source]:
            if STATE_KEYS[key] not in ways:
                ways[STATE_KEYS[key]] = (*ways[source], key)
                queue.append(STATE_KEYS[key])
    return ways[wanted]


class StateMachine:
    """
    The present state and the next change.

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


STEP = 0.05

# Key, lower case -> (stick axis, direction).
STICK_KEYS = {
    'w': ('ly', 1),
    's': ('ly', -1),
    'd': ('lx', 1),
    'a': ('lx', -1),
    'l': ('rx', 1),
    'j': ('rx', -1),
    'i': ('ry', 1),
    'k': ('ry', -1),
}
ZERO_KEYS = (' ', 'SPACE', STOP_KEY)
# Key -> how far on in the table of gaits.
GAIT_KEYS = {'n': 1, 'N': -1}
# Switches between walking by sight and walking blind.
EYES_KEY = 'e'


def is_stick_key(key: str) -> bool:
    """Whether a key, upper or lower case, moves or centres the sticks."""
    return key in ZERO_KEYS or (len(key) == 1 and key.lower() in STICK_KEYS)


@dataclass(frozen=True)
class StickValues:
    """Deflections in [-1, 1]: left and right stick, x to the right, y forward."""

    lx: float = 0.0
    ly: float = 0.0
    rx: float = 0.0
    ry: float = 0.0


class Sticks:
    """
    Keys step an axis by 0.05 and it stays there; space returns all to zero.

    Counts steps as integers, so that twenty up and twenty down is exactly zero. `pressed` is where
    the keys have moved them, `values` what counts: the same, but between `begin_anew` and `meet`.
    """

    def __init__(self) -> None:
        self.zero()

    def zero(self) -> None:
        """Centre both sticks."""
        self.begin_anew()
        self.meet()

    def begin_anew(self) -> None:
        """Move from the centre from now on, for the state that is due; `values` stay till then."""
        self._counts, self.pressed = dict.fromkeys(('lx', 'ly', 'rx', 'ry'), 0), StickValues()
        self._is_early = True

    def meet(self) -> None:
        """Let the keys count that have been pressed."""
        self.values, self._is_early = self.pressed, False

    def press(self, key: str) -> bool:
        """Take a key, upper or lower case; False when it is no stick key."""
        if not is_stick_key(key):
            return False
        if key in ZERO_KEYS:
            self.zero()
            return True
        axis, direction = STICK_KEYS[key.lower()]
        full = round(1.0 / STEP)
        self._counts[axis] = min(max(self._counts[axis] + direction, -full), full)
        self.pressed = replace(self.pressed, **{axis: self._counts[axis] / full})
        if not self._is_early:
            self.meet()
        return True


# What a key of a state is pressed for: `press 2 to stand`.
PURPOSES = {
    StateName.PASSIVE: 'to let go',
    StateName.FIXED_STAND: 'to stand',
    StateName.FREE_STAND: 'to lean',
    StateName.TROTTING: 'to trot',
    StateName.MOVE_BASE: 'for cmd_vel',
    StateName.BALANCE_TEST: 'to balance',
    StateName.SWING_TEST: 'to swing',
    StateName.STEP_TEST: 'to step',
    StateName.GET_UP: 'to get up',
    StateName.LIE_DOWN: 'to lie down',
    StateName.JUMP: 'to jump',
    StateName.POLICY: 'for the policy',
}
_LEAN = {
    ('ly', 1): 'nose down',
    ('ly', -1): 'nose up',
    ('lx', 1): 'lean right',
    ('lx', -1): 'lean left',
    ('rx', 1): 'turn right',
    ('rx', -1): 'turn left',
    ('ry', 1): 'body up',
    ('ry', -1): 'body down',
}
# What a stick does in the states in which it does something, other than to drive.
_EFFECTS = {
    StateName.FREE_STAND: _LEAN,
    StateName.BALANCE_TEST: _LEAN
    | {
        ('ly', 1): 'body forward',
        ('ly', -1): 'body back',
        ('lx', 1): 'body right',
        ('lx', -1): 'body left',
    },
    StateName.SWING_TEST: {
        ('ly', 1): 'front right foot forward',
        ('ly', -1): 'front right foot back',
        ('lx', 1): 'front right foot right',
        ('lx', -1): 'front right foot left',
        ('ry', 1): 'front right foot up',
        ('ry', -1): 'front right foot down',
    },
}
# Answers repeat a key's name up to this length.
LONGEST_NAME = 20
# The sticks that drive a trot.
_DRIVING = ('lx', 'ly', 'rx')
# States whose sticks are velocities.
_BY_STICKS = (StateName.TROTTING, StateName.POLICY)
# What a stranger tries, and the sticks' keys that mean it.
ARROWS = {'UP': 'w', 'DOWN': 's', 'LEFT': 'j', 'RIGHT': 'l'}


_USING_STICKS = (StateName.TROTTING, *_EFFECTS)


@dataclass(frozen=True)
class KeyWords:
    """
    Answers to the user, who may have other keys than the sticks'.

    `drive` is the state in which the keys drive; `elsewhere` are keys that somebody else takes.
    `reset_key` puts a fallen robot on its feet and `help_key` shows the keys; '' where none does.
    `policy` is what gives a network, `name` returns what the driver's keyboard calls a key.
    """

    drive: StateName = StateName.TROTTING
    elsewhere: frozenset[str] = frozenset()
    reset_key: str = ''
    help_key: str = ''
    policy: str = '-p policy:=FILE'
    name: Callable[[str], str] = str

    def is_for_legs(self, key: str) -> bool:
        """Whether a key is for the legs: each digit, and what nobody else takes."""
        return key.isdigit() or key not in self.elsewhere

    def to_fallen(self, obstacle: str = '') -> str:
        """Return the advice for a fallen robot, which an `obstacle` may keep from rolling."""
        if obstacle:
            cure = f'press {self.reset_key} to reset' if self.reset_key else 'put it on its feet'
            return f'{cure} (fallen; {obstacle})'
        reset = f', or {self.reset_key} to reset' if self.reset_key else ''
        return f'press {GET_UP_KEYS[0]} to get up{reset} (the robot has fallen)'

    def to_state(self, state: StateName, wanted: StateName) -> str:
        """Return what to press for a state that cannot follow this one, or is this one."""
        if state is wanted:
            return f'{state.value} already'
        if wanted is SUCCESSORS.get(state):
            return f'wait: {wanted.value} follows {state.value} by itself'
        return f'{self._press(state, wanted)} ({wanted.value} cannot follow {state.value})'

    def to_event(self, event: str, is_fallen: bool, obstacle: str = '') -> str:
        """Return what to press after the robot went passive by itself."""
        if is_fallen:
            return self.to_fallen(obstacle)
        return f'{self._press(StateName.PASSIVE, StateName.FIXED_STAND)} (passive: {event})'

    def to_no_policy(self) -> str:
        """Return how there is a policy."""
        return f'start with {self.policy} (there is no policy to play)'

    def to_velocity(self, state: StateName) -> str:
        """Return what to press so that velocity commands drive."""
        if state is StateName.MOVE_BASE:
            return 'move base is about to begin'
        cure = self._press(state, StateName.MOVE_BASE)
        return f'{cure} (cmd_vel drives in move base, not {state.value})'

    def to_gait(self, gait: str, limits: VelocityLimits) -> str:
        """Return the top speed of a gait, after its choice or a larger command."""
        sideways = f'{limits.lateral:.2g} m/s, {limits.yaw:.2g} rad/s'
        return f'{gait}: at most {limits.forward:.2g}, {sideways} ({self.name("n")}: next gait)'

    def to_eyes(self, is_on: bool, has_map: bool) -> str:
        """Return how the robot walks from now on."""
        if is_on and not has_map:
            return 'by sight, once there is a lidar of points: blind until then'
        return 'eyes open: it walks by sight' if is_on else 'eyes shut: it walks blind'

    def to_stick(self, state: StateName, key: str, has_moved: bool) -> str | None:
        """Return what to tell of a stick's key; None where it drives."""
        if state is StateName.MOVE_BASE or key in ZERO_KEYS:
            if state in _USING_STICKS:
                return 'sticks centred'
            # Nobody presses STOP by hand: no answer.
            return None if key == STOP_KEY else self.to_drive(state, key)
        axis, direction = STICK_KEYS[key.lower()]
        name = self._called(key)
        if state in _BY_STICKS and axis in _DRIVING:
            return None if has_moved else f'{name}: full stick'
        if state in _BY_STICKS:
            return f'{name} moves in 3 (press 2, then 3 to lean)'
        effect = _EFFECTS.get(state, {}).get((axis, direction))
        if effect is None:
            return self.to_drive(state, key)
        cure = self._press(state, self.drive).removeprefix('press ')
        end = '' if has_moved else ', at its end'
        return f'{name}: {effect}{end} (to drive: {cure})'

    def to_other(self, state: StateName, key: str) -> str | None:
        """Return the answer to any other key; None if it has an effect."""
        if key in self.elsewhere or key in ARROWS:
            if state is not self.drive:
                return self.to_drive(state, key)
            if key in self.elsewhere:
                return None
            return f'press {self.name(ARROWS[key])} ({key} does nothing)'
        ours = 'keys: 0-9, v, wasd, ijkl, n, e'
        cure = f'{self.help_key} shows the keys' if self.help_key else ours
        # Whatever came on a topic: its control characters made visible, and not all of it.
        return f'{cure} ({self._called(key)[:LONGEST_NAME]!r} does nothing)'

    def to_drive(self, state: StateName, key: str) -> str | None:
        """Return what to press so that the keys drive; None where they do."""
        if state is self.drive:
            return None
        return f'{self._press(state, self.drive)} ({self._called(key)} does nothing here)'

    def _press(self, state: StateName, wanted: StateName) -> str:
        """Return the keys from a state to another: `press 2 to stand, then 4 to trot`."""
        purposes = dict(PURPOSES)
        if self.drive is StateName.MOVE_BASE:
            purposes[self.drive] = 'to drive'
        words = [
            f'{self.name(key)} {purposes[STATE_KEYS[key]]}' for key in keys_between(state, wanted)
        ]
        stands = SUCCESSORS.get(state) is StateName.FIXED_STAND
        return f'press {", then ".join(words)}{" when it stands" if stands else ""}'

    def _called(self, key: str) -> str:
        """Return how a key stands in a text."""
        return 'SPACE' if key in ZERO_KEYS else self.name(key)
