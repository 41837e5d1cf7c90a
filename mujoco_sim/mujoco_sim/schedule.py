# SPDX-License-Identifier: Apache-2.0
"""The one scheduler: periodic tasks on simulated time, counted in physics steps."""

from collections.abc import Callable
import math

from mujoco_sim.errors import SimulationError


class Schedule:
    """
    Tasks that run every so many physics steps, in the order in which they were added.

    All tasks are due at step 0. What they see is therefore the same in every run, whatever the
    host's speed.
    """

    def __init__(self, time_step: float) -> None:
        self._time_step = time_step
        self._tasks: list[tuple[int, Callable[[], None]]] = []

    def every(self, period: float, task: Callable[[], None]) -> None:
        """
        Add a task with a period [s].

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

    @property
    def stride(self) -> int:
        """Physics steps between two instants at which something may be due."""
        return math.gcd(*(steps for steps, _ in self._tasks)) or 1

    def run_due(self, step: int) -> None:
        """Run what is due at a physics step."""
        for steps, task in self._tasks:
            if step % steps == 0:
                task()
