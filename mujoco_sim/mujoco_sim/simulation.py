# SPDX-License-Identifier: Apache-2.0
"""The simulation loop: tasks and physics in lock-step, tied to wall time only by waiting."""

from collections.abc import Callable
import time

from mujoco_sim.pacer import Pacer
from mujoco_sim.schedule import Schedule
from mujoco_sim.world import World

# Messages are handled at least this often [s of wall time] ...
POLL_PERIOD = 0.02
# ... and while physics is held, waited for so long at a time [s].
HOLD_PERIOD = 0.002


class Simulation:
    """
    A world, what is scheduled on it, and the loop that advances both.

    In each instant the due tasks run in order, then physics steps to the next instant; nothing
    else moves the robot. `on_reset` are called when the robot is put back to its start.
    """

    def __init__(self, world: World, speed: float) -> None:
        self.world = world
        self.schedule = Schedule(world.time_step)
        self.pacer = Pacer(speed)
        self.paused = False
        self.on_reset: list[Callable[[], None]] = []

    def reset(self) -> None:
        """Put the robot and everything that remembers its past back to the start."""
        self.world.reset()
        for forget in self.on_reset:
            forget()

    def advance(self, steps: int) -> None:
        """Run tasks and physics for so many physics steps, whatever the wall time."""
        stride = self.schedule.stride
        while steps > 0:
            phase = self.world.tick % stride
            if phase == 0:
                self.schedule.run_due(self.world.tick)
            run = min(steps, stride - phase)
            self.world.step(run)
            steps -= run

    def run(
        self,
        stop: Callable[[], bool],
        poll: Callable[[float], None],
        each_second: Callable[[], None] = lambda: None,
        duration: float = float('inf'),
        may_advance: Callable[[], bool] = lambda: True,
    ) -> None:
        """
        Advance in pace with wall time until `stop` or until `duration` [s] of simulated time.

        `poll(timeout)` handles messages and may wait for them up to `timeout` [s]. While
        `may_advance` says no, simulated time stands still and messages are handled.
        """
        stride = self.schedule.stride
        stride_time = stride * self.world.time_step
        end = round(duration / self.world.time_step) if duration != float('inf') else None
        polled = time.monotonic()
        next_second = polled + 1.0
        while not stop() and (end is None or self.world.tick < end):
            wall = time.monotonic()
            if wall >= next_second:
                next_second = wall + 1.0
                self.pacer.measure(wall, self.world.time)
                each_second()
            if self.paused:
                self.pacer.restart()
                poll(POLL_PERIOD)
                continue
            if not may_advance():
                poll(HOLD_PERIOD)
                continue
            if self.pacer.allowed(wall, self.world.time) >= self.world.time + 0.5 * stride_time:
                self.advance(stride if end is None else min(stride, end - self.world.tick))
            if time.monotonic() - polled >= POLL_PERIOD:
                polled = time.monotonic()
                poll(0.0)
            wait = self.pacer.wait_for(self.world.time + stride_time, time.monotonic())
            if wait > 0.0:
                poll(min(wait, POLL_PERIOD))
