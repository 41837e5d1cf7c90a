# SPDX-License-Identifier: Apache-2.0
"""--report, --record, --save-keys: checked before the run; one takes no other with it."""

from collections.abc import Callable, Iterator
import json
import os
from pathlib import Path
import stat
import subprocess
import sys
import threading
from typing import Any

import pytest
from teleop_keyboard.key_script import parse_key_script
from terminals import PATIENCE
from wasd_bringup.tools.recording.reader import BagReader

pytestmark = pytest.mark.slow

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
KEYS = '0.1 i*6\n0.3 k\n'
RUN = ('mbot', '--play', 'keys', '--duration', '0.5', '--speed', '0')
NAMES = {'--report': 'run.json', '--record': 'run.mcap', '--save-keys': 'run.keys'}
EVERY = tuple(NAMES)


@pytest.fixture
def run(wasd: Any) -> Callable[..., Any]:
    """Return a function that runs mbot for half a second; it takes where outputs go."""
    (wasd.folder / 'keys').write_text(KEYS)

    def run(places: dict[str, str], **options: Any) -> 'subprocess.CompletedProcess[str]':
        words = [word for pair in places.items() for word in pair]
        done: subprocess.CompletedProcess[str] = wasd(*RUN, *words, **options)
        return done

    return run


def check(option: str, path: Path) -> None:
    """Check that an output is whole."""
    if option == '--report':
        assert len(json.loads(path.read_text())['samples']['t']) == 25
    elif option == '--record':
        counts = {topic.name: topic.messages for topic in BagReader(path).topics}
        assert (counts['/joint_states'], counts['/keys']) == (25, 7)
    else:
        assert [press.key for press in parse_key_script(path.read_text())] == ['i'] * 6 + ['k']


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    """Yield a folder on a disk that has no room left."""
    folder = tmp_path / 'full'
    folder.mkdir()
    size = ('-t', 'tmpfs', '-o', 'size=64k', 'none')
    if subprocess.run(['mount', *size, str(folder)], capture_output=True).returncode:
        pytest.skip('may not mount')
    try:
        for size in (65536, 4096, 1):
            file = os.open(folder / f'filler{size}', os.O_WRONLY | os.O_CREAT)
            try:
                while os.write(file, bytes(size)):
                    pass
            except OSError:
                pass
            os.close(file)
        yield folder
    finally:
        subprocess.run(['umount', str(folder)], check=True)


@pytest.mark.parametrize('option', EVERY)
def test_a_full_disk_costs_one_output_in_one_line(
    run: Callable[..., Any], tmp_path: Path, full_disk: Path, option: str
) -> None:
    lost = f'full/{NAMES[option]}'
    done = run({**NAMES, option: lost})
    assert (done.returncode, done.stderr) == (
        2,
        f'error: {option} {lost}: No space left on device\n',
    )
    assert not (tmp_path / lost).exists() or (tmp_path / lost).stat().st_size == 0
    # A recording or key script that breaks off ends the run: the others are short, but whole.
    others = {other: tmp_path / NAMES[other] for other in EVERY if other != option}
    if option == '--report':
        for other, path in others.items():
            check(other, path)
    elif option == '--record':
        assert json.loads(others['--report'].read_text())['schema'] == 1
        parse_key_script(others['--save-keys'].read_text())
    else:
        assert json.loads(others['--report'].read_text())['sim_time'] >= 0.1
        assert BagReader(others['--record']).topics


def test_all_that_fail_are_said_a_line_each(run: Callable[..., Any]) -> None:
    done = run(dict.fromkeys(NAMES, '/dev/full'))
    assert done.returncode == 2
    lines = [f'error: {option} /dev/full: No space left on device' for option in EVERY]
    said = done.stderr.splitlines()
    # A recording that breaks off ends the run, maybe before there is a key to save.
    assert set(lines[:2]) <= set(said) <= set(lines)
    assert len(said) == len(set(said))
    assert stat.S_ISCHR(os.stat('/dev/full').st_mode)


def test_keys_that_cannot_be_saved_end_the_run_in_one_line(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    done = run({**NAMES, '--save-keys': '/dev/full'})
    said = 'error: --save-keys /dev/full: No space left on device\n'
    assert (done.returncode, done.stderr) == (2, said)
    assert json.loads((tmp_path / NAMES['--report']).read_text())['sim_time'] < 0.2
    assert BagReader(tmp_path / NAMES['--record']).topics


@pytest.mark.parametrize('option', EVERY)
def test_a_folder_that_cannot_be_written_is_said_before_the_run(
    run: Callable[..., Any], tmp_path: Path, option: str
) -> None:
    folder = tmp_path / 'locked'
    folder.mkdir()
    mounted = os.geteuid() == 0
    if mounted:  # whom no mode keeps out
        command = ['mount', '-t', 'tmpfs', '-o', 'ro', 'none', str(folder)]
        if subprocess.run(command, capture_output=True).returncode:
            pytest.skip('may not mount')
    else:
        folder.chmod(0o555)
    reason = 'Read-only file system' if mounted else 'Permission denied'
    try:
        done = run({**NAMES, option: f'locked/{NAMES[option]}'})
    finally:
        if mounted:
            subprocess.run(['umount', str(folder)], check=True)
    said = f'error: {option} locked/{NAMES[option]}: {reason}\n'
    assert (done.returncode, done.stdout, done.stderr) == (2, '', said)
    assert sorted(os.listdir(tmp_path)) == ['keys', 'locked']


def test_links_and_devices_stay_what_they_are(run: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / 'far').mkdir()
    for name in NAMES.values():
        (tmp_path / 'far' / name).write_text('old')
        (tmp_path / name).symlink_to(f'far/{name}')
    done = run(NAMES)
    assert (done.returncode, done.stderr) == (0, '')
    for option, name in NAMES.items():
        assert (tmp_path / name).is_symlink()
        check(option, tmp_path / 'far' / name)
    device = tmp_path / 'device'
    try:
        os.mknod(device, 0o600 | stat.S_IFCHR, os.makedev(1, 3))
        device.write_bytes(b'')
    except PermissionError:
        pytest.skip('may not make device nodes')
    done = run(dict.fromkeys(NAMES, 'device'))
    assert (done.returncode, done.stderr) == (0, '')
    assert stat.S_ISCHR(device.stat().st_mode)


def test_pipes_get_the_same_as_files(run: Callable[..., Any], tmp_path: Path) -> None:
    read: dict[str, bytes] = {}
    threads = []
    for option, name in NAMES.items():
        os.mkfifo(tmp_path / name)

        def take(option: str = option, name: str = name) -> None:
            read[option] = (tmp_path / name).read_bytes()

        threads.append(threading.Thread(target=take))
        threads[-1].start()
    done = run(NAMES)
    assert (done.returncode, done.stderr) == (0, '')
    for thread in threads:
        thread.join(PATIENCE)
    for option, data in read.items():
        copy = tmp_path / f'copy_of_{NAMES[option]}'
        copy.write_bytes(data)
        check(option, copy)


def test_standard_output_takes_one_of_them_and_nothing_else(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    for option in ('--report', '--save-keys'):
        done = run({option: '/dev/stdout'})
        assert (done.returncode, '0.5 s simulated' in done.stderr) == (0, True)
        (tmp_path / 'printed').write_text(done.stdout)
        check(option, tmp_path / 'printed')
    # By itself, as its bytes are no text.
    with open(tmp_path / 'printed', 'wb') as printed:
        done = subprocess.run(
            [*WASD, *RUN, '--record', '/dev/stdout'],
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 0
    assert '0.5 s simulated' in done.stderr  # words go where data does not
    check('--record', tmp_path / 'printed')


def test_a_closed_standard_output_is_one_line_for_who_writes_there(
    run: Callable[..., Any], tmp_path: Path
) -> None:
    places = {**NAMES, '--record': '/dev/stdout'}
    words = ' '.join(word for pair in places.items() for word in pair)
    command = f'exec {" ".join(WASD)} {" ".join(RUN)} {words} >&-'
    done = subprocess.run(
        ['sh', '-c', command],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    said = 'error: --record /dev/stdout: Bad file descriptor\n'
    assert (done.returncode, done.stderr) == (2, said)
    assert os.listdir(tmp_path) == ['keys']


def test_a_closed_standard_output_costs_no_file(run: Callable[..., Any], tmp_path: Path) -> None:
    words = ' '.join(word for pair in NAMES.items() for word in pair)
    done = subprocess.run(
        ['sh', '-c', f'exec {" ".join(WASD)} {" ".join(RUN)} {words} >&-'],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, '')
    for option, name in NAMES.items():
        check(option, tmp_path / name)


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (('--record', 'x', '--report', './x'), '--report x: is the same file as --record x'),
        (('--save-keys', 'link'), '--save-keys link: is the same file as --play keys'),
        (('--twist', 'twist', '--report', 'twist'), 'the same file as --twist twist'),
        (('--controller', 'c.yaml', '--report', 'c.yaml'), 'the same file as --controller c.yaml'),
        (('--description', 'r.urdf', '--record', 'r.urdf'), 'same file as --description r.urdf'),
        (('--preset', 'k.yaml', '--report', 'hard.yaml'), 'the same file as --preset k.yaml'),
        (
            ('--report', 'c.yaml', '--ros-args', '--params-file', 'c.yaml'),
            'the same file as --params-file c.yaml',
        ),
    ],
)
def test_one_file_for_two_things_is_refused_before_anything_is_lost(
    run: Callable[..., Any], wasd: Any, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    files = ('twist', 'c.yaml', 'r.urdf', 'k.yaml')
    for name in files:
        (tmp_path / name).write_text('' if name == 'twist' else 'old')
    (tmp_path / 'link').symlink_to('keys')
    os.link(tmp_path / 'k.yaml', tmp_path / 'hard.yaml')
    done = wasd(*RUN, *words)
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert said in done.stderr
    assert (tmp_path / 'keys').read_text() == KEYS
    assert {(tmp_path / name).read_text() for name in files} == {'', 'old'}
    assert not (tmp_path / 'x').exists()


def test_what_cannot_be_loaded_leaves_the_files_of_the_last_run(
    run: Callable[..., Any], wasd: Any, tmp_path: Path
) -> None:
    for name in NAMES.values():
        (tmp_path / name).write_text('old')
    words = [word for pair in NAMES.items() for word in pair]
    (tmp_path / 'bad.urdf').write_text('<robot name="x"><link/></robot>')
    done = wasd(*RUN, '--description', 'bad.urdf', *words)
    assert (done.returncode, done.stderr.count('\n')) == (2, 1)
    assert {(tmp_path / name).read_text() for name in NAMES.values()} == {'old'}
