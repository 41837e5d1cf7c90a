# SPDX-License-Identifier: Apache-2.0
"""Keys of a run itself, whichever robot is driven: the help and the way back to the start."""

from teleop_keyboard.dashboard import HELP_KEY

# MuJoCo's own viewer has it there; no preset on any layout uses it.
RESET_KEY = 'BACKSPACE'
KEY_LINE = f'{HELP_KEY} all keys   {RESET_KEY} back to the start   Ctrl-C quit'
