# SPDX-License-Identifier: Apache-2.0
"""The wasd command: composes and starts everything."""
