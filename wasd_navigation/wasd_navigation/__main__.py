# SPDX-License-Identifier: Apache-2.0
"""`python -m wasd_navigation` compiles the navigator, at the end of an installation."""

from wasd_navigation import guard
from wasd_navigation.mapping.localizer import Localizer
from wasd_navigation.mapping.mapper import Mapper
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.parts import make_pilot, warm_up

if __name__ == '__main__':
    settings = NavigatorParameters()
    mapper = Mapper(settings.mapping)
    warm_up(mapper, make_pilot(settings))
    long = NavigatorParameters(footprint_length=0.7, footprint_width=0.3)
    guard.warm_up(settings.footprint)
    warm_up(Localizer(mapper.grid, settings.mapping), make_pilot(long))
