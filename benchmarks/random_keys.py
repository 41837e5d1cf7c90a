# SPDX-License-Identifier: Apache-2.0
"""Random keys: for both robots by turns for ever, or for the Go2 as a monkey presses them."""

from collections.abc import Callable, Iterator, Sequence
import random

# How a script says a press: how long after the one before [s], and the keys.
Press = tuple[float, str]

GO2_WAYS = 'wsadjl'
TESTS = '35098'  # states that are entered from standing and left for it
MBOT_WAYS = ('i', ',', 'j', 'l', 'u', 'o', 'm', '.')
MBOT_SPEEDS = 'qzwxec'
# What shows the keys, and what does nothing; the second `?` takes the help away.
IDLE = ('? ?', '7', 'p', 'F5', 'HOME', 'n')
START = ((0.2, '2'), (3.0, '4'), (1.8, 'SPACE'))


def _sticks(chance: random.Random, most: int) -> Iterator[Press]:
    """Yield up to two directions at once, held for a while, and the end of both."""
    for way in chance.sample(GO2_WAYS, chance.randint(1, 2)):
        yield 0.02, f'{way}*{chance.randint(1, most)}'
    yield chance.uniform(1.0, 3.0), 'SPACE'


def _test(chance: random.Random) -> Iterator[Press]:
    """Yield one of the states that are not for travelling, from a stand, and back to a trot."""
    yield from ((0.02, 'SPACE'), (1.0, '2'), (1.5, chance.choice(TESTS)))
    yield 0.5, f'{chance.choice(GO2_WAYS + "ik")}*{chance.randint(1, 5)}'
    yield from ((1.5, 'SPACE'), (1.0, '2'), (1.5, '4'), (0.5, 'SPACE'))


def _lie_down(chance: random.Random) -> Iterator[Press]:
    """Yield a way to the ground and up again."""
    yield from ((0.02, 'SPACE'), (1.0, '2'), (1.5, '1'), (chance.uniform(1.0, 3.0), '2'))
    yield from ((3.0, '4'), (0.5, 'SPACE'))


def _start_again(_: random.Random) -> Iterator[Press]:
    yield 0.02, 'BACKSPACE'
    yield from START


def _go2_turn(chance: random.Random) -> Iterator[Press]:
    kinds: tuple[tuple[float, Callable[[], Iterator[Press]]], ...] = (
        (0.80, lambda: _sticks(chance, 10)),
        (0.12, lambda: _test(chance)),
        (0.05, lambda: _lie_down(chance)),
        (0.03, lambda: _start_again(chance)),
    )
    yield 0.05, chance.choice(IDLE)
    weights = [weight for weight, _ in kinds]
    yield from chance.choices([make for _, make in kinds], weights)[0]()


def _mbot_turn(chance: random.Random) -> Iterator[Press]:
    """Yield changes of speed that stay near the first, ways, at times a stop."""
    key = chance.choice(MBOT_SPEEDS)
    yield 0.05, chance.choice((key, key, *IDLE))
    for way in chance.choices(MBOT_WAYS, k=chance.randint(1, 3)):
        yield 0.05, f'{way}*{chance.randint(1, 20)}'
        yield 0.7, chance.choice(('k', 'SPACE', 'n', way))


# A monkey's presses: how likely, and keys of which each comes up to so often in a row.
MONKEY: tuple[tuple[float, Sequence[str], int], ...] = (
    (0.25, '2', 1),
    (0.2, '45', 1),
    (0.15, '39087v6', 1),
    (0.05, ('1', 'SPACE'), 1),
    (0.32, 'wasdjlik', 20),
    (0.06, 'nN', 3),
)


def monkey_keys(duration: float, seed: int) -> str:
    """Return a key script for `wasd go2`: any key at any time, sticks up to their ends."""
    chance = random.Random(seed)
    lines, now = ['0.2 2'], 0.2 + chance.uniform(0.1, 3.0)
    while now < duration:
        _, keys, most = chance.choices(MONKEY, [share for share, _, _ in MONKEY])[0]
        lines.append(f'{now:.3f} {chance.choice(keys)}*{chance.randint(1, most)}')
        now += chance.choice((0.02, chance.uniform(0.1, 1.0), chance.uniform(0.5, 2.5)))
    return '\n'.join(lines) + '\n'


def random_keys(duration: float, seed: int) -> str:
    """Return a key script for `wasd both`: the robots by turns, never long at rest."""
    chance = random.Random(seed)
    lines: list[str] = []
    now, turn = 0.0, 0
    presses = iter(START)
    while True:
        for after, keys in presses:
            now += after
            if now > duration:
                return '\n'.join(lines)
            lines.append(f'{now:.3f} {keys}')
        now += 0.05
        lines.append(f'{now:.3f} TAB')
        presses = _mbot_turn(chance) if turn % 2 == 0 else _go2_turn(chance)
        turn += 1
