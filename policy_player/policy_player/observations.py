# SPDX-License-Identifier: Apache-2.0
"""The observation of a network: terms, clipped and scaled, with their history."""

import math

import numpy as np
from wasd_core.robot_io import Senses

from policy_player.spec import PolicySpec, SCAN_ROWS


def gravity_in_base(orientation: np.ndarray) -> np.ndarray:
    """Return the unit vector down in base axes: (0, 0, -1) when level."""
    w, x, y, z = orientation.tolist()
    return np.array((2.0 * (w * y - x * z), -2.0 * (w * x + y * z), 2.0 * (x * x + y * y) - 1.0))


class Observer:
    """
    Makes the observation of a `PolicySpec`.

    State: what was shown in the last instants, and how many steps there were. `step` takes an
    instant and returns all that is shown.
    """

    def __init__(self, spec: PolicySpec) -> None:
        self.spec = spec
        self._default = np.array(spec.default_position)
        self._scale, self._low, self._high = _scaling(spec)
        self._depth = 1 + max(age for term in spec.terms for age in term.ages)
        self._order = _order(spec)
        self._names = [term.name for term in spec.terms]
        is_in_order = np.array_equal(self._order, np.arange(len(self._scale)))
        self._is_plain = self._depth == 1 and is_in_order
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._steps = 0
        self._past: np.ndarray | None = None  # the latest instant first

    def step(
        self,
        senses: Senses,
        command: np.ndarray,
        last_action: np.ndarray,
        heights: np.ndarray | None = None,
    ) -> np.ndarray:
        """
        Return the observation (width,) float32; `command` is (3,).

        `heights` (187,) are those of a height scan [m], where one is shown.
        """
        spec = self.spec
        known = {
            'linear_velocity': senses.linear_velocity,
            'angular_velocity': senses.angular_velocity,
            'gravity': gravity_in_base(senses.orientation),
            'command': command,
            'joint_position': senses.joint_position - self._default,
            'joint_velocity': senses.joint_velocity,
            'last_action': last_action,
        }
        if spec.phase_period:
            turn = 2.0 * math.pi * self._steps * spec.period / spec.phase_period
            known['phase'] = np.array((math.sin(turn), math.cos(turn)))
        self._steps += 1
        if heights is not None:
            known['height_scan'] = heights
            known['height_scan_by_row'] = heights.reshape(SCAN_ROWS, -1).T.ravel()
        told = self._scale * np.concatenate([known[name] for name in self._names])
        now = np.minimum(np.maximum(told, self._low), self._high)
        if self._is_plain:  # for a network without memory that is all
            return np.asarray(now, np.float32)
        if self._past is None:
            first = np.zeros_like(now) if spec.begins_with_zeros else now
            self._past = np.tile(first, (self._depth, 1))
        self._past[1:] = self._past[:-1]
        self._past[0] = now
        return np.asarray(self._past.ravel()[self._order], np.float32)


def _scaling(spec: PolicySpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the scales of an instant's numbers, (n,), and what the scaled ones are within."""
    scales, lows, highs = [], [], []
    for term in spec.terms:
        scale = np.broadcast_to(np.array(term.scale), spec.width_of(term))
        ends = np.broadcast_to(np.array(term.clip)[:, None], (2, len(scale)))
        if not term.scales_first:  # a clip before the scale is another one after it
            with np.errstate(invalid='ignore'):
                ends = np.where(np.isinf(ends), ends, ends * np.abs(scale))
            ends = np.where(scale < 0.0, -ends[::-1], ends)
        most = spec.observation_clip
        low, high = np.minimum(np.maximum(ends, -most), most)
        scales.append(scale)
        lows.append(low)
        highs.append(high)
    return np.concatenate(scales), np.concatenate(lows), np.concatenate(highs)


def _order(spec: PolicySpec) -> np.ndarray:
    """Return where in the past, the latest instant first, each number of an observation is."""
    widths = [spec.width_of(term) for term in spec.terms]
    begins = np.cumsum([0, *widths])
    parts = [
        [begin + age * begins[-1] + np.arange(width) for age in term.ages]
        for term, begin, width in zip(spec.terms, begins[:-1], widths, strict=True)
    ]
    if spec.by_time:
        return np.concatenate([part for instant in zip(*parts, strict=True) for part in instant])
    return np.concatenate([part for ages in parts for part in ages])
