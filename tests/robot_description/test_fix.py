# SPDX-License-Identifier: Apache-2.0
from pathlib import Path
import shutil

from cases import for_all
import pytest
from robot_description.describe_command import main, MENDABLE
from robot_description.fix.mending import FIXES, mend
from robot_description.fix.workspace import Edit
from robot_description.lint.session import lint
from robot_description.urdf import parse_urdf
from robot_description.xacro.session import expand_document, XacroSession
from wasd_core.errors import DescriptionError

# Each mends by expanding several times.
pytestmark = pytest.mark.slow

FIXTURES = Path(__file__).parent / 'fixtures'
HEAD = '<robot name="robot" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def joint(name, child, origin='0 0 0', kind='fixed'):
    """Return a joint below link `base` and its child."""
    return (
        f'<joint name="{name}" type="{kind}"><origin rpy="0 0 0" xyz="{origin}"/>'
        f'<parent link="base"/><child link="{child}"/></joint><link name="{child}"/>'
    )


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a robot with a link `base` and returns its path."""

    def write(body, name='robot.xacro'):
        path = tmp_path / name
        path.write_text(f'{HEAD}\n  <link name="base"/>\n{body}\n</robot>\n')
        return path

    return write


@pytest.fixture
def courses_mbot(tmp_path):
    """Return a copy of the courses' mbot."""
    shutil.copytree(FIXTURES / 'mbot_description', tmp_path / 'mbot_description')
    return tmp_path / 'mbot_description/urdf/mbot.xacro'


def mended_text(path, **options):
    """Return the mended text of a description that is one file."""
    return mend(path, **options).after[path].decode()


@pytest.mark.slow
def test_the_courses_mbot_gets_its_six_links_and_all_wheels(courses_mbot, tmp_path, capsys):
    (tmp_path / 'out').mkdir()
    assert main(['fix', str(courses_mbot), '--output', str(tmp_path / 'out')]) == 0
    written = tmp_path / 'out/mbot_description/urdf/mbot.xacro'
    assert f'written: {written}' in capsys.readouterr().err
    robot = parse_urdf(expand_document(written).urdf)
    assert len(robot.links) == 6
    assert {joint.name for joint in robot.movable_joints} == {
        *('left_wheel_joint', 'right_wheel_joint', 'front_caster_joint', 'back_caster_joint')
    }
    assert robot.joints['left_wheel_joint'].pose.position[1] == pytest.approx(0.19)
    assert robot.joints['front_caster_joint'].pose.position[0] == pytest.approx(0.18)
    assert robot.mass == pytest.approx(1.8)
    assert not [one.line() for one in lint(XacroSession(written)) if one.is_error]


@pytest.mark.slow
def test_the_sources_stay_as_they_are(courses_mbot):
    files = [courses_mbot, courses_mbot.with_name('mbot_base.xacro')]
    before = [file.read_bytes() for file in files]
    assert len(mend(courses_mbot).after) == 2
    assert [file.read_bytes() for file in files] == before


def test_only_what_is_mended_changes(courses_mbot):
    for path, after in mend(courses_mbot, only=['unprefixed-macro']).after.items():
        assert after.replace(b'xacro:', b'') == path.read_bytes().replace(b'xacro:', b'')
        assert after.count(b'<xacro:') > path.read_bytes().count(b'<xacro:')


@pytest.mark.slow
def test_the_diff_is_what_patch_applies(courses_mbot, capsys, monkeypatch):
    monkeypatch.chdir(courses_mbot.parents[2])
    assert main(['fix', str(courses_mbot)]) == 0
    diff = capsys.readouterr().out
    assert '--- mbot_description/urdf/mbot.xacro\n+++ mbot_description/urdf/mbot.xacro\n' in diff
    assert '\n-  <mbot_base/>' in diff
    assert '\n+  <xacro:mbot_base/>' in diff


def test_a_call_with_blocks_gets_both_its_tags_prefixed(write):
    path = write(
        '<xacro:macro name="with" params="*block"><xacro:insert_block name="block"/></xacro:macro>'
        '<with><gazebo/></with>'
    )
    assert '<xacro:with><gazebo/></xacro:with>' in mended_text(path)


def test_a_tag_of_gazebo_that_is_called_as_a_macro_stays(write):
    path = write('<xacro:macro name="wheel"/><gazebo><plugin><wheel>1</wheel></plugin></gazebo>')
    assert mend(path).after == {}


def test_the_first_of_several_materials_stays():
    path = FIXTURES / 'lint/repeated-material.urdf'
    before, after = path.read_text().splitlines(), mended_text(path).splitlines()
    assert after[7].strip().startswith('<!--')
    assert [*after[:7], *after[8:]] == [*before[:7], *before[9:]]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('left', 'right'),
    [
        ('0.1 -0.2 0.3', '0.1  0.2  0.3'),
        ('0 ${-0.2} 0', '0 ${0.1 + 0.1} 0'),
        ('0 $(arg left) 0', '0 0.2 0'),
    ],
)
def test_left_and_right_exchange_their_y(write, left, right):
    arg = '<xacro:arg name="left" default="-0.2"/>'
    path = write(f'{arg}{joint("left_joint", "l", left)}{joint("right_joint", "r", right)}')
    text = mended_text(path)
    y_left, y_right = left.split(' ', 1)[1].rsplit(' ', 1)[0], right.split(' ', 1)[1]
    assert y_left in text and y_right.strip().rsplit(' ', 1)[0].strip() in text
    path.write_text(text)
    joints = parse_urdf(expand_document(path).urdf).joints
    assert joints['left_joint'].pose.position[1] == pytest.approx(0.2)
    assert joints['right_joint'].pose.position[1] == pytest.approx(-0.2)


def test_front_and_back_exchange_their_x(write):
    path = write(joint('front_joint', 'f', '-0.2 0 0') + joint('rear_joint', 'r', '0.2 0 0'))
    assert 'xyz="0.2 0 0"/><parent link="base"/><child link="f"/>' in mended_text(path)


def test_sides_that_the_name_decides_in_a_macro_are_left_alone(write):
    call = "y = -0.1 if side == 'left' else 0.1"
    path = write(
        '<xacro:macro name="arm" params="side">'
        + joint('${side}_joint', '${side}', f'0 ${{{call[4:]}}} 0')
        + '</xacro:macro><xacro:arm side="left"/><xacro:arm side="right"/>'
    )
    fixes = mend(path)
    assert fixes.after == {}
    assert [one.rule.code for one in fixes.left] == ['swapped-sides']


def wheeled(z):
    """Return two joints of wheels below link `base`, at a height [m]."""
    wheel = (
        '<collision><geometry><cylinder radius="0.06" length="0.025"/></geometry></collision>'
        '<inertial><mass value="0.2"/>'
        '<inertia ixx="2e-4" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    body = joint('left_wheel_joint', 'l', f'0 0.19 {z}', 'continuous') + joint(
        'right_wheel_joint', 'r', f'0 -0.19 {z}', 'continuous'
    )
    body = body.replace('<child', '<axis xyz="0 1 0"/><child')
    return body.replace('<link name="l"/>', f'<link name="l">{wheel}</link>').replace(
        '<link name="r"/>', f'<link name="r">{wheel}</link>'
    )


@for_all('kind', ['fixed', 'floating', 'planar'])
def test_no_footprint_is_put_under_a_world(write, kind):
    world = '<link name="world"/><joint name="w" type="{}"><parent link="world"/>{}</joint>'
    path = write(wheeled(0.3) + world.format(kind, '<child link="base"/>'))
    fixes = mend(path)
    assert fixes.after == {}
    assert 'missing-footprint' not in {one.rule.code for one in fixes.left}


def test_a_footprint_has_the_line_ends_of_the_file_and_the_root_as_it_is_written(write):
    path = write(wheeled(-0.05).replace('link="base"', 'link="a&amp;&quot;b"'))
    text = path.read_text().replace('"base"', '"a&amp;&quot;b"').replace('\n', '\r\n')
    path.write_bytes(text.encode())
    mended = mend(path).after[path]
    assert mended.count(b'\n') == mended.count(b'\r\n')
    assert b'<child link="a&amp;&quot;b"/>' in mended
    path.write_bytes(mended)
    assert parse_urdf(expand_document(path).urdf).root == 'base_footprint'
    assert mend(path).after == {}


def test_a_fix_after_which_nobody_can_read_the_file_is_taken_back(write, monkeypatch):
    def spoil(workspace):
        yield Edit(path, 0, 0, 'no xml <<')

    path = write(wheeled(-0.05))
    monkeypatch.setitem(FIXES, 'missing-footprint', spoil)
    assert mend(path).mended == ()


def test_the_joint_of_a_footprint_has_a_name_that_no_other_has(write):
    path = write(wheeled(-0.05) + joint('base_footprint_joint', 'a'))
    (mended,) = mend(path).after.values()
    path.write_bytes(mended)
    joints = parse_urdf(expand_document(path).urdf).joints
    assert joints['base_footprint_joint_'].parent == 'base_footprint'


@pytest.mark.slow
def test_a_footprint_stands_where_the_wheels_do(write):
    path = write(wheeled(-0.05))
    text = mended_text(path)
    assert '\n  <link name="base_footprint"/>\n  <joint name="base_footprint_joint"' in text
    path.write_text(text)
    robot = parse_urdf(expand_document(path).urdf)
    assert robot.root == 'base_footprint'
    assert robot.joints['base_footprint_joint'].pose.position == pytest.approx([0, 0, 0.11])
    assert lint(XacroSession(path)) == []


def test_a_joint_is_renamed_wherever_it_is_named(write):
    path = write(
        joint('base_l_wheel_joint', 'wheel')
        + joint('other_joint', 'other').replace(
            '<child', '<mimic joint="base_l_wheel_joint"/><child'
        )
        + '<transmission name="t"><joint name="base_l_wheel_joint"/></transmission>'
        '<gazebo reference="base_l_wheel_joint"/><gazebo><plugin name="p">'
        '<leftJoint> base_l_wheel_joint </leftJoint></plugin></gazebo>'
    )
    text = mended_text(path, renames={'base_l_wheel_joint': 'left_wheel_joint'})
    assert 'base_l_wheel_joint' not in text
    assert text.count('left_wheel_joint') == 5
    assert '<leftJoint> left_wheel_joint </leftJoint>' in text


@pytest.mark.slow
def test_joints_that_a_macro_makes_are_renamed_to_arbotix_and_back(courses_mbot):
    path = courses_mbot.with_name('mbot_base.xacro')
    path.write_text(path.read_text().replace('</robot>', '<xacro:mbot_base/></robot>'))
    there = {'left_wheel_joint': 'base_l_wheel_joint', 'right_wheel_joint': 'base_r_wheel_joint'}
    path.write_text(mended_text(path, renames=there))
    joints = parse_urdf(expand_document(path).urdf).joints
    assert set(there.values()) < set(joints)
    assert 'front_caster_joint' in joints
    back = {new: old for old, new in there.items()}
    path.write_text(mended_text(path, renames=back))
    assert set(there) < set(parse_urdf(expand_document(path).urdf).joints)


@pytest.mark.slow
def test_a_name_between_single_quotes_is_renamed_in_them(write):
    made = joint('${side}_joint', '${side}').replace(
        'name="${side}_joint"', "name='${side}_joint'"
    )
    path = write(f'<xacro:macro name="m" params="side">{made}</xacro:macro><xacro:m side="left"/>')
    path.write_text(mended_text(path, renames={'left_joint': 'l_joint'}))
    assert 'l_joint' in parse_urdf(expand_document(path).urdf).joints


def test_a_joint_of_another_package_is_not_renamed(tmp_path, capsys):
    for name in ('dog', 'cat'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'package.xml').write_text(f'<package><name>{name}</name></package>')
    body = f'<link name="base"/>{joint("tail_joint", "tail")}'
    (tmp_path / 'cat/cat.xacro').write_text(f'{HEAD}{body}</robot>')
    path = tmp_path / 'dog/robot.xacro'
    path.write_text(f'{HEAD}<xacro:include filename="$(find cat)/cat.xacro"/></robot>')
    assert main(['fix', str(path), '--rename', 'tail_joint:=t']) == 2
    assert '--rename tail_joint: cannot be done here' in capsys.readouterr().err


def test_a_link_keeps_its_name_where_a_joint_of_that_name_gets_another(write):
    tags = (
        '<gazebo reference="wheel"><mu1>0.3</mu1></gazebo><gazebo><plugin name="wheel">'
        '<frameName>wheel</frameName>{}</plugin></gazebo>'
    )
    names = (
        '<leftJoint>{0}</leftJoint></plugin></gazebo><transmission name="t"><joint name="{0}"/>'
    )
    body = joint('{0}', 'wheel') + tags.replace('{}</plugin></gazebo>', names) + '</transmission>'
    path = write(body.format('wheel'))
    assert mended_text(path, renames={'wheel': 'lw'}) == path.read_text().replace(
        body.format('wheel'), body.format('lw')
    )


def test_two_joints_exchange_their_names(write):
    path = write(joint('a_joint', 'a') + joint('b_joint', 'b'))
    text = mended_text(path, renames={'a_joint': 'b_joint', 'b_joint': 'a_joint'})
    assert text.index('name="b_joint"') < text.index('name="a_joint"')


@pytest.mark.slow
@pytest.mark.parametrize(
    ('rename', 'said'),
    [
        ('nope_joint:=x', '--rename nope_joint: there is no such joint'),
        ('left_whel_joint:=x', "; 'left_wheel_joint' is"),
        ('left_wheel_joint:=right_wheel_joint', "there is a joint 'right_wheel_joint' already"),
        ('left_wheel_joint', 'wanted OLD:=NEW'),
        ('left_wheel_joint:=a"b', 'wanted OLD:=NEW'),
    ],
)
def test_a_rename_that_cannot_be_is_one_line(rename, said, capsys):
    assert main(['fix', 'mbot', '--rename', rename]) == 2
    assert said in capsys.readouterr().err


def test_comments_and_line_ends_stay(tmp_path):
    path = tmp_path / 'robot.xacro'
    text = (
        f'<!-- <wheel/> -->\r\n{HEAD}\r\n<xacro:macro name="wheel"><link name="base"/>'
        '</xacro:macro>\r\n\t<wheel   /><!-- räder --></robot>'
    )
    path.write_bytes(text.encode())
    wanted = text.replace('<wheel   />', '<xacro:wheel   />').encode()
    assert mend(path).after == {path: wanted}
    assert '\\ No newline at end of file\n' in mend(path).diff()


def test_another_packages_file_is_not_changed(tmp_path):
    for name in ('dog', 'cat'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'package.xml').write_text(f'<package><name>{name}</name></package>')
    macros = '<xacro:macro name="leg"/><xacro:macro name="body"><leg/></xacro:macro>'
    (tmp_path / 'cat/cat.xacro').write_text(f'{HEAD}{macros}</robot>')
    path = tmp_path / 'dog/robot.xacro'
    path.write_text(f'{HEAD}<xacro:include filename="$(find cat)/cat.xacro"/><body/></robot>')
    fixes = mend(path)
    assert list(fixes.after) == [path]
    assert 'unprefixed-macro' in {one.rule.code for one in fixes.left}


@pytest.mark.slow
def test_a_sound_robot_is_left_alone(capsys):
    assert main(['fix', 'go2']) == 0
    assert capsys.readouterr() == ('', '')


def test_every_fix_can_be_asked_for_by_its_code():
    assert tuple(FIXES) == MENDABLE


def test_text_that_is_not_utf8_is_not_mended(tmp_path):
    path = tmp_path / 'robot.urdf'
    path.write_bytes(b'<?xml version="1.0" encoding="latin-1"?><robot name="\xe4"/>')
    with pytest.raises(DescriptionError, match='is not UTF-8'):
        mend(path)


def test_the_trunk_that_is_not_there_becomes_the_base_that_is():
    path = FIXTURES / 'robots/dog_description/urdf/dog_trunk.urdf'
    assert mended_text(path) == path.read_text().replace('meshes/trunk.obj', 'meshes/base.obj')


@pytest.mark.parametrize(('size', 'written'), [(0.2, True), (241.0, False)])
def test_a_guess_of_absurd_size_is_not_written(size, written, write, tmp_path):
    mesh = '<visual><geometry><mesh filename="plate.obj"/></geometry></visual>'
    cover = joint('on', 'cover').replace(
        '<link name="cover"/>', f'<link name="cover">{mesh}</link>'
    )
    path = write(joint('lid', 'lid_link', '0 0 0.2') + cover)
    (tmp_path / 'shapes').mkdir()
    corners = ('0 0 0', f'{size} 0 0', f'0 {size} 0')
    text = ''.join(f'v {corner}\n' for corner in corners) + 'f 1 2 3\n'
    (tmp_path / 'shapes/plate.obj').write_text(text)
    fixes = mend(path)
    assert ('wrong-mesh-path' in fixes.mended) == written
    assert any('it would be 241 x 241 x 0 m' in one.message for one in fixes.left) != written
