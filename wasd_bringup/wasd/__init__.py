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
from wasd_core.errors import UserError
from wasd_core.loading import loading

# MuJoCo chooses what it draws with when it is imported for the first time.
if 'mujoco' not in sys.modules:
    choose_renderer()

with loading(is_ours=False):
    from mujoco_sim.parameters import Payload, Untold

    from wasd.robots import G1, Go2, Mbot

__all__ = ['G1', 'Go2', 'Mbot', 'Payload', 'Untold', 'UserError']
