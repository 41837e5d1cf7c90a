# SPDX-License-Identifier: Apache-2.0
"""What a description says, as JSON has it: its tree, masses, joints, limits and meshes."""

import math
from typing import Any

from robot_description.description import Description
from robot_description.urdf import Joint


def info_record(description: Description) -> dict[str, Any]:
    """Return all there is to know in SI units, with `null` for a limit that there is not."""
    robot = description.robot
    return {
        'path': str(description.path),
        'name': robot.name,
        'kind': description.kind,
        'root': robot.root,
        'floating': not robot.is_fixed,
        'mass': robot.mass,
        'links': [
            {
                'name': link.name,
                'mass': link.mass,
                'visuals': [shape.url or shape.kind for shape in link.visuals],
                'collisions': [shape.url or shape.kind for shape in link.collisions],
            }
            for link in robot.links.values()
        ],
        'joints': [_joint_record(joint) for joint in robot.joints.values()],
        'meshes': [record.record() for record in description.meshes.records],
        'repairs': list(description.repairs),
        'warnings': list(description.warnings),
    }


def _joint_record(joint: Joint) -> dict[str, Any]:
    return {
        'name': joint.name,
        'type': joint.kind,
        'parent': joint.parent,
        'child': joint.child,
        'axis': joint.axis.tolist(),
        'lower': joint.lower if math.isfinite(joint.lower) else None,
        'upper': joint.upper if math.isfinite(joint.upper) else None,
        'effort': joint.effort,
        'velocity': joint.velocity,
        'mimics': joint.mimics or None,
    }
