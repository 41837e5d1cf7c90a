# SPDX-License-Identifier: Apache-2.0
"""A stranger does what stands on the left of docs/first_ten_minutes.md, and sees the right."""

from collections.abc import Callable, Iterator
import contextlib
import json
from pathlib import Path
import re
import shlex
import signal
import subprocess
import sys
import time
from typing import Any, NamedTuple

from page_puppet import CutOff, middle_of, PagePuppet
import programs
import pytest
from terminals import PATIENCE
from wasd_cockpit.widgets import Rect

WASD = (sys.executable, '-m', 'wasd_bringup.cli')
TESTS = Path(__file__).resolve().parents[1]
PAGE = TESTS.parent / 'docs/first_ten_minutes.md'
DESK = (1280, 720)
FIRST_PORT = 8800
# Lines and columns of the terminal: with room for the dashboard.
WINDOW = (30, 110)
BYTES = {'SPACE': ' ', 'BACKSPACE': '\x7f', 'Ctrl-C': '\x03'}
# Where a hand drags the middle of something to, in halves of its size.
WAYS = {'up': (0.0, -0.9), 'left': (-0.8, 0.0)}


class Step(NamedTuple):
    """A row of a table: what is done, to what or with which words, and what is seen then."""

    verb: str
    words: tuple[str, ...]
    rest: str
    seen: tuple[str, ...]


class Run(NamedTuple):
    """A command of the page, and the steps below it."""

    words: tuple[str, ...]
    steps: list[Step]


def runs_of(text: str) -> list[Run]:
    """Return what the page has a stranger do, in its order."""
    runs: list[Run] = []
    for line in text.splitlines():
        if line.startswith('    ./wasd '):
            runs.append(Run(tuple(shlex.split(line)[1:]), []))
        elif line.startswith('| ') and not line.startswith(('| --- ', '| in the ', '| on the ')):
            done, seen = (cell.strip() for cell in line.strip('| ').split(' | '))
            verb = re.match(r'[a-z ]+', done)
            assert verb, line
            words = tuple(re.findall(r'`([^`]+)`', done))
            texts = tuple(re.findall(r'`([^`]+)`', seen))
            assert texts, f'nothing is seen: {line}'
            runs[-1].steps.append(Step(verb[0].strip(), words, done.rpartition('` ')[2], texts))
    return runs


class Stranger:
    """Does the steps of one run, on its terminal and with the pointer on its page."""

    def __init__(self, session: Any, rects: Path, second: Callable[..., Any]) -> None:
        self._session = session
        self._rects = rects
        self._second = second
        self._held = ''
        self._puppet: PagePuppet | None = None
        self._stack = contextlib.ExitStack()

    def do(self, step: Step) -> None:
        """Do a step, and see what is to be seen."""
        since = len(self._session.shown)
        act = getattr(self, f'_{step.verb.replace(" ", "_")}', None)
        assert act, f'no hand for {step}'
        until = act(step)
        shown: Callable[[], str] = until or (lambda: self._session.shown[since:])
        deadline = time.monotonic() + PATIENCE
        seen = 0
        for text in step.seen:
            # One after the other: a screen from before may have the later one, too.
            while (at := shown().find(text, seen)) < 0:
                assert time.monotonic() < deadline, f'{step}: {shown()[-2000:]}'
                if self._held:
                    self._session.type(self._held)
                self._session.read(1.0 / 30.0)
            seen = at + len(text)

    def close(self) -> None:
        """Leave the page."""
        self._stack.close()

    def _press(self, step: Step) -> None:
        for key in step.words:
            self._session.type(BYTES.get(key, key))

    def _hold(self, step: Step) -> None:
        (self._held,) = step.words

    def _let_go(self, step: Step) -> None:
        if self._held:
            self._held = ''
        else:
            self._page().let_go()

    def _wait(self, step: Step) -> None:
        pass

    def _click(self, step: Step) -> None:
        (name,) = step.words
        self._page().press_at(middle_of(self._find(name)))
        # `restart` ends the page, maybe before it has drawn again.
        with contextlib.suppress(CutOff):
            self._page().let_go()

    def _drag(self, step: Step) -> None:
        (name,) = step.words
        rect, (right, down) = self._find(name), WAYS[step.rest]
        x, y = middle_of(rect)
        self._page().press_at((x, y))
        place = x + 0.5 * right * rect.width, y + 0.5 * down * rect.height
        self._page().drag_to((round(place[0]), round(place[1])))

    def _in_a_second_terminal(self, step: Step) -> Callable[[], str]:
        (line,) = step.words
        words = shlex.split(line)
        assert words[0] == './wasd', line
        return self._second(words[1:], lambda: self._session.read())

    def _page(self) -> PagePuppet:
        """Return the page, which is opened when it is needed."""
        if self._puppet is None:
            (url,) = set(re.findall(r'viewer: (http://\S+)', self._session.shown))
            self._puppet = self._stack.enter_context(PagePuppet(url, size=DESK))
        return self._puppet

    def _find(self, label: str) -> Rect:
        """Return where a widget is, by what stands on it."""
        self._page()
        deadline = time.monotonic() + PATIENCE
        while True:
            found = json.loads(self._rects.read_text()) if self._rects.exists() else {}
            names = [name for name in found if f' {name}'.endswith(f' {label}')]
            if label in found or len(names) == 1:
                return Rect(*found[label if label in found else names[0]])
            assert time.monotonic() < deadline, f'{label} is not one of {sorted(found)}'
            self._session.read(0.05)


@pytest.fixture
def second(environment: dict[str, str], tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Return a function that starts `wasd` and returns one that tells what it has said."""
    started: list[subprocess.Popen[str]] = []

    def start(words: list[str], idle: Callable[[], None]) -> Callable[[], str] | None:
        said = tmp_path / f'second_{len(started)}.txt'
        with said.open('w') as file:
            started.append(
                programs.start(
                    [*WASD, *words],
                    env=environment,
                    cwd=tmp_path,
                    stdin=subprocess.DEVNULL,
                    stdout=file,
                    stderr=file,
                    start_new_session=True,
                )
            )
        # What goes on until it is stopped is seen on the first terminal.
        return None if words[0] == 'pub' else said.read_text

    yield start
    for process in started:
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE)
        process.kill()
        process.wait()


RUNS = runs_of(PAGE.read_text())


def test_the_page_is_read_as_it_stands():
    assert [run.words[0] for run in RUNS] == ['go2', 'mbot', 'replay']
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith('| ')]
    headings = sum(line.startswith('| --- ') for line in rows)
    assert sum(len(run.steps) for run in RUNS) == len(rows) - 2 * headings > 25


def test_a_changed_command_or_key_is_run_as_changed():
    text = PAGE.read_text().replace('    ./wasd mbot --world room', '    ./wasd mbot --world flat')
    text = text.replace('| hold `i` |', '| hold `o` |')
    assert '--world flat' in ' '.join(runs_of(text)[1].words)
    assert runs_of(text)[1].steps[0].words == ('o',)
    with pytest.raises(AssertionError, match='nothing is seen'):
        runs_of(text + '| press `x` | something |\n')


@pytest.mark.slow
def test_the_first_ten_minutes_are_as_the_page_says(
    run_on_terminal: Callable[..., Any],
    second: Callable[..., Any],
    environment: dict[str, str],
    tmp_path: Path,
) -> None:
    private = {**environment, 'XDG_CONFIG_HOME': str(tmp_path / 'config')}
    private['PYTHONPATH'] = str(TESTS)
    for number, run in enumerate(RUNS):
        rects = tmp_path / f'rects_{number}.json'
        words = ['-m', 'page_watch', str(rects), *run.words]
        if run.words[0] != 'replay':
            # Other tests take the first port that is free, also while this run restarts.
            words += ['--port', str(FIRST_PORT + int(environment['ROS_DOMAIN_ID']))]
        session = run_on_terminal(words, private, tmp_path, WINDOW)
        stranger = Stranger(session, rects, second)
        if run.words[0] != 'replay':
            session.wait_for(' x', timeout=PATIENCE)
        try:
            for step in run.steps:
                stranger.do(step)
        finally:
            stranger.close()
        # A second Ctrl-C, while the first one's is still closing, would end it at once.
        if run.words[0] != 'replay' and 'Ctrl-C' not in run.steps[-1].words:
            session.type('\x03')
        assert session.end(PATIENCE) == 0, session.shown[-2000:]
