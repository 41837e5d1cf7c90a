# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo world: physics, clock, joints, sensors, services, viewers."""

from importlib import import_module
from typing import Any

from wasd_core import quiet_start

quiet_start(__name__, 'simulator')

# Where each name is defined; loaded when it is asked for, as MuJoCo and ROS take a while.
_HOMES = {
    'CameraView': 'viewer.page',
    'NativeView': 'viewer.native',
    'RobotSetup': 'robot_setup',
    'Simulation': 'simulation',
    'SimulationError': 'errors',
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


def __getattr__(name: str) -> Any:
    """
    Return a public name from where it is defined.

    Raises:
        AttributeError: it is none.
    """
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
