# SPDX-License-Identifier: Apache-2.0
"""Where the panels are, on a desk and on a phone, and which of several in one place is shown."""

from collections.abc import Mapping
from typing import NamedTuple

from wasd_cockpit.widgets import Rect

# Narrower pages, and such as are taller than wide, have one place for all below the scene
# [pixels].
LEAST_WIDTH = 900.0
LEFT_WIDTH = 268.0
# Shares of the page's height.
BOTTOM_SHARE, PHONE_SCENE_SHARE = 0.30, 0.42
# Of the left side, for the robot: what its buttons need [pixels], and at most this share.
ROBOT_HEIGHT, ROBOT_SHARE = 430.0, 0.62

PANELS = ('robot', 'drive', 'keys', 'plots')


class Place(NamedTuple):
    """A window for one or several panels, of which one is shown."""

    rect: Rect
    panels: tuple[str, ...]


def is_desk(width: float, height: float) -> bool:
    """Whether a page of a size [pixels] has room for panels on all sides."""
    return width >= LEAST_WIDTH and width > height


def places(width: float, height: float) -> tuple[Place, ...]:
    """Return the windows of a page of a size [pixels]."""
    if not is_desk(width, height):
        top = round(PHONE_SCENE_SHARE * height)
        order = ('drive', 'robot', 'plots', 'keys')
        return (Place(Rect(0.0, top, width, height), order),)
    robot = round(min(ROBOT_HEIGHT, ROBOT_SHARE * height))
    bottom = round((1.0 - BOTTOM_SHARE) * height)
    return (
        Place(Rect(0.0, 0.0, LEFT_WIDTH, robot), ('robot',)),
        Place(Rect(0.0, robot, LEFT_WIDTH, height), ('drive', 'keys')),
        Place(Rect(LEFT_WIDTH, bottom, width, height), ('plots',)),
    )


def scene_rect(width: float, height: float) -> Rect:
    """Return where the scene is not covered by panels, on a page of a size [pixels]."""
    if not is_desk(width, height):
        return Rect(0.0, 0.0, width, round(PHONE_SCENE_SHARE * height))
    bottom = round((1.0 - BOTTOM_SHARE) * height)
    return Rect(LEFT_WIDTH, 0.0, width, bottom)


class Layout:
    """
    Which panels are shown where.

    It remembers of each place which panel was chosen; `chosen` is all that is to be kept.
    """

    def __init__(self, chosen: Mapping[str, str] | None = None) -> None:
        self.chosen: dict[str, str] = dict(chosen or {})
        self.is_hidden = False
        self.places: tuple[Place, ...] = ()
        self._size = (0.0, 0.0)
        self._place_of: dict[str, Place] = {}

    def resize(self, width: float, height: float) -> None:
        """Take the size of the page [pixels]."""
        if (width, height) == self._size:
            return
        self._size = (width, height)
        self.places = places(width, height)
        self._place_of = {panel: place for place in self.places for panel in place.panels}

    @property
    def is_desk(self) -> bool:
        """Whether there is room for panels on all sides."""
        return is_desk(*self._size)

    @property
    def scene(self) -> Rect:
        """Where the scene is not covered."""
        if self.is_hidden:
            return Rect(0.0, 0.0, *self._size)
        return scene_rect(*self._size)

    def choose(self, panel: str) -> None:
        """Show a panel in its place."""
        self.chosen[self._place_of[panel].panels[0]] = panel

    def shown(self, place: Place) -> str:
        """Return the panel that a place shows."""
        chosen = self.chosen.get(place.panels[0], '')
        return chosen if chosen in place.panels else place.panels[0]

    def place_of(self, panel: str) -> Place | None:
        """Return the place in which a panel is shown, None where it is not."""
        place = self._place_of.get(panel)
        if self.is_hidden or place is None or self.shown(place) != panel:
            return None
        return place
