# SPDX-License-Identifier: Apache-2.0
"""The Go2 knows how high it is, where nothing but its feet tells it."""

import math

import pytest
import wasd

pytestmark = pytest.mark.slow

TIGHT = (-0.47, -0.46, 1.7)


@pytest.mark.parametrize(
    ('world', 'velocity', 'seconds'),
    [('flat', (-2.0, -1.0), 2.0), ('slope:3', (0.8, 0.0), 3.5)],
)
def test_the_height_that_it_believes_in_is_right_to_two_percent_of_the_way(
    world, velocity, seconds
):
    """At (-2, -1) m/s it sank by 14 cm a second, and of a gentle slope it saw nothing."""
    dog = wasd.Go2(world=world, seed=33, limits='race')
    dog.press('2')
    dog.press('5')
    dog.run(1.2)
    dog.drive(*velocity)
    dog.run(1.0)
    begin = dog.truth.position - dog.odometry.position
    start = dog.truth.position
    dog.run(seconds)
    off = dog.truth.position - dog.odometry.position - begin
    way = math.dist(dog.truth.position, start)
    assert dog.state == 'move base'
    assert way > 2.5
    assert abs(off[2]) < 0.02 * way


def test_a_floor_stays_at_its_height_however_it_is_driven_on():
    """Sliding in tight turns it once left the level of the floor: by 1.3 cm a second."""
    dog = wasd.Go2(seed=34)
    dog.press('2')
    dog.press('5')
    dog.run(1.2)
    begin = dog.truth.position - dog.odometry.position
    for velocity in 2 * ((-0.65, 0.73, -1.64), (-0.92, -0.77, 1.92), (0.53, 0.4, 1.5), TIGHT):
        dog.drive(*velocity)
        dog.run(1.5)
        off = dog.truth.position - dog.odometry.position - begin
        assert abs(off[2]) < 0.03
    assert dog.state == 'move base'
