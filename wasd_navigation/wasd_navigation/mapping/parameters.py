# SPDX-License-Identifier: Apache-2.0
"""Parameters of mapping and localising."""

from dataclasses import dataclass

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters


@dataclass(frozen=True, kw_only=True)
class MappingParameters(Parameters):
    """What scans are matched against, when places are kept, how the grid is drawn."""

    resolution: float = parameter(
        0.05,
        doc='Length of a cell of the map',
        unit='m',
        minimum=0.01,
        maximum=1.0,
        read_only=True,
    )
    range_noise: float = parameter(
        0.012, doc="Standard deviation of the lidar's ranges", unit='m', above=0.0, read_only=True
    )
    minimum_travel_distance: float = parameter(
        0.3, doc='A place is kept after so much way', unit='m', above=0.0, read_only=True
    )
    minimum_travel_heading: float = parameter(
        0.35, doc='A place is kept after so much turning', unit='rad', above=0.0, read_only=True
    )
    scan_buffer_size: int = parameter(
        25,
        doc='A scan is matched against what was seen from so many last places',
        minimum=3,
        read_only=True,
    )
    loop_search_maximum_distance: float = parameter(
        2.5,
        doc='A loop is closed with a place within this distance',
        unit='m',
        above=0.0,
        read_only=True,
    )
    loop_every: int = parameter(
        2, doc='Of so many places one is tried to close a loop with', minimum=1, read_only=True
    )
    loop_match_minimum_chain_size: int = parameter(
        13, doc='Old places around one, with which a loop is closed', minimum=1, read_only=True
    )
