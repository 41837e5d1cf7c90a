# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: expand, check, mend, load into MuJoCo and Pinocchio, publish."""

from wasd_core import load_lazily, quiet_start

quiet_start(__name__, 'describe', 'state_publisher')

# Public names by module; it is loaded for the first of them, as MuJoCo and Pinocchio are slow.
__all__, __getattr__ = load_lazily(
    __name__,
    {
        'description': 'Description load_robot read_description',
        'morphology.quadruped': 'Quadruped find_quadruped',
        'morphology.wheels': 'drive_wheels',
        'mujoco.builder': 'to_mujoco',
        'packages': 'DESCRIPTIONS share_directory',
        'pinocchio_model': 'to_pinocchio',
        'robot': 'Robot',
        'urdf': 'parse_urdf',
    },
)
