# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from robot_description.xacro.expand import expand
from robot_description.xacro.expressions import Evaluator
from wasd_core.errors import DescriptionError
import xacro

NAMES = {'pi': math.pi, 'radians': math.radians, 'd': {'a': {'b': 2}}, 'name': 'FL', 'n': 3}
FUNCTIONS = {f.__name__: f for f in (range, len, str, float, int, list, max, sorted, map, sum)}


@pytest.mark.parametrize(
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
    ],
)  # fmt: skip
def test_what_robots_need_has_pythons_value(text):
    names = {**NAMES, **FUNCTIONS}
    assert Evaluator().evaluate(text, dict(names)) == eval(text, dict(names))


@pytest.mark.parametrize(
    'text',
    [
        '9 ** 9 ** 9',
        '1 << 10 ** 9',
        "'a' * 10 ** 9",
        '[0] * 10 ** 9',
        'range(10 ** 9)',
        "'a'.ljust(10 ** 9)",
        "'%999999999d' % 1",
        "'{:999999999}'.format(1)",
        "f'{1:{n}}'",
        "f'{1:999999999}'",
        '[0 for a in range(9999) for b in range(9999)]',
        "'a' * 9999 + 'a' * 9999",
        '().__class__',
        '(lambda: ().__class__)()',
        '[x.__class__ for x in [1]]',
        '(x for x in [1]).gi_frame',
        '__import__',
        'map(range, [10 ** 9])',
        'vars(d)',
        'type(n)',
        'str.mro()',
    ],
)  # fmt: skip
def test_what_leads_out_or_grows_is_refused(text):
    with pytest.raises(DescriptionError):
        Evaluator().evaluate(text, {**NAMES, **FUNCTIONS})


def test_no_builtin_is_known():
    for name in ('open', 'eval', 'exec', 'getattr', 'globals', 'object', 'print'):
        with pytest.raises(NameError):
            Evaluator().evaluate(name, {})


def test_steps_are_counted_over_all_expressions_of_a_file():
    evaluator = Evaluator()
    with pytest.raises(DescriptionError, match='more than 200000 steps'):
        for _ in range(100):
            evaluator.evaluate('[0 for x in range(9999)]', dict(FUNCTIONS))


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
    assert expand(path) == xacro.process_file(str(path), mappings={}).toprettyxml(indent='  ')


def test_an_attribute_made_of_a_number_is_text(tmp_path):
    path = tmp_path / 'robot.xacro'
    path.write_text(
        FEATURES.split('<xacro:arg')[0] + '<xacro:attribute name="n" value="${2}"/></robot>'
    )
    assert 'n="2"' in expand(path)
