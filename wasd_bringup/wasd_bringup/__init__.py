# SPDX-License-Identifier: Apache-2.0
"""The wasd command: composes and starts everything."""

from wasd_core.quiet_start import quiet_start

quiet_start(__name__, 'wasd')
