# SPDX-License-Identifier: Apache-2.0
"""Every program answers --help at once, and refuses what it does not know in one line."""

import functools
from importlib import import_module
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from cases import for_all
from executables import SCRIPTS
import pytest
from terminals import PATIENCE
from wasd_core.command_line import Executable, split_ros_words
from wasd_core.parameters import known_parameters

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = {
    name: getattr(import_module(target.partition(':')[0]), target.partition(':')[2])
    for name, target in SCRIPTS.items()
    if target.partition(':')[0].endswith('parameters')
}
# Of processor time, which other programs do not take away [s].
AT_ONCE = 1.0
# Answers words in turn, by functions or, where none is named, as the module does that is run:
# status, output, standard error of each, and the processor time since the last, or the start.
START = """
import contextlib, io, json, runpy, sys, time
from importlib import import_module
def run(module):
    sys.modules.pop(module, None)  # another has loaded it
    runpy.run_module(module, run_name='__main__', alter_sys=True)
asked = [(name, word) for name in sys.argv[1].split(',') for word in sys.argv[2:]]
answers, before = [], 0.0
for name, word in asked:
    module, _, function = name.partition(':')
    main = getattr(import_module(module), function) if function else lambda: run(module)
    said, complaint = (io.TextIOWrapper(io.BytesIO(), 'utf-8') for _ in range(2))
    sys.argv = ['', word]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complaint):
        try:
            status = main()
        except SystemExit as end:
            status = end.code
    if function and not {'rclpy', 'mujoco'}.isdisjoint(sys.modules):
        complaint.write('heavy modules were loaded')
    said.seek(0), complaint.seek(0)
    took, before = time.process_time() - before, time.process_time()
    answers.append((status, said.read(), complaint.read(), took))
print(json.dumps(answers))
"""
# Of one start; the first is the help, which comes at once.
WORDS = ('--help', '-h', 'nonsense', '--nonsense', 'description:=go2')


def start(name: str, word: str) -> tuple[int, str, str, float]:
    """Run a program; return status, output, standard error, and the processor time it took."""
    return answer(SCRIPTS[name], WORDS)[WORDS.index(word)]


@functools.cache
def answer(mains: str, words: tuple[str, ...]) -> list[Any]:
    """Return what each function or module answers to words, and the processor time it took."""
    done = subprocess.run(
        [sys.executable, '-c', START, mains, *words],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE,
        check=False,
        env={**os.environ, 'COLUMNS': '80'},
    )
    assert (done.returncode, done.stderr) == (0, '')
    answers: list[Any] = json.loads(done.stdout)
    return answers


def test_all_programs_are_known():
    assert set(SCRIPTS) - set(PROGRAMS) == {'describe', 'unitree_bridge', 'wasd'}


@pytest.mark.slow
@for_all('name', SCRIPTS)
@for_all('word', ['--help', '-h'])
def test_help_comes_at_once_and_starts_nothing(name, word):
    status, said, complaint, took = start(name, word)
    assert (status, complaint) == (0, '')
    assert said.startswith(f'usage: {name} ')
    assert took < AT_ONCE
    assert max(map(len, said.splitlines())) <= 100


@pytest.mark.slow
@for_all('name', PROGRAMS)
def test_help_has_every_parameter_with_its_default_the_topics_and_an_example(name):
    _, said, _, _ = start(name, '--help')
    program: Executable = PROGRAMS[name]
    names: list[str] = []
    for place in program.parameters:
        module, _, definition = place.partition(':')
        names += known_parameters(getattr(import_module(module), definition))
    assert names
    for outward in names:
        assert f'\n  {outward}  (' in said
    assert 'docs/topics.md' in said
    assert f'\n  {program.example}\n' in said
    assert program.example.startswith(f'{name} ')


@pytest.mark.slow
@for_all('name', SCRIPTS)
@for_all('word', ['nonsense', '--nonsense', 'description:=go2'])
def test_an_unknown_word_is_refused_in_one_line(name, word):
    status, said, complaint, took = start(name, word)
    assert (status, said) == (2, '')
    assert complaint.startswith('error: ')
    assert complaint.count('\n') == 1
    assert took < AT_ONCE


@pytest.mark.slow
def test_a_node_started_by_its_module_answers_the_same():
    words = ('--help', 'nonsense')
    answers = answer(','.join(program.module for program in PROGRAMS.values()), words)
    wanted = [start(name, word)[:3] for name in PROGRAMS for word in words]
    assert [each[:3] for each in answers] == wanted


@for_all(
    ('words', 'own', 'ros'),
    [
        ('', '', ''),
        ('a b', 'a b', ''),
        ('--ros-args -r a:=b', '', '--ros-args -r a:=b'),
        ('a --ros-args -p b:=c', 'a', '--ros-args -p b:=c'),
        ('--ros-args -p b:=c -- a', 'a', '--ros-args -p b:=c --'),
        ('--ros-args -- a --ros-args x', 'a', '--ros-args -- --ros-args x'),
    ],
)
def test_words_for_ros_end_at_two_dashes(words, own, ros):
    assert split_ros_words(words.split()) == (own.split(), ros.split())


@for_all('name', ['teleop', 'key_publisher'])
def test_programs_that_read_keys_save_them(name):
    given = PROGRAMS[name].read(['--save-keys', 'a.keys', '--ros-args', '-p', 'x:=1'])
    assert (given.save_keys, given.ros) == ('a.keys', ['--ros-args', '-p', 'x:=1'])
