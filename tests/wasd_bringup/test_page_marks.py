# SPDX-License-Identifier: Apache-2.0
"""What the page draws beside a walking Go2: where it presses, where it will land, how it goes."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from quadruped_sim.leg_kinematics import LEGS
from wasd_bringup.page.bridge import CockpitBridge
from wasd_bringup.ros.face import make_ros_run
from wasd_bringup.run.options import RunOptions
from wasd_cockpit.scene import draw_marks, OVERLAYS, Pool

from wasd_cockpit import style

pytestmark = pytest.mark.slow

FORWARD = 0.5  # [m/s], five presses of w
LOOKS, LOOK = 100, 0.01  # how many, and how far apart [s]
ARROW, SPHERE = int(mujoco.mjtGeom.mjGEOM_ARROW), int(mujoco.mjtGeom.mjGEOM_SPHERE)
BOX = int(mujoco.mjtGeom.mjGEOM_BOX)
WALKED: list['Walk'] = []


class Walk:
    """A Go2 that trots ahead; of each look the snapshot, the feet in truth, and which stand."""

    def __init__(self) -> None:
        options = RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0)
        self.session = make_ros_run(options)
        self._bridge = CockpitBridge(self.session)
        self.snapshots, self.feet, self.stances = [], [], []
        for keys, seconds in (('2', 1.3), ('4', 0.5), ('wwwww', 2.0)):
            for key in keys:
                self.session.press(key)
            self._advance(seconds)
        world, legs = self.session.world, self.session.robot.legs.controller
        links = list(world.parts.link_of_geom)
        geoms = [links.index(f'{leg}_foot') for leg in LEGS]
        for look in range(LOOKS):
            self._advance(LOOK)
            mujoco.mj_kinematics(world.model, world.data)
            self._bridge.step(float(look), 0.0)
            self.snapshots.append(self._bridge._link.snapshot)
            self.feet.append(world.data.geom_xpos[geoms].copy())
            self.stances.append(legs.locomotion.is_stance.copy())

    def _advance(self, seconds: float) -> None:
        self.session.simulation.advance(round(seconds / self.session.world.time_step))

    def close(self) -> None:
        """End it."""
        self._bridge.close()
        self.session.close()


@pytest.fixture
def walk(ros, tmp_path, monkeypatch):
    """A walk of a second, the same for all tests."""
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    if not WALKED:
        WALKED.append(Walk())
        WALKED[0].close()
    return WALKED[0]


def test_feet_and_what_they_press_with_are_drawn_where_they_are(walk):
    shown = np.array([snapshot.marks.feet for snapshot in walk.snapshots])
    assert np.abs(shown - walk.feet).max() < 0.02
    forces = np.array([snapshot.marks.forces for snapshot in walk.snapshots])
    weight = 9.81 * walk.snapshots[0].mass
    assert forces[:, :, 2].sum(axis=1).mean() == pytest.approx(weight, rel=0.15)


def test_a_foothold_is_where_the_foot_comes_down(walk):
    last, misses = {}, []
    for snapshot, feet, stance in zip(walk.snapshots, walk.feet, walk.stances, strict=True):
        aims = snapshot.marks.footholds
        swinging = np.flatnonzero(~stance)
        assert len(aims) == len(swinging)
        misses += [feet[leg, :2] - last.pop(leg)[:2] for leg in list(last) if stance[leg]]
        last |= dict(zip(swinging.tolist(), aims, strict=True))
    assert len(misses) >= 6
    assert np.linalg.norm(misses, axis=1).max() < 0.05


def test_arrows_are_how_it_is_to_go_and_goes_and_a_box_is_where_it_believes_to_be(walk):
    for snapshot in walk.snapshots:
        assert snapshot.marks.command[0] == pytest.approx(FORWARD, abs=0.02)
        assert np.abs(snapshot.marks.estimate - snapshot.marks.place).max() < 0.1
    measured = np.mean([snapshot.marks.measured[0] for snapshot in walk.snapshots])
    assert measured == pytest.approx(FORWARD, abs=0.1)


def test_each_mark_is_drawn_in_its_colour(walk):
    for snapshot in walk.snapshots[::10]:
        marks, pool = snapshot.marks, Pool()
        draw_marks(pool, {'motion', 'forces', 'footholds', 'estimate'}, snapshot, None)
        drawn = [(int(geom.type), tuple(np.round(geom.rgba[:3], 3))) for geom in pool.geoms()]

        def count(kind, rgb, drawn=drawn):
            return drawn.count((kind, tuple(np.round(np.float32(style.rgba(rgb)[:3]), 3))))

        assert count(ARROW, style.COMMAND) == count(ARROW, style.ODOMETRY) == 1
        pressing = (marks.forces[:, 2] > 0.27 * snapshot.mass).sum()
        assert count(ARROW, style.TRUTH) == pressing > 0
        assert count(SPHERE, style.FOOTHOLD) == len(marks.footholds)
        assert count(BOX, style.ESTIMATE) == 1
        assert len(drawn) == 3 + pressing + len(marks.footholds)


def test_the_trail_is_green_as_all_that_is_true(walk):
    pool = Pool()
    trail = np.array([(0.0, 0.0), (0.5, 0.0)])
    draw_marks(pool, {'trail'}, replace(walk.snapshots[-1], trail=trail), None)
    colours = {tuple(geom.rgba) for geom in pool.geoms()}
    assert colours == {tuple(np.float32(style.rgba(style.TRUTH)))}
    assert OVERLAYS['trail'] == style.TRUTH
