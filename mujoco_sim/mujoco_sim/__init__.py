# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo world: physics, clock, joints, sensors, services, viewers."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'simulator')

import robot_description.mujoco  # noqa: E402, F401  it prepares the import of mujoco

# Public names by module; it is loaded for the first of them, as MuJoCo and ROS take a while.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'pictures': 'Viewpoint take_picture',
        'robot_setup': 'RobotSetup usual_setup',
        'scene': 'SimulationError',
        'simulation': 'Simulation',
        'simulator_node': 'SimulatorNode',
        'viewer.page': 'CameraView WebView',
        'viewer.views': 'NativeView',
        'world': 'World build_shared_world build_world',
    },
)
