# SPDX-License-Identifier: Apache-2.0
"""One class per state of the leg controller."""
