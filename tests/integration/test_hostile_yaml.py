# SPDX-License-Identifier: Apache-2.0
"""Whatever YAML says, everything that reads it says what is wrong in one line, soon."""

from collections.abc import Callable
from pathlib import Path
import time

from cases import for_all
from diff_drive_sim.controller_file import read_controller_file
import pytest
from robot_description.xacro.session import expand_document
from teleop_keyboard.keymap_file import load_preset
from wasd_core.errors import UserError

LAUGHS = 'a: &a [x,x,x,x,x,x,x,x,x]\n' + ''.join(
    f'{chr(98 + i)}: &{chr(98 + i)} [{",".join(["*" + chr(97 + i)] * 9)}]\n' for i in range(8)
)
HOSTILE = {
    'within itself': 'a: &a [*a]\n',
    'merged into itself': 'a: &a {<<: *a}\n',
    'open lists': '[' * 5000,
    'lists': '[' * 5000 + ']' * 5000,
    'mappings': '{a: ' * 3000 + '1' + '}' * 3000,
    'dashes': '- ' * 3000 + 'x',
    'deep': '\n'.join(' ' * i + 'a:' for i in range(400)),
    'billion laughs': LAUGHS,
    'huge text': 'a: ' + 'x' * 2_000_000,
    'huge number': 'wheel_separation: ' + '9' * 90_000,
    'sixties': 'wheel_separation: 1:' + '1:' * 40_000 + '1\n',
    'no date': 'wheel_separation: 9999-99-99\n',
    'code': '!!python/object/apply:os.system ["true"]\n',
    'code within': 'wheel_separation: !!python/object/apply:os.system ["true"]\n',
    'list': '- a\n- b\n',
    'text': 'hello\n',
    'twice': 'a: 1\na: 2\n',
    'two documents': 'a: 1\n---\nb: 2\n',
    'control characters': 'a: \x00\x1b\n',
    'lists as names': '? [a, b]\n: c\n',
    'binary': bytes(range(256)) * 10,
    'utf-16': 'help: a\n'.encode('utf-16'),
}
# What is plain YAML to a xacro file that loads it.
HARMLESS_VALUES = ('list', 'text', 'twice', 'sixties')


def load_in_xacro(path: str) -> None:
    file = Path(path).with_suffix('.xacro')
    file.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="p" '
        f'value="${{xacro.load_yaml(\'{path}\')}}"/><link name="${{str(p)[:1]}}"/></robot>'
    )
    expand_document(file)


READERS: dict[str, Callable[[str], object]] = {
    'keymap': load_preset,
    'controller': read_controller_file,
    'xacro': load_in_xacro,
}


@pytest.mark.slow
@for_all('reader', READERS)
@for_all('name', HOSTILE)
def test_hostile_yaml_is_one_line_soon(tmp_path: Path, reader: str, name: str) -> None:
    if reader == 'xacro' and name in HARMLESS_VALUES:
        return  # harmless here
    text = HOSTILE[name]
    path = tmp_path / 'file.yaml'
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    started = time.process_time()
    with pytest.raises(UserError) as caught:
        READERS[reader](str(path))
    assert time.process_time() - started < 2.0
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < 1000
    assert 'file.' in str(caught.value)


@for_all('reader', ['keymap', 'controller'])
def test_a_file_without_end_is_not_read_to_its_end(tmp_path: Path, reader: str) -> None:
    (tmp_path / 'file.yaml').symlink_to('/dev/zero')
    with pytest.raises(UserError, match=r'file\.yaml'):
        READERS[reader](str(tmp_path / 'file.yaml'))
