# SPDX-License-Identifier: Apache-2.0
"""A pad is found, read, lost and found again; what is no pad is refused, and nobody waits."""

import os

from pads import PipePad
import pytest
from teleop_keyboard.gamepad_device import first_pads, Gamepad, LOOK_PERIOD
from wasd_core.errors import UserError

STEP = 0.01


@pytest.fixture
def pipe(tmp_path):
    pipe = PipePad(tmp_path / 'js0')
    yield pipe
    pipe.unplug()


@pytest.fixture
def gamepad(tmp_path):
    gamepad = Gamepad(folder=tmp_path)
    yield gamepad
    gamepad.close()


def test_a_pad_is_there_from_its_first_word_to_its_end(gamepad, pipe):
    assert gamepad.step(STEP) == ((), False)
    assert not gamepad.is_there
    pipe.plug()
    (state,), is_lost = gamepad.step(STEP)
    assert (len(state.axes), len(state.buttons), is_lost) == (8, 11, False)
    assert gamepad.is_there
    pipe.press(4)
    assert gamepad.step(STEP).states[-1].buttons[4] == 1
    pipe.unplug()
    assert gamepad.step(STEP) == ((), True)
    assert not gamepad.is_there
    assert gamepad.step(STEP) == ((), False)


def test_its_last_words_are_heard_before_it_is_lost(gamepad, pipe):
    gamepad.step(STEP)
    pipe.plug()
    gamepad.step(STEP)
    pipe.press(0)
    pipe.unplug()
    assert gamepad.step(STEP).states[-1].buttons[0] == 1
    assert gamepad.step(STEP).is_lost


def test_it_is_found_again_and_nothing_of_before_counts(gamepad, pipe):
    gamepad.step(STEP)
    pipe.plug()
    pipe.press(4)
    pipe.push(1, -1.0)
    gamepad.step(STEP)
    pipe.unplug()
    gamepad.step(STEP)
    gamepad.step(LOOK_PERIOD)
    pipe.plug(down=(4,))
    (state,), _ = gamepad.step(STEP)
    # It was held all the time.
    assert not any(state.axes) and not any(state.buttons)
    pipe.release(4)
    pipe.press(4)
    assert gamepad.step(STEP).states[-1].buttons[4] == 1


def test_a_pad_may_come_when_nobody_expects_it(gamepad, tmp_path):
    for _ in range(3):
        assert gamepad.step(LOOK_PERIOD) == ((), False)
    late = PipePad(tmp_path / 'js3')
    gamepad.step(LOOK_PERIOD)
    late.plug()
    assert gamepad.step(STEP).states
    assert gamepad.name == str(tmp_path / 'js3')
    late.unplug()


def test_a_state_that_stays_is_told_twenty_times_a_second(gamepad, pipe):
    gamepad.step(STEP)
    pipe.plug()
    gamepad.step(STEP)
    told = [bool(gamepad.step(STEP).states) for _ in range(100)]
    assert 19 <= sum(told) <= 20


def test_who_waits_is_woken_by_the_pad_and_by_what_is_due(gamepad, pipe):
    gamepad.step(STEP)
    pipe.plug()
    gamepad.wait()
    assert gamepad.step(0.0).states
    gamepad.wait()  # nothing comes: the state is to be told again
    assert gamepad.step(1.0 / gamepad.rate).states
    gamepad.rate = 0.0
    pipe.press(0)
    gamepad.wait()
    assert gamepad.step(0.0).states[-1].buttons[0] == 1
    pipe.unplug()
    gamepad.wait()
    assert gamepad.step(0.0).is_lost


def test_js2_comes_before_js10_and_other_files_are_no_pads(tmp_path):
    for name in ('js10', 'js2', 'event0', 'mouse1', 'jsx'):
        (tmp_path / name).touch()
    assert first_pads(tmp_path) == [str(tmp_path / 'js2'), str(tmp_path / 'js10')]
    assert first_pads(tmp_path / 'nowhere') == []


def test_what_can_never_be_a_pad_is_refused(tmp_path):
    (tmp_path / 'notes.txt').touch()
    with pytest.raises(UserError, match='notes.txt: wanted a device as /dev/input/js0, got a pla'):
        Gamepad(str(tmp_path / 'notes.txt'))
    with pytest.raises(UserError, match='got a folder'):
        Gamepad(str(tmp_path))


@pytest.mark.parametrize('device', ['urandom', 'zero', 'null', 'tty', 'ptmx'])
def test_a_device_that_is_no_joystick_is_refused_and_never_read(device, tmp_path):
    path = f'/dev/{device}'
    try:
        os.close(os.open(path, os.O_RDONLY | os.O_NONBLOCK))
    except OSError:
        pytest.skip(f'no {path} here')
    with pytest.raises(UserError, match=f'gamepad {path}: wanted .*, got a device that is no joy'):
        Gamepad(path)
    # Nor when it comes later.
    late = tmp_path / 'pad'
    gamepad = Gamepad(str(late))
    late.symlink_to(path)
    for _ in range(100):
        assert gamepad.step(STEP).states == ()
    assert not gamepad.is_there
    assert gamepad.problem == f'gamepad {late}: a device that is no joystick'
    gamepad.close()


@pytest.mark.skipif(os.geteuid() == 0, reason='root may read everything')
def test_a_pad_that_may_not_be_read_is_named(gamepad, pipe):
    os.chmod(pipe.path, 0)
    gamepad.step(STEP)
    assert gamepad.problem == f'gamepad {pipe.path}: Permission denied'


def test_an_error_while_reading_is_a_loss(gamepad, pipe, monkeypatch):
    gamepad.step(STEP)
    pipe.plug()
    gamepad.step(STEP)

    def fail(descriptor, count):
        raise OSError(19, 'No such device')

    monkeypatch.setattr(os, 'read', fail)
    assert gamepad.step(STEP).is_lost


def test_a_writer_without_end_is_read_in_pieces(gamepad, pipe):
    gamepad.step(STEP)
    pipe.plug()
    for _ in range(4000):
        pipe.press(0)
    assert len(gamepad.step(STEP).states) < 1000
