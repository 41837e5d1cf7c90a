# SPDX-License-Identifier: Apache-2.0
"""A neural network as the controller: its files, observations and commands."""

from wasd_core import quiet_start

quiet_start(__name__, 'policy_player')
