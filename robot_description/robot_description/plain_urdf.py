# SPDX-License-Identifier: Apache-2.0
"""A URDF without what readers of it disagree on: repeated, unknown and idle words."""

import xml.etree.ElementTree as ElementTree

from robot_description.urdf import INERTIA_COMPONENTS
from robot_description.urdf import MOVABLE
from robot_description.urdf_shapes import SIZES

SHAPES = ('visual', 'collision')


def plain_urdf(urdf: str) -> ElementTree.Element:
    """
    Return links and joints of a URDF that `parse_urdf` accepts, said in one way.

    Of repeated tags the first counts, as for `parse_urdf`; what is left out is URDF's default.
    Materials stay as they are. Limits of no width and the imitation of no joint are dropped.
    """
    tree = ElementTree.fromstring(urdf)
    for element in list(tree):
        if element.tag not in ('link', 'joint', 'material'):
            tree.remove(element)
    for link in tree.findall('link'):
        _keep_first(link, several=SHAPES)
        for shape in [*link.findall('visual'), *link.findall('collision')]:
            _keep_first(shape, several=('material',))
            _keep_one_kind(shape)
        inertial = link.find('inertial')
        if inertial is not None:
            _keep_first(inertial)
            for mass in inertial.findall('mass'):
                mass.set('value', mass.get('value', '0'))
            for inertia in inertial.findall('inertia'):
                for component in INERTIA_COMPONENTS:
                    inertia.set(component, inertia.get(component, '0'))
    movable = {j.get('name') for j in tree.findall('joint') if j.get('type') in MOVABLE}
    for joint in tree.findall('joint'):
        _keep_first(joint)
        joint.set('type', joint.get('type', 'fixed'))
        _drop_idle_words(joint, movable)
    return tree


def _keep_first(element: ElementTree.Element, several: tuple[str, ...] = ()) -> None:
    seen: set[str] = set()
    for child in list(element):
        if child.tag in seen and child.tag not in several:
            element.remove(child)
        seen.add(child.tag)


def _keep_one_kind(shape: ElementTree.Element) -> None:
    """Leave the kind of shape that `read_shape` reads."""
    geometry = shape.find('geometry')
    if geometry is None:
        return
    kind = next((kind for kind in SIZES if geometry.find(kind) is not None), None)
    for child in list(geometry):
        if child is not geometry.find(kind or ''):
            geometry.remove(child)


def _drop_idle_words(joint: ElementTree.Element, movable: set[str | None]) -> None:
    axis, limit, mimic = (joint.find(tag) for tag in ('axis', 'limit', 'mimic'))
    if axis is not None and (joint.get('type') not in MOVABLE or 'xyz' not in axis.attrib):
        joint.remove(axis)
    if mimic is not None and not {joint.get('name'), mimic.get('joint')} <= movable:
        joint.remove(mimic)
    if limit is not None and float(limit.get('lower', '0')) == float(limit.get('upper', '0')):
        limit.attrib.pop('lower', None)
        limit.attrib.pop('upper', None)
