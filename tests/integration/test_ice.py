# SPDX-License-Identifier: Apache-2.0
"""A robot that is not told how slippery the ground is feels it, and stays up."""

import pytest
import wasd

pytestmark = pytest.mark.slow

RINK = """<mujoco><worldbody><body>
<geom type="box" size="9 9 0.1" pos="0 0 -0.1" friction="0.25" priority="2"/>
</body></worldbody></mujoco>"""


def test_it_speeds_up_on_ice_without_falling(tmp_path):
    path = tmp_path / 'rink.xml'
    path.write_text(RINK)
    dog = wasd.Go2(world=str(path), seed=906)
    dog.press('2')
    dog.press('5')
    dog.run(1.2)
    dog.drive(0.5)
    dog.run(3.0)
    assert dog.state == 'move base'
    assert dog.truth.planar_velocity[0] == pytest.approx(0.5, abs=0.1)
