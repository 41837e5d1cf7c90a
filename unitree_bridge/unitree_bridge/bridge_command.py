# SPDX-License-Identifier: Apache-2.0
"""The `unitree_bridge` command: a simulated Go2 that SDK programs find where they look."""

import argparse
from collections.abc import Sequence
import functools
import math
import sys

from wasd_core.command_line import OneLineParser
from wasd_core.errors import Stopped, UserError
from wasd_core.network import LAST_DOMAIN
from wasd_core.signals import last_status, StopSignals
from wasd_core.streams import lost_output, never_wait, OutputLost, prepare_streams, print_error


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = OneLineParser(
        prog='unitree_bridge',
        description="Simulate a Go2 that unchanged programs of Unitree's SDK command.",
        epilog='Example: unitree_bridge --domain 1 --world rough:0.03',
        allow_abbrev=False,
    )
    parser.add_argument(
        '--domain',
        type=functools.partial(_whole, most=LAST_DOMAIN),
        default=0,
        help="DDS domain: 0 (default), as on the robot, or 1 for unitree_mujoco's programs",
    )
    parser.add_argument(
        '--network', default='lo', help='a loopback interface; no other is used (default: lo)'
    )
    parser.add_argument(
        '--sync',
        action='store_true',
        help='physics waits for the LowCmd that answers each LowState',
    )
    parser.add_argument('--world', default='flat', help='world, as in `wasd go2` (default: flat)')
    parser.add_argument('--seed', type=_whole, default=0, help='seed of all noise (default: 0)')
    parser.add_argument(
        '--estimator', choices=('kalman', 'truth'), default='kalman', help='default: kalman'
    )
    parser.add_argument(
        '--speed', type=_number, default=1.0, help='real-time factor; 0: as fast as possible'
    )
    parser.add_argument(
        '--duration',
        type=_number,
        default=float('inf'),
        help='simulated seconds to run (default: no end)',
    )
    return parser


def _whole(text: str, most: float = math.inf) -> int:
    if not text.isascii() or not text.isdigit() or int(text) > most:
        span = '>= 0' if math.isinf(most) else f'from 0 to {most}'
        raise argparse.ArgumentTypeError(f'got {text!r}, wanted a whole number {span}')
    return int(text)


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not number >= 0.0:
        raise argparse.ArgumentTypeError(f'got {text!r}, wanted a number >= 0')
    return number


def main(argv: Sequence[str] | None = None) -> int:
    """Simulate until Ctrl-C or the duration is over; return the exit status."""
    prepare_streams()
    try:
        options = make_parser().parse_args(sys.argv[1:] if argv is None else argv)
        with StopSignals() as stop:
            never_wait()
            _run(options, stop)
        return last_status(stop)
    except UserError as error:
        print_error(error)
        return 2
    except Stopped:
        return 130
    except OutputLost as error:
        return lost_output(error)


def _run(options: argparse.Namespace, stop: StopSignals) -> None:
    # Here, because what simulates takes a second to load.
    from unitree_bridge.connection import open_wire
    from unitree_bridge.simulated import ALL_INTO, ALL_OUT, SimulatedGo2

    wire = open_wire(options.domain, options.network, ALL_OUT, ALL_INTO)
    go2 = SimulatedGo2(
        wire,
        _say,
        world=options.world,
        seed=options.seed,
        estimator=options.estimator,
        speed=options.speed,
        is_synced=options.sync,
    )
    _say(f'Unitree interface: domain {options.domain} on {options.network}')
    try:
        go2.run(lambda: stop.requested, options.duration)
    finally:
        go2.close()


def _say(text: str) -> None:
    print(text, flush=True)


if __name__ == '__main__':
    sys.exit(main())
