# SPDX-License-Identifier: Apache-2.0
"""`wasd go2`, scripted, with the parameter step_in_place: it trots at zero command, too."""

import sys

import rclpy
from wasd_bringup.cli import make_parser
from wasd_bringup.options import read_options
from wasd_bringup.session import Session
from wasd_core.node import init_ros
from wasd_core.signals import StopSignals

PARAMETERS = ('--ros-args', '-p', 'leg_controller:step_in_place:=true')


def main() -> int:
    """Run the options of the command line; the report is written at the end."""
    options = read_options(make_parser().parse_args())
    with StopSignals() as stop:
        init_ros(PARAMETERS)
        session = Session(options)
        try:
            session.run(stop)
        finally:
            session.close()
            rclpy.try_shutdown()
    return stop.exit_status


if __name__ == '__main__':
    sys.exit(main())
