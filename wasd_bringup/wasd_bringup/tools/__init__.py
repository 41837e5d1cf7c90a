# SPDX-License-Identifier: Apache-2.0
"""Commands beside a run: recordings, the graph of ROS, calibration."""
