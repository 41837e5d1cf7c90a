# SPDX-License-Identifier: Apache-2.0
"""
The simulated robots in a script of your own: no ROS, no threads, no clock but the simulated one.

    import wasd

    dog = wasd.Go2(seed=1)
    dog.press('2')
    dog.run(2.5)
    dog.press('5')
    dog.drive(0.5, 0.0, 0.2)
    dog.run(4.0)
    print(dog.state, dog.truth.position, dog.odometry.position)
"""

import sys

from robot_description.mujoco import choose_renderer

# MuJoCo chooses what it draws with when it is imported for the first time.
if 'mujoco' not in sys.modules:
    choose_renderer()

from mujoco_sim.parameters import (
    Payload,  # noqa: E402
    Untold,  # noqa: E402
)
from wasd_core.errors import UserError  # noqa: E402

from wasd.robots import (
    G1,  # noqa: E402
    Go2,  # noqa: E402
    Mbot,  # noqa: E402
)

__all__ = ['G1', 'Go2', 'Mbot', 'Payload', 'Untold', 'UserError']
