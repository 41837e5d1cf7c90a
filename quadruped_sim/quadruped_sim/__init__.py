# SPDX-License-Identifier: Apache-2.0
"""Leg controller of a four-legged robot: states, gait, estimator, convex MPC, whole-body QP."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'leg_controller')

# Where each name is defined; loaded when it is asked for, as numba and ROS take a while.
_HOMES = {
    'ConvexMpc': 'locomotion.convex_mpc',
    'Gait': 'locomotion.gait',
    'JointMap': 'robot_model',
    'KalmanEstimator': 'estimation.kalman',
    'KeyWords': 'keys',
    'LegController': 'leg_controller',
    'LegControllerNode': 'leg_controller_node',
    'LegControllerParameters': 'parameters',
    'LegNodeParameters': 'parameters',
    'Legs': 'legs',
    'RobotModel': 'robot_model',
    'RobotModelError': 'robot_model',
    'WholeBody': 'locomotion.whole_body',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
