# SPDX-License-Identifier: Apache-2.0
"""Order of the legs; every array over legs or joints uses it, with hip, thigh, calf in each."""

LEGS = ('FL', 'FR', 'RL', 'RR')
FL, FR, RL, RR = range(4)

# +1 for the left legs and -1 for the right; +1 front, -1 rear.
LEFT = (1.0, -1.0, 1.0, -1.0)
FRONT = (1.0, 1.0, -1.0, -1.0)
