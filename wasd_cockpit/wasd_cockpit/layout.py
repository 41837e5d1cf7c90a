# SPDX-License-Identifier: Apache-2.0
"""The layout of panels, on a desk and on a phone, and the shown one of several."""

from collections.abc import Mapping
from typing import NamedTuple

from wasd_cockpit.widgets import Rect

# Narrower pages, and such as are taller than wide, have one place for all below the scene
# [pixels].
LEAST_WIDTH = 1000.0
# Lower ones, and low ones that are not wide, show the scene alone until panels are asked for.
LEAST_HEIGHT = 450.0
# What is pressed is so much higher where there is no desk, and so a finger.
TOUCH_SCALE = 1.4
LEFT_WIDTH, RIGHT_WIDTH = 268.0, 330.0
# Shares of the page's height.
BOTTOM_SHARE, PHONE_SCENE_SHARE, EYES_SHARE = 0.30, 0.42, 0.5
# Of the left side, for the robot: what its buttons need [pixels], and at most this share.
ROBOT_HEIGHT, ROBOT_SHARE = 420.0, 0.62


class Place(NamedTuple):
    """A window for one or several panels, of which one is shown."""

    rect: Rect
    panels: tuple[str, ...]


class Layout:
    """
    Which panels are shown where.

    It remembers of each place which panel was chosen; `chosen` is all that is to be kept.
    """

    def __init__(self, chosen: Mapping[str, str] | None = None) -> None:
        self.chosen: dict[str, str] = dict(chosen or {})
        # Whether only the scene is shown; None: as there is room.
        self.hides: bool | None = None
        self.places: tuple[Place, ...] = ()
        self._size = (0.0, 0.0)
        self._place_of: dict[str, Place] = {}

    def resize(self, width: float, height: float) -> bool:
        """Take the size of the page [pixels]; return whether it is another one."""
        if (width, height) == self._size:
            return False
        self._size = (width, height)
        if self.is_desk:
            right = width - RIGHT_WIDTH
            robot = round(min(ROBOT_HEIGHT, ROBOT_SHARE * height))
            bottom, eyes = round((1.0 - BOTTOM_SHARE) * height), round(EYES_SHARE * height)
            self.places = (
                Place(Rect(0.0, 0.0, LEFT_WIDTH, robot), ('robot',)),
                Place(Rect(0.0, robot, LEFT_WIDTH, height), ('drive', 'keys')),
                Place(Rect(LEFT_WIDTH, bottom, right, height), ('plots',)),
                Place(Rect(right, 0.0, width, eyes), ('view', 'eyes', 'world')),
                Place(Rect(right, eyes, width, height), ('map',)),
            )
        else:
            top = round(PHONE_SCENE_SHARE * height)
            order = ('drive', 'robot', 'map', 'eyes', 'plots', 'view', 'keys', 'world')
            self.places = (Place(Rect(0.0, top, width, height), order),)
        self._place_of = {panel: place for place in self.places for panel in place.panels}
        return True

    @property
    def is_hidden(self) -> bool:
        """Whether only the scene is shown: where that was chosen, or there is no room for more."""
        if self.hides is not None:
            return self.hides
        return self._size[1] < LEAST_HEIGHT or not (self.is_desk or self.is_tall)

    @property
    def is_tall(self) -> bool:
        """Whether the page is higher than wide."""
        return self._size[0] <= self._size[1]

    @property
    def is_desk(self) -> bool:
        """Whether there is room for panels on all sides."""
        width, height = self._size
        return width >= LEAST_WIDTH and width > height

    @property
    def scene(self) -> Rect:
        """Where the scene is not covered."""
        width, height = self._size
        if self.is_hidden:
            return Rect(0.0, 0.0, width, height)
        if not self.is_desk:
            return Rect(0.0, 0.0, width, round(PHONE_SCENE_SHARE * height))
        bottom = round((1.0 - BOTTOM_SHARE) * height)
        return Rect(LEFT_WIDTH, 0.0, width - RIGHT_WIDTH, bottom)

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
