# SPDX-License-Identifier: Apache-2.0
"""The ArbotiX board and its driver as they are: integer loop, ramp, odometry, slips included."""
