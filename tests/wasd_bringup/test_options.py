# SPDX-License-Identifier: Apache-2.0
"""Options: checked before anything starts, with defaults that the contract names."""

import argparse
from dataclasses import replace
import math
import os
from pathlib import Path

from cases import for_all
from mujoco_sim.parameters import Payload, Untold
import pytest
from wasd_bringup.cli import main, make_parser
from wasd_bringup.cli.options import add_run_options, OPTIONS, read_options, vain_words
from wasd_bringup.robots import WHEELS
from wasd_bringup.run.options import AFTERGLOW
from wasd_bringup.tools.recording.reader import describe_run, recorded_options
from wasd_core.errors import UserError
from wasd_core.output_file import OutputError


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Return a function that reads options in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    parser = argparse.ArgumentParser()
    add_run_options(parser, 'go2')
    return lambda *words: read_options(parser.parse_args(words))


@pytest.mark.slow
def test_an_option_of_another_robot_names_that_robot_and_the_help_of_this_one():
    with pytest.raises(UserError, match=r'arguments: --gait walk \(see: .*wasd mbot --help\)'):
        make_parser().parse_args(['mbot', '--gait', 'walk'])
    with pytest.raises(UserError, match='^--goal is for wasd go2, wasd mbot, wasd g1; unrec'):
        make_parser().parse_args(['both', '--explore', '--goal=1 1'])
    with pytest.raises(UserError, match='^unrecognized arguments: --gaol'):
        make_parser().parse_args(['both', '--gaol', '1 1'])
    with pytest.raises(UserError, match=r'arguments: more \(see: .*wasd keys --help\)'):
        make_parser().parse_args(['keys', 'mbot', 'more'])


def test_defaults_are_those_of_the_contract(read):
    options = read()
    assert (options.robot, options.description, options.world) == ('go2', 'go2', 'flat')
    assert (options.speed, options.seed, options.duration) == (1.0, 0, math.inf)
    assert (options.estimator, options.limits, options.preset) == ('kalman', None, 'unitree')
    assert (options.viewer, options.untold) == (None, Untold())
    assert options.keys is None
    assert not options.scripted


@pytest.mark.parametrize(
    ('words', 'has', 'vain'),
    [
        ('', {'page': False, 'lidar': False, 'physics': False}, ''),
        ('--port 0 --no-open --seed 3', {'page': False}, '--port --no-open'),
        ('--port 0 --no-open --lidar a1', {'page': True, 'lidar': True}, ''),
        ('--lidar honest', {'lidar': False}, '--lidar'),
        ('--payload 2 --friction 1', {'physics': False}, '--payload --friction'),
    ],
)
def test_options_without_what_they_need_are_named(words, has, vain):
    parser = argparse.ArgumentParser()
    add_run_options(parser, 'mbot')
    assert vain_words(parser.parse_args(words.split()), has) == vain.split()


@pytest.mark.slow
def test_what_is_without_effect_is_a_line_and_changes_neither_result_nor_status(capfd):
    told = []
    words = 'mbot --mode fake --description mbot_bare --duration 0.1 --speed 0 --viewer none'
    for more in ('', '--port 0 --lidar a1 --friction 0.5'):
        assert main([*words.split(), '--no-ros', *more.split()]) == 0
        told.append(capfd.readouterr())
    line = 'WARNING: without effect here: --port, --friction, --lidar\n'
    assert told[1].err == told[0].err + line
    assert [out.out.partition(';')[2] for out in told][0] == told[1].out.partition(';')[2]


def test_a_wheeled_robot_has_no_estimator_to_choose():
    parser = argparse.ArgumentParser()
    add_run_options(parser, 'mbot')
    assert read_options(parser.parse_args([])).estimator == 'kalman'
    with pytest.raises(SystemExit):
        parser.parse_args(['--estimator', 'truth'])


@for_all(
    'option', [option for option in OPTIONS if set(option.how) <= {'metavar', 'nargs', 'const'}]
)
def test_an_empty_value_as_of_an_unset_variable_is_refused(option):
    robot = 'mbot' if option.of == WHEELS else 'go2'
    parser = argparse.ArgumentParser()
    add_run_options(parser, robot)
    with pytest.raises(UserError) as caught:
        read_options(parser.parse_args([f'{option.word}=']))
    assert str(caught.value) == f"{option.word}: got '', wanted {option.how['metavar']}"


@for_all(
    'words',
    [
        ('replay', ''),
        ('describe', 'policy', ''),
        ('describe', 'policy', 'ours', '--policy-config', ''),
        ('calibrate', '--description', ''),
        ('calibrate', '--package-path', ''),
        ('calibrate', '--controller', ''),
        ('calibrate', '--output', ''),
    ],
)
def test_an_empty_path_is_not_taken_for_this_folder(words):
    with pytest.raises(UserError, match="got '', wanted a file or a folder"):
        make_parser(words[0]).parse_args(words)


def test_an_option_that_stands_alone_is_no_empty_value(read):
    assert read('--map', '--gamepad').map == ''
    assert read('--map', '--gamepad').gamepad == ''


def test_a_picture_that_is_given_as_a_map_names_the_yaml_beside_it(read, tmp_path):
    (tmp_path / 'house.pgm').write_bytes(b'P5\n4 4\n255\n' + bytes(16))
    for words in (('--keepout', 'house.pgm'), ('--map', 'house')):
        with pytest.raises(UserError) as caught:
            read(*words)
        assert 'did you mean' not in str(caught.value)
    (tmp_path / 'house.yaml').write_text('image: house.pgm\nresolution: 0.05\norigin: [0, 0, 0]')
    for words in (('--keepout', 'house.pgm'), ('--map', 'house')):
        with pytest.raises(UserError, match=f'^{words[0]} .*, did you mean house.yaml.$'):
            read(*words)
    assert read('--keepout', 'house.yaml').keepout == 'house.yaml'


def test_scripts_are_read_at_once(read, tmp_path):
    (tmp_path / 'k').write_text('1 2\n3 w*2')
    (tmp_path / 't').write_text('2 0.5 0 0')
    options = read('--play', 'k', '--twist', 't')
    assert [press.key for press in options.keys] == ['2', 'w', 'w']
    assert options.twists[0].velocity == (0.5, 0.0, 0.0)
    assert options.scripted


def test_a_scripted_run_ends_a_moment_after_its_last_line(read, tmp_path):
    (tmp_path / 'k').write_text('1 2\n3 w')
    (tmp_path / 't').write_text('2 0.5 0 0\n5 stop')
    assert read('--play', 'k').duration == 3.0 + AFTERGLOW
    assert read('--play', 'k', '--twist', 't').duration == 5.0 + AFTERGLOW
    assert read('--play', 'k', '--duration', '1').duration == 1.0


def test_a_script_may_begin_with_the_mark_that_some_editors_write(read, tmp_path):
    (tmp_path / 'k').write_text('0 2', encoding='utf-8-sig')
    (tmp_path / 't').write_text('1 0.5 0 0', encoding='utf-8-sig')
    options = read('--play', 'k', '--twist', 't')
    assert (options.keys[0].key, options.twists[0].time) == ('2', 1.0)


def test_an_empty_script_is_a_script(read, tmp_path):
    (tmp_path / 'k').write_text('# nothing yet\n')
    options = read('--play', 'k')
    assert options.scripted
    assert options.duration == AFTERGLOW


def test_pushes_and_folders_may_be_given_again_and_again(read, tmp_path):
    boxes = ('--box', '3 1 0', '--box', '1 2 0 0.5')
    options = read('--push', '1 1 0 0 1', '--push', '2 0 1 0 1', '--package-path', '.', *boxes)
    assert [box.time for box in options.boxes] == [3.0, 1.0]
    assert [push.time for push in options.pushes] == [1.0, 2.0]
    assert options.package_path == (tmp_path.resolve(),)


def test_what_the_controller_is_not_told_is_read(read):
    untold = read(
        '--friction', '0.3', '--payload', '8@0,0.1,0', '--randomise', '1', '--imu-drift', '2'
    ).untold
    assert untold == Untold(
        friction=0.3, payload=Payload(8.0, (0.0, 0.1, 0.0)), randomise=1.0, imu_drift=2.0
    )


def test_a_recording_knows_what_guards_a_robot_and_what_walks_it(read, tmp_path):
    network = tmp_path / 'walk.onnx'
    network.write_bytes(b'')
    more = {'policy': str(network), 'policy_config': 'deploy.yaml', 'height_scan': 'truth'}
    options = replace(read('--guard', '--eyes', '--lidar', 'ideal'), **more)
    recorded = recorded_options(describe_run(options))
    assert (recorded.guard, recorded.eyes, recorded.lidar) == (True, True, 'ideal')
    assert {name: getattr(recorded, name) for name in more} == more
    older = {name: value for name, value in describe_run(options).items() if name not in
             ('guard', 'eyes', 'lidar', 'preset', 'layout', *more)}  # fmt: skip
    network = {'policy': None, 'policy_config': None, 'height_scan': 'map'}
    assert recorded_options(older) == replace(
        recorded, guard=False, eyes=False, lidar='honest', **network
    )


def test_a_recording_knows_the_keyboard_and_its_files_from_every_folder(read, tmp_path):
    for name in ('plan,1.png', 'keys.yaml', 'wasd', 'room', 'stairs:0.1', 'go2'):
        (tmp_path / name).write_text(name)
    words = '--layout', 'azerty', '--preset', 'keys.yaml', '--world', 'plan,1.png,0.05'
    recorded = recorded_options(describe_run(read(*words)))
    assert (recorded.layout, recorded.preset) == ('azerty', str(tmp_path / 'keys.yaml'))
    assert recorded.world == f'{tmp_path}/plan,1.png,0.05'
    named = recorded_options(describe_run(read('--preset', 'wasd', '--world', 'stairs:0.1,0.3')))
    assert (named.preset, named.world) == ('wasd', 'stairs:0.1,0.3')
    assert (named.description, recorded_options(describe_run(read('--world', 'room'))).world) == (
        'go2',
        'room',
    )


def test_what_is_recorded_of_a_run_are_its_options(read):
    words = '--friction', '0.3', '--payload', '8@0,0.1,0', '--randomise', '1', '--imu-drift', '2'
    options = read(*words)
    assert recorded_options(describe_run(options)).untold == options.untold


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (('--seed', '-1'), "--seed: got '-1', wanted 0 to 9223372036854775807"),
        (('--seed', str(2**63)), "--seed: got '9223372036854775808', wanted 0 to"),
        (('--port', '70000'), "--port: got '70000', wanted 0 to 65535"),
        (('--port', '1e3'), "--port: got '1e3', wanted 0 to 65535"),
        (
            ('--push', '-1 0 9 0 1'),
            "--push: got '-1 0 9 0 1', wanted 't fx fy fz seconds [x y z]', t",
        ),
        (
            ('--box', '0 1 1 0 0 1'),
            "--box: got '0 1 1 0 0 1', wanted 't x y [yaw [length width]]', t",
        ),
        (('--duration', 'nan'), "--duration: got 'nan', wanted a number >= 0"),
        (('--duration', '-1'), "--duration: got '-1'"),
        (('--speed', '1e-9'), '--speed must be 0, or >= 0.001 and <= 1000, got 1e-09'),
        (('--speed', 'fast'), "--speed: got 'fast', wanted a number >= 0"),
        (('--friction', '0'), '--friction must be >= 0.01 and <= 2, got 0.0'),
        (('--friction', '-0.1'), '--friction must be >= 0.01 and <= 2, got -0.1'),
        (('--friction', 'nan'), '--friction: got nan, wanted a finite number'),
        (('--friction', 'ice'), "--friction: got 'ice', wanted a number"),
        (('--imu-drift', '101'), '--imu-drift must be >= 0 and <= 100, got 101.0'),
        (('--imu-drift', 'much'), "--imu-drift: got 'much', wanted a number"),
        (('--randomise', '1.5'), '--randomise must be >= 0 and <= 1, got 1.5'),
        (('--payload', 'heavy'), "--payload: got 'heavy', wanted KG or KG@X,Y,Z with KG > 0"),
        (
            ('--payload', '1e9'),
            "--payload: got '1e9', wanted KG or KG@X,Y,Z with KG > 0 and <= 100",
        ),
        (('--speed', 'inf'), "--speed: got 'inf'"),
        (('--play', 'gone'), '--play gone: no such file'),
        (('--twist', 'bytes'), '--twist bytes: not a text file'),
        (('--package-path', 'gone'), '--package-path gone: no such folder'),
        (('--report', 'gone/r.json'), '--report gone/r.json: wanted a file'),
        (('--report', '.'), '--report .: wanted a file'),
    ],
)
def test_what_is_wrong_is_said_before_the_run(read, tmp_path, words, said):
    (tmp_path / 'bytes').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(UserError) as caught:
        read(*words)
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize('option', ['--play', '--twist'])
def test_a_script_that_is_no_file_is_refused_and_never_waited_for(read, tmp_path, option):
    os.mkfifo(tmp_path / 'fifo')
    for path in ('/dev/zero', '/dev/null', 'fifo'):
        with pytest.raises(UserError) as caught:
            read(option, path)
        assert str(caught.value) == f'{option} {path}: is a device or pipe, wanted a file'
    for path in ('.', 'a' * 300, 'nul\0'):
        with pytest.raises(UserError, match=f'^{option} '):
            read(option, path)


def test_no_output_takes_the_place_of_a_network_or_its_settings(read, tmp_path):
    for name in ('walk.onnx', 'deploy.yaml'):
        (tmp_path / name).write_bytes(b'trained')
    for option, name in (('--policy', 'walk.onnx'), ('--policy-config', 'deploy.yaml')):
        with pytest.raises(OutputError, match=f'--report {name}: .* as {option} {name}'):
            read(option, name, '--report', name)
        assert (tmp_path / name).read_bytes() == b'trained'


def test_a_wrong_key_script_is_a_users_error(read, tmp_path):
    (tmp_path / 'k').write_text('0 NOWHERE')
    with pytest.raises(UserError, match='k:1:'):
        read('--play', 'k')


def test_the_report_is_a_path(read):
    assert read('--report', 'r.json').report.path == Path('r.json')


@pytest.mark.parametrize('ending', ['', '.yaml', '.yml', '.pgm'])
def test_a_map_is_saved_by_its_name_without_the_ending_of_one_of_its_files(read, ending):
    assert read('--save-map', f'here{ending}').save_map == 'here'
    assert read('--save-map', '.yaml').save_map == '.yaml'
