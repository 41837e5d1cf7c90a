# SPDX-License-Identifier: Apache-2.0
"""The cockpit's part of the scene: marks, the camera, pushes by the pointer."""

from collections.abc import Iterator
import math
from typing import Any

import mujoco
from mujoco.studio import ux
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco_sim.sensors.lidar import SEEN_GROUPS
import numpy as np
from wasd_core.rotations import rpy_from_matrix

from wasd_cockpit import style
from wasd_cockpit.link import Grip, Marks, moved, Order, Push, Snapshot
from wasd_cockpit.panels.page_panel import PageState
from wasd_cockpit.widgets import Dragging

CAMERAS = ('follow', 'free', 'first person')
# What a pointer may do in the scene instead of turning the camera.
HANDS = ('push', 'goal')
OVERLAYS = {
    'motion': style.COMMAND,
    'forces': style.TRUTH,
    'footholds': style.FOOTHOLD,
    'estimate': style.ESTIMATE,
    'trail': style.TRUTH,
    'lidar': style.LIDAR,
}
# A hand: force [N/kg] per metre that it is ahead, and at most [N/kg], a little more than gravity.
STIFFNESS, STRONGEST = 17.0, 10.0
# How much farther away the camera is for a page with panels below the scene.
TALL_DISTANCE = 1.6
# A camera that follows goes up where furniture hides the robot: by so much at a time, no higher
# than this [degrees], and so fast up and down [degrees/s].
HIGHER, HIGHEST = 7.5, 82.0
UP_RATE, DOWN_RATE = 120.0, 20.0
# What is to be seen, as shares of a robot's size: before and behind its middle, above the ground.
SEEN_SHARE, SEEN_ABOVE = 0.7, 0.4
# More marks than these cost more than they show: each is 256 bytes a picture.
MOST_DOTS, MOST_TRAIL = 60, 40
_SPHERE, _ARROW = int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_ARROW)
_CAPSULE, _BOX = int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_BOX)
_TRACKING, _FREE = mujoco.mjtCamera.mjCAMERA_TRACKING, mujoco.mjtCamera.mjCAMERA_FREE
_HAND_FLAGS = style.flags(
    imgui.WindowFlags,
    'NoDecoration',
    'NoBackground',
    'NoMove',
    'NoSavedSettings',
    'NoBringToFrontOnFocus',
    'NoNav',
)


class Pool:
    """Geoms that are made once and moved: to make one takes as long as to move three."""

    def __init__(self) -> None:
        self._geoms: list[Any] = []
        self._count = 0

    def begin(self) -> None:
        """Use the geoms again."""
        self._count = 0

    def geoms(self) -> list[Any]:
        """Return those that were used."""
        return self._geoms[: self._count]

    def dot(self, place: np.ndarray, radius: float, rgb: style.Rgb) -> None:
        """Put a sphere somewhere."""
        geom = self._next(_SPHERE, rgb, 1.0)
        geom.pos[:] = place
        geom.size[:] = radius

    def box(
        self, place: np.ndarray, rotation: np.ndarray, half: np.ndarray, rgb: style.Rgb
    ) -> None:
        """Put a box somewhere, half seen."""
        geom = self._next(_BOX, rgb, 0.4)
        geom.pos[:] = place
        geom.mat[:] = rotation
        geom.size[:] = half

    def link(
        self, kind: int, width: float, start: np.ndarray, end: np.ndarray, rgb: style.Rgb
    ) -> None:
        """Put an arrow or a capsule from a point to another."""
        geom = self._next(kind, rgb, 1.0)
        mujoco.mjv_connector(geom, kind, width, start, end)

    def _next(self, kind: int, rgb: style.Rgb, alpha: float) -> Any:
        if self._count == len(self._geoms):
            geom = mujoco.MjvGeom()
            eye = np.eye(3).flatten()
            colour = np.ones(4, dtype=np.float32)
            mujoco.mjv_initGeom(geom, _SPHERE, np.zeros(3), np.zeros(3), eye, colour)
            self._geoms.append(geom)
        geom = self._geoms[self._count]
        self._count += 1
        geom.type = kind
        geom.rgba[:] = style.rgba(rgb, alpha)
        return geom


class Scene:
    """Applies in each frame what is chosen for the scene."""

    def __init__(self) -> None:
        self.camera = CAMERAS[0]
        self.shown: set[str] = {'motion', 'forces', 'footholds'}
        self.hand = ''  # one of HANDS, or none
        self.force = 0.0  # of the hand [N]
        # How much higher the camera is than was asked for [degrees]; None before the first look.
        self.lifted: float | None = None
        self._pool = Pool()
        self._home: tuple[float, float, float] | None = None
        # Where the robot and the pointer were then, and what is held, None once it is lost.
        self._grabbed: tuple[np.ndarray, tuple[float, float], Grip | None] | None = None
        self._in_force = ''
        self._scale = 1.0
        self._dragging = Dragging()

    def draw(self, page: PageState, snapshot: Snapshot) -> None:
        """Draw what is chosen."""
        self._pool.begin()
        draw_marks(self._pool, self.shown, snapshot, page)
        self._aim(page, snapshot)
        self._hold(page, snapshot)
        page.viewer.extra_geoms[:] = self._pool.geoms()

    def go_back(self) -> None:
        """See the robot as in the beginning."""
        self.camera, self._in_force = CAMERAS[0], 'back'

    def _aim(self, page: PageState, snapshot: Snapshot) -> None:
        camera = page.viewer.camera
        if self.camera == 'free':  # it stays where it is
            self.lifted = 0.0
        camera.elevation += self.lifted or 0.0
        if self._home is None:
            self._home = camera.distance, camera.azimuth, camera.elevation
        # Of a page that is narrower than high, more is needed to see as much.
        scale = TALL_DISTANCE if page.layout.is_tall else 1.0
        if scale != self._scale:
            camera.distance *= scale / self._scale
            self._scale = scale
        if self.camera != self._in_force:
            if self._in_force in ('first person', 'back'):
                camera.distance, camera.azimuth, camera.elevation = self._home
                camera.distance *= scale
            self._in_force = self.camera
        if self.camera == 'follow':
            self.lifted = self._climb(page, snapshot)
            camera.elevation -= self.lifted
        if self.camera == 'follow' and (page.layout.is_desk or page.layout.is_hidden):
            camera.type = _TRACKING
            return
        camera.type = _FREE
        if self.camera == 'follow':
            # Below the scene are panels: what is looked at is to be in what is left.
            camera.lookat[:] = snapshot.marks.place - self._lift(page, camera)
        elif self.camera == 'first person':
            self.lifted = 0.0
            self._look_ahead(camera, snapshot.marks)

    def _climb(self, page: PageState, snapshot: Snapshot) -> float:
        """Return how much higher the camera is than was asked for [degrees]: to see the robot."""
        wanted = lift_to_see(page.viewer, snapshot)
        if self.lifted is None:
            return wanted
        dt = float(imgui.GetIO().DeltaTime)
        return min(max(wanted, self.lifted - DOWN_RATE * dt), self.lifted + UP_RATE * dt)

    def _lift(self, page: PageState, camera: Any) -> np.ndarray:
        """Return how far above the page's middle that of the scene is, at the robot [m]."""
        rect, height = page.layout.scene, imgui.GetIO().DisplaySize.y
        share = 0.5 - 0.5 * (rect.top + rect.bottom) / height
        _, up = axes_of(camera)
        return np.asarray(share * height * metres_per_pixel(page.viewer, height) * up)

    def _look_ahead(self, camera: Any, marks: Marks) -> None:
        ahead = marks.rotation[:, 0]
        eye = marks.place + marks.size * ahead + 0.2 * marks.size * marks.rotation[:, 2]
        _, pitch, yaw = rpy_from_matrix(marks.rotation).tolist()
        camera.distance = 0.05
        camera.lookat[:] = eye + 0.05 * ahead
        camera.azimuth, camera.elevation = math.degrees(yaw), -math.degrees(pitch)

    def _hold(self, page: PageState, snapshot: Snapshot) -> None:
        """Push the robot with the pointer, or choose where it is to drive."""
        self.force = 0.0
        page.push = None
        if not self.hand:
            self._grabbed = None
            return
        # What the pointer does there is for the hand, and not for the camera.
        rect = page.layout.scene
        top = rect.top + 60.0
        imgui.SetNextWindowPos(imgui.Vec2(rect.left, top))
        imgui.SetNextWindowSize(imgui.Vec2(rect.width, rect.bottom - top))
        imgui.Begin('hand', flags=_HAND_FLAGS)
        imgui.SetCursorPos(imgui.Vec2(0.0, 0.0))
        imgui.InvisibleButton('hand', imgui.Vec2(rect.width, rect.bottom - top))
        page.widgets.note('hand')
        is_held = bool(imgui.IsItemActive())
        imgui.End()
        if self.hand == 'goal':
            self._point(page, snapshot, is_held and page.is_there)
        elif is_held and page.is_live:
            self._push(page, snapshot)
        else:
            self._grabbed = None

    def _point(self, page: PageState, snapshot: Snapshot, is_held: bool) -> None:
        """Order a goal where the scene is clicked; a drag from there is the way to look."""

        def to_map(x: float, y: float) -> tuple[float, float] | None:
            seen, navigation = place_at(page.viewer, x, y), snapshot.navigation
            if seen is None or navigation is None:
                return None  # the sky
            ((x, y),) = moved(seen[None], snapshot.pose, navigation.pose).tolist()
            return x, y

        drag = self._dragging.step(is_held, snapshot.robot, to_map)
        if drag is not None and page.is_there:
            page.link.order(Order.goal(*drag))

    def _push(self, page: PageState, snapshot: Snapshot) -> None:
        """Pull where the pointer drags it what it has taken hold of, and nothing else."""
        mouse, place = imgui.GetMousePos(), snapshot.marks.place
        if self._grabbed is None:
            self._grabbed = place.copy(), (mouse.x, mouse.y), snapshot.grip
        start, (x, y), grip = self._grabbed
        if grip != snapshot.grip:
            self._grabbed = start, (x, y), None
            return
        force = pull(page.viewer, (mouse.x - x, mouse.y - y), place - start, snapshot.mass)
        self.force = float(np.linalg.norm(force))
        page.push = Push((float(force[0]), float(force[1]), float(force[2])), snapshot.grip)
        end = place + force / (STIFFNESS * snapshot.mass)
        self._pool.link(_ARROW, 0.03 * snapshot.marks.size, place, end, style.ODOMETRY)


def axes_of(camera: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions in the world of right and up on the page, (3,) each."""
    azimuth, elevation = math.radians(camera.azimuth), math.radians(camera.elevation)
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    sin, cos = math.sin(elevation), math.cos(elevation)
    up = np.array([-sin * math.cos(azimuth), -sin * math.sin(azimuth), cos])
    return right, up


def lift_to_see(viewer: Any, snapshot: Snapshot) -> float:
    """
    Return how much higher a camera has to be to see a robot past what is around it [degrees].

    It is 0 where the robot is seen as it is, or from nowhere.
    """
    camera, marks = viewer.camera, snapshot.marks
    middle = np.array([*marks.place[:2], marks.height + SEEN_ABOVE * marks.size])
    along = SEEN_SHARE * marks.size * np.array([*marks.rotation[:2, 0], 0.0])
    azimuth = math.radians(camera.azimuth)
    for lift in np.arange(0.0, HIGHEST + camera.elevation, HIGHER).tolist():
        elevation = math.radians(camera.elevation - lift)
        level = math.cos(elevation)
        ahead = np.array(
            [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)]
        )
        eye = middle - camera.distance * ahead
        places = (middle, middle + along, middle - along)
        if all(_is_seen(viewer, eye, place, snapshot.body) for place in places):
            return float(lift)
    return 0.0


def _is_seen(viewer: Any, eye: np.ndarray, place: np.ndarray, body: int) -> bool:
    """Whether nothing but the robot itself, whose root is `body`, lies before a place in it."""
    met = np.array([-1], dtype=np.int32)
    model = viewer.model
    share = mujoco.mj_ray(model, viewer.data, eye, place - eye, SEEN_GROUPS, True, -1, met)
    return not 0.0 <= share < 1.0 or int(model.body_rootid[model.geom_bodyid[met[0]]]) == body


def metres_per_pixel(viewer: Any, height: float) -> float:
    """Return how long a pixel is where the camera looks at, on a page of so many."""
    half = math.radians(0.5 * float(viewer.model.vis.global_.fovy))
    return 2.0 * float(viewer.camera.distance) * math.tan(half) / max(height, 1.0)


def place_at(viewer: Any, x: float, y: float) -> np.ndarray | None:
    """Return what is seen at a place of the page [pixels]: x, y [m], None of the sky."""
    size = imgui.GetIO().DisplaySize
    share = x / max(size.x, 1.0), y / max(size.y, 1.0)
    aspect = size.x / max(size.y, 1.0)
    seen = ux.Pick(viewer.model, viewer.data, viewer.camera, *share, aspect, viewer.vis_options)
    return None if seen.body < 0 else np.array(seen.point)[:2]


def pull(viewer: Any, moved: tuple[float, float], followed: np.ndarray, mass: float) -> np.ndarray:
    """
    Return the force [N] of a hand that has moved so many pixels to the right and down.

    The robot has `followed` it so far [m].
    """
    right, up = axes_of(viewer.camera)
    scale = metres_per_pixel(viewer, imgui.GetIO().DisplaySize.y)
    ahead = scale * (moved[0] * right - moved[1] * up) - followed
    force = STIFFNESS * mass * ahead
    strength, most = float(np.linalg.norm(force)), STRONGEST * mass
    return np.asarray(force * (most / strength) if strength > most else force)


def draw_marks(pool: Pool, shown: set[str], snapshot: Snapshot, page: PageState) -> None:
    """Put what is shown beside the robot into a pool."""
    marks = snapshot.marks
    if 'motion' in shown:
        _draw_motion(pool, marks)
    if 'forces' in shown and marks.feet is not None and marks.forces is not None:
        weight = 9.0 * snapshot.mass
        for foot, force in zip(marks.feet, marks.forces, strict=True):
            if force[2] > 0.03 * weight:
                end = foot + force * (1.2 * marks.size / weight)
                pool.link(_ARROW, 0.025 * marks.size, foot, end, style.TRUTH)
    if 'footholds' in shown and marks.footholds is not None:
        for place in marks.footholds:
            pool.dot(place, 0.05 * marks.size, style.FOOTHOLD)
    if 'estimate' in shown and marks.estimate is not None:
        rotation = marks.rotation if marks.estimated_rotation is None else marks.estimated_rotation
        pool.box(marks.estimate, rotation, marks.size * np.array([0.5, 0.2, 0.12]), style.ESTIMATE)
    lines = [(snapshot.trail, style.TRUTH)] if 'trail' in shown else []
    lines += [(marks.path, style.COMMAND)] if marks.path is not None else []
    for places, rgb in lines:
        for start, end in _pieces(places):
            ends = (np.array([*start, marks.height + 0.01]), np.array([*end, marks.height + 0.01]))
            pool.link(_CAPSULE, 0.015 * marks.size, *ends, rgb)
    if 'lidar' in shown:
        page.sight.want('ranges')
        seen = page.sight.seen
        every = max(1, -(-len(seen.points) // MOST_DOTS))
        for x, y in seen.points[::every].tolist():
            pool.dot(np.array([x, y, seen.height]), 0.02, style.LIDAR)


def _draw_motion(pool: Pool, marks: Marks) -> None:
    """Put arrows above the robot: where it is to go, and where it believes to be going."""
    yaw = float(rpy_from_matrix(marks.rotation)[2])
    cos, sin = math.cos(yaw), math.sin(yaw)
    above = marks.place + (0.0, 0.0, 0.6 * marks.size)
    for height, (forward, left, _), rgb in (
        (0.0, marks.command, style.COMMAND),
        (0.12 * marks.size, marks.measured, style.ODOMETRY),
    ):
        if math.hypot(forward, left) < 0.02:
            continue
        way = np.array([cos * forward - sin * left, sin * forward + cos * left, 0.0])
        start = above + (0.0, 0.0, height)
        pool.link(_ARROW, 0.04 * marks.size, start, start + 1.2 * marks.size * way, rgb)


def _pieces(trail: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pieces of the last part of a trail that are longer than nothing."""
    every = max(1, -(-len(trail) // MOST_TRAIL))
    places = trail[::-1][::every]
    for start, end in zip(places[:-1], places[1:], strict=True):
        if np.abs(end - start).max() > 0.01:
            yield start, end
