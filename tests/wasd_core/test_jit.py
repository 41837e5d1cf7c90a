# SPDX-License-Identifier: Apache-2.0
"""What numba compiled is kept for each state of its package, for all environments that have it."""

import importlib.util
import multiprocessing
from multiprocessing import forkserver
from multiprocessing.connection import Connection
import os
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

import pytest
from terminals import PATIENCE

import wasd_core

pytestmark = pytest.mark.slow

KERNELS = """
import numpy
from wasd_core.jit import jit
from kernels.numbers import SIZE

@jit
def size():
    return SIZE

@jit
def total():
    return numpy.ones(SIZE).sum()
"""
FRESH = """
from kernels.size import size
print(size(), *size.stats.cache_hits.values())
"""
# numba with another name for one thing of its own.
OTHER_NUMBA = """
from importlib.machinery import SourceFileLoader
from pathlib import Path
get_code = SourceFileLoader.get_code

def renamed(self, name):
    if not name.startswith('numba.') or (data := Path(self.path).read_bytes()).count(NAME) == 0:
        return get_code(self, name)
    return compile(data.replace(NAME, b'_of_another_numba'), self.path, 'exec')

SourceFileLoader.get_code = renamed
import importlib
import kernels.size
print(kernels.size.size(), importlib.reload(kernels.size).size())
"""


class Kernels:
    """A package with one kernel, which a process of its own calls."""

    def __init__(self, folder: Path, forks: Any) -> None:
        self.folder, self.package, self._forks = folder, folder / 'kernels', forks
        self.errors = folder / 'errors'
        self.package.mkdir()
        self.package.joinpath('__init__.py').touch()
        self.set_size(1)
        self.package.joinpath('size.py').write_text(KERNELS)
        self.environment = {**os.environ, 'XDG_CACHE_HOME': str(folder / 'cache')}
        self.environment.pop('NUMBA_CACHE_DIR', None)

    def set_size(self, size: int) -> None:
        """Change a file that the kernel is compiled of, beside its own."""
        self.package.joinpath('numbers.py').write_text(f'SIZE = {size}')

    def start(self, place: str = '.') -> Connection:
        """Start a process that has loaded the kernel, from a folder, and waits."""
        import kernel_user  # which compiles: not in each worker, before its first test

        talk, theirs = self._forks.Pipe()
        words = (self.folder / place, self.environment, self.errors, theirs)
        self._forks.Process(target=kernel_user.use, args=words, daemon=True).start()
        theirs.close()
        assert self.hear(talk) == 'ready'
        return talk

    def hear(self, talk: Connection) -> str:
        """Return what a process says next."""
        assert talk.poll(PATIENCE)
        try:
            return str(talk.recv())
        except EOFError:
            pytest.fail(self.errors.read_text())

    def call(self, talk: Connection) -> str:
        """Have a process call the kernel, and return what it says."""
        talk.send('call')
        return self.hear(talk)

    def use(self, place: str = '.') -> str:
        """Return the kernel's value, and 1 if it was not compiled."""
        return self.call(self.start(place))

    def run(self, script: str) -> str:
        """Return what a script prints, in a new interpreter."""
        done = subprocess.run(
            [sys.executable, '-c', script],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def kept(self) -> list[str]:
        """Return what is kept for the kernel, in any folder."""
        return sorted(path.name for path in self.folder.rglob('*size*.nb[ci]'))


@pytest.fixture(scope='module')
def forks():
    """Return how processes are forked of one that has loaded numba."""
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload(['kernel_user'])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PYTHONPATH', str(Path(__file__).parents[1]), prepend=os.pathsep)
        forkserver.ensure_running()
    return context


@pytest.fixture
def kernels(tmp_path, forks):
    """A package with a kernel that was never compiled."""
    return Kernels(tmp_path, forks)


def test_a_kernel_knows_the_other_files_of_its_package_under_any_name_of_it(kernels):
    """As it is in a colcon workspace of links."""
    (kernels.folder / 'install').mkdir()
    (kernels.folder / 'install/kernels').symlink_to(kernels.package)
    assert kernels.use() == '1'
    assert kernels.use('install') == '1 1'
    # An editor's lock is no module, and goes nowhere.
    (kernels.package / '.#numbers.py').symlink_to('somebody@host.123')
    assert kernels.use() == '1 1'
    kernels.set_size(22)
    assert kernels.use() == '22'
    (kernels.package / 'gait').mkdir()
    (kernels.package / 'gait/moved.py').touch()
    assert kernels.use() == '22'


@pytest.mark.parametrize(
    'name',
    ['_load_defined_symbols', 'JITCodeLibrary', '_finalize_final_module', 'from_struct_dtype'],
)
def test_a_numba_without_a_name_that_is_replaced_compiles_and_loads(kernels, name):
    assert kernels.run(f'NAME = {name.encode()!r}\n{OTHER_NUMBA}') == '1 1'


def test_a_state_that_comes_back_is_still_compiled_until_many_others_came(kernels):
    assert kernels.use() == '1'
    kernels.set_size(22)
    assert kernels.use() == '22'
    kernels.set_size(1)
    assert kernels.use() == '1 1'
    states = {path.parent for path in kernels.folder.rglob('*size*.nbi')}
    (folder,) = {state.parent for state in states}
    for state in states:
        os.utime(state, (0.0, 0.0))  # a file's time is coarse: others could come at the same
    for other in range(8 - 1):
        (folder / f'kernels-{other}').mkdir()
    kernels.set_size(333)
    assert kernels.use() == '333'
    kernels.set_size(1)
    assert kernels.use() == '1'
    assert len(list(folder.glob('kernels-*'))) == 8


def test_the_state_that_is_used_is_kept_though_others_seem_newer(kernels):
    assert kernels.use() == '1'
    (folder,) = {path.parent.parent for path in kernels.folder.rglob('*size*.nbi')}
    for other in range(8):
        (folder / f'kernels-{other}').mkdir()
        os.utime(folder / f'kernels-{other}', (4e9, 4e9))  # as before a clock was set back
    assert kernels.use() == '1 1'
    assert len(list(folder.glob('kernels-*'))) == 8


def test_an_installation_elsewhere_of_the_same_files_compiles_nothing(kernels):
    assert kernels.use() == '1'
    other = kernels.folder / 'another environment'
    other.mkdir()
    kernels.package.rename(other / 'kernels')
    for path in other.rglob('*.py'):
        os.utime(path, (0.0, 0.0))  # as each installation writes them at its own time
    assert kernels.use('another environment') == '1 1'


def test_nothing_is_written_beside_the_code(kernels):
    kernels.environment['PYTHONDONTWRITEBYTECODE'] = '1'
    before = sorted(kernels.package.rglob('*'))
    assert kernels.run(FRESH) == '1'
    assert sorted(kernels.package.rglob('*')) == before
    assert (kernels.folder / 'cache/wasd').stat().st_mode & 0o777 == 0o700


def test_a_kernel_knows_them_where_it_is_kept_in_the_home(kernels):
    kernels.environment.pop('XDG_CACHE_HOME', None)
    kernels.environment['HOME'] = str(kernels.folder / 'home')
    assert kernels.use() == '1'
    assert len(kernels.kept()) == 2
    assert (kernels.folder / 'home/.cache/wasd').is_dir()
    kernels.set_size(22)
    assert kernels.use() == '22'
    assert kernels.use() == '22 1'


def test_a_kernel_knows_the_files_of_wasd_core(kernels):
    ours = kernels.folder / 'wasd_core'
    ignored = shutil.ignore_patterns('__pycache__')
    shutil.copytree(Path(wasd_core.__file__).parent, ours, ignore=ignored)
    (ours / 'weight.py').write_text('GRAVITY = 9.81')
    (kernels.package / 'numbers.py').write_text('from wasd_core.weight import GRAVITY as SIZE')
    assert kernels.run(FRESH) == '9.81'
    (ours / 'weight.py').write_text('GRAVITY = 3.7')
    assert kernels.run(FRESH) == '3.7'


def test_what_an_older_process_compiles_after_a_change_is_not_used(kernels):
    older = kernels.start()
    kernels.set_size(22)
    assert kernels.use() == '22'
    assert kernels.call(older) == '1'
    assert kernels.use() == '22 1'


@pytest.fixture
def refused(kernels, tmp_path):
    """Return a function that says what is said, and the value, where NUMBA_CACHE_DIR is bad."""
    kernels.environment.pop('XDG_CACHE_HOME')
    kernels.environment['HOME'] = str(kernels.folder / 'home')

    def use(place: Path) -> tuple[str, str]:
        kernels.environment['NUMBA_CACHE_DIR'] = str(place)
        value = kernels.use()
        return value, kernels.errors.read_text()

    return use


def test_a_cache_that_others_may_write_is_not_used_and_a_line_says_so(kernels, refused):
    cache = kernels.folder / 'cache'
    assert refused(cache) == ('1', '')
    assert refused(cache) == ('1 1', '')
    for folder in (cache, next(cache.iterdir())):
        mode = folder.stat().st_mode
        folder.chmod(0o777)
        shutil.rmtree(kernels.folder / 'home', ignore_errors=True)
        value, said = refused(cache)
        # The same line for every package, and so once.
        reason = f'{folder} can be written by any user (mode 777)'
        assert (value, said) == ('1', f'wasd: compiled code is not cached: {reason}\n')
        folder.chmod(mode)
    link = kernels.folder / 'link'
    link.symlink_to(cache)
    assert refused(link) == ('1 1', '')
    cache.chmod(0o777)
    assert 'can be written by any user' in refused(link)[1]
    assert sorted((kernels.folder / 'home').rglob('*.nbi')) != []  # where it went instead


def test_a_cache_in_a_folder_of_others_is_not_used(kernels, refused):
    open_to_all = kernels.folder / 'open'
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    assert f'{open_to_all} can be written by any user' in refused(open_to_all / 'cache')[1]
    open_to_all.chmod(0o1777)  # as /tmp is: what is in it is its owner's
    assert refused(open_to_all / 'cache') == ('1', '')


def test_a_file_of_the_cache_that_others_may_write_is_not_read(kernels, refused):
    cache = kernels.folder / 'cache'
    assert refused(cache)[0] == '1'
    for kind in ('nbi', 'nbc'):
        (file,) = cache.rglob(f'*.{kind}')
        file.chmod(0o666)
        value, said = refused(cache)
        assert (value, len(said.splitlines())) == ('1', 1)
        assert f'not read from {file}' in said
        assert file.stat().st_mode & 0o777 != 0o666  # it was written over
        assert refused(cache) == ('1 1', '')


@pytest.mark.skipif(os.geteuid() != 0, reason='only root gives folders away')
def test_a_cache_of_another_user_is_not_used(kernels, refused):
    cache = kernels.folder / 'cache'
    refused(cache)
    os.chown(cache, 1234, 1234)
    assert f'{cache} belongs to user 1234' in refused(cache)[1]
    assert refused(cache)[0] == '1 1'  # from the home


# What numba compiles with takes longer to load than the kernels of a robot, SciPy above all.
LOADED = """
import sys
from kernels.size import size
size()
print([name for name in ('numba.np.arraymath', 'scipy.linalg') if name in sys.modules])
"""
MEMORY = """
from kernels.size import total
from numba.core.runtime import rtsys
print(total(), rtsys._init)
"""
COMPILES = """
import numba, numpy
print(numba.njit(lambda half: half @ half)(numpy.full((2, 2), 0.5))[0, 0])
"""


@pytest.mark.skipif(importlib.util.find_spec('scipy') is None, reason='needs SciPy')
def test_what_is_compiled_loads_nothing_to_compile_with(kernels):
    """That comes with the first function that is not compiled yet."""
    assert kernels.run(LOADED).splitlines() == ["['numba.np.arraymath', 'scipy.linalg']"]
    # From the cache.
    assert kernels.run(LOADED + COMPILES).splitlines() == ['[]', '0.5']


def test_what_is_compiled_allocates_without_what_numba_compiles_for_that(kernels):
    assert kernels.run(MEMORY) == '1.0 True'
    # From the cache; then numba compiles what allocates.
    more = 'import numba, numpy; print(numba.njit(lambda: numpy.ones(3))().sum(), rtsys._init)'
    assert kernels.run(f'{MEMORY}{more}\n').splitlines() == ['1.0 False', '3.0 True']


SUMS = """
import sys
from kernels.size import total
parts = [f'numba.np.{name}' for name in ('arraymath', 'arrayobj')]
print(total(), *total.stats.cache_hits.values(), any(name in sys.modules for name in parts))
"""


def test_what_is_compiled_loads_no_part_of_numba_that_it_calls_compiled(kernels):
    assert kernels.run(SUMS).split() == ['1.0', 'True']
    # They come with what is compiled after that.
    more = 'import numba; print(numba.njit(lambda: numpy.ones((2, 3)).sum())())'
    said = kernels.run(f'{SUMS}import numpy; {more}\n').split()
    assert said == ['1.0', '1', 'False', '6.0']


PARSED = """
from llvmlite import binding
parse, parsed = binding.parse_bitcode, []
binding.parse_bitcode = lambda *words: parsed.append(words) or parse(*words)
import numba
from kernels.size import size
print(size(), len(parsed))
if size.stats.cache_hits:
    print(numba.njit(lambda: size() + 1)(), len(parsed) > 0)
"""


def test_what_is_loaded_is_parsed_once_it_is_compiled_into_another_function(kernels):
    assert kernels.use() == '1'
    assert kernels.run(PARSED).splitlines() == ['1 0', '2 True']


RECORDS = """
from kernels.size import size
import numba, numpy
from numba.np import numpy_support
find, found = numpy_support.from_dtype, []
numpy_support.from_dtype = lambda dtype: found.append(dtype.kind) or find(dtype)
fields = [('mass', float)]
kinds = [numpy.dtype(fields), numpy.dtype(fields), numpy.dtype(fields, align=True)]
first, same, aligned = [numba.typeof(numpy.zeros(1, kind)).dtype for kind in kinds]
print(found.count('f'), first == same, first.aligned, aligned.aligned)
"""


def test_the_type_of_a_record_is_found_once(kernels):
    assert kernels.run(RECORDS) == '2 True False True'


NAMES = """
from kernels.size import size
size()
engine = size.targetctx.codegen()._engine
(compiled,) = size.overloads.values()
functions = compiled.library._get_module_for_linking().functions
names = {each.name for each in functions if not each.is_declaration}
print(len(names) > 1, names <= engine._defined_symbols)
print(all(map(engine.is_symbol_defined, names)), engine.is_symbol_defined('nobody'))
"""


def test_of_what_is_loaded_only_the_names_that_are_asked_for_are_looked_up(kernels):
    assert kernels.use() == '1'
    assert kernels.run(NAMES).splitlines() == ['True False', 'True False']
