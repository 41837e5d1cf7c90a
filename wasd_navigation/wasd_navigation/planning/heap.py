# SPDX-License-Identifier: Apache-2.0
"""A binary heap of (key, item) in two arrays: what is to be looked at next, nearest first."""

from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit


class Heap(NamedTuple):
    """`keys` and `items`, shape (room,), and how many there are in `held`, shape (1,)."""

    keys: np.ndarray
    items: np.ndarray
    held: np.ndarray


def make_heap(room: int) -> Heap:
    """Return an empty heap for so many."""
    return Heap(np.empty(room, np.float32), np.empty(room, np.int32), np.zeros(1, np.int64))


@jit
def push(heap: Heap, key: float, item: int) -> None:
    """Add an item."""
    at = heap.held[0]
    heap.held[0] += 1
    while at > 0:
        parent = (at - 1) >> 1
        if heap.keys[parent] <= key:
            break
        heap.keys[at], heap.items[at] = heap.keys[parent], heap.items[parent]
        at = parent
    heap.keys[at], heap.items[at] = key, item


@jit
def pop(heap: Heap) -> tuple[float, int]:
    """Remove the item with the least key and return key and item; there must be one."""
    least, first = heap.keys[0], heap.items[0]
    heap.held[0] -= 1
    count = heap.held[0]
    key, item = heap.keys[count], heap.items[count]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= count:
            break
        if child + 1 < count and heap.keys[child + 1] < heap.keys[child]:
            child += 1
        if heap.keys[child] >= key:
            break
        heap.keys[at], heap.items[at] = heap.keys[child], heap.items[child]
        at = child
    heap.keys[at], heap.items[at] = key, item
    return least, first
