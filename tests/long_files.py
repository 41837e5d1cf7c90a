# SPDX-License-Identifier: Apache-2.0
"""Files of tests that take a minute or more beside others, the longest first."""

from pathlib import Path

LONGEST = (
    'colcon/test_workspace',
    'catalogue/test_catalogue',
    'unitree_bridge/test_sdk_programs',
    'wasd_cockpit/test_panels',
    'unitree_bridge/test_services',
    'robot_description/test_any_robot',
    'integration/test_first_hour',
    'integration/test_golden_runs',
    'quadruped_sim/test_compilation',
    'integration/test_go2_runs',
    'integration/test_gaits',
    'integration/test_graph_commands',
    'integration/test_node_by_node',
    'quadruped_sim/test_support',
    'integration/test_recording',
    'integration/test_own_script',
    'integration/test_replay',
    'robot_description/test_build_interfaces',
    'integration/test_who_may_talk',
    'wasd_core/test_jit',
    'teleop_keyboard/test_lost_terminal',
    'teleop_keyboard/test_every_signal',
    'wasd_bringup/test_latched',
    'integration/test_coming_and_going',
)
PLACES = {Path(__file__).parent / f'{name}.py': place for place, name in enumerate(LONGEST)}


def place_in_line(path: Path) -> int:
    """Return when a file begins: the longest ones in their order, then all others."""
    return PLACES.get(path, len(PLACES))
