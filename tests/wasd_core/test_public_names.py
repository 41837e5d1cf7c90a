# SPDX-License-Identifier: Apache-2.0
"""Public names of the packages: each is there, and loads no more than it needs."""

import importlib

from cases import for_all
import pytest

PACKAGES = ('mujoco_sim', 'robot_description', 'teleop_keyboard', 'wasd_core')


@for_all('name', PACKAGES)
def test_every_public_name_is_there_and_no_other(name):
    package = importlib.import_module(name)
    assert 5 <= len(package.__all__) <= 15
    assert all(getattr(package, one) is not None for one in package.__all__)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nonsense'"):
        package.nonsense  # noqa: B018
