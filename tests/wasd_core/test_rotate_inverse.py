# SPDX-License-Identifier: Apache-2.0
import mujoco
import numpy as np
import pytest
from wasd_core.rotations import rotate_inverse


@pytest.mark.parametrize('seed', range(5))
def test_a_world_vector_is_seen_from_a_turned_frame_as_its_matrix_says(seed):
    random = np.random.default_rng(seed)
    quaternion = random.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    v_world = random.normal(size=3)
    R_world_base = np.empty(9)
    mujoco.mju_quat2Mat(R_world_base, quaternion)
    v_base = R_world_base.reshape(3, 3).T @ v_world
    np.testing.assert_allclose(rotate_inverse(quaternion, v_world), v_base, atol=1e-15, rtol=1e-13)
