# SPDX-License-Identifier: Apache-2.0
"""Files that are broken or hostile: one line within 2 s of CPU time and 500 MB, never a hang."""

import json
import os
from pathlib import Path
import subprocess
import sys

import pytest
from robot_description.describe_command import main

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
LAUGHS = ''.join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
YAML_LAUGHS = 'l0: &l0 ha\n' + ''.join(
    f'l{i}: &l{i} [{", ".join([f"*l{i - 1}"] * 10)}]\n' for i in range(1, 10)
)
MACRO_BOMB = ''.join(
    f'<xacro:macro name="m{i}">{f"<xacro:m{i - 1}/>" * 10}</xacro:macro>' for i in range(1, 9)
)
PROPERTY_BOMB = ''.join(
    f'<xacro:property name="p{i}" value="{f"${{p{i - 1}}}" * 10}"/>' for i in range(1, 10)
)


def robot(body):
    """Return the text of a robot with that in it."""
    return f'{HEAD}{body}</robot>'


def include(filename):
    """Return a robot that includes a file."""
    return robot(f'<xacro:include filename="{filename}"/>')


# Name of the case: what is in robot.xacro, and what the error says.
TEXTS = {
    'empty': ('', 'no element found'),
    'truncated': (robot('<link name="a"/>')[:-12], 'not well-formed XML'),
    'binary': ('\x7fELF\x02\x01\x01\x00\x00', 'not well-formed XML'),
    'unbound prefix': ('<robot><xacro:wheel/></robot>', 'unbound prefix'),
    'unknown encoding': ('<?xml version="1.0" encoding="klingon"?><robot/>', 'encoding'),
    'billion laughs': (
        f'<!DOCTYPE r [<!ENTITY l0 "ha">{LAUGHS}]><robot>&l9;</robot>',
        "defines the entity 'l0'",
    ),
    'external entity': (
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot>&x;</robot>',
        "defines the entity 'x'",
    ),
    'deep nesting': ('<a>' * 100_000, 'nested more than'),
    'many elements': ('<robot>' + '<link name="a"/>' * 100_000 + '</robot>', 'more than 30000'),
    'macro recursion': (
        robot('<xacro:macro name="m"><xacro:m/></xacro:macro>\n<xacro:m/>'),
        'call each other without end: xacro:m',
    ),
    'macro bomb': (
        robot(f'<xacro:macro name="m0"><link name="l"/></xacro:macro>{MACRO_BOMB}<xacro:m8/>'),
        'grows to more than 20000 elements',
    ),
    'property bomb': (
        robot(f'<xacro:property name="p0" value="haha"/>{PROPERTY_BOMB}<link name="${{p9}}"/>'),
        'grows to more than',
    ),
    'circular property': (
        robot('<xacro:property name="a" value="${a}"/><link name="${a}"/>'),
        'circular variable definition: a -> a',
    ),
    'huge power': (robot('<link name="${9**9**9}"/>'), 'grows too large'),
    'huge text': (robot('<link name="${\'a\' * 10**9}"/>'), 'grows too large'),
    'long loop': (
        robot('<link name="${[0 for a in range(9999) for b in range(9999)]}"/>'),
        'grows too large',
    ),
    'interpreter frames': (
        robot('<link name="${(x for x in [1]).gi_frame}"/>'),
        "'gi_frame' cannot be used",
    ),
    'double underscores': (robot('<link name="${().__class__}"/>'), "'__class__' cannot be used"),
    'reading by eval': (robot('<link name="$(eval open)"/>'), "'open' is not defined"),
    'including itself': (include('robot.xacro'), 'include each other in a circle'),
    'including in a circle': (include('one.xacro'), 'circle: one.xacro -> two.xacro -> one.xacro'),
    'include of nothing': (include('nowhere.xacro'), 'nowhere.xacro: no such file'),
    'include of a folder': (include('folder'), 'is a folder'),
    'include of a pipe': (include('pipe'), 'is a device or pipe'),
    'include of a device': (include('/dev/zero'), 'refused'),
    'absolute include': (include('/etc/passwd'), '/etc/passwd: refused'),
    'include far above': (include('../../../../../../../../etc/passwd'), 'refused'),
    'include through find': (include('$(find other)/../../../etc/passwd'), 'refused'),
    'find of a folder above': (include('$(find ..)/x.xacro'), "package '..' not found"),
    'include by a link': (include('link.xacro'), 'link.xacro: refused'),
    'include of a circle of links': (include('circle.xacro'), 'leads nowhere'),
    'include of everything': (include('/*/*/*/*'), '/: refused'),
    'yaml from elsewhere': (
        robot('<link name="${xacro.load_yaml(\'/etc/passwd\')}"/>'),
        '/etc/passwd: refused',
    ),
    'yaml laughs': (
        robot('<link name="${xacro.load_yaml(\'laughs.yaml\')}"/>'),
        'laughs.yaml: not YAML: more than 10000 values',
    ),
    'yaml in itself': (
        robot('<link name="${xacro.load_yaml(\'circle.yaml\')}"/>'),
        'circle.yaml: not YAML: more than 10000 values',
    ),
    'yaml that is none': (
        robot('<link name="${xacro.load_yaml(\'link.yaml\')}"/>'),
        'link.yaml: not YAML',
    ),
}
# Numbers and structure that only the URDF reader sees.
URDFS = {
    'no links': ('<robot name="r"/>', 'no links'),
    'mass nan': (
        '<robot name="r"><link name="a"><inertial><mass value="nan"/></inertial></link></robot>',
        "needs a number, got 'nan'",
    ),
    'mass inf': (
        '<robot name="r"><link name="a"><inertial><mass value="inf"/></inertial></link></robot>',
        "needs a number, got 'inf'",
    ),
}
# Paths handed over as the description itself.
PATHS = {
    'folder': 'is a folder, wanted a file',
    'pipe': 'is a device or pipe, wanted a file',
    '/dev/zero': 'is a device or pipe, wanted a file',
    'circle.xacro': 'leads nowhere',
    'large.urdf': '104.9 MB is too much',
    'nowhere.urdf': 'nowhere.urdf: no such file',
}
# Reads descriptions one after another as a process with 500 MB of memory; prints what they say.
READER = """
import json, pathlib, resource, sys, time
resource.setrlimit(resource.RLIMIT_AS, (500_000_000, 500_000_000))
resource.setrlimit(resource.RLIMIT_CPU, (100, 100))
from wasd_core.errors import DescriptionError
from robot_description.xacro.expand import expand
from robot_description.urdf import parse_urdf
for line in sys.stdin:
    started = time.process_time()
    try:
        parse_urdf(expand(pathlib.Path(line.rstrip())))
        said = ''
    except DescriptionError as error:
        said = str(error)
    print(json.dumps([said, time.process_time() - started]), flush=True)
"""


def furnish(folder):
    """Put beside a description what some of them try to reach."""
    (folder / 'robot_package').mkdir()
    package = folder / 'robot_package'
    (package / 'package.xml').write_text('<package/>')
    (folder / 'other').mkdir()
    (folder / 'other/package.xml').write_text('<package><name>other</name></package>')
    (package / 'folder').mkdir()
    os.mkfifo(package / 'pipe')
    (package / 'link.xacro').symlink_to('/etc/passwd')
    (package / 'circle.xacro').symlink_to(package / 'circle.xacro')
    (package / 'one.xacro').write_text(include('two.xacro'))
    (package / 'two.xacro').write_text(include('one.xacro'))
    (package / 'laughs.yaml').write_text(YAML_LAUGHS)
    (package / 'circle.yaml').write_text('&a [*a, *a]')
    (package / 'link.yaml').write_text('a: [')
    with (package / 'large.urdf').open('wb') as file:
        file.truncate(100 * 1024 * 1024)
    return package


@pytest.fixture(scope='module')
def said(tmp_path_factory):
    """What was said about each case, and the CPU time it took [s]."""
    paths = {}
    for name, (text, _) in {**TEXTS, **URDFS}.items():
        folder = furnish(tmp_path_factory.mktemp('case'))
        paths[name] = folder / 'robot.xacro'
        paths[name].write_text(text)
    paths |= {name: folder / name for name in PATHS}
    done = subprocess.run(
        [sys.executable, '-c', READER],
        input='\n'.join(map(str, paths.values())),
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'},
        capture_output=True,
        text=True,
        timeout=300,
    )
    answers = done.stdout.splitlines()
    assert len(answers) == len(paths), done.stderr
    return dict(zip(paths, map(json.loads, answers), strict=True))


@pytest.mark.parametrize('name', [*TEXTS, *URDFS, *PATHS])
def test_it_is_refused_in_one_line_at_once(name, said):
    text, seconds = said[name]
    wanted = {**TEXTS, **URDFS}[name][1] if name not in PATHS else PATHS[name]
    assert wanted in text
    assert '\n' not in text
    assert len(text) < 700
    assert seconds < 2.0


@pytest.mark.parametrize('name', PATHS)
def test_the_path_is_named_once(name, said):
    assert said[name][0].count(f'/{Path(name).name}') == 1


@pytest.mark.parametrize('name', TEXTS)
def test_the_line_is_named(name, said):
    assert 'robot.xacro:' in said[name][0] or 'two.xacro:' in said[name][0]


def test_a_loop_unrolled_by_a_macro_is_no_endless_recursion(tmp_path, capsys):
    path = tmp_path / 'robot.xacro'
    path.write_text(
        robot(
            '<xacro:macro name="chain" params="n"><link name="l${n}"/>'
            '<xacro:if value="${n > 0}"><xacro:chain n="${n - 1}"/></xacro:if></xacro:macro>'
            '<xacro:chain n="100"/>'
        )
    )
    assert main(['expand', str(path)]) == 0
    assert capsys.readouterr().out.count('<link') == 101


def test_a_link_within_the_package_is_followed(tmp_path):
    package = furnish(tmp_path)
    (package / 'part.xacro').write_text(robot('<link name="a"/>'))
    (package / 'alias.xacro').symlink_to('part.xacro')
    (package / 'robot.xacro').write_text(include('alias.xacro'))
    assert main(['info', str(package / 'robot.xacro')]) == 0


def test_a_description_that_is_a_link_may_read_the_package_it_leads_to(tmp_path):
    package = furnish(tmp_path)
    (package / 'part.xacro').write_text(robot('<link name="a"/>'))
    (package / 'robot.xacro').write_text(include(package / 'part.xacro'))
    installed = tmp_path / 'installed'
    installed.mkdir()
    (installed / 'robot.xacro').symlink_to(package / 'robot.xacro')
    assert main(['info', str(installed / 'robot.xacro')]) == 0


def test_a_given_folder_may_be_read(tmp_path, capsys):
    package = furnish(tmp_path)
    elsewhere = tmp_path / 'elsewhere'
    elsewhere.mkdir()
    (elsewhere / 'part.xacro').write_text(robot('<link name="a"/>'))
    (package / 'robot.xacro').write_text(include(elsewhere / 'part.xacro'))
    assert main(['info', str(package / 'robot.xacro')]) == 2
    assert 'refused' in capsys.readouterr().err
    options = ['--package-path', str(elsewhere)]
    assert main(['info', str(package / 'robot.xacro'), *options]) == 0


def test_an_unreadable_file_says_so(tmp_path, monkeypatch, capsys):
    path = Path(tmp_path / 'robot.xacro')
    path.write_text(robot('<link name="a"/>'))

    def refuse(*_):
        raise PermissionError(13, 'Permission denied')

    monkeypatch.setattr('wasd_core.safe_files.os.open', refuse)
    assert main(['info', str(path)]) == 2
    assert capsys.readouterr().err == f'error: {path}: Permission denied\n'
