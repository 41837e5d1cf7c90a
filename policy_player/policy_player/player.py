# SPDX-License-Identifier: Apache-2.0
"""Plays a policy: senses and a command in, joint targets and gains out, without ROS or a clock."""

from collections.abc import Callable
import math

import numpy as np
from wasd_core.robot_io import is_finite, JointTargets, Senses

from policy_player.observations import Observer
from policy_player.policy_file import Policy
from policy_player.spec import Numbers

# A step that is due within this share of one is taken: sums of floating-point times are not exact.
_ALMOST = 1e-6


class Player:
    """
    Runs a network at its own period; between its steps targets stay.

    State: the past of the observation, the last action, the time to the next step. The caller of
    `step` applies the targets by torque = stiffness (target - q) - damping dq at every physics
    step. `failure` says why there are none any more, '' while all is well.
    """

    def __init__(self, policy: Policy) -> None:
        self.policy, self.spec = policy, policy.spec
        self.joints, self.ranges = policy.spec.joints, policy.spec.ranges
        self._observer = Observer(policy.spec)
        # Tells the height scan of now, (187,) [m], to a network that sees one.
        self.heights: Callable[[], np.ndarray | None] = lambda: None
        self.has_height_scan = policy.spec.has_height_scan
        spec = policy.spec
        self.default = np.array(spec.default_position)
        self._scale, self._offset = np.array(spec.action_scale), np.array(spec.action_offset)
        self._action_clip, self._target_clip = _ends(spec.action_clip), _ends(spec.target_clip)
        self._gains = np.array(spec.stiffness), np.array(spec.damping)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next step asks the network."""
        self._observer.reset()
        self.action = np.zeros(len(self.joints))
        self.observation = np.zeros(self.spec.width, np.float32)
        self._wait = -math.inf
        self.failure = ''
        self._targets = self._towards(self.action)

    @property
    def due_after(self) -> float:
        """How long after the last step the next one asks the network [s]."""
        return math.inf if self.failure else self._wait

    def step(self, senses: Senses, command: np.ndarray, dt: float) -> JointTargets:
        """
        Return the targets for an instant `dt` [s] after the one before; `command` is (3,).

        When the output of the network is not a number, targets stay and `failure` says so.
        """
        self._wait -= dt
        if self.due_after > _ALMOST * self.spec.period:
            return self._targets
        # After a step that came a whole period late, the time counts from now.
        late = self._wait if self._wait > -self.spec.period else 0.0
        self._wait = late + self.spec.period
        heights = self.heights() if self.has_height_scan else None
        if self.has_height_scan and heights is None:
            self.failure = 'there are no heights of the ground around the robot'
            return self._targets
        self.observation = self._observer.step(senses, command, self.action, heights)
        try:
            action = self.policy.network(self.observation).astype(float)
        except Exception as error:  # what a library raises in the middle of a run
            self.failure = f'the network broke: {" ".join(str(error).split())[:100]}'
            return self._targets
        if action.shape != self.action.shape or not is_finite(action):
            self.failure = 'the output of the network is not a number'
            return self._targets
        self.action = _within(self._action_clip, action)
        self._targets = self._towards(self.action)
        return self._targets

    def _towards(self, action: np.ndarray) -> JointTargets:
        position = _within(self._target_clip, self._offset + self._scale * action)
        return JointTargets(position, *self._gains)


def _ends(clip: tuple[Numbers, Numbers]) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the ends of a clip, None where it is without any."""
    low, high = np.array(clip[0]), np.array(clip[1])
    return None if np.isneginf(low).all() and np.isposinf(high).all() else (low, high)


def _within(ends: tuple[np.ndarray, np.ndarray] | None, values: np.ndarray) -> np.ndarray:
    """Clip, in a third of the time of `np.clip`."""
    if ends is None:
        return values
    return np.asarray(np.minimum(np.maximum(values, ends[0]), ends[1]))
