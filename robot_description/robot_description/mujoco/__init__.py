# SPDX-License-Identifier: Apache-2.0
"""A robot as a MuJoCo model: its tree, its masses, its shapes, and what of it touches what."""
