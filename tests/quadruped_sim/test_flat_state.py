# SPDX-License-Identifier: Apache-2.0
"""A record in one block of memory is the record that was put in."""

from dataclasses import replace

import numpy as np
from quadruped_sim.algebra import flatten, view_of
from quadruped_sim.estimation.ground import Plane


def test_what_compiled_stages_write_is_seen_in_the_record(robot_state):
    robot_state = replace(robot_state)  # others use that one, too
    robot_state.flat['base']['omega'][0] = 1.0, 2.0, 3.0
    robot_state.flat['is_contact'][0] = 1, 0, 1, 0
    np.testing.assert_array_equal(robot_state.base.omega, (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(robot_state.is_contact, (True, False, True, False))
    robot_state.dynamics.mass[2, 3] = 7.0
    assert robot_state.flat['dynamics']['mass'][0, 2, 3] == 7.0


def test_a_state_that_replaces_parts_of_another_shares_nothing_with_it(robot_state):
    other = replace(robot_state, feet=np.ones((4, 3)))
    assert not np.array_equal(robot_state.feet, other.feet)
    np.testing.assert_array_equal(other.flat['feet'][0], 1.0)
    before = robot_state.base.R.copy()
    other.base.R[:] = 5.0
    np.testing.assert_array_equal(robot_state.base.R, before)


def test_records_of_numbers_and_arrays_keep_all_of_them(rng):
    plane = Plane(*(rng.normal(size=shape) for shape in ((4, 3), 2, 2, 3, (3, 3))), 0.25)
    flat = flatten(plane)
    for name in plane._fields:
        np.testing.assert_array_equal(flat[name][0], getattr(plane, name))
    seen = view_of(flat, plane)
    assert isinstance(seen, Plane)
    seen.gradient[1] = 3.0
    assert flat['gradient'][0, 1] == 3.0
    flat['height'] = 0.5
    assert seen.height == 0.5


def test_each_number_of_a_state_lies_in_a_word_of_its_own(robot_state):
    def places(layout, start):
        for part, offset in layout.fields.values():
            if part.fields:
                yield from places(part, start + offset)
            elif part.base.kind == 'f':
                yield start + offset

    assert not any(place % 8 for place in places(robot_state.flat.dtype, 0))
