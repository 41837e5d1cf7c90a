# SPDX-License-Identifier: Apache-2.0
"""Pairs readings by their stamps, and steps the legs."""

from collections.abc import Callable
import math

from wasd_core.robot_io import BaseState, ImuReading, JointCommand, JointStates, Reading

from quadruped_sim.feed import Feed
from quadruped_sim.legs import Legs

# Longest step of gait and estimate between two readings [s]; a request is as old as it is.
MAXIMUM_STEP = 0.02
# After so long without a reading the motors have braked and the robot has sunk [s].
LONGEST_GAP = 0.3
# Who rests is told so long after readings have become slow [s]:
# a simulator waits for nobody until it is first answered, and states may be lost till then.
SLOW_AT_REST = 1.0
# One that moves is stopped after this [s]: what a busy machine loses for a moment does no harm.
SLOW_IN_MOTION = 0.05

# Joints by name; and what is done with the command that answers them.
Joints = tuple[tuple[str, ...], JointStates]
Answer = Callable[[JointCommand], None]


class Readings:
    """
    Steps legs on joints, IMU and, with the estimator `truth`, the base, which come in any order.

    Joints wait for what belongs to them: topics overtake each other, on a busy machine by far.
    Times are stamps [s]. `warn` hears of readings that are of no use, `inform` that all is well
    again.
    """

    def __init__(
        self, legs: Legs, warn: Callable[[str], None], inform: Callable[[str], None]
    ) -> None:
        self._legs, self._warn, self._inform = legs, warn, inform
        self.last: float | None = None  # time of the joints that were answered last
        self._imu: tuple[float, ImuReading] | None = None
        self._truth: tuple[float, BaseState | None] = -math.inf, None
        self._needs_truth = legs.settings.estimator == 'truth'
        self._waiting: tuple[float, Joints, Answer] | None = None
        topics = ['joint_states', 'imu/data', *['ground_truth/odom'] * self._needs_truth]
        self._slow_for = 0.0  # readings have come too slowly for so long [s]
        self.feeds = {topic: Feed(legs.settings.update_rate) for topic in topics}
        self._needed = set(legs.model.quadruped.joint_names)

    def take_imu(self, now: float, imu: ImuReading) -> None:
        """Take what the IMU measured."""
        self._imu = now, imu
        self.feeds['imu/data'].take(now)
        self._answer_when_complete()

    def take_truth(self, now: float, truth: BaseState) -> None:
        """Take where the base is, as the simulator knows it."""
        self._truth = now, truth
        self.feeds['ground_truth/odom'].take(now)
        self._answer_when_complete()

    def take_joints(
        self, now: float, names: tuple[str, ...], joints: JointStates, answer: Answer
    ) -> None:
        """Take joints; `answer` gets the command for them, maybe later, maybe never."""
        if not self._needed <= set(names) or {len(part) for part in joints} != {len(names)}:
            self._warn('joint_states lacks joints, velocities or efforts: ignored')
            return
        late, self._waiting = self._waiting, (now, (names, joints), answer)
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

    def _answer(self, now: float, found: Joints, answer: Answer) -> None:
        """Step with joints and the latest of the other readings."""
        if self._imu is None:
            return
        at, imu = self._imu
        previous, self.last = self.last, now
        self.feeds['joint_states'].take(now)
        if previous is None or now == previous:
            return
        if now < previous:
            self._legs.reset()
            self._warn('time went back (was the simulator restarted?): passive')
            return
        if abs(now - at) > MAXIMUM_STEP:
            self._warn('imu/data is silent: no commands')
            return
        self._judge_feeds(now - previous)
        (names, joints), motors = found, self._legs.model.quadruped.joint_names
        self._legs.notice.step(now - previous)
        dt = min(now - previous, MAXIMUM_STEP)
        self._legs.controller.command_filter.pass_time(now - previous - dt)
        answer(self._legs.control(Reading(joints, imu), names, motors, dt, self._truth[1]))

    def _judge_feeds(self, gap: float) -> None:
        """Move only while every reading comes often enough; the last one came `gap` [s] ago."""
        legs = self._legs.controller
        if gap > LONGEST_GAP:
            legs.e_stop(f'no joint_states for {gap:.1f} s')
        slow = [topic for topic, feed in self.feeds.items() if feed.is_slow]
        self._slow_for = self._slow_for + gap if slow else 0.0
        if legs.hindrance and not slow:
            legs.hindrance = ''
            self._inform('readings come often enough again: it may move')
            return
        patience = SLOW_AT_REST if legs.rests else SLOW_IN_MOTION
        if not legs.hindrance and self._slow_for > patience:
            topic, wanted = slow[0], self._legs.settings.update_rate
            legs.hindrance = (
                f'{topic} comes at {self.feeds[topic].rate:.0f} Hz, wanted {wanted:g} '
                f'(update_rate): it does not move; start the simulator with '
                f'state_rate:={wanted:.1f}'
            )
            self._legs.say(legs.hindrance)
