# SPDX-License-Identifier: Apache-2.0
"""The panels, a file each: a class with `draw`, which reads the snapshot and gives orders."""
