# SPDX-License-Identifier: Apache-2.0
import math

from cases import for_all
from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.parameters import DiffDriveParameters
import pytest
from wasd_core.parameters import InvalidParameter

# As the tutorial prints it: one pair of braces per level, no indent, comments in Chinese.
TUTORIAL = """controllers: {
base_controller: {
type: diff_controller,#类型:差速控制器类型
base_frame_id: base_footprint, #坐标系
base_width: 0.26, #轮子间距
ticks_meter: 4100, #频率
#pid控制
Kp: 12,
Kd: 12,
Ki: 0,
Ko: 50,
accel_limit: 1.0 #加速度限制
}
}
"""
COURSE = {
    'base_frame_id': 'base_footprint',
    'wheel_separation': 0.26,
    'ticks_meter': 4100.0,
    'Kp': 12.0,
    'Kd': 12.0,
    'Ki': 0.0,
    'Ko': 50.0,
    'accel_limit': 1.0,
    'cmd_vel_timeout': 1.0,
}


@pytest.fixture
def read(tmp_path):
    """Return a function that writes a text to drive.yaml and reads it."""

    def read(text):
        path = tmp_path / 'drive.yaml'
        path.write_text(text, encoding='utf-8')
        return read_controller_file(str(path))

    return read


@pytest.fixture
def complaint(read, tmp_path):
    """Return a function that says what is wrong with a text, without its folder."""

    def complaint(text):
        with pytest.raises(InvalidParameter) as caught:
            read(text)
        assert '\n' not in str(caught.value)
        return str(caught.value).removeprefix(f'{tmp_path}/')

    return complaint


def test_the_file_of_the_tutorial_loads_as_it_is(read):
    file = read(TUTORIAL)
    assert file.values == COURSE
    assert file.name == 'base_controller'
    assert file.unused == ()


@for_all(
    'text',
    [
        TUTORIAL.replace('\n', '\n\t').rstrip('\t'),
        TUTORIAL.replace('\n', '\r\n'),
        '\ufeff' + TUTORIAL,
        ' '.join(line.partition('#')[0] for line in TUTORIAL.splitlines()),
        'controllers:\n  base_controller:\n    type: diff_controller\n'
        + '\n'.join(f'    {name}: {value}' for name, value in COURSE.items()),
        TUTORIAL.replace(
            'controllers:', 'port: /dev/ttyUSB0\nbaud: 115200\nrate: 20\ncontrollers:'
        ),
    ],
)
def test_it_may_be_written_in_other_ways(read, text):
    assert read(text).values == COURSE


def test_what_an_arbotix_file_leaves_out_is_as_with_arbotix(read):
    file = read('controllers: {c: {type: diff_controller}}')
    parameters = DiffDriveParameters.from_mapping(file.values)
    assert parameters.cmd_vel_timeout == 1.0
    gains = (parameters.Kp, parameters.Kd, parameters.Ki, parameters.Ko)
    assert gains == (5.0, 1.0, 0.0, 50.0)
    assert (parameters.rate, parameters.odom_frame_id) == (10.0, 'odom')


def test_sim_true_is_mode_fake(read):
    text = 'sim: true\ncontrollers: {c: {type: diff_controller}}'
    assert read(text).values['mode'] == 'fake'


def test_of_several_controllers_the_differential_drive_is_taken(read):
    text = (
        'controllers:\n  arm: {type: follow_controller, joints: [a, b]}\n'
        '  base: {type: diff_controller, Kp: 9}\njoints: {a: {id: 1}}'
    )
    assert read(text).name == 'base'
    assert read(text).values['Kp'] == 9.0


def test_a_ros_2_parameter_file_is_read_by_dots_and_by_levels(read):
    file = read(
        'controller_manager:\n  ros__parameters:\n    update_rate: 100\n'
        'diff_drive_base:\n  ros__parameters:\n'
        '    left_wheel_names: ["left_wheel_joint"]\n'
        '    right_wheel_names: [right_wheel_joint]\n'
        '    wheel_separation: 0.38\n    wheel_radius: 0.06\n'
        '    pose_covariance_diagonal: [0.001, 0.001, 0, 0, 0, 0.01]\n'
        '    use_stamped_vel: false\n    position_feedback: true\n'
        '    linear.x.max_velocity: 1\n    linear:\n      x:\n        max_jerk: .nan\n'
        '    angular.z.max_deceleration: -2.5e0\n'
    )
    assert file.name == 'diff_drive_base'
    assert file.unused == ('position_feedback',)
    assert math.isnan(file.values.pop('linear.x.max_jerk'))
    assert file.values == {
        'left_wheel_names': ('left_wheel_joint',),
        'right_wheel_names': ('right_wheel_joint',),
        'wheel_separation': 0.38,
        'wheel_radius': 0.06,
        'pose_covariance_diagonal': (0.001, 0.001, 0.0, 0.0, 0.0, 0.01),
        'stamped': False,
        'linear.x.max_velocity': 1.0,
        'angular.z.max_deceleration': -2.5,
    }


def test_what_all_nodes_share_comes_before_what_one_has(read):
    file = read(
        '/**:\n  ros__parameters: {Kp: 3, Kd: 4}\n'
        '/ns:\n  diff_drive_controller:\n    ros__parameters: {Kd: 5}'
    )
    assert file.values == {'Kp': 3.0, 'Kd': 5.0}


def test_limits_that_an_older_file_switches_off_are_off(read):
    values = read(
        'linear.x.has_velocity_limits: false\nlinear.x.max_velocity: 0.4\n'
        'linear.x.has_acceleration_limits: true\nlinear.x.max_acceleration: 0.7\n'
        'linear.x.min_acceleration: -0.9'
    ).values
    assert math.isnan(values['linear.x.max_velocity'])
    assert values['linear.x.max_acceleration'] == 0.7
    assert values['linear.x.max_deceleration'] == -0.9


def test_a_plain_table_has_the_names_of_here(read):
    assert read('mode: arbotix\nticks_meter: 1e3').values == {
        'mode': 'arbotix',
        'ticks_meter': 1000.0,
    }


@for_all(
    ('text', 'message'),
    [
        (
            TUTORIAL.replace('0.26', '-0.26'),
            'drive.yaml:5: base_width must be 0, or >= 0.01 and <= 10 m, got -0.26',
        ),
        (
            TUTORIAL.replace('12,', 'twelve,', 1),
            "drive.yaml:8: Kp must be a number, got 'twelve'",
        ),
        (
            TUTORIAL.replace('Ko: 50', 'Ko: 0'),
            'drive.yaml:11: Ko must be >= 1 and <= 1000, got 0.0',
        ),
        (
            TUTORIAL.replace('base_width', 'base_widht'),
            "drive.yaml:5: unknown parameter 'base_widht', did you mean base_width?",
        ),
        (
            TUTORIAL.replace('base_width: ', 'base_width:'),
            "drive.yaml:5: 'base_width:0.26': a space is missing after the colon",
        ),
        (
            TUTORIAL.replace('controllers: {', 'controllers:{'),
            'drive.yaml:2: mapping values are not allowed here '
            '(is a space missing after a colon?)',
        ),
        (TUTORIAL.replace('Kd: 12', 'Kp: 12'), "drive.yaml:9: 'Kp' is there twice"),
        (
            TUTORIAL.replace('diff_controller', 'servo_controller'),
            'drive.yaml:1: controllers needs one of type diff_controller, '
            'got base_controller (servo_controller)',
        ),
        (
            'robot:\n base:\n  type: "diff_drive_controller/DiffDriveController"\n  left_wheel: l',
            'drive.yaml:3: base is of ROS 1, or lacks ros__parameters: wanted '
            'base: {ros__parameters: {left_wheel_names: [JOINT], ...}}',
        ),
        (
            '/**:\n ros__parameters:\n  base: {type: diff_drive_controller/DiffDriveController}',
            "drive.yaml:3: unknown parameter 'base.type'",
        ),
        ('controllers: 5', 'drive.yaml:1: controllers must name at least one controller'),
        (
            'linear.x.max_deceleration: 2.0',
            'drive.yaml:1: linear.x.max_deceleration must be >= -1000 and <= -0.001 m/s^2, '
            'or NaN: -max_acceleration, got 2.0',
        ),
        (
            'pose_covariance_diagonal: [1, 2]',
            'drive.yaml:1: pose_covariance_diagonal must be 6 numbers, got 2',
        ),
        ('mode: real', "drive.yaml:1: mode must be one of float, arbotix, fake, got 'real'"),
        (
            'mode: arbotix\nKp: 12.5',
            'drive.yaml: Kp must be a whole number up to 255 in mode arbotix (the firmware gets '
            'one byte), got 12.5',
        ),
        (
            'mode: arbotix\nKp: 256',
            'drive.yaml: Kp must be a whole number up to 255 in mode arbotix (the firmware gets '
            'one byte), got 256',
        ),
        ('legacy: true', "drive.yaml: legacy needs mode 'arbotix', got mode 'float'"),
        (
            'left_wheel_names: [a]',
            'drive.yaml: left_wheel_names and right_wheel_names must be given both',
        ),
        (
            'left_wheel_names: [a, b]\nright_wheel_names: [c, d]',
            'drive.yaml: left_wheel_names must be one joint, got 2',
        ),
        (
            'a:\n  ros__parameters: {x: 1}\nb:\n  ros__parameters: {y: 1}',
            'drive.yaml: wanted the parameters of one diff drive, e.g. diff_drive_controller, '
            'got a, b',
        ),
        ('', 'drive.yaml: wanted "name: value" pairs'),
        ('- 1\n- 2', 'drive.yaml: wanted "name: value" pairs'),
        ('Kp: !!bool maybe', "drive.yaml:1: 'maybe' is no bool"),
        ('Kp: !!timestamp x', "drive.yaml:1: 'x' is no timestamp"),
        ('Kp: 1.0\n[a, b]: 1', 'drive.yaml:2: a name must be a word, got a sequence'),
        ('a: [', "drive.yaml:1: expected the node content, but found '<stream end>'"),
    ],
)
def test_an_error_names_the_line_what_came_and_what_is_wanted(complaint, text, message):
    assert complaint(text) == message


def test_a_file_that_is_none_is_named(tmp_path):
    with pytest.raises(InvalidParameter, match='none.yaml: No such file'):
        read_controller_file(str(tmp_path / 'none.yaml'))
    (tmp_path / 'picture').write_bytes(b'\xff\xfe\x00\x80')
    with pytest.raises(InvalidParameter, match='picture: not a text file'):
        read_controller_file(str(tmp_path / 'picture'))
    with pytest.raises(InvalidParameter, match='embedded null byte'):
        read_controller_file('drive\0.yaml')
