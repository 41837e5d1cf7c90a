# SPDX-License-Identifier: Apache-2.0
"""Says what is wrong with a description, where, and how to cure it."""

from robot_description.lint.session import lint, lint_session

__all__ = ['lint', 'lint_session']
