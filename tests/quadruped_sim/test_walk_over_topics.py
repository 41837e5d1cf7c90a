# SPDX-License-Identifier: Apache-2.0
"""The leg controller walks a robot that it knows by topics only."""

import numpy as np
import pytest
from quadruped_sim.leg_controller_node import LegControllerNode
from robot_description.packages import share_directory
import topic_rig
from topic_rig import PERIOD, place

pytestmark = pytest.mark.slow

LAIKAGO = str(
    share_directory('example-robot-data') / 'robots/laikago_description/urdf/laikago.urdf'
)


class Rig(topic_rig.Rig):
    """A simulator and a leg controller."""

    def __init__(self, spawn, spin_until, description, **parameters):
        super().__init__(spawn, spin_until, LegControllerNode, description, **parameters)

    def press(self, key, state):
        self.peer.press(key)
        self.wait_until(lambda: self.node.legs.controller._machine._due is not None)
        self.run(2 * PERIOD)
        assert self.node.legs.controller.state == state

    def drive(self, vx):
        self.peer.drive(vx)
        filtered = self.node.legs.controller.command_filter
        self.wait_until(lambda: filtered._is_new)


@pytest.mark.parametrize(
    ('description', 'estimator', 'height', 'frame'),
    [
        ('go2', 'truth', 0.335, 'base'),
        (LAIKAGO, 'kalman', 0.42, 'trunk'),  # other order of joints, no link for the IMU
    ],
    ids=['go2-truth', 'laikago'],
)
def test_keys_and_cmd_vel_walk_the_simulated_robot_over_topics(
    spawn, spin_until, description, estimator, height, frame
):
    rig = Rig(spawn, spin_until, description, estimator=estimator)
    rig.press('2', 'fixed stand')
    rig.run(2.2)
    assert rig.world.base().position[2] == pytest.approx(height, abs=0.025)
    rig.press('5', 'move base')
    for _ in range(5):
        rig.drive(0.4)
        rig.run(0.2)
    truth = rig.world.base()
    assert truth.planar_velocity[0] == pytest.approx(0.4, abs=0.08)
    assert truth.tilt < 0.1
    spin_until(spawn.pump, lambda: len(rig.peer.odometry) > 100)
    assert np.linalg.norm(place(rig.peer.odometry[-1]) - truth.position) < 0.05
    assert rig.peer.states == ['passive', 'fixed stand', 'move base']
    assert {message.child_frame_id for message in rig.peer.odometry} == {frame}
