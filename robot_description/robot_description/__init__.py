# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: expand, check, mend, load into MuJoCo and Pinocchio, publish."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'describe', 'state_publisher')

# Where each name is defined; loaded when it is asked for, as MuJoCo and Pinocchio take a second.
_HOMES = {
    'DESCRIPTIONS': 'packages',
    'Description': 'description',
    'Quadruped': 'morphology.quadruped',
    'Robot': 'robot',
    'drive_wheels': 'morphology.wheels',
    'find_quadruped': 'morphology.quadruped',
    'load_robot': 'description',
    'parse_urdf': 'urdf',
    'read_description': 'description',
    'share_directory': 'packages',
    'to_mujoco': 'mujoco.builder',
    'to_pinocchio': 'pinocchio_model',
}
__all__ = list(_HOMES)  # noqa: PLE0605
__getattr__ = load_lazily(__name__, _HOMES)
