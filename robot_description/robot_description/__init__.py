# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: expand, check, mend, load into MuJoCo and Pinocchio, publish."""

from wasd_core import quiet_start

quiet_start(__name__, 'describe', 'state_publisher')
