# SPDX-License-Identifier: Apache-2.0
"""Checks of the files as they were written, before xacro has them."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from wasd_core.safe_files import Place

from robot_description.lint.finding import Finding
from robot_description.lint.finding import finding
from robot_description.macro_calls import unprefixed_calls


def check_macro_calls(sources: Mapping[Path, bytes]) -> Iterator[Finding]:
    """Macros are called with their prefix, also from within macros and in included files."""
    for path, tag in unprefixed_calls(sources):
        text = f'<{tag.name}> calls a macro without xacro:, so it does nothing'
        cure = f'write <xacro:{tag.name}>; describe fix does it'
        yield finding('unprefixed-macro', Place(path, tag.line, tag.column), text, cure)
