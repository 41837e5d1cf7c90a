# SPDX-License-Identifier: Apache-2.0
"""Files of anything: what reads parameters or keys loads one, or refuses it in one line."""

from collections.abc import Callable, Mapping
from dataclasses import Field
from importlib import resources
from pathlib import Path
import random
from typing import Any

from diff_drive_sim.controller_file import KIND as WHEELS
from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.parameters import DiffDriveParameters
import pytest
from quadruped_sim.parameters import LegNodeParameters
from teleop_keyboard.keymap_file import load_preset
from wasd_core.errors import UserError
from wasd_core.parameters import known_parameters, numeric_ends, Parameters

FILES = 400  # of each reader
# Scalars as people and other programs write them, and as nobody should.
SCALARS = (
    *('0', '1', '-1', '0.3', '1e-3', '0x1F', '0o17', '1_000', '1:30', '+.5', '0,5', '1e400'),
    *('.inf', '-.Inf', '.nan', 'nan', 'inf', '5e-324', '1' * 5000, '-' + '9' * 400, '1e999999999'),
    *('true', 'yes', 'off', '~', 'null', '""', "''", 'x', 'trot', '"\\x00"', '"\\uD800"', 'é☃'),
    *('2020-13-45', '2020-01-01', '2020-01-01 00:00:00 +99:99', '"a\\nb"', '"' + 'y' * 3000 + '"'),
    *('!!float x', '!!int 1.5', '!!python/object/apply:os.system [ls]', '!!binary "~"', '!own 1'),
    *('!!set {a, b}', '!!omap [a: 1]', '!!pairs [a: 1]', '!!timestamp x', '!!bool maybe', '!!str'),
    *('[]', '[1, x, .nan]', '[[1], [2]]', '{}', '{a: {b: 1}}', '[1, 2', '{a: 1', '"open', "'open"),
    *(
        '&a [*a]',
        '*missing',
        '&b 1',
        '*b',
        '<<',
        '|',
        '>-',
        '@x',
        '`x',
        '%x',
        '? x',
        '- - 1',
        ': :',
    ),
    *('[' * 60 + ']' * 60, '{a: ' * 60 + '1' + '}' * 60, '[1, 2, 3, 4, 5, 6, 7, 8, 9]'),
)
KEYS = (
    *(
        '',
        '1',
        '1.5',
        'null',
        'true',
        '[a]',
        '{a: 1}',
        '? [a, b]',
        '<<',
        '"\\0"',
        'ros__parameters',
    ),
    *(
        '/**',
        '.',
        '..',
        'gait.',
        '.gait',
        'gait..x',
        'x' * 500,
        'é',
        '-',
        '---',
        '...',
        '%YAML 9.9',
    ),
)
# What is done to a whole text.
SPOILS: tuple[Callable[[str, random.Random], str], ...] = (
    lambda text, _: '\ufeff' + text,
    lambda text, _: text.replace('\n', '\r\n'),
    lambda text, _: text.replace('\n', '\r'),
    lambda text, _: text.replace('  ', '\t'),
    lambda text, _: text + '---\n' + text,
    lambda text, chance: text[: chance.randint(0, len(text))],
    lambda text, chance: ''.join(chance.sample(text, len(text))),
    lambda text, chance: text.replace(': ', ':', chance.randint(1, 3)),
    lambda text, _: '\n'.join(reversed(text.splitlines())),
    lambda text, _: text.replace(':', '\0', 1),
    lambda text, _: 'a: &a [1, 1]\n' + ''.join(f'a{n}: &a [*a, *a]\n' for n in range(40)) + text,
)


def legal(field: 'Field[Any]', chance: random.Random) -> str:
    """Return a value in a parameter's range, as a file has it."""
    default, (low, high) = field.default, numeric_ends(field)
    if isinstance(default, bool):
        return chance.choice(('true', 'false'))
    if isinstance(default, (int, float)):
        return str((chance.randint if isinstance(default, int) else chance.uniform)(low, high))
    if isinstance(default, str):
        return chance.choice(tuple(field.metadata['choices']) or (default or '""',))
    is_text = not all(isinstance(item, float) for item in default)
    ends = () if is_text else zip(low, high, strict=True)
    return str([chance.uniform(*pair) for pair in ends])


def random_text(definition: type[Parameters], node: str, chance: random.Random) -> str:
    """Return a file that gives some of these parameters, or what looks like it."""
    known, lines = known_parameters(definition), []
    is_fair = chance.random() < 0.5
    for name in chance.sample(sorted(known), chance.randint(0, 8)):
        value = legal(known[name].field, chance)
        if not is_fair and chance.random() < 0.3:
            value = chance.choice(SCALARS)
        if not is_fair and chance.random() < 0.2:
            name = chance.choice((*KEYS, ''.join(chance.sample(name, len(name)))))
        if '.' in name and chance.random() < 0.3:
            group, _, name = name.partition('.')
            lines.append(f'{group}:')
            name = f'  {name}'
        lines.append(f'{name}: {value}')
    if chance.random() < 0.3:
        head = chance.choice((node, '/**', f'/robot/{node}', 'other', '1', '[a]'))
        lines = [f'{head}:', '  ros__parameters:', *(f'    {line}' for line in lines)]
    text = '\n'.join(lines) + '\n'
    return chance.choice(SPOILS)(text, chance) if chance.random() < 0.3 else text


def preset_text(chance: random.Random) -> str:
    """Return a preset of ours with a line or two that are anything."""
    preset = chance.choice(('mbot', 'wasd', 'go2'))
    lines = resources.files('teleop_keyboard').joinpath(f'presets/{preset}.yaml').read_text()
    kept = lines.splitlines()
    for _ in range(chance.randint(1, 2)):
        at = chance.randrange(len(kept))
        key = kept[at].partition(':')[0] if chance.random() < 0.8 else chance.choice(KEYS)
        kept[at] = f'{key}: {chance.choice(SCALARS)}'
    text = '\n'.join(kept) + '\n'
    return chance.choice(SPOILS)(text, chance) if chance.random() < 0.2 else text


# Of each reader: what makes a text, and what reads it.
READERS: Mapping[str, tuple[Callable[[random.Random], str], Callable[[str], Any]]] = {
    'legs': (
        lambda chance: random_text(LegNodeParameters, 'leg_controller', chance),
        LegNodeParameters.from_file,
    ),
    'wheels': (
        lambda chance: random_text(DiffDriveParameters, WHEELS.name, chance),
        read_controller_file,
    ),
    'keys': (preset_text, load_preset),
}


def try_files(kind: str, seeds: range, folder: Path) -> int:
    """Return how many files of random text load; every other is refused in one short line."""
    make, read = READERS[kind]
    path, loaded = folder / 'drawn.yaml', 0
    for seed in seeds:
        path.write_bytes(make(random.Random(seed)).encode('utf-8', 'surrogatepass'))
        try:
            read(str(path))
            loaded += 1
        except UserError as error:
            line = str(error)
            assert line.isprintable(), (seed, line)
            assert len(line) < 400, (seed, line)
            assert str(path) in line, (seed, line)
    return loaded


@pytest.mark.slow
@pytest.mark.parametrize('kind', READERS)
def test_a_file_of_anything_loads_or_is_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    assert 0 < try_files(kind, range(FILES), tmp_path) < FILES
