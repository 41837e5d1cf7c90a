# SPDX-License-Identifier: Apache-2.0
"""Puts a base_footprint on the ground below a wheeled robot."""

from collections.abc import Iterator

from wasd_core.errors import DescriptionError

from robot_description.fix.workspace import Edit
from robot_description.fix.workspace import Workspace
from robot_description.lint.model import Model
from robot_description.lint.sides import find_wheels
from robot_description.lint.sides import FOOTPRINT

TEXT = """{indent}<link name="{footprint}"/>
{indent}<joint name="{footprint}_joint" type="fixed">
{indent}  <origin xyz="0 0 {height:.6g}" rpy="0 0 0"/>
{indent}  <parent link="{footprint}"/>
{indent}  <child link="{root}"/>
{indent}</joint>
"""


def add_footprint(workspace: Workspace) -> Iterator[Edit]:
    """
    Add the link and the joint to the root, at the height of the wheels' lowest point.

    Raises:
        DescriptionError: it cannot be said which link is the root.
    """
    model = workspace.model()
    if FOOTPRINT in model.links:
        return
    roots = [link for link in model.links if link not in model.joint_above]
    if len(roots) != 1:
        raise DescriptionError(f'{workspace.path}: {FOOTPRINT} needs one root to stand under')
    robot = workspace.tags(workspace.path)
    if robot.close is None:
        return
    data = workspace.sources()[workspace.path]
    line_start = data.rfind(b'\n', 0, robot.close) + 1
    is_alone = not data[line_start : robot.close].strip()
    at = line_start if is_alone else robot.close
    indent = '  '
    if robot.children:
        before = data[: robot.children[0].start].rpartition(b'\n')[2].decode()
        indent = before if not before.strip() else indent
    text = TEXT.format(
        indent=indent, footprint=FOOTPRINT, height=_ground_clearance(model), root=roots[0]
    )
    yield Edit(workspace.path, at, at, text if is_alone else '\n' + text)


def _ground_clearance(model: Model) -> float:
    """Return how far below the root the wheels touch the ground [m]."""
    heights = [wheel.radius - wheel.z for wheel in find_wheels(model)]
    return max(heights)
