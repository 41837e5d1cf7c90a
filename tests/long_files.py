# SPDX-License-Identifier: Apache-2.0
"""Files of tests that take a minute or more beside others, the longest first."""

from pathlib import Path

LONGEST = (
    'unitree_bridge/test_sdk_programs',
    'wasd_cockpit/test_panels',
    'integration/test_golden_runs',
    'integration/test_own_script',
    'quadruped_sim/test_support',
    'integration/test_parameter_ranges',
    'integration/test_gaits',
    'integration/test_replay',
    'robot_description/test_build_interfaces',
    'wasd_core/test_jit',
    'teleop_keyboard/test_lost_terminal',
    'wasd_bringup/test_latched',
    'unitree_bridge/test_services',
    'colcon/test_workspace',
    'integration/test_who_may_talk',
    'integration/test_random_keys',
    'quadruped_sim/test_two_processes',
    'quadruped_sim/test_walk_over_topics',
)
PLACES = {Path(__file__).parent / f'{name}.py': place for place, name in enumerate(LONGEST)}


def place_in_line(path: Path) -> int:
    """Return when a file begins: the longest ones in their order, then all others."""
    return PLACES.get(path, len(PLACES))
