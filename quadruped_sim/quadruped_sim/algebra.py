# SPDX-License-Identifier: Apache-2.0
"""
Small algebra of one tick: loops that numba compiles.

numba compiles `numpy.linalg` and `@` for seconds per function, and for as long what fills a slice,
with its error messages; these loops take a tenth of that and are as fast for sizes up to 6.
An array that a function returns costs 50 ns, more than what is in it: vectors are three numbers.
"""

from collections.abc import Callable, Mapping
from typing import Any, cast, TypeVar

import numpy as np
from wasd_core.jit import jit

_T = TypeVar('_T', bound=tuple[Any, ...])
Three = tuple[float, float, float]
# One object for each layout: numba compares those of equal records field by field, at each call.
_LAYOUTS: dict[np.dtype[Any], np.dtype[Any]] = {}
# Turns a NamedTuple into a tuple, for a call of a compiled function from Python: numba takes 10 us
# to unpack a NamedTuple, 1 us for a tuple. The function names the fields again, at no cost:
# `base = BaseMotion(*base)`.
plain = cast('Callable[[_T], _T]', tuple)


def flatten(record: Any) -> np.ndarray:
    """
    Return what a NamedTuple, or a mapping, holds in one block of memory, a record array (1,).

    A compiled function takes such a block as fast as one number. It returns nothing and writes
    into the block instead: each array that numba is given takes 0.2 us, each that it returns 1 us
    and more. There, `base = robot[0].base` has the fields of the NamedTuple that was flattened.
    """
    layout = _layout(record)
    return np.array([_values(record)], _LAYOUTS.setdefault(layout, layout))


def _parts(record: Any) -> Any:
    parts = record if isinstance(record, Mapping) else record._asdict()
    # A block holds no texts.
    return [(name, part) for name, part in parts.items() if not isinstance(part, str)]


def _is_record(value: Any) -> bool:
    return isinstance(value, Mapping) or hasattr(value, '_fields')


def _layout(value: Any) -> np.dtype[Any]:
    if _is_record(value):
        return np.dtype([(name, _layout(part)) for name, part in _parts(value)])
    array = np.asarray(value)
    # numba knows no flags in records.
    return np.dtype((np.uint8 if array.dtype == bool else float, array.shape))


def _values(value: Any) -> Any:
    return tuple(_values(part) for _, part in _parts(value)) if _is_record(value) else value


def view_of(flat: np.ndarray, record: Any) -> Any:
    """
    Return the like of a NamedTuple, or array, that is a view on its flattened form.

    Its numbers are arrays of shape ().
    """
    if _is_record(record):
        return type(record)(*(view_of(flat[name], part) for name, part in _parts(record)))
    part = flat.reshape(flat.shape[1:])
    return part.view(bool) if np.asarray(record).dtype == bool else part


@jit
def rotate(R: np.ndarray, v: np.ndarray | Three) -> Three:
    """R v for a (3, 3) matrix and three numbers."""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@jit
def rotate_back(R: np.ndarray, v: np.ndarray | Three) -> Three:
    """R' v for a (3, 3) matrix and three numbers."""
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@jit
def put(into: np.ndarray, v: np.ndarray | Three) -> None:
    """Copy a vector into one of its length."""
    for i in range(len(into)):
        into[i] = v[i]


@jit
def write_rotation(q: np.ndarray, R: np.ndarray) -> None:
    """Write the rotation matrix (3, 3) of a quaternion (w, x, y, z) of any length."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)


@jit
def cross3(a: np.ndarray | Three, b: np.ndarray | Three) -> Three:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def invert3(A: np.ndarray, out: np.ndarray) -> None:
    """Write the inverse of a (3, 3) matrix by cofactors; a singular one gives infinities."""
    for i in range(3):
        for j in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            c, d = (j + 1) % 3, (j + 2) % 3
            out[j, i] = A[a, c] * A[b, d] - A[a, d] * A[b, c]
    determinant = A[0, 0] * out[0, 0] + A[0, 1] * out[1, 0] + A[0, 2] * out[2, 0]
    scale = 1.0 / determinant if determinant != 0.0 else np.inf
    for i in range(3):
        for j in range(3):
            out[i, j] *= scale


@jit
def solve_in_place(A: np.ndarray, B: np.ndarray) -> None:
    """Replace `B` (n, m) by A^-1 B; `A` (n, n), which needs no pivots, is destroyed."""
    n, m = B.shape
    for k in range(n):  # elimination without pivoting
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= factor * A[k, j]
            for j in range(m):
                B[i, j] -= factor * B[k, j]
    for j in range(m):
        for i in range(n - 1, -1, -1):
            total = B[i, j]
            for k in range(i + 1, n):
                total -= A[i, k] * B[k, j]
            B[i, j] = total / A[i, i]
