# SPDX-License-Identifier: Apache-2.0
"""What a network is shown: terms, clipped and scaled, with their past."""

from collections import deque
import math

import numpy as np
from wasd_core.robot_io import Senses

from policy_player.spec import PolicySpec


def gravity_in_base(orientation: np.ndarray) -> np.ndarray:
    """Return the unit vector down in base axes: (0, 0, -1) when level."""
    w, x, y, z = orientation.tolist()
    return np.array((2.0 * (w * y - x * z), -2.0 * (w * x + y * z), 2.0 * (x * x + y * y) - 1.0))


def _within(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Clip values; numpy's own `clip` takes ten times as long for a few numbers."""
    if low == -math.inf and high == math.inf:
        return values
    return np.asarray(np.minimum(np.maximum(values, low), high))


class Observer:
    """
    Makes the observation of a `PolicySpec`.

    State: the past of each term, and how many steps there were. `step` takes an instant and
    returns all that is shown.
    """

    def __init__(self, spec: PolicySpec) -> None:
        self.spec = spec
        self._default = np.array(spec.default_position)
        self._scales = [np.array(term.scale) for term in spec.terms]
        self._past: list[deque[np.ndarray]] = []
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._steps = 0
        self._past = [deque(maxlen=max(term.ages) + 1) for term in self.spec.terms]

    def step(self, senses: Senses, command: np.ndarray, last_action: np.ndarray) -> np.ndarray:
        """Return the observation (width,) float32; `command` is (3,)."""
        spec = self.spec
        turn = 2.0 * math.pi * self._steps * spec.period / (spec.phase_period or 1.0)
        self._steps += 1
        known = {
            'linear_velocity': senses.linear_velocity,
            'angular_velocity': senses.angular_velocity,
            'gravity': gravity_in_base(senses.orientation),
            'command': command,
            'joint_position': senses.joint_position - self._default,
            'joint_velocity': senses.joint_velocity,
            'phase': np.array((math.sin(turn), math.cos(turn))),
            'last_action': last_action,
        }
        for term, scale, past in zip(spec.terms, self._scales, self._past, strict=True):
            value = known[term.name]
            if term.scales_first:
                value = _within(scale * value, *term.clip)
            else:
                value = scale * _within(value, *term.clip)
            value = _within(value, -spec.observation_clip, spec.observation_clip)
            if not past:
                first = np.zeros_like(value) if spec.begins_with_zeros else value
                past.extend([first] * (past.maxlen or 1))
            past.append(value)
        terms = [
            [past[-1 - age] for age in term.ages]
            for term, past in zip(spec.terms, self._past, strict=True)
        ]
        if spec.by_time:
            parts = [part for instant in zip(*terms, strict=True) for part in instant]
        else:
            parts = [part for ages in terms for part in ages]
        return np.concatenate(parts).astype(np.float32)
