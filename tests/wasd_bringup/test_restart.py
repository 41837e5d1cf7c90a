# SPDX-License-Identifier: Apache-2.0
"""A run that its page starts again: with which words, and when it does not."""

from pathlib import Path
import re
import socket
import subprocess
import sys
import urllib.request

from cases import for_all
from mujoco_sim.scene import TERRAINS
from mujoco_sim.scene import WORLDS as PLAIN
import programs
import pytest
from terminals import wait_until
from wasd_bringup.cli import make_parser
from wasd_bringup.cli.options import read_options
from wasd_bringup.page.restart import choices_of, page_port, restart_words, WORLDS
from wasd_bringup.run.options import RunOptions
from wasd_cockpit.link import Start
from wasd_core.output_file import OutputFile

# A run whose page asks at once for another robot.
ASKS = """
import sys
from wasd_bringup.cli import main
from wasd_bringup.page.bridge import CockpitBridge
from wasd_cockpit.link import Order

attach = CockpitBridge.attach

def ask(bridge, where):
    attach(bridge, where)
    bridge._link.order(Order('start', 'mbot flat'))

CockpitBridge.attach = ask
sys.exit(main(sys.argv[1:]))
"""
USUAL = RunOptions(robot='go2', description='go2', words=('go2',))


def choices(**options: object) -> Start:
    """Return what a run with some options may start again with."""
    words = {'robot': 'go2', 'description': 'go2', 'words': ('go2',)}
    return choices_of(RunOptions(**{**words, **options}))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('before', 'after'),
    [
        ('go2', 'go2'),
        ('go2 --gait walk --world flat --port 8090', 'go2 --gait walk'),
        ('go2 --world=flat --no-open --port=8090 --seed 3', 'go2 --seed 3'),
        ('go2 --viewer web --seed 3', 'go2 --seed 3'),
        ('mbot --preset wasd --world flat', 'go2'),  # the options of another robot
        ('mbot --ros-args -p update_rate:=50', 'go2'),
    ],
)
def test_a_run_starts_again_with_its_options_in_another_world_on_the_same_page(before, after):
    words = restart_words(tuple(before.split()), 'go2', 'room', '8083')
    assert ' '.join(words) == f'{after} --world room --viewer web --port 8083 --no-open'
    again = restart_words(words, 'go2', 'flat', '8083')
    assert len(again) == len(words)
    options = read_options(make_parser().parse_args(again))
    assert (options.world, options.port, options.opens_page) == ('flat', 8083, False)


def test_the_page_shows_the_options_with_which_the_same_robot_starts_again(monkeypatch):
    monkeypatch.delenv('WASD_CALLED', raising=False)
    words = ('go2', '--map', '--port', '8090', '--package-path', 'my robots', '--no-open')
    words += ('--ros-args', '-p', 'gait:=walk')
    start = choices(words=words, map='', world='my house/room.xml')
    assert start.refusal == ''
    shown = "wasd go2 --world 'my house/room.xml' --map --package-path 'my robots'"
    assert start.words('go2', 'my house/room.xml') == f'{shown} --ros-args -p gait:=walk'
    assert start.words('mbot', 'room') == 'wasd mbot --world room'


@pytest.mark.slow
def test_without_a_terminal_the_page_comes_back_with_another_robot(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CONFIG_HOME', str(tmp_path))
    words = [sys.executable, '-P', '-c', ASKS, 'go2', '--viewer', 'web', '--no-ros', '--port', '0']
    with programs.start(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as run:
        places: list[str] = []
        for line in run.stdout:
            places += re.findall(r'^viewer: (\S+)', line)
            if len(places) == 2:
                break
        try:
            _, page = places
            wait_until(lambda: b'mbot' in urllib.request.urlopen(f'{page}status').read())
        finally:
            run.kill()


def test_a_port_that_was_taken_in_between_is_not_insisted_on(monkeypatch, capsys):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        assert page_port(port) == port  # a user asked for it, and is told
        monkeypatch.setenv('WASD_ANEW', '1')
        assert page_port(port) == 0
        assert f'port {port} is taken now' in capsys.readouterr().out
    assert page_port(port) == port


def test_what_is_for_ros_stays_behind_all_options():
    words = restart_words(('go2', '--ros-args', '-r', '__ns:=/a'), 'go2', 'room', '8083')
    assert words[-3:] == ('--ros-args', '-r', '__ns:=/a')
    assert words.index('--world') < words.index('--ros-args')


def test_only_what_the_page_offers_is_started():
    start = choices()
    assert not start.offers('go2', 'no such world')
    assert not start.offers('no_such_robot', 'room')
    assert start.offers('both', 'stairs:0.1')
    words = 'both --world stairs:0.1 --viewer web --port 8083 --no-open'
    assert restart_words(('go2',), 'both', 'stairs:0.1', '8083') == tuple(words.split())


def test_every_kind_of_world_is_offered_and_each_can_be_had():
    assert {world.partition(':')[0] for world in WORLDS} == {*PLAIN, *TERRAINS}
    for world in WORLDS:
        name, _, size = world.partition(':')
        assert size or name in PLAIN
        if size:
            first = TERRAINS[name].spans[0]
            assert first.least <= float(size) <= first.most


def test_a_file_of_the_users_that_is_the_world_is_offered_too():
    assert choices(world='my/house.xml').worlds == (*WORLDS, 'my/house.xml')


@for_all(
    ('options', 'why'),
    [
        ({'words': ()}, 'not started by its command'),
        ({'record': OutputFile(Path('a.mcap'), '--record')}, 'files of this run'),
        ({'report': OutputFile(Path('a.json'), '--report')}, 'files of this run'),
        ({'save_keys': OutputFile(Path('a.txt'), '--save-keys')}, 'files of this run'),
        ({'save_map': 'house'}, 'files of this run'),
        ({'map': 'house.yaml'}, 'belong to this world'),
        ({'goals': ((1.0, 2.0, 0.0),), 'map': ''}, 'belong to this world'),
        ({'keys': ()}, 'a script drives'),
        ({'twists': ()}, 'a script drives'),
    ],
)
def test_a_run_that_would_lose_something_is_not_started_again(options, why):
    start = choices(**options)
    assert why in start.refusal
    assert not start.offers('go2', 'room')
