# SPDX-License-Identifier: Apache-2.0
"""The robot's view for the page: a picture with depth, and ranges all around."""

from collections.abc import Callable
import logging
import math
import threading
import time
from typing import NamedTuple

import mujoco
from mujoco_sim.sensors.camera import Frustum, Offscreen
from mujoco_sim.sensors.lidar import SEEN_GROUPS
from mujoco_sim.world import World
import numpy as np
from wasd_core.errors import SimulationError
from wasd_core.rotations import Pose

from wasd_cockpit.link import ATTENTION, Snapshot

SIZE = (320, 240)
FIELD_OF_VIEW = math.radians(87.0)  # from left to right
NEAR, FAR = 0.05, 20.0  # [m]
# Depths are coloured up to this one [m].
DEEPEST = 6.0
# The inset is so many times smaller.
INSET = 3
RAYS, LONGEST = 120, 12.0
# So often [s of wall time], as long as somebody looks.
PERIOD = 0.2
_LOG = logging.getLogger(__name__)


class Seen(NamedTuple):
    """
    What was seen: `number` counts, `picture` is rgba bytes of SIZE, None where none was wanted.

    `points` (n, 2) are where rays ended [m], `height` how high they ran.
    """

    number: int
    picture: bytes | None
    points: np.ndarray
    height: float


class Sight:
    """
    Looks from the front of a robot, in a thread of its own while somebody wants to see.

    The page calls `want` in each frame; `seen` is the last that was seen. Why there are no
    pictures, if there are none, stands in `failure`.
    """

    def __init__(self, snapshot: Callable[[], Snapshot | None]) -> None:
        """Take where the state of now comes from."""
        self._snapshot = snapshot
        self._wanted_until = {'picture': 0.0, 'ranges': 0.0}
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_closed = False
        self.world: World | None = None  # that is looked at; only its model is used
        self.seen = Seen(0, None, np.empty((0, 2)), 0.0)
        self.failure = ''

    def want(self, what: str) -> None:
        """Ask for `picture` or `ranges`, for a moment."""
        with self._wake:
            self._wanted_until[what] = time.monotonic() + ATTENTION
            self._wake.notify()
        if self._thread is None and self.world is not None and not self._is_closed:
            thread = threading.Thread(target=self._run, name='sight', daemon=True)
            thread.start()
            self._thread = thread  # not before: an interrupt may come between

    def close(self) -> None:
        """Look no more."""
        with self._wake:
            self._is_closed = True
            self._wake.notify()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        assert self.world is not None
        eye = _Eye(self.world)
        try:
            while self._wait():
                began = time.monotonic()
                self._look(eye)
                with self._wake:
                    left = PERIOD - (time.monotonic() - began)
                    self._wake.wait_for(lambda: self._is_closed, max(left, 0.02))
        except Exception:
            # A picture is no reason to stop a robot.
            _LOG.exception('the robot sees nothing any more')
            self.failure = 'no pictures: see the log'
        finally:
            eye.close()

    def _wait(self) -> bool:
        """Wait until somebody wants to see; False when that is over."""
        with self._wake:
            self._wake.wait_for(
                lambda: self._is_closed or max(self._wanted_until.values()) > time.monotonic()
            )
            return not self._is_closed

    def _look(self, eye: '_Eye') -> None:
        snapshot = self._snapshot()
        if snapshot is None:
            return
        eye.place(snapshot)
        now = time.monotonic()
        points, height = self.seen.points, self.seen.height
        if self._wanted_until['ranges'] > now:
            points, height = eye.ranges(snapshot)
        picture = None
        if self._wanted_until['picture'] > now and not self.failure:
            try:
                picture = eye.picture(snapshot)
            except SimulationError as error:
                self.failure = f'no pictures: {error}'
        self.seen = Seen(self.seen.number + 1, picture, points, height)


class _Eye:
    """The thread's own data of a world's model."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._model = world.model
        self._data = mujoco.MjData(world.model)
        self._offscreen: Offscreen | None = None
        angles = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)
        self._rays = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(RAYS)))
        self._hits = np.empty(RAYS, dtype=np.int32)
        self._distances = np.empty(RAYS)

    def place(self, snapshot: Snapshot) -> None:
        """Move everything to where a snapshot says."""
        self._data.qpos[:] = snapshot.qpos
        self._data.mocap_pos[:], self._data.mocap_quat[:] = np.hsplit(snapshot.mocap, [3])
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def ranges(self, snapshot: Snapshot) -> tuple[np.ndarray, float]:
        """Return where level rays from above the robot end, (n, 2) [m], and how high they are."""
        body = snapshot.body
        start = self._data.xpos[body].copy()
        start[2] += self._reach(body)[1] + 0.03
        mujoco.mj_multiRay(
            self._model,
            self._data,
            start,
            self._rays.flatten(),
            SEEN_GROUPS,
            True,
            body,
            self._hits,
            self._distances,
            None,
            RAYS,
            LONGEST,
        )
        hit = self._hits >= 0
        own = self._model.body_rootid[self._model.geom_bodyid[self._hits]] == body
        hit &= ~own
        points = start[:2] + self._distances[hit, None] * self._rays[hit, :2]
        return points, float(start[2])

    def picture(self, snapshot: Snapshot) -> bytes:
        """
        Return what the front of the robot sees, its depth in a corner.

        Raises:
            SimulationError: nothing renders here.
        """
        if self._offscreen is None:
            self._offscreen = Offscreen(self._world, *SIZE)
        frustum = Frustum(FIELD_OF_VIEW, *SIZE, NEAR, FAR)
        body = snapshot.body
        rotation = self._data.xmat[body].reshape(3, 3)
        ahead, up = self._reach(body)
        eye = self._data.xpos[body] + rotation @ (ahead + 0.02, 0.0, 0.5 * up)
        camera = Pose(eye, rotation)
        self._offscreen.look(self._data, camera, frustum, SIZE)
        image = np.full((SIZE[1], SIZE[0], 4), 255, dtype=np.uint8)
        image[..., :3] = self._offscreen.colours()
        self._offscreen.look(self._data, camera, frustum, SIZE, sky=False)
        inset = depth_colours(self._offscreen.depths(frustum)[::INSET, ::INSET])
        height, width = inset.shape[:2]
        image[-height - 4 : -4, -width - 4 : -4, :3] = inset
        return image.tobytes()

    def close(self) -> None:
        """Release what OpenGL holds."""
        if self._offscreen is not None:
            self._offscreen.close()

    def _reach(self, body: int) -> tuple[float, float]:
        """Return how far what collides on a body reaches ahead and up, in its axes [m]."""
        model = self._model
        geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype != 0))
        ends = model.geom_pos[geoms] + model.geom_aabb[geoms, :3] + model.geom_aabb[geoms, 3:]
        ahead, _, up = ends.max(axis=0, initial=0.0).tolist()
        return ahead, up


def depth_colours(depths: np.ndarray) -> np.ndarray:
    """Return colours (h, w, 3) of depths (h, w) [m]: red is near, blue far or nothing."""
    share = np.clip(np.nan_to_num(depths, posinf=DEEPEST) / DEEPEST, 0.0, 1.0)
    ramp = np.stack(
        (
            np.clip(2.0 - 3.0 * share, 0.0, 1.0),
            np.clip(1.0 - np.abs(3.0 * share - 1.3), 0.0, 1.0),
            np.clip(3.0 * share - 1.5, 0.0, 1.0),
        ),
        axis=-1,
    )
    return np.asarray(255.0 * ramp, dtype=np.uint8)
