# SPDX-License-Identifier: Apache-2.0
"""What names of joints and links say: sides, and which of several names was meant."""

from robot_description.morphology.names import (
    guess_name,
    hint_at,
    OPPOSITE,
    part,
    SIDES,
    sides,
    unknown_joint_warning,
    words,
)

__all__ = [
    'OPPOSITE',
    'SIDES',
    'guess_name',
    'hint_at',
    'part',
    'sides',
    'unknown_joint_warning',
    'words',
]
