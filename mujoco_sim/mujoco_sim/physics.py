# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's model and state, stepped for all the robots in it."""

from typing import Protocol

import mujoco

from mujoco_sim.errors import SimulationError


class Inhabitant(Protocol):
    """A robot, as far as stepping has to know it."""

    is_kinematic: bool

    @property
    def limits_change(self) -> bool:
        """Whether `before_step` and `after_step` are to be called at every single step."""

    def begin(self) -> None:
        """Begin anew; the state is that of the model at rest."""

    def begin_stretch(self) -> int | None:
        """Put in force what is due now; return the tick at which something changes next."""

    def before_step(self) -> None:
        """Set what depends on the state."""

    def after_step(self) -> None:
        """Note what only shows at single steps."""

    def end_stretch(self) -> None:
        """Drop what has ended."""


class Physics:
    """
    A compiled model, its state, and `tick`, the number of physics steps so far.

    Commands and pushes of the robots begin and end between steps; in between, MuJoCo runs alone.
    """

    def __init__(self, spec: mujoco.MjSpec) -> None:
        """
        Compile the specification; whoever lives in it adds itself to `robots`.

        Raises:
            SimulationError: what the compiler says, in one line.
        """
        try:
            self.model = spec.compile()
        except ValueError as error:
            raise SimulationError(f'MuJoCo: {" ".join(str(error).split())}') from None
        self.data = mujoco.MjData(self.model)
        self.time_step = float(self.model.opt.timestep)
        self.tick = 0
        self.robots: list[Inhabitant] = []

    def reset(self) -> None:
        """Put everything back to where it began, at rest; time goes on."""
        mujoco.mj_resetData(self.model, self.data)
        for robot in self.robots:
            robot.begin()
        mujoco.mj_forward(self.model, self.data)

    def step(self, count: int) -> None:
        """Advance by `count` physics steps."""
        last = self.tick + count
        while self.tick < last:
            changes = [robot.begin_stretch() for robot in self.robots]
            until = min(last, *(tick for tick in changes if tick is not None), last)
            self._advance(until - self.tick)
            for robot in self.robots:
                robot.end_stretch()

    def _advance(self, count: int) -> None:
        self.tick += count
        if all(robot.is_kinematic for robot in self.robots):
            return
        fickle = [robot for robot in self.robots if robot.limits_change]
        if not fickle:
            mujoco.mj_step(self.model, self.data, count)
            return
        for _ in range(count):
            for robot in fickle:
                robot.before_step()
            mujoco.mj_step(self.model, self.data)
            for robot in fickle:
                robot.after_step()
