# SPDX-License-Identifier: Apache-2.0
"""
What is published works for a stranger: built, installed without a compiler, run by another user.

Downloads more than a gigabyte, so it is asked for: WASD_TEST_WHEELS=1. A folder of wheels that
`.ci/wheels` has filled may be named by WASD_WHEELS.
"""

import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import time
import urllib.request

import pytest
from source_trees import copy_checkout, ROOT

pytestmark = [
    pytest.mark.slow,
    pytest.mark.takes_up_to(3600.0),
    pytest.mark.skipif('WASD_TEST_WHEELS' not in os.environ, reason='WASD_TEST_WHEELS=1 asks'),
]
NOBODY = 65534
SYSTEM_PYTHON = '/usr/bin/python3'
WALK = ('--play', 'walk.keys', '--speed', '0', '--report', 'r.json')
# Not in a container: what a system is made of, and who uses it.
SYSTEM_STEPS = ('apt-get ', 'useradd ')


@pytest.fixture(scope='module')
def python() -> str:
    """A Python that every user may run, if there is one; the wheels are for its version."""
    command = [SYSTEM_PYTHON, '-I', '-c', 'import ensurepip, sys; print(sys.version_info[:2])']
    asked = subprocess.run(command, capture_output=True, text=True)
    is_fit = asked.stdout.strip() == str(sys.version_info[:2])
    return SYSTEM_PYTHON if is_fit else os.path.realpath(sys.executable)


@pytest.fixture(scope='module')
def wheels(tmp_path_factory: pytest.TempPathFactory, python: str) -> Path:
    """A folder with the wheels of this checkout."""
    if given := os.environ.get('WASD_WHEELS'):
        return Path(given)
    folder = tmp_path_factory.mktemp('wheels')
    subprocess.run([ROOT / '.ci/wheels', folder, python], check=True)
    return folder


@pytest.fixture(scope='module')
def installation(tmp_path_factory: pytest.TempPathFactory, wheels: Path, python: str) -> Path:
    """An environment into which they are installed, which has walked."""
    folder = tmp_path_factory.mktemp('opt') / 'wasd'
    smoke = subprocess.run([ROOT / '.ci/smoke', wheels, python, folder], capture_output=True)
    assert smoke.returncode == 0, smoke.stdout + smoke.stderr
    return folder


def test_what_is_built_is_what_an_index_takes(wheels: Path) -> None:
    names = sorted(path.name for path in wheels.iterdir())
    assert [name.split('-')[0] for name in names if 'wasd_robots' in name] == ['wasd_robots'] * 2
    assert any(re.match(r'wasd_interfaces-.*-manylinux_2_28_x86_64\.whl', name) for name in names)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root runs as somebody else')
def test_another_user_with_a_read_only_home_walks_and_hears_where_nothing_is_kept(
    installation: Path, tmp_path: Path
) -> None:
    home, temporary, work = (tmp_path / name for name in ('home', 'tmp', 'work'))
    for folder in (home, temporary, work):
        folder.mkdir()
    for folder in (temporary, work):
        os.chown(folder, NOBODY, NOBODY)
    home.chmod(0o555)
    # pytest's folders are closed to others.
    for folder in (tmp_path, *tmp_path.parents[:3], *installation.parents[:3]):
        folder.chmod(folder.stat().st_mode | 0o011)
    shutil.copy(ROOT / 'docs/examples/walk.keys', work)
    before = time.time()
    done = subprocess.run(
        [installation / 'bin/wasd', 'go2', *WALK],
        cwd=work,
        env={'HOME': str(home), 'TMPDIR': str(temporary), 'PATH': '/usr/bin:/bin'},
        user=NOBODY,
        group=NOBODY,
        extra_groups=(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads((work / 'r.json').read_text())['falls'] == 0
    said = (done.stdout + done.stderr).splitlines()
    assert len(said) <= 12
    (line,) = (line for line in said if 'caches are kept in' in line)
    assert f'{temporary}/wasd-{NOBODY}' in line
    assert f'{home}/.cache/wasd' in line
    assert not list(home.iterdir())
    files = (path for path in installation.rglob('*') if path.is_file())
    assert not [path for path in files if path.lstat().st_mtime > before]


def steps(kind: str) -> list[str]:
    """Return the steps of one kind of the Dockerfile."""
    text = (ROOT / 'Dockerfile').read_text()
    return re.findall(rf'^{kind} (.*)$', text, re.MULTILINE)


def test_the_steps_of_the_dockerfile_end_in_a_page_that_answers(
    wheels: Path, tmp_path: Path
) -> None:
    home = tmp_path / 'home'
    home.mkdir()
    moved = {'/wheels': str(wheels), '/opt/wasd': str(tmp_path / 'opt'), '/home/driver': str(home)}

    def here(step: str) -> str:
        return re.sub('|'.join(moved), lambda found: moved[found[0]], step)

    for step in steps('RUN'):
        if not step.startswith(SYSTEM_STEPS):
            subprocess.run(['sh', '-c', here(step)], cwd=home, env=bare(home), check=True)
    (entry,), words = (json.loads(steps(kind)[0]) for kind in ('ENTRYPOINT', 'CMD'))
    check_page([here(entry), *words], home, home)


def test_the_steps_of_the_devcontainer_end_in_the_page_that_it_forwards(tmp_path: Path) -> None:
    home = tmp_path / 'home'
    home.mkdir()
    clone = copy_checkout(tmp_path / 'wasd')
    container = json.loads((ROOT / '.devcontainer/devcontainer.json').read_text())
    subprocess.run(
        ['sh', '-c', container['postCreateCommand']], cwd=clone, env=bare(home), check=True
    )
    command = container['postAttachCommand'].split()
    assert container['forwardPorts'] == [int(command[-1])]
    check_page(command, clone, home)


def bare(home: Path) -> dict[str, str]:
    """Return the environment of a container: a home, and how this machine reaches an index."""
    passed = ('PATH', 'PIP_CERT', 'SSL_CERT_FILE', 'PIP_FIND_LINKS')
    return {name: os.environ[name] for name in passed if name in os.environ} | {'HOME': str(home)}


def check_page(command: list[str], folder: Path, home: Path) -> None:
    """Start a command whose last word is the port of a page, and wait for the page."""
    process = subprocess.Popen(command, cwd=folder, env=bare(home))
    try:
        assert '<title>' in page(f'http://127.0.0.1:{command[-1]}/')
    finally:
        process.terminate()
        process.wait(30.0)


def page(address: str) -> str:
    """Return what a page answers, once it does."""
    for _ in range(600):
        try:
            with urllib.request.urlopen(address, timeout=5.0) as answer:
                return answer.read().decode()
        except OSError:
            time.sleep(0.2)
    raise AssertionError(f'{address} does not answer')
