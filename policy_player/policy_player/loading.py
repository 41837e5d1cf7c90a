# SPDX-License-Identifier: Apache-2.0
"""Loads the network that walks, if there is one."""

from typing import Any

from robot_description.robot import Robot
from wasd_core.errors import UserError


def load_policy(path: str | None, config: str | None, robot: Robot) -> Any:
    """
    Return the `Player` of a network's file, or of its name, for a robot; None without one.

    `config` is the file or preset that says how it was trained; None if the network says it.

    Raises:
        UserError: why it cannot be played, in one line.
    """
    if path is None:
        if config is not None:
            raise UserError('policy_config needs a network: give one as policy (--policy FILE)')
        return None
    # Here, because few play one.
    from policy_player.player import Player
    from policy_player.policy_file import read_policy
    from policy_player.usual import beyond_limits

    policy = read_policy(path, config)
    if beyond := beyond_limits(policy.spec, robot):
        raise UserError(f'{policy.config or path}: {beyond}')
    return Player(policy)
