# SPDX-License-Identifier: Apache-2.0
"""Unitree's own interface of the Go2, served by the simulated one."""

from wasd_core import quiet_start

quiet_start(__name__, 'unitree_bridge')
