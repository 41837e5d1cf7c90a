# SPDX-License-Identifier: Apache-2.0
"""The options of `wasd calibrate`."""

import argparse


def add_calibrate_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `wasd calibrate`."""
    parser.add_argument(
        '--description', default='mbot', metavar='PATH', help='a xacro or URDF of your own'
    )
    parser.add_argument(
        '--package-path', action='append', default=[], metavar='DIR', help='as of wasd mbot'
    )
    parser.add_argument(
        '--controller', metavar='FILE', help="YAML with the drive's parameters, to be calibrated"
    )
    parser.add_argument(
        '--wheel-separation', type=float, metavar='M', help='what the controller believes it is'
    )
    parser.add_argument(
        '--left-radius', type=float, metavar='M', help='what the controller believes it is'
    )
    parser.add_argument(
        '--right-radius', type=float, metavar='M', help='what the controller believes it is'
    )
    parser.add_argument(
        '--side', type=float, default=1.0, metavar='M', help='of the squares (default 1)'
    )
    parser.add_argument(
        '--runs', type=int, default=3, metavar='N', help='squares each way (default 3)'
    )
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='of their speeds')
    parser.add_argument('--output', metavar='FILE', help='YAML to write, for --controller')
