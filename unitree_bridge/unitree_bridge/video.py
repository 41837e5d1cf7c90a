# SPDX-License-Identifier: Apache-2.0
"""What the front camera sees, as a stream of JPEGs."""

from collections.abc import Callable
import io

from PIL import Image
from wasd_core.errors import UserError
from wasd_core.timing import Beat

from unitree_bridge import topics
from unitree_bridge.cdr import encode
from unitree_bridge.legs_robot import LegsRobot
from unitree_bridge.wire import Wire

# Rendering takes a machine without a graphics card 50 ms a picture, while time waits [Hz].
RATE = 5.0
_SMALL = {'video360p': (640, 360), 'video180p': (320, 180)}


class FrontVideo:
    """Tells pictures of three sizes while somebody listens; `say` hears why there are none."""

    def __init__(self, robot: LegsRobot, say: Callable[[str], None]) -> None:
        self._robot, self._say = robot, say
        self._beat, self._works = Beat(), True

    def step(self, wire: Wire) -> None:
        """Tell a picture, where one is due."""
        time = self._robot.time
        if not (self._beat.is_due(time, RATE) and self._works and wire.is_heard(topics.VIDEO)):
            return
        try:
            whole = self._robot.picture()
        except UserError as error:
            self._works = False
            self._say(f'frontvideostream: no picture: {error}')
            return
        fields = {name: _shrunk(whole, size) for name, size in _SMALL.items()}
        told = {'time_frame': round(1e6 * time), 'video720p': whole, **fields}
        wire.publish(topics.VIDEO, encode(topics.VIDEO.shape, told))


def _shrunk(jpeg: bytes, size: tuple[int, int]) -> bytes:
    written = io.BytesIO()
    picture = Image.open(io.BytesIO(jpeg))
    picture.draft('RGB', size)
    picture.resize(size).save(written, 'JPEG')
    return written.getvalue()
