# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a description: `lint` tells it by rules, with file, line and cure."""

from robot_description.lint.finding import Finding as Finding
from robot_description.lint.rules import RULES as RULES
from robot_description.lint.rules import Severity as Severity
from robot_description.lint.run import lint as lint
