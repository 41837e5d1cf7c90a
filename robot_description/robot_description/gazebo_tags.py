# SPDX-License-Identifier: Apache-2.0
"""What the gazebo tags of a URDF say that another simulator can use; the rest is ignored."""

import xml.etree.ElementTree as ElementTree

from robot_description.urdf_numbers import parse_numbers

# Gazebo has spelt it both ways.
SELF_COLLIDE = ('self_collide', 'selfCollide')
FALSE = ('0', 'false')


def read_friction(tree: ElementTree.Element) -> dict[str, float]:
    """
    Return the first friction coefficient, mu1, of the links that give one.

    Raises:
        DescriptionError: it is no number.
    """
    return {
        str(tag.get('reference')): float(parse_numbers(str(tag.findtext('mu1')), 1, 'mu1')[0])
        for tag in tree.findall('gazebo')
        if tag.get('reference') and tag.findtext('mu1')
    }


def read_self_collide(tree: ElementTree.Element) -> dict[str, bool]:
    """Return whether links that say so may touch other links of the robot."""
    said = {}
    for tag in tree.findall('gazebo'):
        for name in SELF_COLLIDE:
            text = tag.findtext(name)
            if tag.get('reference') and text is not None:
                said[str(tag.get('reference'))] = text.strip().lower() not in FALSE
    return said
