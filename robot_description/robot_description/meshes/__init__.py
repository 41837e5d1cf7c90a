# SPDX-License-Identifier: Apache-2.0
"""From the mesh URL of a description to its file, and from the file to triangles."""
