# SPDX-License-Identifier: Apache-2.0
"""Outputs: the old file or the new one, links followed, devices and pipes written to."""

import errno
import os
from pathlib import Path
import resource
import stat
import subprocess
import sys
import threading
import time
from unittest.mock import Mock

from cases import for_all
import pytest
from terminals import PATIENCE
from wasd_core.errors import attempt_all, UserError
from wasd_core.output_file import check_apart, OutputError, OutputFile

from wasd_core import output_file

# Writes for as long as it lives.
WRITER = """
import sys
from wasd_core.output_file import OutputFile
number = 0
while True:
    OutputFile(sys.argv[1], '--report').write(str(number % 10).encode() * 2_000_000)
    number += 1
    print(flush=True)
"""


def output(path: Path, option: str = '--report') -> OutputFile:
    return OutputFile(path, option)


def test_a_new_file_has_the_mode_of_any_new_file_and_leaves_nothing_beside_it(tmp_path):
    umask = os.umask(0o027)
    try:
        output(tmp_path / 'new').write(b'text')
    finally:
        os.umask(umask)
    assert (tmp_path / 'new').read_bytes() == b'text'
    assert stat.S_IMODE((tmp_path / 'new').stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ['new']


def test_a_file_that_is_replaced_keeps_its_mode(tmp_path):
    path = tmp_path / 'old'
    path.write_text('old and longer')
    path.chmod(0o604)
    output(path).write(b'new')
    assert path.read_text() == 'new'
    assert stat.S_IMODE(path.stat().st_mode) == 0o604


def test_links_are_followed_and_stay_links(tmp_path):
    (tmp_path / 'far').mkdir()
    (tmp_path / 'link').symlink_to('other')
    (tmp_path / 'other').symlink_to('far/file')
    output(tmp_path / 'link').write(b'text')
    assert (tmp_path / 'far' / 'file').read_bytes() == b'text'
    assert (tmp_path / 'link').is_symlink()
    assert (tmp_path / 'other').is_symlink()


def test_until_it_is_written_the_old_file_is_there(tmp_path):
    path = tmp_path / 'old'
    path.write_text('old')
    output(path)
    assert path.read_text() == 'old'
    assert os.listdir(tmp_path) == ['old']


@pytest.mark.parametrize(
    ('fault', 'seen'),
    [
        (KeyboardInterrupt(), KeyboardInterrupt),
        (OSError(errno.ENOSPC, 'No space left on device'), OutputError),
    ],
)
def test_what_breaks_off_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch, fault, seen):
    path = tmp_path / 'old'
    path.write_text('old')
    with monkeypatch.context() as patch, pytest.raises(seen):
        patch.setattr('wasd_core.output_file.os.write', Mock(side_effect=fault))
        output(path).write(b'new')
    assert path.read_text() == 'old'
    assert os.listdir(tmp_path) == ['old']


@pytest.mark.slow
def test_killed_at_any_moment_it_leaves_a_whole_file(tmp_path):
    path = tmp_path / 'file'
    for _ in range(10):
        process = subprocess.Popen(
            [sys.executable, '-c', WRITER, str(path)], stdout=subprocess.PIPE
        )
        process.stdout.readline()
        time.sleep(0.02)
        process.kill()
        process.communicate()
        data = path.read_bytes()
        assert data == data[:1] * 2_000_000


def test_a_device_is_written_to_and_stays_a_device(tmp_path):
    path = tmp_path / 'null'
    try:
        os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 3))
        path.write_bytes(b'')
    except PermissionError:
        pytest.skip('may not make device nodes')
    output(path).write(b'text')
    assert stat.S_ISCHR(path.stat().st_mode)
    assert os.listdir(tmp_path) == ['null']


def test_a_file_that_grows_has_whole_lines_after_a_full_disk_too(tmp_path):
    file = output(tmp_path / 'drive.keys', '--save-keys')
    file.begin(b'0.0 w\n')
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
    try:
        with pytest.raises(OutputError, match='^--save-keys .*drive.keys: File too large$'):
            file.append(b'1.25 SPACE\n')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.path.read_bytes() == b'0.0 w\n'
    file.append(b'2.0 s\n')
    file.close()
    assert file.path.read_bytes() == b'0.0 w\n2.0 s\n'


def test_a_full_device_is_one_line():
    full = output(Path('/dev/full'))
    with pytest.raises(OutputError, match='^--report /dev/full: No space left on device$'):
        full.write(b'text')


def test_a_pipe_gets_everything_also_when_its_reader_comes_later(tmp_path):
    path = tmp_path / 'pipe'
    os.mkfifo(path)
    read = []

    def reader():
        time.sleep(0.3)
        read.append(path.read_bytes())

    thread = threading.Thread(target=reader)
    thread.start()
    data = os.urandom(1_000_000)
    output(path).write(data)
    thread.join(PATIENCE)
    assert read == [data]
    assert stat.S_ISFIFO(path.stat().st_mode)


def test_a_pipe_that_nobody_reads_is_said_in_time(tmp_path, monkeypatch):
    monkeypatch.setattr(output_file, 'PATIENCE', 0.3)
    path = tmp_path / 'pipe'
    os.mkfifo(path)
    with pytest.raises(OutputError, match='nobody reads'):
        output(path)
    standing_still = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        pipe = output(path)
        with pytest.raises(OutputError, match='nobody reads'):
            pipe.write(bytes(1_000_000))
    finally:
        os.close(standing_still)


def test_a_reader_that_has_gone_is_one_line(tmp_path):
    path = tmp_path / 'pipe'
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    pipe = output(path)
    os.close(reader)
    with pytest.raises(OutputError, match='Broken pipe'):
        pipe.write(b'text')


@pytest.mark.slow
@pytest.mark.parametrize('name', ['/dev/stdout', '/dev/fd/1', '/proc/self/fd/1', 'link'])
def test_standard_output_is_written_to_where_it_stands(tmp_path, name):
    (tmp_path / 'link').symlink_to('/dev/stdout')
    code = (
        'import sys\nfrom wasd_core.output_file import OutputFile\n'
        'print("before", flush=True)\nfile = OutputFile(sys.argv[1], "--report")\n'
        'file.write(b"data\\n")\nprint("after", file.is_standard_output)'
    )
    # To a file: a second opening would write over what stands there, or replace it.
    with open(tmp_path / 'printed', 'w') as printed:
        subprocess.run(
            [sys.executable, '-c', code, name], cwd=tmp_path, stdout=printed, check=True
        )
    assert (tmp_path / 'printed').read_text() == 'before\ndata\nafter True\n'


@for_all(
    ('name', 'reason'),
    [
        ('.', 'wanted a file in a folder that exists'),
        ('gone/file', 'wanted a file in a folder that exists'),
        ('', 'wanted a file in a folder that exists'),
        ('loop', 'Too many levels of symbolic links'),
        ('x' * 300, 'File name too long'),
        ('file/below', 'Not a directory'),
    ],
)
def test_what_cannot_be_written_is_said_before(tmp_path, monkeypatch, name, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'loop').symlink_to('loop')
    (tmp_path / 'file').write_text('')
    with pytest.raises(OutputError) as caught:
        OutputFile(name, '--record')
    assert str(caught.value).startswith('--record')
    assert str(caught.value).endswith(f': {reason}')
    assert sorted(os.listdir(tmp_path)) == ['file', 'loop']


def test_one_file_under_two_names_is_refused(tmp_path):
    (tmp_path / 'file').write_text('')
    os.link(tmp_path / 'file', tmp_path / 'hard')
    (tmp_path / 'soft').symlink_to('file')
    (tmp_path / 'to_be').symlink_to('new')
    for one, other in [
        ('file', './file'),
        ('file', 'hard'),
        ('file', 'soft'),
        ('new', '../' + tmp_path.name + '/new'),
        ('new', 'to_be'),
    ]:
        paths = tmp_path / one, f'{tmp_path}/{other}'
        outputs = [OutputFile(paths[0], '--report'), OutputFile(paths[1], '--record')]
        with pytest.raises(OutputError, match='--record .* is the same file as --report '):
            check_apart(outputs, [])
        with pytest.raises(OutputError, match='--report .* is the same file as --play '):
            check_apart(outputs[:1], [('--play', paths[1])])
    check_apart([output(tmp_path / 'file'), output(tmp_path / 'new')], [('--play', 'x')])
    check_apart([output(Path('/dev/null')), output(Path('/dev/null'))], [('--play', '/dev/null')])


def test_what_fails_takes_nothing_else_with_it():
    done = []

    def fail(reason):
        raise UserError(reason)

    with pytest.raises(UserError) as caught:
        attempt_all(lambda: fail('a'), lambda: done.append(1), lambda: fail('b'))
    assert str(caught.value) == 'a\nerror: b'
    with pytest.raises(KeyError):
        attempt_all(lambda: {}['x'], lambda: done.append(2))
    assert done == [1, 2]
