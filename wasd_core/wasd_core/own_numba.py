# SPDX-License-Identifier: Apache-2.0
"""
Loads numba, and what it has compiled: only files of ours, and only the parts that are needed.

numba reads `.numba_config.yaml` in the current folder, when it is imported and before it compiles,
and unpickles what lies in its cache: either one runs the code of the user who wrote it.
"""

import contextlib
import functools
import os
from pathlib import Path
import shutil
import sys
from typing import Any
import warnings

from wasd_core.cache import cache_folder, say_once, why_unfit
from wasd_core.ownership import others_can_write


def _import_numba() -> None:
    """Import numba; where another has done so before, have it forget the current folder's file."""
    modules: Any = sys.modules
    kept = {name: modules.get(name) for name in ('yaml', 'coverage')}
    # Without yaml numba cannot read the file. It would warn where there is one.
    modules['yaml'] = None
    # It looks for what measures coverage: nothing does that has not been loaded yet.
    modules.setdefault('coverage', None)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings('ignore', module='numba.core.config')
            from numba.core import config
    finally:
        for name, module in kept.items():
            del modules[name]
            if module is not None:
                modules[name] = module
    config._config_fname = ''
    config.reload_config()


_import_numba()

from numba.core import caching, codegen, environment  # noqa: E402
from numba.core.runtime import nrt  # noqa: E402
from numba.np import numpy_support  # noqa: E402


def _remember_module(engine: Any, module: Any) -> None:
    engine.__dict__.setdefault('modules', []).append(module)


def _is_symbol_defined(engine: Any, name: str) -> bool:
    known, modules = engine._defined_symbols, engine.__dict__.get('modules', ())
    # The newest first: it is what is asked about.
    if name not in known and any(_defines(module, name) for module in reversed(modules)):
        known.add(name)
    return name in known


def _defines(module: Any, name: str) -> bool:
    for look_up in (module.get_function, module.get_global_variable):
        with contextlib.suppress(NameError):
            if not look_up(name).is_declaration:
                return True
    return False


_Engine: Any = getattr(codegen, 'JitEngine', None)
_JitLibrary: Any = getattr(codegen, 'JITCodeLibrary', object)
# numba lists all names of each module that it loads, a call of LLVM for each of thousands: a sixth
# of the time in which a controller's functions are loaded. A few of them are ever asked for. A
# numba that does so in another way is left alone, here and below.
if hasattr(_Engine, '_load_defined_symbols'):
    _Engine._load_defined_symbols = _remember_module
    _Engine.is_symbol_defined = _is_symbol_defined


class _Unparsed:
    """The bitcode of a function from the cache: parsed once it is compiled into another one."""

    def __init__(self, bitcode: bytes) -> None:
        self._bitcode = bitcode

    @functools.cached_property
    def _module(self) -> Any:
        return codegen.ll.parse_bitcode(self._bitcode)  # type: ignore[attr-defined]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


class _Library(_JitLibrary):  # type: ignore[misc]
    """One that does not parse bitcode as it is loaded, which takes half of the time of that."""

    @classmethod
    def _unserialize(cls, owner: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != 'object':
            return super()._unserialize(owner, state)
        library = owner.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(data[0])
        library._shared_module = _Unparsed(data[1])
        library._finalize_final_module()
        owner._engine._load_defined_symbols(library._shared_module)
        return library

    def get_pointer_to_function(self, name: str) -> Any:
        """Return where a function is; of one from the cache its wrapper is there for sure."""
        is_cached = isinstance(getattr(self, '_shared_module', None), _Unparsed)
        if is_cached and name.startswith(WRAPPER):
            return self._codegen._engine.get_function_address(name)
        return super().get_pointer_to_function(name)


# The prefix of the names of wrappers, by which Python calls compiled functions.
WRAPPER = '_ZN7cpython'
_NEEDED = ('_unserialize', '_set_compiled_object', '_finalize_final_module')
if hasattr(_Engine, '_load_defined_symbols') and all(hasattr(_JitLibrary, n) for n in _NEEDED):
    codegen.JITCPUCodegen._library_class = _Library

_find_record: Any = getattr(numpy_support, 'from_struct_dtype', None)


@functools.cache
def _record_of(dtype: Any, is_aligned: bool) -> Any:
    """Return numba's type of a structured one; alone, dtypes are equal whether aligned or not."""
    return _find_record(dtype)


# numba finds the type of each array that a function is first called with, field by field.
if _find_record is not None:
    numpy_support.from_struct_dtype = lambda dtype: _record_of(dtype, dtype.isalignedstruct)

# Functions of numba's own that a cached one calls name their module, which would be imported:
# numba.np.arraymath, and SciPy with it, for a sum. What is compiled looks at nothing in it.
if hasattr(environment, '_rebuild_env'):
    _rebuild_with_module = environment._rebuild_env

    @functools.wraps(_rebuild_with_module)  # by its name it is in the files of the cache
    def _rebuild_env(module: str, constants: Any, name: str) -> Any:
        if module in sys.modules or not module.startswith('numba.'):
            return _rebuild_with_module(module, constants, name)
        if (rebuilt := environment.lookup_environment(name)) is None:
            rebuilt = environment.Environment({'__name__': module})
            rebuilt.consts[:], rebuilt.env_name = constants, name
            environment.Environment._memo[name] = rebuilt
        return rebuilt

    environment._rebuild_env = _rebuild_env

# So many states of a package are kept: those of several checkouts, and of several versions.
MOST_KEPT = 8


def folder_of(state: str, name: str) -> Path | None:
    """
    Return the folder for the compiled code of one state of a package; None if there is none.

    It is a folder of $NUMBA_CACHE_DIR, or of the user's caches: the same for every environment
    that has this state. `name` is the package's; of older states of it some are kept.
    """
    told = os.environ.get('NUMBA_CACHE_DIR')
    if told:
        folder = Path(os.path.realpath(told)) / f'{name}-{state}'
        why = why_unfit(folder)
        if not why:
            return _used(folder, name)
        say_once(f'compiled code is not cached: {why}')
    kept = cache_folder('numba')
    if kept is None or why_unfit(kept / f'{name}-{state}'):
        return None
    return _used(kept / f'{name}-{state}', name)


def _used(folder: Path, name: str) -> Path:
    """Mark a folder as the last that was used, and forget those that were not for long."""
    with contextlib.suppress(OSError):
        os.utime(folder)
        # The used one is the last, whatever a coarse clock, or one that was set back, makes of it.
        others = {*folder.parent.glob(f'{name}-*')} - {folder}
        for old in sorted(others, key=lambda path: path.stat().st_mtime)[: 1 - MOST_KEPT]:
            shutil.rmtree(old, ignore_errors=True)
    return folder


class _Place(caching._CacheLocator):
    """The place of one function: files of its name in a folder of one state of its package."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def from_function(self, function: Any, file: str) -> '_Place':  # type: ignore[override]
        """Return the place of a function."""
        self._py_file = file  # of which numba warns
        self._name = f'{function.__module__}-{function.__code__.co_firstlineno}'
        return self

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return the state that the folder is of: of that nothing in it is stale."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name apart."""
        return self._name


class _Impl(caching.CompileResultCacheImpl):
    """Keeps the functions in a folder."""

    def __init__(self, folder: Path, function: Any) -> None:
        self._locator_classes = [_Place(folder)]  # type: ignore[list-item]
        super().__init__(function)


class _Files(caching.IndexDataCacheFile):
    """A function's files, which count as missing where another user could have written them."""

    def _load_index(self) -> dict[Any, str]:
        index: dict[Any, str] = super()._load_index() if _can_load(self._index_path) else {}
        return index

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        if not _can_load(path):
            raise FileNotFoundError(path)  # it is then compiled, and written over
        return super()._load_data(name)


def _can_load(path: str) -> bool:
    try:
        is_ours = not others_can_write(os.stat(path))
    except FileNotFoundError:
        return True
    if not is_ours:
        say_once(f'what numba compiled is not read from {path}: another user can write it')
    return is_ours


class OwnCache(caching.FunctionCache):
    """A function's cache in a folder of one state of its package, see `folder_of`."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._impl_class = functools.partial(_Impl, folder)  # type: ignore[assignment]
        super().__init__(function)
        self._cache_file = _Files(
            self.cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """
        Return a function from the cache, None if it is not there.

        What is compiled calls numba's memory by name, but none of what numba compiles with: to
        prepare that, as numba does here, takes a tenth of a start. It does so before it compiles.
        """
        _name_memory()
        return self._load_overload(sig, target_context)


@functools.cache
def _name_memory() -> None:
    """Tell LLVM where the functions of numba's memory are, under the names that numba gives."""
    memory: Any = nrt
    for name, address in memory._nrt.c_helpers.items():
        memory.ll.add_symbol(name if name.startswith('_') else f'NRT_{name}', address)
