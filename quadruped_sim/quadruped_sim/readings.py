# SPDX-License-Identifier: Apache-2.0
"""Steps the legs on readings that come by topics."""

from collections.abc import Callable

from wasd_core.paired import Answer, LONGEST_GAP, LONGEST_LAG, Paired, PairedReadings
from wasd_core.robot_io import BaseState, ImuReading, JointStates, Reading

from quadruped_sim.feed import Feed
from quadruped_sim.legs import Legs

# Who rests is told so long after readings have become slow [s]:
# a simulator waits for nobody until it is first answered, and states may be lost till then.
SLOW_AT_REST = 1.0
# One that moves is stopped after this [s]: what a busy machine loses for a moment does no harm.
SLOW_IN_MOTION = 0.05


class Readings:
    """
    Steps legs on joints, IMU and, with the estimator `truth`, the base, see `PairedReadings`.

    Times are stamps [s]. `warn` hears of readings that are of no use, `inform` that all is well
    again.
    """

    def __init__(
        self, legs: Legs, warn: Callable[[str], None], inform: Callable[[str], None]
    ) -> None:
        self._legs, self._inform = legs, inform
        needs_truth = legs.settings.estimator == 'truth'
        motors = legs.model.quadruped.joint_names
        self._paired = PairedReadings(motors, self._step, legs.reset, warn, needs_truth)
        topics = ['joint_states', 'imu/data', *['ground_truth/odom'] * needs_truth]
        self._slow_for = 0.0  # readings have come too slowly for so long [s]
        self.feeds = {topic: Feed(legs.settings.update_rate) for topic in topics}

    @property
    def last(self) -> float | None:
        """The time of the joints that were answered last [s]; None before there are any."""
        return self._paired.last

    def take_imu(self, now: float, imu: ImuReading) -> None:
        """Take what the IMU measured."""
        self.feeds['imu/data'].take(now)
        self._paired.take_imu(now, imu)

    def take_truth(self, now: float, truth: BaseState) -> None:
        """Take where the base is, as the simulator knows it."""
        self.feeds['ground_truth/odom'].take(now)
        self._paired.take_truth(now, truth)

    def take_joints(
        self, now: float, names: tuple[str, ...], joints: JointStates, answer: Answer
    ) -> None:
        """Take joints; `answer` gets the command for them, maybe later, maybe never."""
        self.feeds['joint_states'].take(now)
        self._paired.take_joints(now, names, joints, answer)

    def _step(self, found: Paired, answer: Answer) -> None:
        self._judge_feeds(found.gap)
        self._legs.notice.step(found.gap)
        # The longest step of gait and estimate; a request is as old as it is.
        dt = min(found.gap, LONGEST_LAG)
        self._legs.controller.command_filter.pass_time(found.gap - dt)
        reading, motors = Reading(found.joints, found.imu), self._legs.model.quadruped.joint_names
        answer(self._legs.control(reading, found.names, motors, dt, found.truth))

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
