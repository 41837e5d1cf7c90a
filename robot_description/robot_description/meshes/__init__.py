# SPDX-License-Identifier: Apache-2.0
"""What is in the mesh files of a robot: whether it can be used, and whether its size can be."""
