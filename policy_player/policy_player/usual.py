# SPDX-License-Identifier: Apache-2.0
"""Finds odd numbers of a policy: mistakes that make it walk badly, without an error."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from robot_description.robot import Robot

from policy_player.spec import Numbers, PolicySpec

# What public policies of robots of the Go2's size have: joint stiffness [N m/rad] and damping
# [N m s/rad], rad an action, and the step [s].
STIFFNESS, DAMPING, SCALE, STEP = (18.0, 50.0), (0.3, 3.0), (0.1, 0.5), 0.02
# So far beyond its stop a joint of the default pose may be [rad].
CLOSE = 0.1
LEG_ORDERS = (
    ('FL', 'FR', 'RL', 'RR'),
    ('FR', 'FL', 'RR', 'RL'),
)


def oddities(spec: PolicySpec) -> list[str]:
    """Return what is unusual, each with what it may be, in words."""
    return [*_odd_motors(spec), *_odd_terms(spec)]


def beyond_limits(spec: PolicySpec, robot: Robot) -> str:
    """Return which joint of the default pose is beyond its stops, in words; '' if none is."""
    for name, angle in zip(spec.joints, spec.default_position, strict=True):
        joint = robot.joints.get(name)
        if joint and not joint.lower - CLOSE <= angle <= joint.upper + CLOSE:
            ends = f'{joint.lower:.3g} to {joint.upper:.3g}'
            return f'default pose: {name}: got {angle:g} rad, wanted {ends} (degrees?)'
    return ''


def _odd_motors(spec: PolicySpec) -> Iterator[str]:
    low, high = STIFFNESS
    kp, kd, scale = spec.stiffness, spec.damping, np.abs(spec.action_scale)
    if max(kp) > high:
        yield (
            f'stiffness {_range(kp)} N m/rad is unusual ({low:g} to {high:g}): '
            'are these the gains of the stand?'
        )
    if min(kp) < low:
        yield f'stiffness {_range(kp)} N m/rad is unusual ({low:g} to {high:g}): half of it?'
    if min(kd) == 0.0:
        yield 'damping 0 N m s/rad: nothing damps the motors; is it left out?'
    elif min(kd) < DAMPING[0] or max(kd) > DAMPING[1]:
        yield f'damping {_range(kd)} N m s/rad is unusual ({DAMPING[0]:g} to {DAMPING[1]:g})'
    if scale.max() > SCALE[1] or scale.max() < SCALE[0]:
        yield (
            f'action scale {_range(scale.tolist())} rad is unusual '
            f'({SCALE[0]:g} to {SCALE[1]:g}): is it doubled, or halved?'
        )
    if abs(spec.period - STEP) > 1e-9:
        yield (
            f'a step of {1e3 * spec.period:g} ms ({1.0 / spec.period:.0f} Hz) is unusual: '
            f'nearly all policies have {1e3 * STEP:g} ms'
        )
    if not np.allclose(spec.action_offset, spec.default_position, atol=1e-3):
        yield 'the offset of actions is not the default position: is one of them of another pose?'


def _odd_terms(spec: PolicySpec) -> Iterator[str]:
    for term in spec.terms:
        if not any(term.scale):
            yield f'observation {term.name} is always zero (scale 0): is it left out?'
        elif term.name == 'last_action' and set(term.scale) != {1.0}:
            yield f'observation last_action has a scale of {term.scale[0]:g}: 1 is usual'
        elif term.name == 'gravity' and min(term.scale) < 0.0:
            yield 'observation gravity points up: most networks see it point down'
        elif term.name == 'linear_velocity':
            yield (
                'observation linear_velocity is the estimate of the legs here: a network that was '
                'trained on the truth may fall for it'
            )
    names = {term.name for term in spec.terms}
    for name in ('gravity', 'command', 'joint_position', 'joint_velocity'):
        if name not in names:
            yield f'observation {name} is not there: walkers need it'


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f'{low:g}' if low == high else f'{low:g} to {high:g}'


def variants(spec: PolicySpec) -> Iterator[tuple[str, PolicySpec]]:
    """Yield what else could have been meant, and the mistake that it would be."""

    def times(values: Numbers, factor: float) -> Numbers:
        return tuple(factor * value for value in values)

    for factor, words in ((2.0, 'half'), (0.5, 'twice')):
        kp, kd = times(spec.stiffness, factor), times(spec.damping, factor)
        stiffer = replace(spec, stiffness=kp, damping=kd)
        yield f'the gains are {words} of what they should be', stiffer
        scale = times(spec.action_scale, factor)
        yield (
            f'the action scale is {words} of what it should be',
            replace(spec, action_scale=scale),
        )
        yield (
            f'the step is {words} of what it should be',
            replace(spec, period=min(max(factor * spec.period, 0.001), 0.2)),
        )
    flipped = tuple(
        replace(term, scale=times(term.scale, -1.0)) if term.name == 'gravity' else term
        for term in spec.terms
    )
    yield 'gravity has the wrong sign', replace(spec, terms=flipped)
    turned = tuple(replace(term, ages=term.ages[::-1]) for term in spec.terms)
    yield 'the history is the wrong way round', replace(spec, terms=turned)
    yield from orders(spec)


def orders(spec: PolicySpec) -> Iterator[tuple[str, PolicySpec]]:
    """Yield the same numbers for joints in other orders, of a robot with four legs."""
    parts = sorted({name.partition('_')[2] for name in spec.joints}, key=_along)
    if len(spec.joints) != 12 or len(parts) != 3:
        return
    for legs in LEG_ORDERS:
        by_leg = tuple(f'{leg}_{part}' for leg in legs for part in parts)
        by_kind = tuple(f'{leg}_{part}' for part in parts for leg in legs)
        for joints, words in ((by_leg, 'leg by leg'), (by_kind, 'by kind')):
            if joints != spec.joints and set(joints) == set(spec.joints):
                told = f'the joints are {" ".join(legs)}, {words}, not as told'
                yield told, replace(spec, joints=joints)


def order_of(spec: PolicySpec) -> str:
    """Return the order of the joints in words, or their names."""
    legs = list(dict.fromkeys(name.partition('_')[0] for name in spec.joints))
    is_by_leg = all(
        name.startswith(f'{legs[index * len(legs) // len(spec.joints)]}_')
        for index, name in enumerate(spec.joints)
    )
    return f'{" ".join(legs)}, {"leg by leg" if is_by_leg else "by kind"}'


def _along(part: str) -> int:
    """Return how far along a leg a joint is, by its name."""
    known = ('hip', 'thigh', 'calf')
    return next((index for index, name in enumerate(known) if name in part), len(known))
