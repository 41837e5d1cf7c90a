# SPDX-License-Identifier: Apache-2.0
"""Writes an MCAP file that is complete at any time, also while it is being written."""
