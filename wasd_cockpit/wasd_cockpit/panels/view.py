# SPDX-License-Identifier: Apache-2.0
"""The panel View: the camera, the marks and the pointer of the scene."""

from mujoco.studio.dear_imgui import dear_imgui as imgui

from wasd_cockpit import style
from wasd_cockpit.link import Snapshot
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.scene import CAMERAS, HANDS, OVERLAYS, Scene
from wasd_cockpit.widgets import columns, in_rows

_HEIGHT = 28.0
_ABOUT = 15.0  # [degrees]
_HAND_LABELS = {'push': 'push by dragging', 'goal': 'goal by a click'}
_HAND_WORDS = {
    'push': 'drag the robot in the scene',
    'goal': 'click in the scene to set a goal; drag to choose its heading',
}


class View:
    """Chooses for the scene."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw it in the window that is open."""
        widgets, scene = page.widgets, self._scene
        widgets.heading('CAMERA')
        size = (columns(len(CAMERAS)), _HEIGHT)
        for name in in_rows(CAMERAS):
            if widgets.toggle(f'camera {name}', name, name == scene.camera, size):
                scene.camera = name
        quarter = columns(3)
        if widgets.button('camera back', '\uf0e2  back', (quarter, _HEIGHT)):
            scene.go_back()
        for name, label, about in (('left', '\uf060', -_ABOUT), ('right', '\uf061', _ABOUT)):
            imgui.SameLine()
            if widgets.button(f'about {name}', f'{label}  {name}', (quarter, _HEIGHT)):
                camera = page.viewer.camera
                camera.azimuth = (camera.azimuth + about + 180.0) % 360.0 - 180.0
        widgets.heading('SHOW')
        width = columns(2)
        for name, rgb in in_rows(OVERLAYS.items(), 2):
            # Lit in the colour that it has in the scene, on which dark words are read best.
            fill, text = (rgb, style.BACKGROUND) if name in scene.shown else (None, None)
            needs_feet = name in ('forces', 'footholds') and not snapshot.columns.feet
            if widgets.button(
                f'show {name}',
                name,
                (width, _HEIGHT),
                fill=None if needs_feet else fill,
                text=None if needs_feet else text,
                refusal='this robot has no feet' if needs_feet else '',
            ):
                scene.shown ^= {name}
        self._draw_pointer(page, snapshot)

    def _draw_pointer(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw what a pointer does in the scene, besides turning the camera."""
        widgets, scene = page.widgets, self._scene
        widgets.heading('POINTER')
        size = (columns(len(HANDS)), _HEIGHT)
        for name in in_rows(HANDS):
            is_on = name == scene.hand
            # What is on can be put away without a map, too.
            lacks_map = name == 'goal' and snapshot.navigation is None and not is_on
            refusal = 'this robot makes no map: start with --map' if lacks_map else ''
            if widgets.toggle(name, _HAND_LABELS[name], is_on, size, refusal=refusal):
                scene.hand = '' if is_on else name
        if scene.hand:
            widgets.words(_HAND_WORDS[scene.hand], style.DIM, wrapped=True)
        if scene.force:
            widgets.words(f'{scene.force:.0f} N', style.ODOMETRY)
