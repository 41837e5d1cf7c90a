# SPDX-License-Identifier: Apache-2.0
"""Keyboard teleoperation: keys, keys to twist, presets, mux."""
