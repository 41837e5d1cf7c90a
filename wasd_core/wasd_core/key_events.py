# SPDX-License-Identifier: Apache-2.0
"""
What a message on `keys` tells: the name of a key is a press of it.

Where a keyboard tells more, `HELD+w` says that w is (still) down and that its end will be told,
and `RELEASE+w` is that end; who cares for presses only skips both.
"""

HELD = 'HELD'
RELEASE = 'RELEASE'
# How all begin that are no press.
NO_PRESS = (f'{HELD}+', f'{RELEASE}+')
# How often it is told that a key is still down, where its release is told [s].
HELD_PERIOD = 0.1
# Repeats of a key that is held, as keyboards send them [Hz].
REPEAT_RATE = 30.0

# Names for characters that a file format cannot hold as themselves.
ALIASES = {'SPACE': ' '}


def split_event(name: str) -> tuple[str, str]:
    """Return what a name tells, HELD, RELEASE or '' for a press, and of which key."""
    for start in NO_PRESS:
        if name.startswith(start) and len(name) > len(start):
            key = name[len(start) :]
            return start[:-1], ALIASES.get(key, key)
    return '', name


def with_event(event: str, key: str) -> str:
    """Return the name of a message that tells HELD or RELEASE of a key."""
    return f'{event}+{"SPACE" if key == " " else key}'


def is_press(key: str) -> bool:
    """Return whether a message on `keys` is a press, not the HELD or RELEASE of one."""
    return bool(key) and not split_event(key)[0]
