# SPDX-License-Identifier: Apache-2.0
"""The simulation loop: schedule, pace, and waiting for controllers."""

from collections import deque
from collections.abc import Callable
import math
import time
from typing import NamedTuple

import numpy as np
from wasd_core.errors import SimulationError

from mujoco_sim.world import World

# Messages are handled at least this often [s of wall time] ...
POLL_PERIOD = 0.02
# ... and while physics is held, waited for so long at a time [s].
HOLD_PERIOD = 0.002

# Of so many instants of a cycle of all tasks it is remembered which are due.
CYCLE_REMEMBERED = 10_000
# Physics goes on without a look at anything else for so many strides at most; a share of a stride
# that is less is an error of rounding.
MOST_STRIDES, EXACT = 100, 1e-6

# A host that lags more than this [s] is not asked to catch up: the robot just runs slower.
MAXIMUM_LAG = 0.1
# With less than this share of the pace that is wanted, the host has no time to spare.
LEAST_SHARE = 0.95
# The factor is measured over no less than this [s]: shorter, a single physics step would show.
MINIMUM_INTERVAL = 0.5

# Physics runs at most so many states ahead of a controller in another process ...
STATES_AHEAD = 3
# ... and waits so long for one that has only just begun to answer, or has gone [s of wall time].
PATIENCE = 0.2
# So many answers in a row make a controller one that is relied on.
STEADY = 10
# Looks are milliseconds apart; longer than this we were stopped ourselves [s of wall time].
LONGEST_LOOK = 0.1
# A state that is not answered for so long may have been lost [s of wall time].
REPEAT_PERIOD = 0.1


class Simulation:
    """
    A world, its schedule, and the loop that advances both.

    In each instant the due tasks run in order, then physics steps to the next instant; nothing
    else moves the robot. `on_reset` are called when the robot is put back to its start, `on_step`
    after a step by hand, `on_resume` at the end of a pause. `hand_steps` are the ticks at which
    such steps of a recording ended, in order: they are made again.
    """

    def __init__(self, world: World, speed: float) -> None:
        self.world = world
        self.schedule = Schedule(world.time_step)
        self.pacer = Pacer(speed)
        self.paused = False
        self.on_reset: list[Callable[[], None]] = []
        self.on_step: list[Callable[[], None]] = []
        self.on_resume: list[Callable[[], None]] = []
        self.hand_steps: deque[int] = deque()

    def reset(self) -> None:
        """Put the robot and everything that remembers its past back to the start."""
        self.world.reset()
        for forget in self.on_reset:
            forget()

    def step(self, steps: int = 1) -> None:
        """Advance by so many physics steps, by hand, and tell of it."""
        self.advance(steps)
        self._tell_step()

    def _tell_step(self) -> None:
        for tell in self.on_step:
            tell()

    def advance(self, steps: int) -> None:
        """Run tasks and physics for so many physics steps, whatever the wall time."""
        while steps > 0:
            steps -= self._advance_once(steps)

    def _advance_once(self, most: int) -> int:
        """Run what is due, and physics up to the next task; return how many steps of `most`."""
        schedule, physics = self.schedule, self.world.physics
        ahead = schedule.stride - physics.tick % schedule.stride
        if ahead == schedule.stride:
            schedule.run_due(physics.tick)
            ahead = schedule.ahead(physics.tick)
        ahead, again = min(ahead, most), self.hand_steps
        if again:
            ahead = min(ahead, again[0] - physics.tick)
        physics.step(ahead)
        if again and physics.tick == again[0]:
            again.popleft()
            self._tell_step()
        return ahead

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
        stride, physics, pacer = self.schedule.stride, self.world.physics, self.pacer
        stride_time = stride * self.world.time_step
        end = round(duration / self.world.time_step) if duration != float('inf') else None
        polled = time.monotonic()
        next_second = polled + 1.0
        while not stop() and (end is None or physics.tick < end):
            wall = time.monotonic()
            if wall >= next_second:
                next_second = wall + 1.0
                self.pacer.measure(wall, self.world.time)
                each_second()
            if self.paused:
                self.pacer.restart()
                poll(POLL_PERIOD)
                if not self.paused:
                    for tell in self.on_resume:
                        tell()
                continue
            if not may_advance():
                poll(HOLD_PERIOD)
                continue
            now = self.world.time
            ahead = (pacer.allowed(wall, now) - now) / stride_time
            if ahead >= 0.5:
                most = stride * math.floor(min(ahead + 0.5, MOST_STRIDES))
                self._advance_once(most if end is None else min(most, end - physics.tick))
            wall = time.monotonic()
            if wall - polled >= POLL_PERIOD:
                polled = wall
                poll(0.0)
            if pacer.speed == 0.0:
                continue
            wait = pacer.wait_for(self.world.time + stride_time, time.monotonic())
            if wait > 0.0:
                poll(min(wait, POLL_PERIOD))


class Schedule:
    """
    Tasks that run every so many physics steps, in the order in which they were added.

    All tasks are due at step 0. What they see is therefore the same in every run, whatever the
    host's speed.
    """

    def __init__(self, time_step: float) -> None:
        self._time_step = time_step
        self._tasks: list[tuple[int, Callable[[], None]]] = []
        self._rests: list[Callable[[], float]] = []
        self._tireless: set[int] = set()  # the periods of tasks that never rest
        self._stride = self._cycle = 1
        self._due: dict[int, list[Callable[[], None]]] = {}  # by how far a cycle of all has come

    def every(
        self, period: float, task: Callable[[], None], rest: Callable[[], float] | None = None
    ) -> None:
        """
        Add a task with a period [s].

        `rest` returns for how long from now [s] the task would do nothing: it may be left out.

        Raises:
            SimulationError: the period is not a whole number of physics steps.
        """
        steps = round(period / self._time_step)
        if steps < 1 or not math.isclose(steps * self._time_step, period, rel_tol=1e-9):
            rate = f' ({1.0 / period:g} Hz)' if period > 0.0 else ''
            raise SimulationError(
                f'a period must be a multiple of the physics step {self._time_step} s, '
                f'got {period:g} s{rate}'
            )
        self._tasks.append((steps, task))
        periods = [steps for steps, _ in self._tasks]
        self._stride, self._cycle = math.gcd(*periods), math.lcm(*periods)
        self._due.clear()
        if rest is None:
            self._tireless.add(steps)
        elif rest not in self._rests:
            self._rests.append(rest)

    def at_rate(
        self,
        parameter: str,
        rate: float,
        task: Callable[[], None],
        rest: Callable[[], float] | None = None,
    ) -> None:
        """
        Add a task at a rate [Hz] that a parameter of this name asks for; `rest` is as in `every`.

        Raises:
            SimulationError: the period is not a whole number of physics steps; names the
                parameter and the next rate that is legal.
        """
        try:
            self.every(1.0 / rate, task, rest)
        except SimulationError:
            # A faster one: a slower one may be less than the parameter allows.
            steps = max(1, math.floor(1.0 / (rate * self._time_step)))
            fitting = next(filter(self._is_short, range(steps, 0, -1)))
            raise SimulationError(
                f'{parameter}: got {rate:g} Hz, which does not fit the physics step of '
                f'{self._time_step} s; {1.0 / (fitting * self._time_step):g} Hz does'
            ) from None

    def _is_short(self, steps: int) -> bool:
        """Whether the rate of so many steps can be typed, as that of 17 cannot: 1000 / 17 Hz."""
        rate = 1.0 / (steps * self._time_step)
        return math.isclose(float(f'{rate:g}'), rate, rel_tol=1e-9)

    @property
    def stride(self) -> int:
        """Physics steps between two instants at which something may be due."""
        return self._stride

    def ahead(self, step: int) -> int:
        """Return how many steps after an instant the next one comes at which a task may act."""
        stride = self._stride
        strides = MOST_STRIDES
        for period in self._tireless:
            strides = min(strides, (period - step % period) // stride)
        for rest in self._rests:
            if strides == 1:
                return stride
            idle = max(rest() / (stride * self._time_step), 1.0)
            strides = math.ceil(min(idle, strides) - EXACT)
        return strides * stride

    def run_due(self, step: int) -> None:
        """Run what is due at a physics step."""
        phase = step % self._cycle
        due = self._due.get(phase)
        if due is None:
            due = [task for steps, task in self._tasks if step % steps == 0]
            if len(self._due) < CYCLE_REMEMBERED:
                self._due[phase] = due
        for task in due:
            task()


class Pacer:
    """
    Ties simulated time to wall time by a factor, and measures the factor reached.

    It is told both times [s] and reads no clock. `speed` 0 means as fast as it goes.
    """

    def __init__(self, speed: float) -> None:
        self.speed = speed
        self._anchor: tuple[float, float] | None = None
        self._mark: tuple[float, float] | None = None
        self.real_time_factor = 0.0

    def restart(self) -> None:
        """Forget the past, e.g. after a pause."""
        self._anchor = None
        self._mark = None

    def allowed(self, wall: float, simulated: float) -> float:
        """Return the simulated time [s] that should have been reached at a wall time."""
        if self._mark is None:
            self._mark = (wall, simulated)
        if self.speed == 0.0:
            return float('inf')
        if self._anchor is None:
            self._anchor = (wall, simulated)
        target = self._anchor[1] + (wall - self._anchor[0]) * self.speed
        if target - simulated > MAXIMUM_LAG * self.speed:
            target = simulated + MAXIMUM_LAG * self.speed
            self._anchor = (wall, target)
        return target

    @property
    def is_hurried(self) -> bool:
        """Whether the host has no time to spare: no pace is given, or it is not reached."""
        return 0.0 < self.real_time_factor < LEAST_SHARE * self.speed or self.speed == 0.0

    def wait_for(self, simulated: float, wall: float) -> float:
        """Return how long [s] to wait until a simulated time may be reached; 0 if it may now."""
        if self.speed == 0.0 or self._anchor is None:
            return 0.0
        due = self._anchor[0] + (simulated - self._anchor[1]) / self.speed
        return max(0.0, due - wall)

    def measure(self, wall: float, simulated: float) -> float:
        """
        Return the real-time factor since the last measurement or restart, and keep it.

        Within MINIMUM_INTERVAL of that it is still the factor measured last, at first 0.
        """
        if self._mark is not None and wall - self._mark[0] >= MINIMUM_INTERVAL:
            self.real_time_factor = (simulated - self._mark[1]) / (wall - self._mark[0])
            self._mark = (wall, simulated)
        return self.real_time_factor


class AnswerHold:
    """
    Keeps the last state that a controller answered, and the time of waiting for it.

    A controller in another process that stamps its commands with the state they answer is never
    more than STATES_AHEAD states behind: on a busy machine the robot slows down instead of
    falling. One that has been answering and is still there (a process that is stopped or starved
    keeps its publisher) is waited for longer than one that has gone. After that, physics goes on
    without it, and waits again once it has answered.
    """

    def __init__(self) -> None:
        self._answered: float | None = None
        self._answers = 0
        self._held: float | None = None
        self._looked_at = self._repeats_at = 0.0

    @property
    def is_holding(self) -> bool:
        """Whether physics is being held."""
        return self._held is not None

    def answer(self, stamp: float, now: float) -> None:
        """Take a command's stamp at a simulated time [s]; one of another clock does not count."""
        self._answered = stamp if 0.0 < stamp <= now + 1e-6 else None
        self._answers = self._answers + 1 if self._answered is not None else 0
        self._held = None

    def may_advance(
        self, now: float, state_rate: float, patience: float, is_there: Callable[[], bool]
    ) -> bool:
        """
        Whether physics may go on at a simulated time [s], with so many states a second.

        `patience` [s of wall time] is for a controller that was answering and that `is_there`.
        """
        if self._answered is None or now - self._answered <= STATES_AHEAD / state_rate:
            self._held = None
            return True
        wall = time.monotonic()
        if self._held is None:
            self._held, self._looked_at, self._repeats_at = 0.0, wall, REPEAT_PERIOD
        self._held += min(wall - self._looked_at, LONGEST_LOOK)
        self._looked_at = wall
        if self._held <= PATIENCE:
            return False
        if self._answers >= STEADY and self._held <= patience and is_there():
            return False
        self._answered, self._answers, self._held = None, 0, None
        return True

    def repeats(self) -> bool:
        """Whether the last state is to be sent again; where all were lost both would wait."""
        if self._held is None or self._held < self._repeats_at:
            return False
        self._repeats_at = self._held + REPEAT_PERIOD
        return True


class TickSummary(NamedTuple):
    """Durations of a periodic task [microseconds]; an overrun took longer than its period."""

    median_us: float
    p99_us: float
    max_us: float
    overruns: int


# So many runs are remembered one by one: two minutes at 500 Hz, half a megabyte.
REMEMBERED = 60_000


class TickStatistics:
    """
    Collects the wall-clock durations of a task with a period [s].

    The longest run and overruns are of all runs, however many; median and 99th percentile are of
    the last REMEMBERED ones, so that memory does not grow with the run.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._durations = np.zeros(REMEMBERED)
        self._count = 0
        self._overruns = 0
        self._longest = 0.0

    def add(self, duration: float) -> None:
        """Count one run that took so long [s]."""
        self._durations[self._count % REMEMBERED] = duration
        self._count += 1
        self._overruns += duration > self._period
        self._longest = max(self._longest, duration)

    @property
    def last(self) -> float:
        """The duration of the last run [s], 0 before the first."""
        return float(self._durations[(self._count - 1) % REMEMBERED])

    def summary(self, last: int | None = None) -> TickSummary:
        """
        Return the figures of all runs, or of the `last` ones; zeros before the first.

        `last` is at most REMEMBERED.
        """
        known = min(self._count, REMEMBERED)
        count = min(last, known) if last else known
        if not count:
            return TickSummary(0.0, 0.0, 0.0, 0)
        durations = self._durations[np.arange(self._count - count, self._count) % REMEMBERED]
        longest, overruns = self._longest, self._overruns
        if last:
            longest, overruns = durations.max(), (durations > self._period).sum()
        # np.percentile would first load numpy's masked arrays.
        parts = np.array((0.5, 0.99)) * (count - 1)
        median, high = np.interp(parts, np.arange(count), np.sort(1e6 * durations))
        return TickSummary(
            round(float(median), 1),
            round(float(high), 1),
            round(float(1e6 * longest), 1),
            int(overruns),
        )
