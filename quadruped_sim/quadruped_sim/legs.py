# SPDX-License-Identifier: Apache-2.0
"""Order and names of legs and joints; every array over legs or joints uses this order."""

LEGS = ('FL', 'FR', 'RL', 'RR')
FL, FR, RL, RR = range(4)

JOINTS_PER_LEG = ('hip', 'thigh', 'calf')
JOINT_NAMES = tuple(f'{leg}_{joint}_joint' for leg in LEGS for joint in JOINTS_PER_LEG)
FOOT_NAMES = tuple(f'{leg}_foot' for leg in LEGS)

# +1 for the left legs and -1 for the right; +1 front, -1 rear.
LEFT = (1.0, -1.0, 1.0, -1.0)
FRONT = (1.0, 1.0, -1.0, -1.0)
