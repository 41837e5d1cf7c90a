# SPDX-License-Identifier: Apache-2.0
"""The cockpit's view of a robot with legs or wheels."""
