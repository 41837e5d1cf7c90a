# SPDX-License-Identifier: Apache-2.0
"""Keys that were pressed before anybody listened."""

from collections import deque

# A key that names a state (of the Go2: 2 stands) means the same when it comes late [s]; longer,
# and whoever pressed it has given up or pressed another.
STATE_LIFETIME = 10.0
# Any other may move the robot: it counts while the finger may still be on it [s].
LIFETIME = 0.5
# More are not kept: the oldest go.
LIMIT = 20


class WaitingKeys:
    """Keeps keys, in order, until somebody listens or they are too old; reads no clock."""

    def __init__(self) -> None:
        self._keys: deque[tuple[str, float]] = deque(maxlen=LIMIT)

    def put(self, key: str) -> None:
        """Keep a key; what tells that one is down or was released is about now alone."""
        if not key.startswith(('HELD+', 'RELEASE+')):
            self._keys.append((key, 0.0))

    def step(self, dt: float) -> list[str]:
        """Let `dt` [s] pass; return the keys that are now too old."""
        older = [(key, age + max(dt, 0.0)) for key, age in self._keys]
        self._keys = deque((pair for pair in older if pair[1] <= _lifetime(pair[0])), LIMIT)
        return [key for key, age in older if age > _lifetime(key)]

    def take(self) -> list[str]:
        """Return what is kept, and forget it."""
        keys = [key for key, _ in self._keys]
        self._keys.clear()
        return keys

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._keys)


def _lifetime(key: str) -> float:
    return STATE_LIFETIME if key.isdecimal() else LIFETIME
