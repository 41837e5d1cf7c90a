#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""
Writes the exact versions and hashes that `./wasd` installs, from the ranges of pyproject.toml.

`python requirements/lock.py python3.11 python3.12 python3.13`: each of these Pythons is asked what
it would install; the first decides on versions, and versions that are in the files stay, unless
`--upgrade` is given. `run.txt` is what runs, `test.txt` what the tests need on top.

`--ranges [test] --without NAME ...` prints what pip is to be asked for instead, without those
packages: whose names begin so.
"""

import argparse
from collections.abc import Iterable
import json
from pathlib import Path
import re
import subprocess
import sys
import tempfile
import tomllib

HERE = Path(__file__).parent
PROJECT = HERE.parent / 'pyproject.toml'
FILES = {'run.txt': (), 'test.txt': ('test',)}
HEAD = """# Written by requirements/lock.py; for CPython {versions} on Linux, x86_64.
"""
# Built here, not fetched: see docs/install.md.
OURS = ('wasd-interfaces',)

Pins = dict[str, str]


def wanted(extras: Iterable[str]) -> list[str]:
    """Return the ranges of the project and of its extras, and of what builds it."""
    settings = tomllib.loads(PROJECT.read_text())
    project = settings['project']
    asked = [*settings['build-system']['requires'], *project['dependencies']]
    for extra in extras:
        asked += project['optional-dependencies'][extra]
    return [each for each in asked if not each.startswith(OURS)]


def name_of(requirement: str) -> str:
    """Return the package that a requirement names."""
    return re.split('[ =<>!~;[]', requirement)[0]


def resolve(python: str, asked: list[str], pins: Pins) -> dict[str, tuple[str, str]]:
    """Return what pip of a Python would install: by name the version and the file's hash."""
    with tempfile.NamedTemporaryFile('w', suffix='.txt') as constraints:
        constraints.writelines(f'{name}=={version}\n' for name, version in pins.items())
        constraints.flush()
        command = [python, '-m', 'pip', 'install', '--dry-run', '--ignore-installed', '--quiet']
        command += ['--report', '-', '--constraint', constraints.name, *asked]
        said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    found = {}
    for row in json.loads(said)['install']:
        name = re.sub('[-_.]+', '-', row['metadata']['name']).lower()
        digest = row['download_info']['archive_info']['hashes']['sha256']
        found[name] = (row['metadata']['version'], f'sha256:{digest}')
    return found


def read_pins(path: Path) -> Pins:
    """Return the versions that a file has."""
    text = path.read_text() if path.is_file() else ''
    return dict(re.findall(r'^([\w.-]+)==([^ ;\\]+)', text, re.MULTILINE))


def lock(name: str, pythons: list[str], pins: Pins) -> dict[str, tuple[str, dict[str, set[str]]]]:
    """Return by package its version, and by hash the Pythons that take that file."""
    rows: dict[str, tuple[str, dict[str, set[str]]]] = {}
    for python in pythons:
        for package, (version, digest) in resolve(python, wanted(FILES[name]), pins).items():
            known, hashes = rows.setdefault(package, (version, {}))
            if known != version:
                raise SystemExit(f'{package}: {version} for {python}, {known} for others')
            hashes.setdefault(digest, set()).add(python)
            pins = {**pins, package: version}
    return rows


def write(name: str, rows: dict[str, tuple[str, dict[str, set[str]]]], pythons: list[str]) -> None:
    """Write one file."""
    versions = ', '.join(sorted(minor(python) for python in pythons))
    lines = [HEAD.format(versions=versions)]
    for package, (version, hashes) in sorted(rows.items()):
        users = set().union(*hashes.values())
        marker = ''
        if len(users) < len(pythons):
            each = ' or '.join(f'python_version == "{minor(python)}"' for python in sorted(users))
            marker = f' ; {each}'
        digests = ' \\\n'.join(f'    --hash={digest}' for digest in sorted(hashes))
        lines.append(f'{package}=={version}{marker} \\\n{digests}\n')
    (HERE / name).write_text(''.join(lines))


def minor(python: str) -> str:
    """Return `3.11` of a Python."""
    ask = 'import sys; print(*sys.version_info[:2], sep=".")'
    return subprocess.run([python, '-c', ask], capture_output=True, text=True).stdout.strip()


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('pythons', nargs='*', default=[sys.executable], metavar='PYTHON')
    parser.add_argument('--upgrade', action='store_true', help='take the newest that fits')
    parser.add_argument('--ranges', nargs='*', metavar='EXTRA', help='print the ranges')
    parser.add_argument('--without', nargs='*', default=[], metavar='NAME')
    parser.add_argument('--from', dest='given', type=Path, help='versions to take, NAME==VERSION')
    options = parser.parse_args()
    if options.ranges is not None:
        names = tuple(f'{name}-' for name in options.without)
        left = (
            word for word in wanted(options.ranges) if not f'{name_of(word)}-'.startswith(names)
        )
        print('\n'.join(left))
        return
    pins: Pins = {} if options.upgrade else {**read_pins(HERE / 'run.txt')}
    pins |= {} if options.upgrade else read_pins(HERE / 'test.txt')
    pins |= read_pins(options.given) if options.given else {}
    run: dict[str, tuple[str, dict[str, set[str]]]] = {}
    for name in FILES:
        rows = lock(name, options.pythons, pins)
        write(name, {k: row for k, row in rows.items() if k not in run}, options.pythons)
        run = run or rows
        pins |= {package: version for package, (version, _) in rows.items()}


if __name__ == '__main__':
    main()
