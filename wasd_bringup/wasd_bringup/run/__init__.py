# SPDX-License-Identifier: Apache-2.0
"""What a run is, without ROS: who drives a robot."""

from wasd_bringup.run.drivers import Drivers

__all__ = ['Drivers']
