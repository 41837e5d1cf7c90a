# SPDX-License-Identifier: Apache-2.0
"""Recordings of a run, MCAP files: written while it runs, read, shown and driven again."""
