# SPDX-License-Identifier: Apache-2.0
"""Command lines: a parser whose errors are one line, and programs that run a node."""

import argparse
from collections.abc import Callable, Iterator, Sequence
import dataclasses
from dataclasses import dataclass
from importlib import import_module
import os
import shutil
import sys
import textwrap
from typing import Any, NoReturn

from wasd_core.errors import UserError
from wasd_core.loading import loading
from wasd_core.network import check_middleware
from wasd_core.parameters import as_given, describe_range, known_parameters
from wasd_core.shared_memory import look_before_ros


class OneLineParser(argparse.ArgumentParser):
    """
    An argparse parser, and of its commands, that raises instead of printing its usage.

    `place_of(word)` says whose option a word is that is unknown here, '' if nobody's.
    """

    place_of: Callable[[str], str] = staticmethod(lambda word: '')

    def error(self, message: str) -> NoReturn:
        """
        Refuse the command line.

        Raises:
            UserError: always; its text names the help that tells more.
        """
        raise UserError(f'{message} (see: {self.prog} --help)')

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse what is not known here: to whom a command leaves it, its help is not named."""
        known, rest = super().parse_known_args(args, namespace)
        if rest:
            places = filter(None, (self.place_of(word.partition('=')[0]) for word in rest))
            self.error('; '.join([*places, f'unrecognized arguments: {" ".join(rest)}']))
        return known, rest


# No help is wider than one can read.
WIDEST = 100
INDENT = '    '
ROS_WORDS = '--ros-args'
END_OF_ROS_WORDS = '--'


@dataclass(frozen=True, kw_only=True)
class Executable:
    """
    One of a package's programs, before anything heavy is imported; called, it runs.

    `module` has the class of its `node`, which `joins` the run that is there (see `init_ros`); or
    a `main` that runs it. `parameters` names the definitions of its parameters, as `module:Class`;
    `notes` tell what no definition holds. `takes_keys` is for programs that read a keyboard and
    can save what was pressed.
    """

    name: str
    module: str
    about: str
    example: str
    node: str = ''
    joins: bool = False
    parameters: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    takes_keys: bool = False

    def __call__(self, words: Sequence[str] | None = None) -> int:
        """Answer --help and unknown words at once, else run; return the exit status."""
        words = list(sys.argv[1:] if words is None else words)
        try:
            self.read(words)
            check_middleware(os.environ)
            look_before_ros()
        except UserError as error:
            print(f'error: {error}', file=sys.stderr)
            return 2
        with loading():
            program = import_module(self.module)
        status: int
        if self.node:
            run_node = import_module('wasd_core.node').run_node
            status = run_node(getattr(program, self.node), words, joins=self.joins)
        else:
            status = program.main(words)
        return status

    def read(self, words: Sequence[str]) -> argparse.Namespace:
        """
        Return the options; `ros` are the words for ROS. On --help print it and raise SystemExit.

        Raises:
            UserError: a word that neither we nor ROS know, in one line.
        """
        own, ros = split_ros_words(words)
        parser = self._parser(is_asked={'-h', '--help'} & set(own) != set())
        given = parser.parse_args(own)
        given.ros = ros
        return given

    def _parser(self, is_asked: bool) -> OneLineParser:
        """Return the parser; the definitions are looked up only for a help that is asked for."""
        parser = OneLineParser(
            prog=self.name,
            usage=f'%(prog)s [-h]{" [--save-keys FILE]" * self.takes_keys} [{ROS_WORDS} ...]',
            description=self.about,
            epilog='\n'.join(self._epilog()) if is_asked else None,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        if self.takes_keys:
            parser.add_argument(
                '--save-keys', metavar='FILE', help='write a key script, as --play reads'
            )
        return parser

    def _epilog(self) -> Iterator[str]:
        width = min(shutil.get_terminal_size().columns, WIDEST)
        if self.parameters:
            yield f'parameters ({ROS_WORDS} -p NAME:=VALUE; live: can be set while it runs):'
        for name in self.parameters:
            module, _, definition = name.partition(':')
            known = known_parameters(getattr(import_module(module), definition))
            for outward, (field, _) in known.items():
                live = '' if field.metadata['read_only'] else ', live'
                yield f'  {outward}  ({written(field.default)}{live})'
                yield textwrap.indent(textwrap.fill(_meaning(field), width - len(INDENT)), INDENT)
        yield from self.notes
        yield ''
        yield 'topics and services: docs/topics.md, or while it runs: wasd topics -t'
        yield 'example:'
        yield f'  {self.example}'


def split_ros_words(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words for us, and those for ROS: each --ros-args up to a `--`."""
    own: list[str] = []
    ros: list[str] = []
    is_ros = False
    for word in words:
        is_ros = is_ros or word == ROS_WORDS
        (ros if is_ros else own).append(word)
        is_ros = is_ros and word != END_OF_ROS_WORDS
    return own, ros


def written(value: Any) -> str:
    """Return a default as it is written on a command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f'[{", ".join(map(written, value))}]'
    return repr(value) if value == '' else f'{value}'


def _meaning(field: 'dataclasses.Field[Any]') -> str:
    """Return what a parameter means, with its choices or its range."""
    meta = as_given(field.metadata)
    text: str = meta['doc']
    if meta['choices']:
        text += f' ({", ".join(word for word in meta["choices"])})'
    elif isinstance(field.default, (int, float)) and not isinstance(field.default, bool):
        text += f' ({describe_range(meta)})'
    return text
