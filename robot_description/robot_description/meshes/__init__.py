# SPDX-License-Identifier: Apache-2.0
"""What is in the mesh files of a robot: whether it can be used, and whether its size can be."""

from robot_description.meshes.opening import open_meshes, with_stand_ins

__all__ = ['open_meshes', 'with_stand_ins']
