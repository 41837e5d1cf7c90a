# SPDX-License-Identifier: Apache-2.0
"""Notes the steps that MuJoCo takes."""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import pytest


@contextmanager
def steps_taken() -> Iterator[list[int]]:
    """Tell how long each step of physics is [ms], in a list that grows while they are taken."""
    taken: list[int] = []
    step = mujoco.mj_step

    def noted(model: mujoco.MjModel, data: mujoco.MjData, count: int = 1) -> None:
        taken.extend([round(1e3 * model.opt.timestep)] * count)
        step(model, data, count)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mujoco, 'mj_step', noted)
        yield taken
