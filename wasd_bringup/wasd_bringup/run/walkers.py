# SPDX-License-Identifier: Apache-2.0
"""Loads the network of a run's options."""

from typing import Any

from wasd_core.errors import UserError

from wasd_bringup.run.options import RunOptions


def load_walker(options: RunOptions) -> Any:
    """
    Return the `Walker` of the state policy; None without the option.

    Raises:
        UserError: why it cannot be played, in one line.
    """
    if options.policy is None:
        if options.policy_config is not None:
            raise UserError('--policy-config needs a network: give --policy FILE')
        return None
    if not isinstance(options.policy, str):
        return options.policy
    # Here, because few runs play one.
    from policy_player.player import Player
    from policy_player.policy_file import read_policy

    return Player(read_policy(options.policy, options.policy_config))
