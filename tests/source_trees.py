# SPDX-License-Identifier: Apache-2.0
"""The checkout as text: its packages, their modules, and what each imports."""

import ast
from collections.abc import Iterator
import functools
from pathlib import Path
import shutil
import subprocess
import tomllib

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / 'pyproject.toml').read_text())
# Import packages beside the one that a package is named after: `import wasd`.
ALSO_IN = {'wasd_bringup': ('wasd',)}

PACKAGES = sorted(path.parent.name for path in ROOT.glob('*/package.xml'))


def copy_checkout(target: Path) -> Path:
    """Copy the checkout as it is now, without what git ignores; return the target."""
    words = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, listed.stdout.split('\0')):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target / name)
    return target


@functools.cache
def modules(package: str) -> dict[str, Path]:
    """Return the modules of a package, by dotted name."""
    folder = ROOT / package
    return {
        '.'.join(path.relative_to(folder).with_suffix('').parts): path
        for name in (package, *ALSO_IN.get(package, ()))
        for path in (folder / name).rglob('*.py')
    }


@functools.cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Return every node of a module's syntax tree."""
    return tuple(ast.walk(ast.parse(path.read_text())))


@functools.cache
def imports(path: Path) -> tuple[str, ...]:
    """Return the dotted names that a module imports anywhere in it, also by `import_module`."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[str]:
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f'{path}: imports are absolute here'
            yield from (f'{node.module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Call) and is_import_module(node.func):
            yield from (a.value for a in node.args if isinstance(a, ast.Constant))


def is_import_module(function: ast.expr) -> bool:
    """Return whether what is called is `import_module`, by that name or as importlib's."""
    name = getattr(function, 'attr', None) or getattr(function, 'id', '')
    return bool(name == 'import_module')


def data_files(package: str) -> set[str]:
    """Return the files of an import package that are not Python, relative to it."""
    folder = ROOT / package / package
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob('*')
        if path.is_file() and path.suffix != '.py' and '__pycache__' not in path.parts
    }
