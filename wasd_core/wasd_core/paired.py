# SPDX-License-Identifier: Apache-2.0
"""Pairs readings of one instant that come by several topics, in any order."""

from collections.abc import Callable, Collection
import math
from typing import NamedTuple

from wasd_core.feed import Feeds
from wasd_core.robot_io import BaseState, ImuReading, JointCommand, JointStates

# Of joints and IMU no reading is older than this against the other [s].
LONGEST_LAG = 0.02
# After so long without a reading the motors have braked and the robot has sunk [s].
LONGEST_GAP = 0.3

# What is done with the command that answers a reading.
Answer = Callable[[JointCommand], None]


class Paired(NamedTuple):
    """Readings of one instant: joints by name, `gap` [s] after the ones before."""

    gap: float
    names: tuple[str, ...]
    joints: JointStates
    imu: ImuReading
    truth: BaseState | None


class PairedReadings:
    """
    Joins joints, IMU and, where `feeds` need it, the base by their stamps [s].

    Joints wait for what belongs to them: topics overtake each other, on a busy machine by far.
    `on_paired` gets the readings and who wants the answer; `on_return` is called where time went
    back. `warn` hears of readings that are of no use.
    """

    def __init__(
        self,
        needed: Collection[str],
        feeds: Feeds,
        on_paired: Callable[[Paired, Answer], None],
        on_return: Callable[[], None],
        warn: Callable[[str], None],
    ) -> None:
        self._needed, self.feeds = set(needed), feeds
        self._needs_truth = 'ground_truth/odom' in feeds.by_topic
        self._on_paired, self._on_return, self._warn = on_paired, on_return, warn
        self.last: float | None = None  # time of the joints that were answered last
        self._imu: tuple[float, ImuReading] | None = None
        self._truth: tuple[float, BaseState | None] = -math.inf, None
        self._waiting: tuple[float, tuple[str, ...], JointStates, Answer] | None = None

    def take_imu(self, now: float, imu: ImuReading) -> None:
        """Take what the IMU measured."""
        self.feeds.take('imu/data', now)
        self._imu = now, imu
        self._answer_when_complete()

    def take_truth(self, now: float, truth: BaseState) -> None:
        """Take where the base is, as the simulator knows it."""
        self.feeds.take('ground_truth/odom', now)
        self._truth = now, truth
        self._answer_when_complete()

    def take_joints(
        self, now: float, names: tuple[str, ...], joints: JointStates, answer: Answer
    ) -> None:
        """Take joints; `answer` gets the command for them, maybe later, maybe never."""
        self.feeds.take('joint_states', now)
        if not self._needed <= set(names) or {len(part) for part in joints} != {len(names)}:
            self._warn('joint_states lacks joints, velocities or efforts: ignored')
            return
        late, self._waiting = self._waiting, (now, names, joints, answer)
        if late is not None:
            self._answer(*late)  # the rest of it has been lost, or comes less often
        self._answer_when_complete()

    def _answer_when_complete(self) -> None:
        """Answer the joints that wait once the other readings of their stamp have come."""
        if self._waiting is None or self._imu is None:
            return
        now = self._waiting[0]
        if self._imu[0] >= now and (self._truth[0] >= now or not self._needs_truth):
            complete, self._waiting = self._waiting, None
            self._answer(*complete)

    def _answer(
        self, now: float, names: tuple[str, ...], joints: JointStates, answer: Answer
    ) -> None:
        """Hand over joints and the latest of the other readings."""
        if self._imu is None:
            return
        at, imu = self._imu
        previous, self.last = self.last, now
        if previous is None or now == previous:
            return
        if now < previous:
            self._on_return()
            self._warn('time went back (was the simulator restarted?): passive')
            return
        if abs(now - at) > LONGEST_LAG:
            self._warn('imu/data is silent: no commands')
            return
        self._on_paired(Paired(now - previous, names, joints, imu, self._truth[1]), answer)
