# SPDX-License-Identifier: Apache-2.0
"""A test for many cases fails where one of its cases does, and says which."""

import logging

from cases import for_all
import numpy as np
import pytest


def test_every_case_is_tried_and_each_that_fails_is_named():
    tried = []

    @for_all(('a', 'b'), [(1, 2), (2, 2), (3, 3)])
    @for_all('c', (10, 20))
    def test_sum(a, b, c):
        tried.append((a, b, c))
        assert (a + b, c) == (4, 10)

    with pytest.raises(BaseExceptionGroup, match='3 of 3 cases') as failed:
        test_sum()
    assert tried == [(a, b, c) for a, b in ((1, 2), (2, 2), (3, 3)) for c in (10, 20)]
    first, second, third = failed.value.exceptions
    assert [str(each) for each in first.__notes__] == ['case: a=1, b=2']
    assert second.__notes__ == ['case: c=20', 'case: a=2, b=2']
    assert isinstance(third, BaseExceptionGroup)


def test_one_failure_is_raised_as_it_is():
    @for_all('number', range(3))
    def test_small(number):
        if number > 1:
            pytest.fail('too large')

    with pytest.raises(pytest.fail.Exception, match='too large') as failed:
        test_small()
    assert failed.value.__notes__ == ['case: number=2']


def test_without_a_case_there_is_no_test():
    with pytest.raises(ValueError, match='no case of number'):
        for_all('number', ())


@for_all('number', range(2))
def test_fixtures_are_as_new_for_each_case(number, tmp_path, monkeypatch, capsys, caplog):
    assert not list(tmp_path.iterdir())
    assert not hasattr(pytest, 'of_a_case')
    assert not caplog.text
    (tmp_path / 'file').touch()
    monkeypatch.setattr(pytest, 'of_a_case', number, raising=False)
    print(number)
    assert capsys.readouterr().out == f'{number}\n'
    print('left')
    logging.getLogger(__name__).warning('left')


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@for_all('number', range(2))
def test_each_case_draws_the_same(number, rng):
    assert rng.integers(1000) == np.random.default_rng(3).integers(1000)
