# SPDX-License-Identifier: Apache-2.0
"""
Keeps numba from reading what another user could have written.

numba reads `.numba_config.yaml` in the current folder, when it is imported and before it compiles,
and unpickles what lies in its cache: either one runs the code of the user who wrote it.
"""

from collections.abc import Sequence
import functools
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
import os
import sys
from types import CodeType, ModuleType
from typing import Any

from wasd_core.ownership import OPEN, others_can_write, why_foreign

CONFIG, CONFIG_FILE = 'numba.core.config', '.numba_config.yaml'


class _ConfigLoader(SourceFileLoader):
    """Loads numba's settings from the environment alone."""

    def get_code(self, fullname: str) -> CodeType | None:
        """Return the module's code, in which the name of the file is that of none."""
        code = super().get_code(fullname)
        if code is None:
            return None
        constants = ('' if each == CONFIG_FILE else each for each in code.co_consts)
        return code.replace(co_consts=tuple(constants))


class _ConfigFinder(MetaPathFinder):
    """Finds numba's settings for our loader."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return where the settings are; None for any other module."""
        if fullname != CONFIG:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _ConfigLoader(fullname, spec.loader.path)
        return spec


def _import_numba() -> None:
    """Import numba; where another has done so before, have it forget the current folder's file."""
    finder = _ConfigFinder()
    sys.meta_path.insert(0, finder)
    try:
        from numba.core import config
    finally:
        sys.meta_path.remove(finder)
    config._config_fname = ''
    config.reload_config()


_import_numba()

from numba.core import caching  # noqa: E402


@functools.cache
def _say(text: str) -> None:
    """Say something on standard error, once in a process."""
    print(f'wasd: {text}', file=sys.stderr, flush=True)


def _place(name: str) -> type:
    """Return numba's class of a place; the numba of Ubuntu 24.04 has an underscore before it."""
    found: type = getattr(caching, name, None) or getattr(caching, f'_{name}')
    return found


class _Guarded:
    """A place of a cache that is none where another user can write."""

    _cache_path: str

    def ensure_cache_path(self) -> None:
        """
        Make the folder.

        Raises:
            OSError: it cannot be written, or by others, too; numba goes on to the next place.
        """
        self._cache_path = os.path.realpath(self._cache_path)
        self._refuse()
        super().ensure_cache_path()  # type: ignore[misc]
        self._refuse()  # somebody may have made it first

    def _refuse(self) -> None:
        reason = self._why_foreign()
        if reason:
            _say(f'what numba compiles is not kept: {reason}')
            raise PermissionError(reason)

    def _why_foreign(self) -> str:
        return why_foreign(self._cache_path)

    def is_ours(self, file: str) -> bool:
        """Whether a file of the cache is ours, or not there."""
        try:
            return not others_can_write(os.stat(file))
        except FileNotFoundError:
            return True


class _Told(_Guarded, _place('UserProvidedCacheLocator')):  # type: ignore[misc]
    """Where NUMBA_CACHE_DIR says."""


class _InHome(_Guarded, _place('UserWideCacheLocator')):  # type: ignore[misc]
    """The user's folder of caches."""


class _BesideCode(_Guarded, _place('InTreeCacheLocator')):  # type: ignore[misc]
    """Beside the code: who can write that needs no cache, so it may be as open, and no more."""

    def _why_foreign(self) -> str:
        source = os.path.realpath(os.path.dirname(self._py_file))
        if os.path.dirname(self._cache_path) != source:  # a link leads away
            return why_foreign(self._cache_path)
        return self._more_open_than_code(self._cache_path)

    def is_ours(self, file: str) -> bool:
        return not self._more_open_than_code(file)

    def _more_open_than_code(self, path: str) -> str:
        code = os.stat(os.path.dirname(self._py_file))
        try:
            status = os.stat(path)
        except FileNotFoundError:
            return ''
        owners = (code.st_uid, os.stat(self._py_file).st_uid)
        reason = others_can_write(status, *owners)
        is_as_open = status.st_uid in (0, os.geteuid(), *owners) and status.st_gid == code.st_gid
        if is_as_open and not status.st_mode & OPEN & ~code.st_mode:
            return ''
        return reason and f'it {reason}'


class _Files(caching.IndexDataCacheFile):
    """A function's files, which count as missing where another user could have written them."""

    def __init__(self, locator: _Guarded, *rest: Any) -> None:
        super().__init__(*rest)
        self._locator = locator

    def _load_index(self) -> dict[Any, str]:
        index: dict[Any, str] = super()._load_index() if self._can_load(self._index_path) else {}
        return index

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        if not self._can_load(path):
            raise FileNotFoundError(path)  # it is then compiled, and written over
        return super()._load_data(name)

    def _can_load(self, path: str) -> bool:
        is_ours = self._locator.is_ours(path)
        if not is_ours:
            _say(f'what numba compiled is not read from {path}: another user can write it')
        return is_ours


class _Impl(caching.CompileResultCacheImpl):
    _locator_classes = [_Told, _BesideCode, _InHome]


class OwnCache(caching.FunctionCache):
    """
    A function's cache in a place where no other user can write.

    Raises:
        RuntimeError: there is no such place.
    """

    _impl_class = _Impl

    def name_files(self, mark: str) -> None:
        """Name the files after a mark, too."""
        name = f'{self._impl.filename_base}.{mark}'
        locator, stamp = self._impl.locator, self._cache_file._source_stamp
        self._cache_file = _Files(locator, self.cache_path, name, stamp)
