# SPDX-License-Identifier: Apache-2.0
import gc
import math
import os
import select
import sys
import threading
import time

from cases import for_all
import pytest
from robot_description.xacro import sandbox
from robot_description.xacro.sandbox import evaluate
from robot_description.xacro.session import expand_document
from wasd_core.errors import DescriptionError
import xacro

YAML = xacro.YamlDictWrapper({'prop': {'type': [1, {'gi_frame': 2}]}, '_x': 3, '__class__': 4})
NAMES = {'pi': math.pi, 'radians': math.radians, 'd': {'a': {'b': 2}}, 'name': 'FL', 'n': 3}
NAMES |= {'ns': YAML, 'type': 'box', 'center': 1.0, 'format': '%d', 'factorial': 4, 'range_': 2}
FUNCTIONS = {
    f.__name__: f for f in (range, len, str, float, int, list, dict, max, sorted, map, sum)
}


@for_all(
    'text',
    [
        'pi / 2 + radians(30)',
        '-n ** 2 % 5 // 2',
        "'left' if name == 'FL' else 'right'",
        "name + '_hip' * 2",
        "d['a']['b']",
        '[x * 2 for x in range(4) if x > 1]',
        '{x: y for x in range(2) for y in range(3)}',
        "'%s_%02d' % (name, n)",
        "'{:.3f} {}'.format(pi, name)",
        "f'{name}_{n:.2f}'",
        "name.lower().replace('l', 'r')",
        "' '.join(str(x) for x in range(3))",
        'max(map(lambda x: x * n, [1, 2]))',
        '1 << 3',
        'sorted(d, key=lambda k: k)[0]',
        '2 ** 0.5 + 1e300 * 2',
        'type + format % center',
        'factorial + n if type == "box" else center',
        'ns.prop.type[1].gi_frame',
        'ns.prop.keys()',
        'ns._x',
        "f'{name:>{n}}{pi:.{n}f}'",
        "'{0[a][b]}{x:>{w}}{{}}'.format(d, x=n, w=5)",
        "'{a}'.format_map(d)",
        'list(map(str.lower, [name])) + list(dict.fromkeys([1]))',
        "name.center(9, '*') + 'x'.ljust(200)",
        '[i for i in range(20000)][-1]',
        "len('a' * 100000)",
    ],
)  # fmt: skip
def test_what_robots_need_has_pythons_value(text):
    names = {**NAMES, **FUNCTIONS}
    assert evaluate(text, dict(names)) == eval(text, dict(names))


@for_all(
    'text',
    [
        '().__class__',
        '(lambda: ().__class__)()',
        '[x.__class__ for x in [1]]',
        "f'{().__class__}'",
        '(x for x in [1]).gi_frame',
        '(lambda: 1).func_globals',
        'radians.name',
        "'{0.real}'.format(1)",
        "'{0.gi_frame.f_globals}'.format(x for x in [1])",
        "'{:{0.__class__}}'.format(1)",
        "'{a.__class__}'.format_map(d)",
        "str.format('{0.__class__}', 1)",
        'list(map(str.format_map, [], []))',
        '[0 for str.x in [1]]',
        '[1 for name.x in [2]]',
        'ns.__class__',
        'd._x',
        '__import__',
        '__builtins__',
        '__attribute(1, "real")',
        '(lambda: __import__)()',
    ],
)  # fmt: skip
def test_what_leads_into_the_interpreter_is_refused(text):
    with pytest.raises(DescriptionError, match='cannot be used in an expression'):
        evaluate(text, {**NAMES, **FUNCTIONS})


def test_no_builtin_is_known():
    for name in (
        'open',
        'eval',
        'exec',
        'getattr',
        'globals',
        'object',
        'print',
        'vars',
        'format',
    ):
        with pytest.raises(NameError):
            evaluate(name, {})


def test_our_own_functions_are_no_way_around():
    names = xacro.Table({})
    evaluate('1', names)
    names['part'] = names
    with pytest.raises(DescriptionError, match="'__class__' cannot be used"):
        evaluate("part['__builtins__']['__attribute']('', '__class__')", names)


FEATURES = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="side" default="left"/>
  <xacro:property name="yaml" value="${xacro.load_yaml('numbers.yaml')}"/>
  <xacro:property name="radius" value="${yaml.wheel.radius}"/>
  <xacro:macro name="link" params="name:=a *block **blocks scale:=^|2">
    <link name="${name}" a="$(arg side)" b="${xacro.arg('side')}">
      <xacro:insert_block name="block"/><xacro:insert_block name="blocks"/>
      <x v="${scale * radius} ${radians(90)} ${python.abs(-1)} ${math.cos(0)} $${a}"/>
    </link>
  </xacro:macro>
  <xacro:link name="b"><one/><two><three/></two></xacro:link>
  <xacro:call macro="link"><one/><two/></xacro:call>
  <xacro:if value="${radius &gt; 0.05 and '$(arg side)' == 'left'}"><yes/></xacro:if>
  <xacro:unless value="$(eval side == 'left')"><no/></xacro:unless>
  <xacro:element xacro:name="made"/><xacro:attribute name="v" value="1.${1 + 1}"/>
  <xacro:include filename="part.xacro" ns="part"/><xacro:part.leg n="${part.legs}"/>
</robot>"""
PART = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="legs" value="${[i * i for i in [1, 2, 3]]}"/>
  <xacro:macro name="leg" params="n"><leg n="${n}" sum="${python.sum(n)}"/></xacro:macro>
</robot>"""


def test_a_file_with_every_feature_expands_as_xacro_expands_it(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_text(FEATURES)
    (tmp_path / 'part.xacro').write_text(PART)
    (tmp_path / 'numbers.yaml').write_text('wheel: {radius: 0.06}')
    theirs = xacro.process_file(str(path), mappings={}).toprettyxml(indent='  ')
    assert expand_document(path).urdf == theirs


PARAMETERS = ('type', 'center', 'format', 'factorial', 'range', 'mro', 'vars', 'gi_frame', 'comb')


@for_all('name', PARAMETERS)
def test_parameters_and_properties_may_have_any_name_that_xacro_takes(tmp_path, name):
    path = tmp_path / 'robot.xacro'
    path.write_text(
        FEATURES.split('<xacro:arg')[0]
        + f'<xacro:property name="{name}" value="a"/>'
        + f'<xacro:macro name="m" params="{name}">'
        + f'<link name="${{{name} + \'_link\'}}"/></xacro:macro>'
        + f'<xacro:m {name}="arm"/></robot>'
    )
    assert 'name="arm_link"' in expand_document(path).urdf


def test_what_files_print_is_a_warning(tmp_path, capfd):
    path = tmp_path / 'robot.xacro'
    words = "${xacro.message('hello')}${xacro.warning('a', 1)}${python.type(1) == python.int}"
    path.write_text(f'{FEATURES.split("<xacro:arg")[0]}<link name="{words}"/></robot>')
    expansion = expand_document(path)
    assert 'name="True"' in expansion.urdf
    assert [text for _, text in expansion.warnings] == ['hello', 'a 1']
    assert capfd.readouterr() == ('', '')


@pytest.mark.slow
def test_a_new_python_expands_where_no_process_can_be_forked(tmp_path, monkeypatch):
    path = tmp_path / 'robot.xacro'
    path.write_text(FEATURES)
    (tmp_path / 'part.xacro').write_text(PART)
    (tmp_path / 'numbers.yaml').write_text('wheel: {radius: 0.06}')
    forked = expand_document(path)
    monkeypatch.setattr(sandbox, 'CAN_FORK', False)
    assert expand_document(path) == forked
    path.write_text(FEATURES.replace('left', '${max(range(10**10))}'))
    monkeypatch.setattr(sandbox, 'WALL', 1.0)
    with pytest.raises(DescriptionError, match='1: expanding robot.xacro took more than 1 s'):
        expand_document(path)


class Garbage:
    """Says so when it is collected in a child."""

    def __init__(self):
        self.itself, self.process = self, os.getpid()

    def __del__(self):
        """Print."""
        if os.getpid() != self.process:
            print('collected', file=sys.stderr)


@pytest.mark.slow
def test_a_fork_while_another_thread_is_stuck_in_a_print_goes_through(tmp_path, monkeypatch):
    path = tmp_path / 'robot.xacro'
    message = '${xacro.message([[i] for i in range(9999)][0])}'
    path.write_text(f'{FEATURES.split("<xacro:arg")[0]}<link name="{message}"/></robot>')
    reader, writer = os.pipe()
    with open(reader, 'rb') as pipe, open(writer, 'w', buffering=1) as stuck:
        for name in ('stdout', 'stderr'):
            monkeypatch.setattr(sys, name, stuck)
        # It holds the stream's lock while nobody reads.
        thread = threading.Thread(target=stuck.write, args=['x' * 1_000_000])
        thread.start()
        while select.select([], [writer], [], 0.0)[1]:
            time.sleep(0.01)
        try:
            gc.collect()
            Garbage()
            assert 'name=""' in expand_document(path).urdf
        finally:
            while thread.is_alive():
                if select.select([pipe], [], [], 0.01)[0]:
                    pipe.read1()
            thread.join()


def test_an_attribute_made_of_a_number_is_text(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_text(
        FEATURES.split('<xacro:arg')[0] + '<xacro:attribute name="n" value="${2}"/></robot>'
    )
    assert 'n="2"' in expand_document(path).urdf
