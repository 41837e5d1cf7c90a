# SPDX-License-Identifier: Apache-2.0
"""What a robot touches."""


def touched(world):
    """
    Return the geoms that are no part of the robot and touch it, `floor` among them.

    They belong to the beginning of the last physics step, as contacts are found then.
    """
    root = world.model.body_rootid[world.model.geom_bodyid[world.data.contact.geom]]
    pairs = zip(world.data.contact.geom, root == world.root, strict=True)
    others = [pair[~own] for pair, own in pairs if own.sum() == 1]
    return {world.model.geom(int(geom)).name for (geom,) in others}
