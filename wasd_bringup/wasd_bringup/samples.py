# SPDX-License-Identifier: Apache-2.0
"""The samples of a report: kept in temporary files, so that a long run takes no more memory."""

from collections.abc import Iterator, Mapping
import contextlib
import json
import tempfile
from typing import Any

from wasd_bringup.errors import UsageError

# Bytes that are copied at a time.
PIECE = 1 << 20


class Samples(Mapping[str, list[Any]]):
    """
    Columns of values that JSON knows; reads like a dictionary of lists, made anew at each look.

    The files have no names, so that nothing is left behind, however the process ends.
    """

    def __init__(self, columns: tuple[str, ...]) -> None:
        self._files = {name: tempfile.TemporaryFile() for name in columns}  # noqa: SIM115
        self._count = 0

    def add(self, row: Mapping[str, Any]) -> None:
        """
        Add a value to each column.

        Raises:
            UsageError: the folder for temporary files is full, or the like.
        """
        separator = ', ' if self._count else ''
        self._count += 1
        try:
            for name, file in self._files.items():
                file.write(f'{separator}{json.dumps(row[name])}'.encode())
        except OSError as error:
            folder = tempfile.gettempdir()
            raise UsageError(f'{folder}: no room for a report: {error.strerror}') from None

    def json_pieces(self) -> Iterator[bytes]:
        """Yield the bytes that json.dumps would make of the columns."""
        for index, (name, file) in enumerate(self._files.items()):
            yield f'{", " if index else "{"}{json.dumps(name)}: ['.encode()
            file.seek(0)
            while piece := file.read(PIECE):
                yield piece
            yield b']'
        yield b'}'

    def __getitem__(self, name: str) -> list[Any]:
        """Return a column."""
        file = self._files[name]
        file.seek(0)
        values: list[Any] = json.loads(b'[' + file.read() + b']')
        return values

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over the columns' names."""
        return iter(self._files)

    def __len__(self) -> int:
        """Return how many columns there are."""
        return len(self._files)

    def close(self) -> None:
        """Forget everything."""
        for file in self._files.values():
            with contextlib.suppress(OSError):  # what was kept back does not fit
                file.close()
