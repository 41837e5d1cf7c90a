# SPDX-License-Identifier: Apache-2.0
"""What every package here shares: errors, parameters, nodes, records of the robot."""
