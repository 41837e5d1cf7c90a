# SPDX-License-Identifier: Apache-2.0
"""What a recording says of its run, beside the topics."""

from pathlib import Path

from wasd_bringup.options import RunOptions
from wasd_bringup.scripts import push_text

# Name of the metadata record in the file.
RECORD_NAME = 'wasd'


def describe_run(options: RunOptions) -> dict[str, str]:
    """Return what has to be known to run the same commands again."""
    world = options.world
    return {
        'robot': options.robot,
        'description': options.description,
        'world': str(Path(world).resolve()) if Path(world).is_file() else world,
        'seed': str(options.seed),
        'estimator': options.estimator,
        'limits': options.limits,
        'pushes': '\n'.join(map(push_text, options.pushes)),
    }
