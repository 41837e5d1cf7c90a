# SPDX-License-Identifier: Apache-2.0
"""One class per state of the leg controller."""

from quadruped_sim.keys import StateName
from quadruped_sim.states.driving import ControllerParts
from quadruped_sim.states.driving import FixedStand
from quadruped_sim.states.driving import FreeStand
from quadruped_sim.states.driving import MoveBase
from quadruped_sim.states.driving import Passive
from quadruped_sim.states.driving import State
from quadruped_sim.states.driving import Trotting
from quadruped_sim.states.exercises import BalanceTest
from quadruped_sim.states.exercises import StepTest
from quadruped_sim.states.exercises import SwingTest
from quadruped_sim.states.jump import Jump
from quadruped_sim.states.lying import GetUp
from quadruped_sim.states.lying import LieDown

__all__ = ['ControllerParts', 'State', 'make_states']


def make_states(parts: ControllerParts) -> dict[StateName, State]:
    """All states over the same parts."""
    return {
        StateName.PASSIVE: Passive(parts),
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
