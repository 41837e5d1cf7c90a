# SPDX-License-Identifier: Apache-2.0
from dataclasses import fields, FrozenInstanceError, replace
import math

from cases import for_all
import pytest
from wasd_core.parameters import InvalidParameter, numeric_ends, parameter, Parameters


class Arm(Parameters):
    speed: float = parameter(1.0, doc='Speed', unit='m/s', above=0.0, maximum=2.0)
    gain: float = parameter(0.5, doc='Gain')
    count: int = parameter(3, doc='How many', minimum=1)
    mode: str = parameter('hold', doc='What a key does', choices=('hold', 'latch'))
    loud: bool = parameter(False, doc='Whether it speaks')


def test_defaults_are_legal():
    assert Arm() == Arm(speed=1.0, gain=0.5, count=3, mode='hold', loud=False)


@for_all('speed', [1e-9, 2.0])
def test_values_up_to_the_bounds_are_taken(speed):
    assert Arm(speed=speed).speed == speed


@for_all(
    ('values', 'message'),
    [
        ({'speed': 0.0}, 'speed must be > 0 and <= 2 m/s, got 0.0'),
        ({'speed': 2.001}, 'speed must be > 0 and <= 2 m/s, got 2.001'),
        ({'count': 0}, 'count must be >= 1, got 0'),
        ({'mode': 'drift'}, "mode must be one of hold, latch, got 'drift'"),
        ({'loud': 1}, 'loud must be true or false, got 1'),
        ({'count': True}, 'count must be a whole number, got True'),
        ({'count': 2.0}, 'count must be a whole number, got 2.0'),
        ({'speed': '1'}, "speed must be a number, got '1'"),
        ({'speed': None}, 'speed must be a number, got None'),
    ],
)
def test_an_illegal_value_says_what_came_and_what_is_wanted(values, message):
    with pytest.raises(InvalidParameter) as caught:
        Arm(**values)
    assert str(caught.value) == message


@for_all('value', [math.nan, math.inf, -math.inf])
@for_all('name', ['speed', 'gain'])
def test_what_is_not_finite_is_refused_with_and_without_bounds(name, value):
    # An acceleration of inf would turn into NaN in the first step of 0 s.
    with pytest.raises(InvalidParameter, match=f'{name} must be a finite number'):
        Arm(**{name: value})


def test_an_int_becomes_the_float_that_is_meant():
    speed = Arm(speed=2).speed
    assert (speed, type(speed)) == (2.0, float)


def test_a_set_is_checked_again_when_it_is_replaced():
    with pytest.raises(InvalidParameter, match='count'):
        replace(Arm(), count=-1)


def test_a_set_cannot_be_changed_in_place():
    with pytest.raises(FrozenInstanceError):
        Arm().speed = 1.5
    with pytest.raises(FrozenInstanceError):
        del Arm().speed


def test_a_set_has_no_other_values_than_its_fields():
    with pytest.raises(TypeError, match="Arm has no 'sped'"):
        Arm(sped=1.5)
    with pytest.raises(TypeError):
        Arm(1.5)


def test_sets_of_equal_values_are_equal_and_are_shown_as_the_call_that_makes_them():
    assert len({Arm(), Arm(speed=1.0), Arm(speed=2.0)}) == 2
    assert Arm() != Arm(gain=0.4)
    assert eval(repr(Arm(speed=1.5)), {'Arm': Arm}) == Arm(speed=1.5)


def test_a_mapping_sets_what_it_names_and_leaves_the_rest():
    assert Arm.from_mapping({'count': 7}) == Arm(count=7)


def test_an_unknown_key_names_its_neighbour():
    with pytest.raises(InvalidParameter) as caught:
        Arm.from_mapping({'sped': 1.0})
    assert str(caught.value) == "unknown parameter 'sped', did you mean speed?"


def test_an_unknown_key_without_a_neighbour_lists_what_is_known():
    with pytest.raises(InvalidParameter, match='known: speed, gain, count, mode, loud'):
        Arm.from_mapping({'xyz': 1.0})


class Leg(Parameters):
    fastest: float = parameter(math.nan, name='knee.max', doc='', unit='m/s', above=0.0, nan='off')
    slowest: float = parameter(-1.0, name='knee.min', doc='', maximum=0.0)
    variances: tuple[float, ...] = parameter((0.0, 1.0), doc='', minimum=0.0)
    joints: tuple[str, ...] = parameter((), doc='')


def test_a_name_with_dots_is_what_mappings_and_errors_have():
    leg = Leg.from_mapping({'knee.max': 2, 'knee.min': -0.5})
    assert (leg.fastest, leg.slowest) == (2.0, -0.5)
    with pytest.raises(InvalidParameter, match="unknown parameter 'fastest'"):
        Leg.from_mapping({'fastest': 2.0})


def test_nan_is_legal_where_it_has_a_meaning():
    assert math.isnan(Leg().fastest)
    with pytest.raises(InvalidParameter, match='knee.min must be a finite number, got nan'):
        Leg(slowest=math.nan)


def test_lists_are_kept_as_tuples():
    leg = Leg(variances=[1, 2.5], joints=['a', 'b'])
    assert (leg.variances, leg.joints) == ((1.0, 2.5), ('a', 'b'))


@for_all(
    ('key', 'value', 'message'),
    [
        ('knee.max', 0.0, 'knee.max must be > 0 m/s, or NaN: off, got 0.0'),
        ('knee.max', math.inf, 'knee.max must be a finite number, got inf'),
        ('knee.min', 0.5, 'knee.min must be <= 0, got 0.5'),
        ('variances', [1.0], 'variances must be 2 numbers, got 1'),
        ('variances', [1.0, -1.0], 'variances must be >= 0, got -1.0'),
        ('variances', 3.0, 'variances must be a list, got 3.0'),
        ('joints', 'ab', "joints must be a list, got 'ab'"),
        ('joints', [1], 'joints must be a text, got 1'),
        ('knee', 1.0, "unknown parameter 'knee', did you mean knee.min?"),
    ],
)
def test_one_value_can_be_checked_by_itself(key, value, message):
    with pytest.raises(InvalidParameter) as caught:
        Leg.checked(key, value)
    assert str(caught.value) == message


def test_a_value_that_is_legal_comes_back_as_it_is_kept():
    assert Leg.checked('knee.max', 3) == 3.0
    assert Leg.checked('joints', ['a']) == ('a',)


class Gaits(Parameters):
    period: float = parameter(0.4, doc='', unit='s', above=0.0, span=(0.3, 0.6))
    gains: tuple[float, ...] = parameter(
        (1.0, 9.0), doc='', minimum=0.0, span=((0.5, 3.0), (2, 27))
    )
    free: float = parameter(1.0, doc='', above=0.0, maximum=2.0)


@for_all(
    ('key', 'value', 'message'),
    [
        ('period', 0.2, 'period must be >= 0.3 and <= 0.6 s, got 0.2'),
        ('period', 1e308, 'period must be >= 0.3 and <= 0.6 s, got 1e+308'),
        ('gains', [1.0, 2.0], 'gains[1] must be >= 3 and <= 27, got 2.0'),
    ],
)
def test_what_people_give_lies_in_the_span_and_an_error_says_it(key, value, message):
    for give in (Gaits.checked, lambda key, value: Gaits().changed({key: value})):
        with pytest.raises(InvalidParameter) as caught:
            give(key, value)
        assert str(caught.value) == message


@for_all('end', [0, 1])
def test_both_ends_of_a_span_are_taken(end):
    period, gains, _ = (numeric_ends(field)[end] for field in fields(Gaits))
    taken = Gaits.from_mapping({'period': period, 'gains': gains})
    assert (taken.period, taken.gains) == (period, gains)


def test_code_may_go_beyond_a_span_and_not_beyond_the_bounds():
    assert replace(Gaits(), period=2.0).period == 2.0
    with pytest.raises(InvalidParameter, match='period must be > 0 s, got 0.0'):
        replace(Gaits(), period=0.0)


def test_the_ends_of_a_number_are_those_that_belong_to_it():
    period, gains, free = (numeric_ends(field) for field in fields(Gaits))
    assert (period, gains) == ((0.3, 0.6), ((0.5, 3.0), (2, 27)))
    assert free == (math.nextafter(0.0, 1.0), 2.0)


@for_all(
    'value',
    ['x' * 10_000, list(range(10_000)), 10**5000, -(10**400)],
)
def test_what_came_is_shown_on_one_line_that_is_not_too_long(value):
    with pytest.raises(InvalidParameter) as caught:
        Gaits.checked('period', value)
    assert len(str(caught.value)) < 200
