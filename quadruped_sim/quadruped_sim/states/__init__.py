# SPDX-License-Identifier: Apache-2.0
"""One class per state of the leg controller."""

from quadruped_sim.states.driving import ControllerParts, State
from quadruped_sim.states.table import make_states

__all__ = ['ControllerParts', 'State', 'make_states']
