# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
from diff_drive_sim.parameters import DiffDriveParameters
from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.simulation import Schedule
import numpy as np
import pytest
from quadruped_sim.parameters import LegNodeParameters
from wasd_core.errors import SimulationError
from wasd_core.parameters import known_parameters


@pytest.fixture
def schedule():
    return Schedule(0.001)


def test_tasks_of_one_instant_run_in_the_order_in_which_they_were_added(schedule):
    ran = []
    for name, period in (('slow', 0.02), ('fast', 0.005), ('also slow', 0.02)):
        schedule.every(period, lambda name=name: ran.append(name))
    schedule.run_due(0)
    assert ran == ['slow', 'fast', 'also slow']


@pytest.mark.parametrize(('period', 'steps'), [(0.001, 1), (0.005, 5), (0.02, 20), (1 / 50, 20)])
def test_a_task_runs_every_so_many_steps(schedule, period, steps):
    ran = []
    for step in range(101):
        schedule = Schedule(0.001)
        schedule.every(period, lambda step=step: ran.append(step))
        schedule.run_due(step)
    assert ran == list(range(0, 101, steps))


@pytest.mark.parametrize(
    ('periods', 'stride'),
    [((), 1), ((0.02,), 20), ((0.005, 0.02), 5), ((0.006, 0.004), 2), ((0.005, 0.001), 1)],
)
def test_the_stride_leads_from_one_instant_to_the_next(schedule, periods, stride):
    for period in periods:
        schedule.every(period, lambda: None)
    assert schedule.stride == stride == (math.gcd(*(round(1000 * p) for p in periods)) or 1)


@pytest.mark.parametrize(
    ('rests', 'ahead'),
    [
        ((0.0,), 2),
        ((-math.inf,), 2),
        ((0.0041,), 6),
        ((0.006,), 6),
        ((1.0,), 18),
        ((1.0, 0.004), 4),
    ],
)
def test_instants_in_which_all_tasks_rest_are_left_out(schedule, rests, ahead):
    for rest in rests:
        schedule.every(0.002, lambda: None, lambda rest=rest: rest)
    schedule.every(0.02, lambda: None)
    assert schedule.ahead(2) == ahead


@pytest.mark.parametrize('period', [1 / 60, 0.0005, 0.0, 0.0015, -0.001])
def test_a_period_between_physics_steps_is_refused(schedule, period):
    with pytest.raises(SimulationError, match='multiple of the physics step 0.001 s, got'):
        schedule.every(period, lambda: None)


@pytest.mark.parametrize(
    ('rate', 'next_one'),
    [
        (60.0, 62.5),
        (58.8235, 62.5),
        (30.0, 31.25),
        (999.0, 1000.0),
        (5000.0, 1000.0),
        (0.3, 0.3125),
        (math.inf, 1000.0),
    ],
)
def test_a_rate_that_does_not_fit_names_its_parameter_and_the_next_that_does(
    schedule, rate, next_one
):
    with pytest.raises(SimulationError) as caught:
        schedule.at_rate('clock_rate', rate, lambda: None)
    assert str(caught.value) == (
        f'clock_rate: got {rate:g} Hz, which does not fit the physics step of 0.001 s; '
        f'{next_one:g} Hz does'
    )
    schedule.at_rate('clock_rate', next_one, lambda: None)


@for_all(
    'kind, name',
    [
        *((LegNodeParameters, name) for name in ('update_rate', 'publish_rate')),
        *(
            (DiffDriveParameters, name)
            for name in ('update_rate', 'publish_rate', 'diagnostic_rate')
        ),
        *((SimulatorParameters, name) for name in ('clock_rate', 'state_rate')),
    ],
)
def test_a_rate_that_is_advised_fits_the_physics_and_its_parameter(schedule, kind, name):
    ends = known_parameters(kind)[name].field.metadata
    schedule.at_rate(name, ends['maximum'], lambda: None)
    for rate in np.geomspace(ends['minimum'], ends['maximum'], 50)[:-1]:
        try:
            schedule.at_rate(name, rate, lambda: None)
        except SimulationError as error:
            advised = float(str(error).rpartition('; ')[2].removesuffix(' Hz does'))
            kind.checked(name, advised)
            schedule.at_rate(name, advised, lambda: None)
