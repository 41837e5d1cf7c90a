# SPDX-License-Identifier: Apache-2.0
"""Viewers of a world; of the browsers on a page one drives, and others may ask for control."""
