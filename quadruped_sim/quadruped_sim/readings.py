# SPDX-License-Identifier: Apache-2.0
"""Steps the legs on readings that come by topics."""

from collections.abc import Callable

from wasd_core.feed import Feeds
from wasd_core.paired import Answer, LONGEST_GAP, LONGEST_LAG, Paired, PairedReadings
from wasd_core.robot_io import Reading

from quadruped_sim.legs import Legs


class Readings(PairedReadings):
    """
    Steps legs on joints, IMU and, with the estimator `truth`, the base.

    Times are stamps [s]. `warn` hears of readings that are of no use, `inform` that all is well
    again.
    """

    def __init__(
        self, legs: Legs, warn: Callable[[str], None], inform: Callable[[str], None]
    ) -> None:
        self._legs, self._inform = legs, inform
        needs_truth = legs.settings.estimator == 'truth'
        topics = ['joint_states', 'imu/data', *['ground_truth/odom'] * needs_truth]
        feeds = Feeds(topics, legs.settings.update_rate, 'update_rate')
        motors = legs.model.quadruped.joint_names
        super().__init__(motors, feeds, self._step, legs.reset, warn)

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
        before = legs.hindrance
        self.feeds.judge(gap, legs.rests)
        legs.hindrance = self.feeds.hindrance
        if before and not legs.hindrance:
            self._inform('readings come often enough again: it may move')
        elif legs.hindrance != before:
            self._legs.say(legs.hindrance)
