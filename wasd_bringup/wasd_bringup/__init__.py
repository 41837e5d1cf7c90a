# SPDX-License-Identifier: Apache-2.0
"""The wasd command: composes and starts everything."""

from wasd_core import quiet_start

quiet_start(__name__, 'wasd')
