# SPDX-License-Identifier: Apache-2.0
"""Xacro files to URDF text, safely: nothing they hold runs programs or reads other files."""
