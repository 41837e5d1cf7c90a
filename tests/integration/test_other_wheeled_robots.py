# SPDX-License-Identifier: Apache-2.0
"""`wasd mbot --description`: wheeled robots as other people describe them."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

Report = dict[str, Any]
WAY = '0 0.2 0 0.4\n3 0 0 -0.8\n5 0 0 0'
# 0.4 rad/s for 3 s and 0.8 rad/s back for 2 s; a step of d at 6 rad/s^2 comes d |d| / 12 late.
TURNED = 1.2 - 1.6 - (0.4**2 - 1.2**2 + 0.8**2) / 12.0


def inertial(mass: float, *diagonal: float) -> str:
    """Return an inertial with a diagonal inertia."""
    x, y, z = diagonal
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" '
        'iyz="0"/></inertial>'
    )


def joint(
    name: str, child: str, origin: str, kind: str = 'continuous', axis: str = '0 1 0'
) -> str:
    """Return a joint on base_link."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="base_link"/><child link="{child}"/>'
        f'<origin {origin}/><axis xyz="{axis}"/></joint>'
    )


def shaped(name: str, shape: str, inertia: str, origin: str = '', kind: str = 'collision') -> str:
    """Return a link of one shape."""
    return (
        f'<link name="{name}"><{kind}><origin {origin}/><geometry><{shape}/></geometry></{kind}>'
        f'{inertia}</link>'
    )


FOOTPRINT = (
    '<link name="base_footprint"/><joint name="up" type="fixed"><parent link="base_footprint"/>'
    '<child link="base_link"/><origin xyz="0 0 {}"/></joint>'
)


def burger_like() -> str:
    """As TurtleBot3's: no limits, no friction, axes along z of rolled joints, a box for caster."""
    wheels = ''.join(
        joint(f'wheel_{side}_joint', f'wheel_{side}', f'xyz="0 {y} 0.023" rpy="-1.57 0 0"',
              axis='0 0 1')
        + shaped(f'wheel_{side}', 'cylinder radius="0.033" length="0.018"',
                 inertial(0.0285, 1.1e-5, 1.1e-5, 2.07e-5))
        for side, y in (('left', 0.08), ('right', -0.08))
    )  # fmt: skip
    return (
        FOOTPRINT.format(0.01)
        + shaped('base_link', 'box size="0.14 0.14 0.143"', inertial(0.83, 2e-3, 2e-3, 2e-3),
                 'xyz="-0.032 0 0.07"')
        + wheels
        + joint('caster', 'caster', 'xyz="-0.081 0 -0.004" rpy="-1.57 0 0"', 'fixed')
        + shaped('caster', 'box size="0.03 0.009 0.02"', inertial(0.005, 1e-3, 1e-3, 1e-3),
                 'xyz="0 0.001 0"')
    )  # fmt: skip


def swapped_mbot(mass: float = 20.0) -> str:
    """As a course's copies of mbot: left on the right, front at the back, no limits, heavy."""
    tyre = 'cylinder radius="0.06" length="0.025"'
    wheels = ''.join(
        joint(f'{side}_wheel_joint', f'{side}_wheel', f'xyz="0 {y} -0.05"')
        + shaped(f'{side}_wheel', tyre, inertial(0.1 * mass, 2e-3, 3.6e-3, 2e-3),
                 'rpy="1.5707963 0 0"')
        for side, y in (('left', -0.19), ('right', 0.19))
    )  # fmt: skip
    casters = ''.join(
        joint(f'{end}_joint', end, f'xyz="{x} 0 -0.095"')
        + shaped(end, 'sphere radius="0.015"', inertial(0.5, 5e-5, 5e-5, 5e-5))
        for end, x in (('front', -0.18), ('back', 0.18))
    )
    drum = shaped(
        'base_link', 'cylinder radius="0.2" length="0.16"', inertial(mass, 0.24, 0.24, 0.4)
    )
    return FOOTPRINT.format(0.11) + drum + wheels + casters


def behind() -> str:
    """The root above the floor, the axle ahead of it, axes to the right, a caster on a swivel."""
    wheels = ''.join(
        joint(name, f'{name}_link', f'xyz="0.09 {y} -0.01"', axis='0 -1 0')
        + shaped(f'{name}_link', 'cylinder radius="0.032" length="0.02"',
                 inertial(0.1, 3e-5, 5.1e-5, 3e-5), 'rpy="1.5707963 0 0"')
        for name, y in (('motor_a', 0.12), ('motor_b', -0.12))
    )  # fmt: skip
    fork = f'<link name="fork">{inertial(0.02, 1e-5, 1e-5, 1e-5)}</link>'
    caster = joint('roll', 'ball', 'xyz="-0.02 0 -0.012"').replace('base_link', 'fork')
    return (
        shaped('base_link', 'cylinder radius="0.16" length="0.005"',
               inertial(1.5, 0.01, 0.01, 0.019))
        + wheels
        + joint('swivel', 'fork', 'xyz="-0.12 0 -0.01"', axis='0 0 1')
        + fork
        + caster
        + shaped('ball', 'cylinder radius="0.02" length="0.01"', inertial(0.02, 4e-6, 4e-6, 4e-6),
                 'rpy="1.5707963 0 0"')
    )  # fmt: skip


@pytest.fixture
def drive(report_of: Callable[..., Report], tmp_path: Path) -> Callable[..., Report]:
    """Return a function that drives a description along WAY."""

    def drive(body: str, *arguments: str) -> Report:
        (tmp_path / 'cart.urdf').write_text(f'<robot name="cart">{body}</robot>')
        return report_of('--description', 'cart.urdf', *arguments, twist=WAY)

    return drive


@pytest.mark.parametrize('describe', [burger_like, swapped_mbot, behind])
def test_it_goes_where_it_is_sent_and_its_odometry_agrees(
    drive: Callable[..., Report], describe: Callable[[], str]
) -> None:
    samples = drive(describe())['samples']
    truth, odometry = samples['position'], samples['odom']
    off = max(math.dist(p[:2], o[:2]) for p, o in zip(truth, odometry, strict=True))
    assert off < 0.002
    yaws = [rpy[2] for rpy in samples['rpy']]
    assert yaws[samples['t'].index(3.0)] == pytest.approx(1.2 - 0.4**2 / 12.0, abs=0.01)
    assert yaws[-1] == pytest.approx(TURNED, abs=0.01)
    assert samples['contacts'][-1] == [1, 1]
    # It stands from the beginning: nothing falls or pops out of the floor.
    heights = [position[2] for position in truth]
    assert max(heights) - min(heights) < 0.001


def test_in_mode_fake_a_description_may_be_for_the_eye_only(drive: Callable[..., Report]) -> None:
    wheels = ''.join(
        joint(f'{side}_wheel_joint', side, f'xyz="0 {y} -0.05"')
        + shaped(side, 'cylinder radius="0.06" length="0.025"', '', 'rpy="1.5707 0 0"', 'visual')
        for side, y in (('left', 0.19), ('right', -0.19))
    )
    drum = shaped('base_link', 'cylinder radius="0.2" length="0.16"', '', '', 'visual')
    samples = drive(drum + wheels, '--mode', 'fake')['samples']
    assert samples['rpy'][-1][2] == pytest.approx(TURNED, abs=1e-3)
    # Lifted onto its wheels, whose right angle is written as 1.5707.
    assert samples['position'][0][2] == pytest.approx(0.11, abs=1e-5)
