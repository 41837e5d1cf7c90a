# SPDX-License-Identifier: Apache-2.0
"""What a navigator is made of by its parameters: what maps or localises, and what drives."""

from wasd_core.errors import UserError

from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.navigator import Locator
from wasd_navigation.navigator import Pilot
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.planning.driver import Driver

Parts = tuple[Locator, Pilot]


def make_parts(settings: NavigatorParameters) -> Parts:
    """
    Return what parameters ask for.

    Raises:
        UserError: the map cannot be read.
    """
    if settings.map:
        raise UserError(f'map {settings.map}: a map can be made, not used yet: leave it out')
    pilot = Driver(settings.limits, settings.footprint, settings.planning)
    return Mapper(settings.mapping), pilot
