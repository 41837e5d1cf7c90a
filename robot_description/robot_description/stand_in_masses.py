# SPDX-License-Identifier: Apache-2.0
"""Masses for a description that is only there to be looked at, as in the first URDF lessons."""

import xml.etree.ElementTree as ElementTree

MASS, INERTIA = '1.0', '0.01'  # [kg], [kg m^2]


def with_stand_in_masses(urdf: str) -> str:
    """Return a URDF in which links without an inertial have one, of no meaning."""
    tree = ElementTree.fromstring(urdf)
    for link in tree.findall('link'):
        if link.find('inertial') is None:
            inertial = ElementTree.SubElement(link, 'inertial')
            ElementTree.SubElement(inertial, 'mass', value=MASS)
            diagonal = dict.fromkeys(('ixx', 'iyy', 'izz'), INERTIA)
            zeros = dict.fromkeys(('ixy', 'ixz', 'iyz'), '0')
            ElementTree.SubElement(inertial, 'inertia', diagonal | zeros)
    return ElementTree.tostring(tree, encoding='unicode')
