# SPDX-License-Identifier: Apache-2.0
"""The states by name."""

from quadruped_sim.keys import StateName
from quadruped_sim.states.driving import (
    ControllerParts,
    FixedStand,
    FreeStand,
    MoveBase,
    Passive,
    State,
    Trotting,
)
from quadruped_sim.states.exercises import BalanceTest, StepTest, SwingTest
from quadruped_sim.states.jump import Jump
from quadruped_sim.states.lying import GetUp, LieDown


def make_states(parts: ControllerParts, passive: Passive) -> dict[StateName, State]:
    """All states over the same parts, `passive` among them."""
    return {
        StateName.PASSIVE: passive,
        StateName.FIXED_STAND: FixedStand(parts),
        StateName.FREE_STAND: FreeStand(parts),
        StateName.TROTTING: Trotting(parts),
        StateName.MOVE_BASE: MoveBase(parts),
        StateName.BALANCE_TEST: BalanceTest(parts),
        StateName.SWING_TEST: SwingTest(parts),
        StateName.STEP_TEST: StepTest(parts),
        StateName.GET_UP: GetUp(parts),
        StateName.LIE_DOWN: LieDown(parts),
        StateName.JUMP: Jump(parts),
    }
