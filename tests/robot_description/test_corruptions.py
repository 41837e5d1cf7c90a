# SPDX-License-Identifier: Apache-2.0
"""Lint of good files with a random fault in them: it says what it says, and never breaks."""

from pathlib import Path
import random
import re
import shutil

from cases import for_all
import pytest
from robot_description.describe_command import main
from robot_description.packages import description_path, share_directory

pytestmark = pytest.mark.slow

EXAMPLES = share_directory('example-robot-data') / 'robots'
FILES = (
    description_path('go2'),
    description_path('mbot'),
    EXAMPLES / 'a1_description/urdf/a1.urdf',
    EXAMPLES / 'ur_description/urdf/ur5_robot.urdf',
    EXAMPLES / 'hyq_description/robots/hyq_no_sensors.urdf',
    EXAMPLES / 'panda_description/urdf/panda.urdf',
)
ROUNDS = 9  # of each file: 54 in all
# What is put in the place of something else.
BITS = (
    *(
        '',
        '"',
        '<',
        '>',
        '</robot>',
        '<link/>',
        '<joint name="a"/>',
        '&x;',
        '\0',
        '\xe9',
        '$',
        '${',
        '}',
    ),
    *(
        '${1/0}',
        '${nope}',
        '$(arg nope)',
        '$(find nope)',
        'nan',
        '1e999',
        '-1',
        '0',
        'one',
        '1 2',
        ' ',
    ),
    *('<xacro:nope/>', '<!--', '-->', '<?', ']]>', '<![CDATA[', '\ufeff', '\n' * 3, 'name="a"'),
)


def corrupt(data: bytes, chance: random.Random) -> bytes:
    """Return a text with one fault: bytes, a value, a tag or a line changed, lost or doubled."""
    how = chance.randrange(6)
    if how == 0:
        at = chance.randrange(len(data))
        return data[:at] + chance.randbytes(chance.randrange(3)) + data[at + chance.randrange(9) :]
    if how == 1:
        return data[: chance.randrange(len(data))]
    if how == 2:
        lines = data.splitlines(keepends=True)
        first, second = chance.randrange(len(lines)), chance.randrange(len(lines))
        lines[first] = lines[second] * chance.randrange(3)
        return b''.join(lines)
    pattern = {3: rb'"[^"]*"', 4: rb'<[^>]*>', 5: rb'[-\d.]+'}[how]
    found = chance.choice(list(re.finditer(pattern, data)))
    bit = chance.choice(BITS).encode()
    if how == 3:
        bit = b'"' + bit + b'"'
    return data[: found.start()] + bit + data[found.end() :]


@for_all('source', FILES)
def test_lint_of_a_corrupted_file_is_lines(source: Path, tmp_path: Path, capsys) -> None:
    chance = random.Random(source.name)
    for round_ in range(ROUNDS):
        folder = tmp_path / str(round_) / 'urdf'
        shutil.copytree(source.parent, folder)
        changed = chance.choice(sorted(folder.glob('*.xacro')) or [folder / source.name])
        changed.write_bytes(corrupt(changed.read_bytes(), chance))
        status = main(['lint', str(folder / source.name)])
        said, errors = capsys.readouterr()
        assert status in (0, 1), (changed, errors)
        assert errors == ''
        for line in said.splitlines():
            assert re.match(
                r'\S+:\d+: (error|warning|info): .*\[[a-z-]+\]; cure: |.*: no findings$', line
            )
        assert (status == 1) == (': error: ' in said)
