# SPDX-License-Identifier: Apache-2.0
"""Scripts of velocities and pushes: read line by line, played on simulated time."""

import math

from cases import for_all
from mujoco_sim.parameters import BoxSize
import pytest
from wasd_bringup.run.inputs import (
    box_text,
    parse_box,
    parse_push,
    parse_twist_script,
    Player,
    push_text,
    ScriptedBox,
    ScriptedPush,
    ScriptedTwist,
    TwistPlayer,
)
from wasd_core.errors import UserError


def test_lines_are_commands_or_silence():
    text = '# there\n0 0.5 0 0\n\n  2.5   0.1 -0.2 3e-1  # turn\n4 stop\n'
    assert parse_twist_script(text, 'f') == [
        ScriptedTwist(0.0, (0.5, 0.0, 0.0)),
        ScriptedTwist(2.5, (0.1, -0.2, 0.3)),
        ScriptedTwist(4.0, None),
    ]


def test_an_empty_script_has_no_commands():
    assert parse_twist_script('\n# nothing\n', 'f') == []


def test_what_is_not_finite_is_let_through_to_the_controller():
    (command,) = parse_twist_script('1 nan inf 0', 'f')
    assert command.velocity is not None
    assert math.isnan(command.velocity[0])
    assert command.velocity[1] == math.inf


@for_all(
    'line',
    ['1 2 3', '1 2 3 4 5', 'soon 0 0 0', '-1 0 0 0', 'nan 0 0 0', '1 halt', '1 0 0 left', '1'],
)
def test_a_wrong_line_is_named_with_its_number(line):
    with pytest.raises(UserError) as caught:
        parse_twist_script(f'0 0 0 0\n\n{line}\n', 'drive.txt')
    assert str(caught.value).startswith('drive.txt:3: ')
    assert line in str(caught.value)
    assert "'t vx vy wz' or 't stop'" in str(caught.value)


def test_times_must_rise():
    with pytest.raises(UserError, match='drive.txt:2: time 1 comes after 2'):
        parse_twist_script('2 0 0 0\n1 0 0 0', 'drive.txt')


PUSHES = {
    ' 1 0 -60.5 0  0.1 ': ScriptedPush(1.0, (0.0, -60.5, 0.0), 0.1),
    '1 0 60 0 0.1 0.2 0 -.05': ScriptedPush(1.0, (0.0, 60.0, 0.0), 0.1, (0.2, 0.0, -0.05)),
}


@for_all('text', PUSHES)
def test_a_push_is_five_numbers_or_eight_and_is_written_as_it_was_read(text):
    push = parse_push(text)
    assert push == PUSHES[text]
    assert parse_push(push_text(push)) == push


@for_all(
    'text',
    ['', '1 2 3 4', '1 2 3 4 5 6', '1 2 3 4 5 6 7', '1 0 0 0 1 0 0 inf', '1 0 0 0 1 0 0 0 0']
    + ['x 0 0 0 1', '1 nan 0 0 1', '1 0 0 0 -1', '-1 0 0 0 1'],
)
def test_anything_else_is_no_push(text):
    with pytest.raises(UserError, match="--push: got .*, wanted 't fx fy fz seconds .x y z.'"):
        parse_push(text)


BOXES = {
    '1.5 2 -3': ScriptedBox(1.5, 2.0, -3.0, 0.0, BoxSize(0.4, 0.4)),
    ' 0 1 0  0.3 ': ScriptedBox(0.0, 1.0, 0.0, 0.3, BoxSize()),
    '9 1 0 1.57 1.0 0.1': ScriptedBox(9.0, 1.0, 0.0, 1.57, BoxSize(1.0, 0.1)),
}


@for_all('text', BOXES)
def test_a_box_is_three_four_or_six_numbers_and_is_written_as_it_was_read(text):
    box = parse_box(text)
    assert box == BOXES[text]
    assert parse_box(box_text(box)) == box


@for_all(
    'text',
    ['', '1', '1 2', '1 2 3 4 5', '1 2 3 4 5 6 7', 'x 0 0', '1 nan 0', '-1 0 0', '1 0 0 inf']
    + ['1 0 0 0 0 1', '1 0 0 0 1 -1', '1 0 0 0 1 nan'],
)
def test_anything_else_is_no_box(text):
    with pytest.raises(UserError, match="--box: got .*, wanted 't x y .yaw .length width..'"):
        parse_box(text)


def events(*times):
    return [ScriptedTwist(time, None) for time in times]


def test_an_event_is_handed_over_once_when_its_time_has_come():
    player = Player(events(0.0, 1.0, 1.0, 2.0))
    assert player.due(0.0) == events(0.0)
    assert player.due(0.5) == []
    assert player.due(1.5) == events(1.0, 1.0)
    assert player.due(1.5) == []
    assert player.due(9.0) == events(2.0)


def test_order_in_the_list_does_not_matter_but_for_equal_times():
    first, second = ScriptedTwist(1.0, (1, 0, 0)), ScriptedTwist(1.0, (2, 0, 0))
    player = Player([*events(3.0), first, second])
    assert player.due(2.0) == [first, second]


def test_a_sum_of_steps_that_falls_short_by_rounding_is_on_time():
    time = 0.0
    for _ in range(10):
        time += 0.1
    assert time < 1.0
    assert Player(events(1.0)).due(time) == events(1.0)


def test_a_velocity_is_repeated_until_the_next_line_and_silence_is_silent():
    published = []
    player = TwistPlayer(
        parse_twist_script('0.1 1 0 0\n0.2 2 0 0\n0.3 stop', 'f'), published.append
    )
    for tick in range(9):
        player.step(0.05 * tick)
    assert published == [(1, 0, 0), (1, 0, 0), (2, 0, 0), (2, 0, 0)]
