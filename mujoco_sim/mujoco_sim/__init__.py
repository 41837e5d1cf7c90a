# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo world: physics, clock, joints, sensors, services, viewers."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'simulator')

import robot_description.mujoco  # noqa: E402, F401  it prepares the import of mujoco

# Where each name is defined; loaded when it is asked for, as MuJoCo and ROS take a while.
_HOMES = {
    'CameraView': 'viewer.page',
    'NativeView': 'viewer.views',
    'RobotSetup': 'robot_setup',
    'Simulation': 'simulation',
    'SimulationError': 'scene',
    'SimulatorNode': 'simulator_node',
    'Viewpoint': 'pictures',
    'WebView': 'viewer.page',
    'World': 'world',
    'build_shared_world': 'world',
    'build_world': 'world',
    'take_picture': 'pictures',
    'usual_setup': 'robot_setup',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
