# SPDX-License-Identifier: Apache-2.0
"""Every number of the leg controller can be given, and changed while it walks."""

from dataclasses import fields, replace
import inspect

import numpy as np
import pytest
from quadruped_sim.command_filter import CommandFilter
from quadruped_sim.leg_controller import LegController
from quadruped_sim.leg_controller_node import LegControllerNode
from quadruped_sim.legs import Legs
from quadruped_sim.parameters import LegControllerParameters, LegNodeParameters
from quadruped_sim.tuning import CommandParameters
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String
from wasd_core.parameters import InvalidParameter, known_parameters, numeric_ends, Parameters

from quadruped_sim import parameters

pytestmark = pytest.mark.slow

NAMES = tuple(known_parameters(LegNodeParameters))
TUNING = tuple(known_parameters(LegControllerParameters))
PERIOD = 0.002


@pytest.fixture
def make(spawn, go2):
    """Return a function that makes the face of legs with parameters."""

    def legs(**values):
        given = [Parameter(name.replace('__', '.'), value=v) for name, v in values.items()]
        return spawn(LegControllerNode(Legs(go2), parameter_overrides=given))

    return legs


@pytest.fixture
def trot(standing):
    """Return a function that lets a controller stand, then trot on the spot."""

    def run(controller, ticks=30):
        for key in '24':
            controller.press(key)
            for _ in range(ticks):
                command = controller.step(standing, PERIOD)
        return command

    return run


def test_every_field_of_every_parameter_class_is_declared_on_the_node(make):
    groups = [
        kind
        for _, kind in inspect.getmembers(parameters, inspect.isclass)
        if issubclass(kind, Parameters)
        and not issubclass(Parameters, kind)
        and not issubclass(kind, LegControllerParameters)
    ]
    wanted = sum(len(fields(group)) for group in groups)
    assert wanted >= 63
    assert len(TUNING) == wanted
    assert set(NAMES) <= set(make().get_parameters_by_prefix(''))


def test_no_parameter_has_two_names():
    inner = [
        (place.group, place.field.name) for place in known_parameters(LegNodeParameters).values()
    ]
    assert len(set(inner)) == len(NAMES)
    # Only these three are called other than their group and field.
    short = {name for name in TUNING if '.' not in name}
    assert short == {'gait', 'limits', 'step_in_place'}


def test_a_value_that_is_given_is_the_controllers(make, trot):
    legs = make(gait__slow_period=0.6, gait__slow_duty=0.5, step_in_place=True)
    trot(legs.legs.controller)
    schedule = legs.legs.controller.locomotion.schedule
    assert (schedule.stance_time, schedule.swing_time) == pytest.approx((0.3, 0.3))


def test_a_list_that_is_given_is_the_controllers(make):
    legs = make(balance__position_gains=[1.0, 2.0, 3.0])
    assert legs.legs.settings.balance.position_gains == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'gait__slow_period': -1}, 'gait.slow_period must be >= 0.3 and <= 0.6 s, got -1.0'),
        ({'gait__slow_period': 'x'}, "gait.slow_period must be a number, got 'x'"),
        ({'gait__slow_periode': 1.0}, "unknown parameter 'gait.slow_periode', did you mean "),
        ({'mpc__pose_weights': [1.0]}, 'mpc.pose_weights must be 6 numbers, got 1'),
        (
            {'mpc__pose_weights': [-1.0] * 6},
            'mpc.pose_weights[0] must be >= 27 and <= 240, got -1.0',
        ),
        ({'contact__force_off': 30.0}, 'contact.force_off must be >= 4 and <= 18 N'),
        ({'mpc__force_min': 300.0}, 'mpc.force_min must be >= 0 and <= 20 N, got 300'),
        ({'grip__least': 0.8}, 'grip.least must be >= 0.05 and <= 0.3, got 0.8'),
        ({'controller': 'none.yaml'}, 'none.yaml: No such file or directory'),
    ],
)
def test_a_bad_value_is_an_error_of_one_line(make, values, message):
    with pytest.raises(InvalidParameter) as caught:
        make(**values)
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    'text',
    [
        'gait:\n  slow_period: 0.6\n',
        'gait.slow_period: 0.6\n',
        '/**/leg_controller:\n  ros__parameters:\n    gait.slow_period: 0.6\n',
        '/**:\n  ros__parameters:\n    use_sim_time: true\n    gait: {slow_period: 0.6}\n',
        'mbot:\n  ros__parameters: {x: 1}\nleg_controller:\n  ros__parameters:\n'
        '    gait: {slow_period: 0.6}\n',
    ],
)
def test_the_file_may_be_a_table_or_a_ros_parameter_file(make, tmp_path, text):
    path = tmp_path / 'legs.yaml'
    path.write_text(text)
    assert make(controller=str(path)).legs.settings.gait.slow_period == 0.6


def test_what_ros_is_given_goes_before_the_file(make, tmp_path):
    path = tmp_path / 'legs.yaml'
    path.write_text('gait: {slow_period: 0.6, fast_period: 0.3}\nlimits: guide\n')
    settings = make(controller=str(path), gait__slow_period=0.5).legs.settings
    assert (settings.gait.slow_period, settings.gait.fast_period) == (0.5, 0.3)
    assert settings.command.limits == 'guide'


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        (
            'gait:\n  slow_period: -1\n',
            ':2: gait.slow_period must be >= 0.3 and <= 0.6 s, got -1.0',
        ),
        ('gait:\n  slow_periode: 1\n', ":2: unknown parameter 'gait.slow_periode', did you mean"),
        ('contact: {force_on: 5}\n', ':1: contact.force_on must be >= 20 and <= 50 N, got 5.0'),
        ('a: {ros__parameters: {}}\n', ': wanted the parameters of one leg controller'),
    ],
)
def test_a_mistake_in_the_file_is_told_with_its_place(make, tmp_path, text, message):
    path = tmp_path / 'legs.yaml'
    path.write_text(text)
    with pytest.raises(InvalidParameter) as caught:
        make(controller=str(path))
    assert str(caught.value).startswith(f'{path}{message}')


def test_a_running_node_takes_a_gait_period_from_the_next_tick(make, trot, spawn, spin_until):
    legs = make(step_in_place=True)
    trot(legs.legs.controller)
    before = legs.legs.controller.locomotion.schedule
    client = spawn(Node('asking')).create_client(SetParameters, 'leg_controller/set_parameters')
    spin_until(spawn.pump, client.service_is_ready)
    change: ParameterMessage = Parameter('gait.slow_period', value=0.6).to_parameter_msg()
    answer = client.call_async(SetParameters.Request(parameters=[change]))
    spin_until(spawn.pump, answer.done)
    assert answer.result().results[0].successful
    trot(legs.legs.controller, ticks=2)
    after = legs.legs.controller.locomotion.schedule
    assert after.stance_time == pytest.approx(0.6 / 0.45 * before.stance_time)
    assert legs.legs.settings.gait.slow_period == 0.6


def test_the_parameter_and_the_key_choose_the_same_gait(make):
    legs = make()
    (result,) = legs.set_parameters([Parameter('gait', value='walk')])
    assert result.successful
    assert legs.legs.controller.gait == 'walk'
    legs.keys.hear(String(data='n'))
    assert legs.legs.controller.gait == legs.get_parameter('gait').value == 'pace'
    legs.legs.reset()
    legs.publish(legs.get_clock().now().to_msg())
    assert legs.legs.controller.gait == legs.get_parameter('gait').value == 'trot'


def test_the_eyes_are_a_parameter_that_follows_the_key(make):
    legs = make()
    (result,) = legs.set_parameters([Parameter('eyes', value=True)])
    assert result.successful
    assert legs.legs.controller.eyes
    legs.keys.hear(String(data='e'))
    assert not legs.legs.controller.eyes
    assert legs.get_parameter('eyes').value is False


def test_a_bad_value_at_run_time_is_refused_and_changes_nothing(make):
    legs = make()
    (result,) = legs.set_parameters([Parameter('contact.force_off', value=30.0)])
    assert not result.successful
    assert 'contact.force_off' in result.reason and 'Min: 4.0, Max: 18.0' in result.reason
    assert legs.legs.settings == LegNodeParameters()
    (result,) = legs.set_parameters([Parameter('update_rate', value=100.0)])
    assert not result.successful


def other(name):
    """Return a legal value of a parameter that is not the default."""
    field = known_parameters(LegControllerParameters)[name].field
    default, meta = field.default, field.metadata
    if isinstance(default, tuple):
        return numeric_ends(field)[1]
    if isinstance(default, bool):
        return not default
    if isinstance(default, str):
        return next(choice for choice in meta['choices'] if choice != default)
    return default + 3 if isinstance(default, int) else 0.9 * default


@pytest.mark.parametrize('part', [group.name for group in fields(LegControllerParameters)])
def test_tuned_while_it_runs_it_does_what_one_made_so_does(model, trot, part):
    known = known_parameters(LegControllerParameters)
    values = {name: other(name) for name in TUNING if known[name].group == part}
    params = LegControllerParameters().changed(values)
    made, tuned = LegController(model, params), LegController(model)
    tuned.tune(params)
    wanted, got = trot(made), trot(tuned)
    np.testing.assert_array_equal(got, wanted)
    assert made.command_filter.limits == tuned.command_filter.limits


def test_new_limits_hold_for_the_present_request_too():
    command = CommandFilter(CommandParameters())
    command.request(2.0, 0.8, 2.0)
    command.tune(replace(CommandParameters(), limits='guide', forward_acceleration=1e3))
    assert command.step(PERIOD)[0] == 0.4


def test_another_horizon_is_taken_while_it_trots(model, trot):
    params = LegControllerParameters().changed({'step_in_place': True})
    controller = LegController(model, params)
    trot(controller)
    controller.tune(params.changed({'mpc.steps': 20}))
    trot(controller)
    walk = controller.locomotion
    assert len(walk.mpc.times) == 20
    assert walk.mpc.solver.failures == walk.whole_body.solver.failures == 0
