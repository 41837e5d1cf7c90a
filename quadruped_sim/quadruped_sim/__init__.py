# SPDX-License-Identifier: Apache-2.0
"""Leg controller of a four-legged robot: states, gait, estimator, convex MPC, whole-body QP."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'leg_controller')

# Public names by module; it is loaded for the first of them, as numba and ROS take a while.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'estimation.kalman': 'KalmanEstimator',
        'keys': 'KeyWords',
        'leg_controller': 'LegController',
        'leg_controller_node': 'LegControllerNode',
        'legs': 'Legs',
        'locomotion.convex_mpc': 'ConvexMpc',
        'locomotion.gait': 'Gait',
        'locomotion.whole_body': 'WholeBody',
        'parameters': 'LegControllerParameters LegNodeParameters',
        'robot_model': 'JointMap RobotModel RobotModelError',
    },
)
