# SPDX-License-Identifier: Apache-2.0
"""
Files that are broken or hostile: one line within 2 s of CPU time and 500 MB, never a hang.

Nothing they name is run, and nothing is read but what `docs/lint.md` allows.
"""

import json
import os
from pathlib import Path
import subprocess
import sys
from xml.sax.saxutils import escape

from cases import for_all
import pytest
from robot_description.describe_command import main
from robot_description.xacro.session import expand_document
from wasd_core.errors import DescriptionError

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


def value(expression):
    """Return a robot with the value of an expression in it."""
    return robot(f'<link name="${{{escape(expression, {chr(34): "&quot;"})}}}"/>')


def include(filename):
    """Return a robot that includes a file."""
    return robot(f'<xacro:include filename="{filename}"/>')


TOO_LONG = 'expanding robot.xacro took more than 0.2 s of CPU time'
TOO_LARGE = 'expanding robot.xacro took more than 256 MB'
TOO_DEEP = 'nested too deep'
NO_WAY = 'cannot be used in an expression'
# Expressions, and what is said of them.
EXPRESSIONS = {
    '9**9**9': f"{TOO_LONG}, at '${{9**9**9}}'",
    'math.factorial(10**7)': TOO_LONG,
    'max(range(10**10))': TOO_LONG,
    'sum(i for i in range(10**10))': "name 'sum' is not defined",
    'python.sum(i for i in range(10**10))': TOO_LONG,
    '[0 for a in range(99999) for b in range(99999) if 0]': TOO_LONG,
    'math.comb(10**7, 10**6)': TOO_LONG,
    '(lambda f: f(f))(lambda f: f(f))': TOO_DEEP,
    '(' * 5000 + ')' * 5000: '',
    '-' * 50000 + '1': '',
    "'a' * 10**9": f"{TOO_LARGE} when evaluating expression ''a' * 10**9'",
    "b'a' * 10**9": TOO_LARGE,
    '[0] * 10**9': TOO_LARGE,
    'list(range(10**8))': TOO_LARGE,
    '[0 for a in range(9999) for b in range(9999)]': '',
    '1 << 10**10': TOO_LARGE,
    "'a'.ljust(10**9)": TOO_LARGE,
    "'%999999999d' % 1": TOO_LARGE,
    "('%c:999999999%c' % (123, 125)).format(1)": TOO_LARGE,
    "('ab' * 10**7).replace('a', 'b' * 100)": TOO_LARGE,
    "xacro.tokenize('a,' * 10**8)": 'expanding robot.xacro took more than',
    'python.sorted(range(10**8))': TOO_LARGE,
    "'a' * 6 * 10**7": 'expanding robot.xacro took more than',
    '().__class__.__base__.__subclasses__()': NO_WAY,
    "[c for c in ''.__class__.__mro__[1].__subclasses__()]": NO_WAY,
    "__import__('os').system('touch ran')": NO_WAY,
    "__builtins__['open']('/etc/passwd')": NO_WAY,
    "xacro.load_yaml.__globals__['os'].system('touch ran')": NO_WAY,
    'python.str.mro.call': NO_WAY,
    "('%c0.__globals__[os].environ%c' % (123, 125)).format(xacro.load_yaml)": NO_WAY,
    "python.str.format('%c0.__globals__%c' % (123, 125), xacro.load_yaml)": NO_WAY,
    "python.type('X', (), python.dict())": 'takes 1 positional argument',
    'python.vars(xacro)': "name 'vars' is not defined",
    "open('/etc/passwd').read()": "name 'open' is not defined",
    "eval('1')": "name 'eval' is not defined",
    "getattr(1, 'real')": "name 'getattr' is not defined",
    'math.__loader__': NO_WAY,
    "xacro.load_yaml('../outside.yaml')": 'refused',
    "xacro.load_yaml(xacro.abs_filename('/proc/self/environ'))": 'refused',
    "xacro.load_yaml('pipe')": 'is a device or pipe',
    "xacro.load_yaml('large.urdf')": 'is too much',
    "xacro.load_yaml('slow.yaml')": TOO_LONG,
    "xacro.load_yaml('python.yaml')": 'not YAML: could not determine a constructor',
    "xacro.fatal('stop\\nhere')": 'stop here',
    "xacro.arg('x' * 10**6)": 'has no value',
}
# Name of the case: what is in robot.xacro, and what the error says.
TEXTS = {
    **{expression[:60]: (value(expression), said) for expression, said in EXPRESSIONS.items()},
    'power in a substitution': (robot('<link name="$(eval 9**9**9)"/>'), TOO_LONG),
    'endless recursion by a call': (
        robot('<xacro:macro name="m"><xacro:call macro="m"/></xacro:macro>\n<xacro:m/>'),
        'call each other without end: xacro:m more than 300 deep',
    ),
    'nested elements by macros': (
        robot(
            '<xacro:macro name="m" params="n"><a><xacro:if value="${n}"><xacro:m n="${n-1}"/>'
            '</xacro:if></a></xacro:macro><xacro:m n="90"/>'
        ),
        'its expansion has a mistake: elements nested more than 60 deep',
    ),
    'large attributes': (
        robot('<xacro:property name="a" value="${\'a\' * 10**7}"/>' + '<b c="${a}"/>' * 20),
        'expanding robot.xacro took more than',
    ),
    'parameter entity': (
        '<!DOCTYPE r [<!ENTITY % x SYSTEM "http://localhost/x.dtd"> %x;]><robot/>',
        "defines the entity 'x'",
    ),
    'include by a property': (
        robot('<xacro:property name="f" value="/etc/hosts"/><xacro:include filename="${f}"/>'),
        '/etc/hosts: refused',
    ),
    'include by the environment': (include('$(env HOME)/.bashrc'), 'refused'),
    'include of a process': (include('/proc/self/environ'), 'refused'),
    'include beside the package': (include('../outside.yaml'), 'refused'),
    'include of a device by a link': (include('zero.xacro'), 'refused'),
    'include by find of a path': (include('$(find /etc)/passwd'), "package '/etc' not found"),
    'unknown substitution': (robot('<link name="$(exec ls)"/>'), 'Unknown substitution command'),
    'empty': ('', '1: is empty; get the file again'),
    'truncated': (robot('<link name="a"/>')[:-12], 'not well-formed XML'),
    'binary': ('\x7fELF\x02\x01\x01\x00\x00', '1: is a program; name the robot'),
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
        'call each other without end: xacro:m more than 300 deep',
    ),
    'macro bomb': (
        robot(f'<xacro:macro name="m0"><link name="l"/></xacro:macro>{MACRO_BOMB}<xacro:m8/>'),
        TOO_LONG,
    ),
    'property bomb': (
        robot(f'<xacro:property name="p0" value="haha"/>{PROPERTY_BOMB}<link name="${{p9}}"/>'),
        'expanding robot.xacro took more than',
    ),
    'circular property': (
        robot('<xacro:property name="a" value="${a}"/><link name="${a}"/>'),
        'circular variable definition: a -> a',
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
    'large.stl': 'is a mesh or a scene by its name',
    'nowhere.urdf': 'nowhere.urdf: no such file',
}
# Reads descriptions one after another; prints what is said, CPU time [s] and memory [kB] so far.
READER = """
import json, os, pathlib, resource, sys
from wasd_core.errors import DescriptionError
from robot_description.xacro import sandbox
from robot_description.xacro.session import expand_document
from robot_description.urdf import parse_urdf
sandbox.CPU = float(sys.argv[1])
for line in sys.stdin:
    started = sum(os.times()[:4])
    try:
        parse_urdf(expand_document(pathlib.Path(line.rstrip())).urdf)
        said = ''
    except DescriptionError as error:
        said = str(error)
    own = int(pathlib.Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])
    memory = own + resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(json.dumps([said, sum(os.times()[:4]) - started, memory]), flush=True)
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
    (package / 'slow.yaml').write_text('[' + '0,' * 45_000 + ']')
    (package / 'python.yaml').write_text('!!python/object/apply:os.system ["touch ran"]')
    (package / 'zero.xacro').symlink_to('/dev/zero')
    (folder / 'outside.yaml').write_text('secret: SECRET')
    with (package / 'large.urdf').open('wb') as file:
        file.truncate(100 * 1024 * 1024)
    (package / 'large.stl').symlink_to('large.urdf')
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
        [sys.executable, '-c', READER, '0.2'],
        input='\n'.join(map(str, paths.values())),
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'},
        capture_output=True,
        text=True,
        timeout=300,
    )
    answers = done.stdout.splitlines()
    assert len(answers) == len(paths), done.stderr
    return dict(zip(paths, map(json.loads, answers), strict=True))


@pytest.mark.slow
@for_all('name', [*TEXTS, *URDFS, *PATHS])
def test_it_is_refused_in_one_line_at_once(name, said):
    text, seconds, memory = said[name]
    wanted = {**TEXTS, **URDFS}[name][1] if name not in PATHS else PATHS[name]
    assert wanted in text
    assert '\n' not in text
    assert len(text) < 700
    assert seconds < 2.0
    assert memory < 500_000


@pytest.mark.slow
def test_nothing_is_run_and_nothing_outside_is_read(said):
    assert not Path('ran').exists()
    assert not [text for text, *_ in said.values() if 'SECRET' in text or 'root:' in text]
    assert len(EXPRESSIONS) + len(TEXTS) >= 60


@pytest.mark.slow
@for_all('name', PATHS)
def test_the_path_is_named_once(name, said):
    assert said[name][0].count(f'/{Path(name).name}') == 1


@pytest.mark.slow
@for_all('name', TEXTS)
def test_the_line_is_named(name, said):
    assert 'robot.xacro:' in said[name][0] or 'two.xacro:' in said[name][0]


@pytest.mark.slow
def test_a_loop_unrolled_by_a_macro_is_no_endless_recursion(tmp_path, capsys):
    times = 220  # as many as xacro itself manages
    path = tmp_path / 'robot.xacro'
    path.write_text(
        robot(
            '<xacro:macro name="chain" params="n"><link name="l${n}"/>'
            '<xacro:if value="${n > 0}"><xacro:chain n="${n - 1}"/></xacro:if></xacro:macro>'
            f'<xacro:chain n="{times}"/>'
        )
    )
    assert main(['expand', str(path)]) == 0
    assert capsys.readouterr().out.count('<link') == times + 1


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


@pytest.mark.slow
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


LICENCE = ''.join(f'<!-- line {n} of a licence -->\n' for n in range(60))


def test_a_robot_below_many_comments_loads_and_a_page_below_them_is_none(tmp_path):
    robot = tmp_path / 'robot.urdf'
    robot.write_text(f'{LICENCE}<robot name="it"><link name="base"/></robot>')
    assert expand_document(robot).urdf.count('<link') == 1
    robot.write_text(f'{LICENCE}<!DOCTYPE html><html></html>')
    with pytest.raises(DescriptionError, match='is a web page'):
        expand_document(robot)


@pytest.mark.parametrize('opening', ['<!--', '<?', '#\n\n', '# a\n \n', '<!-- -->'])
def test_a_file_of_beginnings_without_an_end_is_refused_at_once(tmp_path, opening):
    robot = tmp_path / 'robot.urdf'
    robot.write_text(100_000 * opening + '<robot>')
    with pytest.raises(DescriptionError):
        expand_document(robot)
