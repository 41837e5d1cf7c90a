# SPDX-License-Identifier: Apache-2.0
from cases import for_all
import numpy as np
import pytest
from quadruped_sim.locomotion.gait import Gait
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.presets import GaitRow, GAITS, LIMITS
from quadruped_sim.tuning import GaitParameters
from wasd_bringup.cli import make_parser
from wasd_core.parameters import InvalidParameter

DT = 0.002


def run(gait, seconds, speed=0.0, wants=True):
    return [gait.step(DT, speed, wants) for _ in range(round(seconds / DT))]


def test_diagonal_legs_move_together_and_pairs_alternate():
    for state in run(Gait(GaitParameters()), 2.0):
        stance = state.is_stance
        assert stance[0] == stance[3]
        assert stance[1] == stance[2]
        assert stance[0] or stance[1]


@pytest.mark.slow
def test_measured_duty_and_period_are_the_configured_ones():
    params = GaitParameters()
    states = run(Gait(params), 20 * params.slow_period)
    duty = np.mean([state.is_stance[0] for state in states])
    assert abs(duty - params.slow_duty) < 0.01
    lifts = sum(
        a.is_stance[0] and not b.is_stance[0] for a, b in zip(states, states[1:], strict=False)
    )
    assert lifts == 20


def test_faster_gait_has_shorter_period_and_stance():
    gait = Gait(GaitParameters())
    slow = gait.step(DT, 0.0, True)
    fast = gait.step(DT, 3.0, True)
    assert fast.stance_time + fast.swing_time < slow.stance_time + slow.swing_time
    assert fast.stance_time < slow.stance_time


def test_a_push_hastens_it_for_a_while():
    """An error of 1 m/s counts as 3 (1 - 0.35) m/s, and 2 m/s less each second."""
    quick, pushed = Gait(GaitParameters()), Gait(GaitParameters())
    calm = share_standing(Gait(GaitParameters()).step(DT, 0.5, True))
    pushed.step(DT, 0.5, True, error=1.0)
    for age in np.arange(1, 700) * DT:
        state = pushed.step(DT, 0.5, True)
        quick_state = quick.step(DT, max(0.5, 3.0 * 0.65 - 2.0 * age), True)
        assert period(state) == pytest.approx(period(quick_state))
        # Feet carry it for longer than in a trot that is as quick of its own.
        halfway = 0.5 * (calm + share_standing(quick_state))
        assert share_standing(state) == pytest.approx(halfway)


def period(state):
    return state.stance_time + state.swing_time


def share_standing(state):
    return state.stance_time / period(state)


def test_a_push_is_smaller_for_a_slower_robot():
    for speed, name in ((1.0, 'walk'), (0.5, 'trot')):
        gait = Gait(GaitParameters(name='walk'), speed)
        for _ in range(500):
            gait.step(DT, 0.2, True, error=0.6)  # counts as 0.75 m/s
        assert gait._reached is GAITS[name]


def test_the_error_of_a_ramp_does_not_hasten_it():
    gait = Gait(GaitParameters())
    assert gait.step(DT, 0.5, True, error=0.35).pace == gait.step(DT, 0.5, True).pace


def test_phase_grows_monotonically_within_each_swing():
    last = np.zeros(4)
    was_stance = np.ones(4, dtype=bool)
    for state in run(Gait(GaitParameters()), 2.0, speed=1.0):
        same = was_stance == state.is_stance
        assert (state.phase[same] >= last[same] - 1e-12).all()
        assert ((state.phase >= 0.0) & (state.phase < 1.0)).all()
        last, was_stance = state.phase, state.is_stance


def test_it_stands_until_told_to_step_and_stops_on_four_feet():
    gait = Gait(GaitParameters())
    assert all(state.is_stance.all() for state in run(gait, 1.0, wants=False))
    run(gait, 1.03)
    states = run(gait, 1.0, wants=False)
    assert states[-1].is_stance.all()
    assert not gait.is_stepping


def test_forecast_is_what_happens():
    gait = Gait(GaitParameters())
    run(gait, 0.37)
    times = DT * np.arange(1, 200)
    stance, phase = gait.forecast(times)
    for row, state in enumerate(run(gait, 0.398)):
        np.testing.assert_array_equal(stance[row], state.is_stance)
        stands = state.is_stance
        np.testing.assert_allclose(phase[row][stands], state.phase[stands], atol=1e-9)


def test_in_a_walk_one_foot_after_the_other_begins_to_stand():
    params = GaitParameters(name='walk', slow_period=0.8, slow_duty=0.54)
    period = GAITS['walk'].period * params.slow_period
    states = run(Gait(params), 3 * period)
    stance = np.array([state.is_stance for state in states])
    assert (stance.sum(axis=1) == 3).mean() > 0.98
    rises = [
        DT * (1 + np.flatnonzero(~before & after))
        for before, after in zip(stance[:-1].T, stance[1:].T, strict=True)
    ]
    for touches, offset in zip(rises, GAITS['walk'].offsets, strict=True):
        np.testing.assert_allclose((touches / period + offset + 0.005) % 1.0, 0.005, atol=0.006)
    assert states[-1].stance_time == pytest.approx(0.75 * period)


@for_all('name', GAITS)
@for_all('duty', [0.3, 0.5, 0.54, 0.6])
def test_any_gait_ends_on_four_feet_whatever_its_duty(name, duty):
    gait = Gait(GaitParameters(name=name, slow_duty=duty))
    run(gait, 1.03)
    assert run(gait, 1.0, wants=False)[-1].is_stance.all()
    assert not gait.is_stepping


def test_a_walk_stops_on_four_feet_too():
    gait = Gait(GaitParameters(name='walk'))
    run(gait, 1.03)
    states = run(gait, 1.0, wants=False)
    assert states[-1].is_stance.all()
    assert not gait.is_stepping


@pytest.mark.slow
def test_a_row_is_a_gait_that_can_be_chosen(monkeypatch):
    with pytest.raises(InvalidParameter, match='gait must be one of trot, walk, .* got .amble.'):
        GaitParameters().changed({'gait': 'amble'})
    monkeypatch.setitem(
        GAITS, 'amble', GaitRow((0.0, 0.5, 0.0, 0.5), LIMITS['guide'], (0.4, 0.3, 0.5))
    )
    params = LegControllerParameters().changed({'gait': 'amble'})
    for state in run(Gait(params.gait), 2.0):
        assert state.is_stance[0] == state.is_stance[2]
        assert state.is_stance[1] == state.is_stance[3]
    assert make_parser().parse_args(['go2', '--gait', 'amble']).gait == 'amble'


def durations(flags):
    """How long a flag is set each time [s], without the first time."""
    change = np.diff(np.array(flags, dtype=int))
    begins, ends = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    ends = ends[ends > begins[0]]
    return DT * (ends - begins[: len(ends)])


@for_all('name', [name for name in GAITS if name != 'trot'])
def test_chosen_while_the_legs_move_a_gait_comes_gliding(name):
    """No step is much shorter or longer than those before and after, and these are the row's."""
    gait = Gait(GaitParameters())
    run(gait, 1.03)
    before = gait.state()
    gait.tune(GaitParameters(name=name))
    states = run(gait, 4.0)
    after = states[-1]
    for leg in range(4):
        for part in ('stance', 'swing'):
            flags = [state.is_stance[leg] == (part == 'stance') for state in states]
            usual = [getattr(state, f'{part}_time') for state in (before, after)]
            for took in durations(flags):
                assert 0.6 * min(usual) < took < 1.7 * max(usual)
    row, period = GAITS[name], after.stance_time + after.swing_time
    assert after.footprint == row.footprint
    touches = [
        DT * np.flatnonzero(np.diff([int(state.is_stance[leg]) for state in states]) > 0)[-1]
        for leg in range(4)
    ]
    apart = (np.subtract(touches[0], touches) / period - row.offsets + 0.5) % 1.0
    np.testing.assert_allclose(apart, 0.5, atol=2.0 * DT / period)


def test_chosen_at_rest_a_gait_is_there_at_once():
    gait, always = Gait(GaitParameters()), Gait(GaitParameters(name='walk'))
    gait.tune(GaitParameters(name='walk'))
    for state, wanted in zip(run(gait, 0.5), run(always, 0.5), strict=True):
        np.testing.assert_array_equal(state.is_stance, wanted.is_stance)


def test_between_two_gaits_legs_that_move_go_through_a_trot():
    gait = Gait(GaitParameters(name='walk'))
    run(gait, 1.03)
    gait.tune(GaitParameters(name='pace'))
    states = run(gait, 2.5)
    assert any(np.allclose(state.phase[[0, 1]], state.phase[[3, 2]]) for state in states)
    assert not np.allclose(states[-1].phase[[0, 1]], states[-1].phase[[3, 2]])
    assert gait.has_changed


@for_all('name', ['walk', 'pace'])
def test_pushed_hard_it_steps_as_in_a_trot_and_goes_back_when_it_is_calm(name):
    gait = Gait(GaitParameters(name=name))
    run(gait, 1.03)
    for _ in range(round(0.6 / DT)):
        state = gait.step(DT, 0.5, True, error=1.5)
    assert state.footprint == GAITS['trot'].footprint
    run(gait, 5.0)
    assert gait.state().footprint == GAITS[name].footprint
    assert gait.has_changed


def test_feet_that_bear_it_by_side_or_end_are_no_farther_apart_than_a_go2s():
    found = {}
    for name, row in GAITS.items():
        gait = Gait(GaitParameters(name=name), slimness=(0.8, 0.7))
        found[name] = np.divide(gait.state().footprint, row.footprint).round(9).tolist()
    assert found == {
        'trot': [1.0, 1.0],
        'walk': [1.0, 0.7],
        'pace': [1.0, 0.7],
        'bound': [0.8, 1.0],
        'pronk': [1.0, 1.0],
        'gallop': [0.8, 0.7],
    }
