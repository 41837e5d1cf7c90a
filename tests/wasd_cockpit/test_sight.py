# SPDX-License-Identifier: Apache-2.0
"""What the page's rays see of the world that a snapshot tells of."""

from types import SimpleNamespace

from descriptions import robot_named
from mujoco_sim.parameters import BoxSize
from mujoco_sim.world import build_world
import numpy as np
import pytest
from wasd_cockpit.sight import _Eye


def test_the_map_shows_a_box_from_when_it_was_put_there():
    world = build_world(robot_named('mbot'), boxes=[BoxSize(0.4, 0.4, 0.7)])
    eye = _Eye(world)

    def seen():
        data = world.data
        mocap = np.hstack((data.mocap_pos, data.mocap_quat))
        snapshot = SimpleNamespace(qpos=data.qpos.copy(), mocap=mocap, body=world.root)
        eye.place(snapshot)
        points, _ = eye.ranges(snapshot)
        return points

    assert len(seen()) == 0
    world.physics.boxes.put(0, 1.0, 0.0)
    points = seen()
    assert points[:, 0].min() == pytest.approx(0.8, abs=1e-6)
    assert (np.abs(points[:, 1]) <= 0.2).all()
