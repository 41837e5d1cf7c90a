# SPDX-License-Identifier: Apache-2.0
import io

from cases import for_all
from teleop_keyboard.dashboard import bar, dashboard, KeyHints, Line, plain_line, Surroundings
from teleop_keyboard.keymap import LAYOUTS, table_lines
from teleop_keyboard.keymap_file import load_preset, preset_names
from teleop_keyboard.keys_to_twist import KeysToTwist, Velocity
from teleop_keyboard.screen import CLOSE, OPEN, Screen

ROBOT = Surroundings(velocity=Velocity(vx=0.1, wz=-0.5), state='trotting', subscribers=1)


class Terminal(io.StringIO):
    encoding = 'utf-8'

    def isatty(self):
        return True


def driving(preset='mbot', keys='i'):
    logic = KeysToTwist(load_preset(preset))
    for key in keys:
        logic.press(key)
    logic.step(0.1)
    return logic


def text(lines):
    return '\n'.join(line.text for line in lines)


@for_all('layout', LAYOUTS)
@for_all('preset', preset_names())
def test_every_preset_fits_80_by_24(preset, layout):
    keymap = load_preset(preset, layout)
    lines = dashboard(KeysToTwist(keymap), ROBOT, 80, 24)
    assert len(lines) < 24
    assert all(len(line.text) < 80 for line in lines)
    assert all(line in text(lines) for line in keymap.help_lines)


@for_all(('width', 'height'), [(1, 1), (20, 5), (40, 10), (300, 100)])
def test_any_window_gets_what_fits(width, height):
    lines = dashboard(driving(), ROBOT, width, height)
    assert len(lines) < max(height, 1)
    assert all(len(line.text) < max(width, 1) for line in lines)


def test_it_shows_keys_velocities_state_and_connection():
    shown = text(dashboard(driving(keys='ij'), ROBOT, 80, 24))
    assert '[i] [j]' in shown
    assert 'robot   trotting' in shown
    assert '1 subscriber, Twist' in shown
    rows = [line for line in shown.splitlines() if 'target' in line or 'actual' in line]
    assert [row.split()[-2:] for row in rows] == [
        ['+0.20', 'm/s'],
        ['+0.10', 'm/s'],
        ['+1.00', 'rad/s'],
        ['-0.50', 'rad/s'],
    ]


def test_it_shows_the_axes_that_the_keys_move():
    shown = text(dashboard(driving('twist_keyboard', 'b'), ROBOT, 80, 24))
    names = [row.split()[0] for row in shown.splitlines() if ' target ' in row]
    assert names == ['forward', 'left', 'up', 'turn']
    (row,) = (row for row in shown.splitlines() if row.startswith(' up '))
    assert row.split()[-2:] == ['-0.50', 'm/s']


def test_it_says_when_nobody_listens_and_nothing_is_known():
    shown = dashboard(driving(), Surroundings(), 80, 24)
    assert Line(' cmd_vel nobody listens yet', 'warning') in shown
    assert 'ramp' in text(shown)
    assert 'says nothing on state' in text(shown)


@for_all(
    ('value', 'shown'),
    [
        (0.0, '·····│·····'),
        (1.0, '·····│█████'),
        (-1.0, '█████│·····'),
        (0.4, '·····│██···'),
        (-0.01, '····█│·····'),
        (9.0, '·····│█████'),
    ],
)
def test_a_bar_grows_from_the_middle(value, shown):
    assert bar(value, 1.0, 11) == shown


def page(*lines):
    return lambda width, height: [Line(line) for line in lines]


def test_a_frame_is_in_place_one_write_and_only_when_something_changed():
    terminal = Terminal()
    writes = []
    terminal.write = writes.append
    screen = Screen(terminal)
    for now, lines in enumerate([('a', 'b'), ('a', 'b'), ('a', 'c')]):
        screen.show(page(*lines), float(now))
    screen.close()
    assert len(writes) == 3
    assert writes[0].startswith(OPEN)
    assert 'a\x1b[K\r\nc\x1b[K' in writes[1]
    # No clearing of the screen: it would blink.
    assert '\x1b[2J' not in ''.join(writes)
    assert writes[2] == CLOSE


def test_a_resize_is_a_new_frame(monkeypatch):
    terminal = Terminal()
    screen = Screen(terminal)
    sizes = []

    def show(now):
        screen.show(lambda *size: sizes.append(size) or [Line('a')], now)

    monkeypatch.setenv('COLUMNS', '80')
    monkeypatch.setenv('LINES', '24')
    show(0.0)
    before = len(terminal.getvalue())
    monkeypatch.setenv('COLUMNS', '40')
    show(1.0)
    assert sizes == [(80, 24), (40, 24)]
    assert len(terminal.getvalue()) > before


def test_a_paused_screen_comes_back_with_the_same_page():
    terminal = Terminal()
    screen = Screen(terminal)
    screen.show(page('a'), 0.0)
    screen.close()
    assert terminal.getvalue().endswith(CLOSE)
    screen.show(page('a'), 1.0)
    assert terminal.getvalue().count(OPEN) == 2


def test_a_terminal_without_the_characters_gets_others():
    terminal = Terminal()
    terminal.encoding = 'ascii'
    Screen(terminal).show(page('·│█─'), 0.0)
    assert '.|#-' in terminal.getvalue()


def test_without_a_terminal_there_are_plain_lines_and_only_new_ones():
    stream = io.StringIO()
    screen = Screen(stream)
    logic = driving()
    for now in range(5):
        screen.show(page('a'), float(now))
        screen.log(plain_line(logic, ROBOT), float(now))
    (line,) = stream.getvalue().splitlines()
    assert line == (
        'keys i  full 0.20 m/s 1.00 rad/s  target forward +0.20 turn +0.00  '
        'cmd_vel 1 subscriber, Twist  robot trotting'
    )
    assert '\x1b' not in line


def test_the_help_that_was_asked_for_is_all_there_in_a_small_window():
    logic = KeysToTwist(load_preset('mbot'))
    page = [line.text for line in dashboard(logic, Surroundings(shows_help=True), 80, 24)]
    assert page[0].startswith(' wasd teleop   preset mbot')
    assert page[1:] == table_lines(logic.keymap)


@for_all('height', range(1, 30))
def test_a_window_too_low_for_the_help_says_how_much_is_missing(height):
    logic = driving()
    page = [line.text for line in dashboard(logic, Surroundings(shows_help=True), 80, height)]
    wanted = [line for line in table_lines(logic.keymap) if line]
    missing = [line for line in wanted if line not in page]
    assert len(page) < height
    if height > 2:
        assert bool(missing) == ('more: make the window higher' in page[-1])
        assert not missing or page[-1] == f'{len(missing)} more: make the window higher'


def test_a_hint_stands_beside_the_key_that_it_is_about():
    logic = KeysToTwist(load_preset('mbot'))
    logic.press('w')
    hint = KeyHints(logic, '?').press('w')
    page = [line.text for line in dashboard(logic, Surroundings(hint=hint), 80, 24)]
    assert ' keys    last w  drive with i , j l; w is speed +10 % (? shows the keys)' in page


@for_all('value', [float('nan'), float('inf'), -float('inf'), 1e308])
def test_a_bar_draws_whatever_it_is_given(value):
    for full in (1.0, 0.0, 5e-324, float('nan')):
        assert len(bar(value, full, 11)) == 11
