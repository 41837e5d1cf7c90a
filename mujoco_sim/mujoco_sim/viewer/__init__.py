# SPDX-License-Identifier: Apache-2.0
"""Viewers: the browser page, whose keys drive, and MuJoCo's own window."""
