# SPDX-License-Identifier: Apache-2.0
"""One thing that is wrong with a description, and where."""

from typing import NamedTuple

from wasd_core.safe_files import Place

from robot_description.lint.rules import Rule
from robot_description.lint.rules import RULES
from robot_description.lint.rules import Severity


class Finding(NamedTuple):
    """A rule that a description breaks, the line, and in particular what and how to cure it."""

    rule: Rule
    place: Place
    message: str
    cure: str

    @property
    def is_error(self) -> bool:
        """Whether it is an error."""
        return self.rule.severity is Severity.ERROR

    def line(self) -> str:
        """Return it in one line, as compilers print it."""
        rule = self.rule
        return f'{self.place}: {rule.severity}: {self.message} [{rule.code}]; cure: {self.cure}'

    def record(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return {
            'code': self.rule.code,
            'severity': str(self.rule.severity),
            'file': str(self.place.file),
            'line': self.place.line,
            'message': self.message,
            'cure': self.cure,
        }


def finding(code: str, place: Place, message: str, cure: str | None = None) -> Finding:
    """Return a finding of a rule; `cure` is the rule's unless something better is known."""
    rule = RULES[code]
    return Finding(rule, place, ' '.join(message.split()), cure or rule.cure)
