# SPDX-License-Identifier: Apache-2.0
"""What a run is, without ROS: robots, who drives them, report."""
