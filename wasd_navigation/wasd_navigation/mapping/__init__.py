# SPDX-License-Identifier: Apache-2.0
"""Where the robot is and what is around it: matching, pose graph, occupancy, map files."""
