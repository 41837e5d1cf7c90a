# SPDX-License-Identifier: Apache-2.0
"""What the mesh resolver did, for machines and in one line each for people."""

from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wasd_core.errors import DescriptionError

EXACT = 'exact'
MISSING = 'missing'
AMBIGUOUS = 'ambiguous'
# What was done to find a file, in words; several may come together, joined by '+'.
REPAIRS = {
    'own-package': 'its package is unknown, found in that of the description',
    'foreign-package': 'belongs to another robot: package.xml does not name that package',
    're-rooted': 'that path is of another machine, found in the package of the description',
    'package-root': 'not relative to the description, found relative to its package',
    'find-left': '$(find) was left in the text',
    'percent-escape': 'percent signs were meant as escapes',
    'case': 'upper and lower case differ',
    'extension': 'another file format is there',
    'moved': 'found in another folder of the package',
    'near-name': 'the only mesh not used otherwise whose name fits',
}


@dataclass(frozen=True)
class MeshRecord:
    """
    One mesh URL as one link uses it, and what came of it.

    `use` is `visual` or `collision`; `kind` is `exact`, `missing`, `ambiguous` or names of
    REPAIRS joined by `+`; `candidates` are the files among which could not be decided.
    """

    url: str
    link: str
    use: str
    kind: str
    file: Path | None = None
    candidates: tuple[Path, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Whether the file is where the URL says."""
        return self.kind == EXACT

    def line(self) -> str:
        """Return what happened in one line."""
        what = f'{self.use} mesh {self.url!r} of link {self.link!r}'
        if self.file is not None:
            reasons = '; '.join(REPAIRS[kind] for kind in self.kind.split('+') if kind in REPAIRS)
            return f'{what}: {self.kind}: using {self.file} ({reasons})'
        listed = ', '.join(str(path) for path in self.candidates) or 'none'
        shown = 'left out' if self.use == 'visual' else 'cannot be left out'
        return f'{what}: {self.kind}, {shown}; candidates: {listed}'

    def record(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        file = str(self.file) if self.file is not None else None
        return asdict(self) | {'file': file, 'candidates': [str(c) for c in self.candidates]}


@dataclass(frozen=True)
class MeshReport:
    """All mesh URLs of a description, each with its uses."""

    records: tuple[MeshRecord, ...] = ()

    @property
    def repairs(self) -> tuple[MeshRecord, ...]:
        """What was not exact, each URL once."""
        seen: dict[str, MeshRecord] = {}
        for record in self.records:
            if not record.is_exact:
                seen.setdefault(record.url, record)
        return tuple(seen.values())

    @property
    def files(self) -> dict[str, Path]:
        """The files that were found, by URL."""
        return {record.url: record.file for record in self.records if record.file is not None}

    def check(self, strict: bool = False) -> None:
        """
        Refuse what cannot be simulated, and with `strict` whatever is not exact.

        Raises:
            DescriptionError: the first mesh in question, and how many more there are.
        """
        wrong = [
            record
            for record in self.records
            if record.file is None and record.use == 'collision' or strict and not record.is_exact
        ]
        if wrong:
            raise DescriptionError(_first_of(wrong, strict))


def _first_of(records: Sequence[MeshRecord], strict: bool) -> str:
    rest = len({record.url for record in records}) - 1
    more = f' (and {rest} more)' if rest else ''
    return f'{"--strict: " if strict else ""}{records[0].line()}{more}'
