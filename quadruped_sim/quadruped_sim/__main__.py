# SPDX-License-Identifier: Apache-2.0
"""`python -m quadruped_sim` compiles the leg controller, at the end of an installation."""

from robot_description.description import load_robot

from quadruped_sim.compilation import warm_up
from quadruped_sim.robot_model import RobotModel

if __name__ == '__main__':
    warm_up(RobotModel(load_robot('go2')))
