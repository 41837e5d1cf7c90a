# SPDX-License-Identifier: Apache-2.0
"""Says what is wrong with a description, where, and how to cure it."""
