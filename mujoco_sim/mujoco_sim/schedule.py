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

    def at_rate(self, parameter: str, rate: float, task: Callable[[], None]) -> None:
        """
        Add a task at a rate [Hz] that a parameter of this name asks for.

        Raises:
            SimulationError: the period is not a whole number of physics steps; names the
                parameter and the nearest rates that are legal.
        """
        try:
            self.every(1.0 / rate, task)
        except SimulationError:
            nearest = ' or '.join(f'{legal:g}' for legal in self._rates_near(rate))
            raise SimulationError(
                f'{parameter}: {rate:g} Hz does not fit the physics step of {self._time_step} s; '
                f'nearest: {nearest} Hz'
            ) from None

    def _rates_near(self, rate: float) -> list[float]:
        """Return the legal rates around a rate [Hz] that can be typed, e.g. not 1000 / 17."""
        steps = 1.0 / (rate * self._time_step)
        slower, faster = math.ceil(steps), math.floor(steps)
        while not self._is_short(slower):
            slower += 1
        while faster > 0 and not self._is_short(faster):
            faster -= 1
        return [1.0 / (count * self._time_step) for count in (slower, faster) if count > 0]

    def _is_short(self, steps: int) -> bool:
        rate = 1.0 / (max(1, steps) * self._time_step)
        return math.isclose(float(f'{rate:g}'), rate, rel_tol=1e-9)

    @property
    def stride(self) -> int:
        """Physics steps between two instants at which something may be due."""
        return math.gcd(*(steps for steps, _ in self._tasks)) or 1

    def run_due(self, step: int) -> None:
        """Run what is due at a physics step."""
        for steps, task in self._tasks:
            if step % steps == 0:
                task()
