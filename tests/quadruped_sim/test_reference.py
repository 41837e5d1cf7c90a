# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from quadruped_sim.locomotion.reference import BaseReference
from quadruped_sim.locomotion.reference import horizon

TIMES = 0.025 * np.arange(1, 13)


@pytest.mark.parametrize('yaw_rate', [0.0, 1.5, -2.0])
def test_horizon_pose_is_the_integral_of_its_rate(yaw_rate):
    reference = BaseReference(
        np.array((1.0, 2.0, 0.3)), np.array((0.0, 0.0, 0.4)), np.array((0.6, -0.2, 0.0)), yaw_rate
    )
    times = np.linspace(0.0, 0.3, 3001)
    pose, rate = horizon(reference, 0.4, np.array((1.0, 2.0, 0.3)), times)
    summed = np.concatenate((np.zeros((1, 6)), np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0)))
    np.testing.assert_allclose(pose, summed * (times[1] - times[0]), atol=1e-6)


def test_horizon_is_seen_from_the_yaw_frame():
    reference = BaseReference(
        np.array((1.0, 3.0, 0.3)), np.array((0.0, 0.0, np.pi / 2)), np.array((0.0, 1.0, 0.0)), 0.0
    )
    pose, rate = horizon(reference, np.pi / 2, np.array((1.0, 2.0, 0.3)), TIMES)
    np.testing.assert_allclose(rate[:, 3], 1.0)
    np.testing.assert_allclose(pose[:, 3], 1.0 + TIMES)
    np.testing.assert_allclose(pose[:, [0, 1, 2, 4, 5]], 0.0, atol=1e-12)
