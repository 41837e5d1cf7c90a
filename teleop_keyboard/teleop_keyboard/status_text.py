# SPDX-License-Identifier: Apache-2.0
"""What is told of a robot that is driven, in the order of its importance, and as one line."""

from typing import NamedTuple

from wasd_core.timing import brief

GAP = '  '


class Status(NamedTuple):
    """
    What a driver wants to see of one robot.

    `state` is always shown, `message` (what to press) next, `facts` where there is room: the last
    is left out last.
    """

    state: str
    facts: tuple[str, ...] = ()
    message: str = ''


def status_line(status: Status, clock: str, width: int) -> str:
    """
    Return all of it in one line no wider than `width` columns.

    State and clock are there in every width in which they fit. A message is shortened to what
    is to be done, then makes facts give way, and only then is cut.
    """
    for facts, message in _shorter_and_shorter(status):
        line = GAP.join(filter(None, (status.state, *facts, clock, message)))
        if len(line) <= width:
            return line
    return line[:width]


def _shorter_and_shorter(status: Status) -> list[tuple[tuple[str, ...], str]]:
    """Return facts and message in ever fewer words."""
    facts, message, short = status.facts, status.message, brief(status.message)
    fewer = [(facts[start:], short) for start in range(len(facts) + 1)]
    return [(facts, message), *fewer]
