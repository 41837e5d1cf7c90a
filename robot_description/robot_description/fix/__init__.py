# SPDX-License-Identifier: Apache-2.0
"""Mends what can be mended in a description, in its text; nothing is written but on request."""
