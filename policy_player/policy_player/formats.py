# SPDX-License-Identifier: Apache-2.0
"""
Reads the files of each training framework into a `PolicySpec`.

mjlab writes metadata into the ONNX file, Isaac Lab and unitree_rl_lab a deploy.yaml, rl_sar a
config.yaml, unitree_rl_gym a yaml of its own; legged_gym and MuJoCo Playground write nothing and
are presets.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
import math
from typing import Any

from wasd_core.errors import did_you_mean
from wasd_core.parameters import shown

from policy_player.spec import (
    check_numbers,
    LONGEST_HISTORY,
    MOST_JOINTS,
    MOTOR_ORDER,
    NAMES,
    Numbers,
    PolicyError,
    PolicySpec,
    Term,
    term_name,
    width_of,
)

# In deploy.yaml an observation is called by its function: this one is not less the default.
_ABSOLUTE = 'joint_pos'
# Of the deploy.yaml's mapping of terms, what are switches.
_SWITCHES = ('use_gym_history', 'scale_first')
# What it says of a term; its exporters may leave more there.
_OF_TERM = ('params', 'scale', 'clip', 'history_length')
_FREE = (-math.inf, math.inf)
_ALL_FREE = ((-math.inf,), (math.inf,))
# Steps that a term may show; 0 is 1.
_LENGTHS = range(LONGEST_HISTORY + 1)
USUAL_PERIOD = 0.02


def from_metadata(metadata: Mapping[str, str]) -> PolicySpec:
    """
    Return what mjlab, or whole_body_tracking, has written into an ONNX file.

    Raises:
        PolicyError: what is missing or wrong, by its name.
    """

    def words(key: str) -> list[str]:
        if key not in metadata:
            raise PolicyError(f'metadata {key}: it is missing')
        return [word.strip() for word in metadata[key].split(',') if word.strip()]

    def numbers(key: str, count: int) -> Numbers:
        found = _floats(words(key), f'metadata {key}')
        return check_numbers(found * count if len(found) == 1 else found, count, f'metadata {key}')

    def number(key: str, usual: str) -> float:
        return _floats([metadata.get(key, usual)], f'metadata {key}')[0]

    joints = tuple(words('joint_names'))
    count, called = len(joints), words('observation_names')
    # A network of mjlab sees joints less their default, whatever the term is called.
    known = {**NAMES, _ABSOLUTE: 'joint_position'}
    names = [term_name(name, known) for name in called]
    scales = _per_term(metadata, 'scale', called, 1.0)
    clips = _told_pairs(metadata, 'observation_terms_clip', len(called))
    lengths = _per_term(metadata, 'history_length', called, 0.0, _LENGTHS)
    terms = tuple(
        Term(name=name, scale=(scale,), clip=clip, ages=_last(length))
        for name, scale, clip, length in zip(
            names, scales, clips or [_FREE] * len(called), lengths, strict=True
        )
    )
    default = numbers('default_joint_pos', count)
    return PolicySpec(
        source="the ONNX file's metadata",
        joints=joints,
        stiffness=numbers('joint_stiffness', count),
        damping=numbers('joint_damping', count),
        default_position=default,
        action_scale=numbers('action_scale', count),
        action_offset=default,
        terms=terms,
        phase_period=number('phase_period', '0'),
        action_clip=_told_clip(metadata, count),
        observation_clip=number('observation_clip', 'inf'),
        ranges=_told_pairs(metadata, 'command_ranges', 3),
        assumed=(f'a step of {USUAL_PERIOD:g} s',),
    )


def _last(length: float) -> tuple[int, ...]:
    """Return the steps ago of a history, the oldest first; a length of 0 is 1."""
    return tuple(range(max(int(length), 1) - 1, -1, -1))


def _told_pairs(
    metadata: Mapping[str, str], key: str, count: int
) -> tuple[tuple[float, float], ...] | None:
    """Return what our own files tell as low;high of each; None where they do not."""
    if key not in metadata:
        return None
    pairs = [part.split(';') for part in metadata[key].split(',')]
    if len(pairs) != count or any(len(pair) != 2 for pair in pairs):
        raise PolicyError(f'metadata {key}: wanted {count} pairs low;high')
    found = [_floats(pair, f'metadata {key}') for pair in pairs]
    return tuple((low, high) for low, high in found)


def _told_clip(metadata: Mapping[str, str], count: int) -> tuple[Numbers, Numbers]:
    pairs = _told_pairs(metadata, 'action_clip', count)
    if pairs is None or set(pairs) == {_FREE}:
        return _ALL_FREE
    return tuple(low for low, _ in pairs), tuple(high for _, high in pairs)


def _floats(words: list[str], name: str) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        raise PolicyError(f'{name}: got {",".join(words)[:60]!r}, wanted numbers') from None


def _per_term(
    metadata: Mapping[str, str],
    key: str,
    called: list[str],
    usual: float,
    among: range | None = None,
) -> list[float]:
    name = f'observation_terms_{key}'
    if name not in metadata:
        return [usual] * len(called)
    found = _floats([word.strip() for word in metadata[name].split(',')], f'metadata {name}')
    if len(found) != len(called) or not all(math.isfinite(n) for n in found):
        raise PolicyError(
            f'metadata {name}: got {metadata[name][:60]!r}, wanted {len(called)} numbers, '
            'one an observation'
        )
    if among is not None and not all(n in among for n in found):
        raise PolicyError(
            f'metadata {name}: got {metadata[name][:60]!r}, wanted whole numbers up to {among[-1]}'
        )
    return found


def from_deploy(values: Mapping[str, Any]) -> PolicySpec:
    """
    Return what Isaac Lab's, or unitree_rl_lab's, deploy.yaml says.

    `stiffness` and `damping` are in the order of the robot's motors, all else in the policy's;
    `joint_ids_map` leads from this to those.

    Raises:
        PolicyError: what is missing or wrong, by its name.
    """
    motors = _order(values, 'joint_ids_map')
    count = len(motors)
    if count not in MOTOR_ORDER:
        known = ' or '.join(map(str, MOTOR_ORDER))
        raise PolicyError(
            f'joint_ids_map: the order of {count} motors is not known, only that of {known}'
        )
    joints = tuple(MOTOR_ORDER[count][index] for index in motors)
    gains = {
        name: tuple(_numbers(values, name, count)[index] for index in motors)
        for name in ('stiffness', 'damping')
    }
    default = _numbers(values, 'default_joint_pos', count)
    actions = _mapping(values, 'actions')
    if set(actions) != {'JointPositionAction'}:
        raise PolicyError(
            f'actions: got {", ".join(actions)[:80] or "none"}, only JointPositionAction is played'
        )
    where = 'actions.JointPositionAction'
    action = _mapping(actions, 'JointPositionAction', where)
    if action.get('joint_ids') not in (None, list(range(count))):
        raise PolicyError(f'{where}.joint_ids: wanted all joints in their order')
    observations = _mapping(values, 'observations')
    switches = {name: observations.get(name) or False for name in _SWITCHES}
    for name, value in switches.items():
        if not isinstance(value, bool):
            raise PolicyError(f'observations.{name}: got {shown(value)}, wanted true or false')
    terms = tuple(
        _deployed_term(name, said, count, switches['scale_first'])
        for name, said in observations.items()
        if name not in _SWITCHES
    )
    return PolicySpec(
        source='deploy.yaml',
        joints=joints,
        stiffness=gains['stiffness'],
        damping=gains['damping'],
        default_position=default,
        action_scale=check_numbers(_need(action, 'scale', where), count, f'{where}.scale'),
        action_offset=check_numbers(_need(action, 'offset', where), count, f'{where}.offset'),
        terms=terms,
        period=_numbers(values, 'step_dt')[0],
        target_clip=_limits(action.get('clip'), count, f'{where}.clip'),
        by_time=switches['use_gym_history'],
        ranges=_ranges(values.get('commands')),
        assumed=('the order of the motors is the usual one of its maker',),
    )


def _deployed_term(name: str, said: Any, count: int, scales_first: bool) -> Term:
    where = f'observations.{name}'
    if name == _ABSOLUTE:
        raise PolicyError(f'{where}: in doubt, joint_pos_rel is less the default, is it meant?')
    called = term_name(name)
    if said is None:
        said = {}
    if not isinstance(said, dict):
        raise PolicyError(f'{where}: wanted scale, clip and history_length, got {str(said)[:40]}')
    for key in said:
        if key not in _OF_TERM and (meant := did_you_mean(str(key), _OF_TERM)):
            raise PolicyError(f'{where}.{key}: not known{meant}')
    width = width_of(called, count)
    scale, clip = said.get('scale'), said.get('clip')
    length = said.get('history_length', 1)
    if length not in _LENGTHS:
        raise PolicyError(
            f'{where}.history_length: got {shown(length)}, wanted 0 to {LONGEST_HISTORY}'
        )
    low, high = _FREE if clip is None else check_numbers(clip, 2, f'{where}.clip')
    return Term(
        name=called,
        scale=(1.0,) if scale is None else check_numbers(scale, width, f'{where}.scale'),
        clip=(low, high),
        scales_first=scales_first,
        ages=_last(length),
    )


def _limits(clip: Any, count: int, where: str) -> tuple[Numbers, Numbers]:
    if clip is None:
        return _ALL_FREE
    if not isinstance(clip, list) or len(clip) != count:
        raise PolicyError(f'{where}: wanted {count} pairs')
    pairs = [check_numbers(pair, 2, where) for pair in clip]
    return tuple(low for low, _ in pairs), tuple(high for _, high in pairs)


def _ranges(commands: Any) -> tuple[tuple[float, float], ...] | None:
    """Return the ranges of the command in training, or None where they are not told."""
    velocity = commands.get('base_velocity') if isinstance(commands, dict) else None
    ranges = velocity.get('ranges') if isinstance(velocity, dict) else None
    if not isinstance(ranges, dict):
        return None
    found = []
    for name in ('lin_vel_x', 'lin_vel_y', 'ang_vel_z'):
        low, high = check_numbers(ranges.get(name), 2, f'commands.base_velocity.ranges.{name}')
        found.append((low, high))
    return tuple(found)


# What rl_sar's terms are scaled by.
_SCALES = {
    'linear_velocity': 'lin_vel_scale',
    'angular_velocity': 'ang_vel_scale',
    'command': 'commands_scale',
    'joint_position': 'dof_pos_scale',
    'joint_velocity': 'dof_vel_scale',
}


def from_rl_sar(values: Mapping[str, Any], base: Mapping[str, Any]) -> PolicySpec:
    """
    Return what rl_sar's config.yaml says; `base` are the values of the robot's base.yaml.

    In its `observations_history` 0 is the latest. `joint_mapping` leads from the policy's joints
    to the robot's, whose order `joint_names` is.

    Raises:
        PolicyError: what is missing or wrong, by its name.
    """
    said = {**_section(base), **_section(values)}
    count = _need(said, 'num_of_dofs')
    if count not in range(1, MOST_JOINTS + 1):
        raise PolicyError(
            f'num_of_dofs: got {shown(count)}, wanted a whole number from 1 to {MOST_JOINTS}'
        )
    count = int(count)
    if said.get('wheel_indices'):
        raise PolicyError('wheel_indices: wheels are not played')
    if said.get('framework') == 'isaacsim' and {'rows', 'cols'} & said.keys():
        raise PolicyError('rows, cols: joints by rows and columns are not played')
    ages = _history(said.get('observations_history'))
    priority = said.get('observations_history_priority', 'time')
    if priority not in ('time', 'term'):
        raise PolicyError(f'observations_history_priority: got {priority!r}, wanted time or term')
    called = _need(said, 'observations')
    if not isinstance(called, list) or not all(isinstance(one, str) for one in called):
        raise PolicyError('observations: wanted a list of names')
    terms = []
    for name in map(term_name, called):
        key = _SCALES.get(name)
        number = 3 if name == 'command' else 1
        given = (1.0,) if key is None else _numbers(said, key, number)
        terms.append(Term(name=name, scale=given, ages=ages))
    default = _numbers(said, 'default_dof_pos', count)
    clips = [_numbers(said, f'clip_actions_{end}', count) for end in ('lower', 'upper')]
    assumed = []
    steps = [said.get('dt'), said.get('decimation')]
    for at, (name, usual) in enumerate((('dt', 0.005), ('decimation', 4))):
        if steps[at] is None:
            assumed.append(f'{name} {usual:g}: neither config.yaml nor base.yaml says it')
            steps[at] = usual
    return PolicySpec(
        source='config.yaml',
        joints=_rl_sar_joints(said, count, assumed),
        stiffness=_numbers(said, 'rl_kp', count),
        damping=_numbers(said, 'rl_kd', count),
        default_position=default,
        action_scale=_rl_sar_scale(said, count),
        action_offset=default,
        terms=tuple(terms),
        period=math.prod(check_numbers(steps, 2, 'dt, decimation')),
        action_clip=(clips[0], clips[1]),
        observation_clip=_numbers(said, 'clip_obs')[0],
        by_time=priority == 'time',
        begins_with_zeros=True,
        assumed=tuple(assumed),
    )


def _section(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return what stands below the one name at the top, such as `go2/robot_lab`."""
    inner = [value for value in values.values() if isinstance(value, dict)]
    return inner[0] if len(values) == 1 and inner else values


def _history(ages: Any) -> tuple[int, ...]:
    if ages in (None, []):
        return (0,)
    if not isinstance(ages, list) or not all(isinstance(age, int) for age in ages):
        raise PolicyError(f'observations_history: got {str(ages)[:60]}, wanted steps ago')
    return tuple(ages)


def _rl_sar_scale(said: Mapping[str, Any], count: int) -> tuple[float, ...]:
    """Return the scale of each action; older files reduce that of the hips."""
    scale = list(_numbers(said, 'action_scale', count))
    share = check_numbers(said.get('hip_scale_reduction', 1.0), 1, 'hip_scale_reduction')[0]
    hips = said.get('hip_scale_reduction_indices') or []
    if not isinstance(hips, list) or not all(hip in range(count) for hip in hips):
        raise PolicyError(f'hip_scale_reduction_indices: wanted numbers from 0 to {count - 1}')
    for hip in hips:
        scale[int(hip)] *= share
    return tuple(scale)


def _rl_sar_joints(said: Mapping[str, Any], count: int, assumed: list[str]) -> tuple[str, ...]:
    names = said.get('joint_names')
    controllers = said.get('joint_controller_names')  # of older files, by the policy's order
    if names is None and isinstance(controllers, list):
        names = [f'{str(name).removesuffix("_controller")}_joint' for name in controllers]
    if names is None:
        if count not in MOTOR_ORDER:
            raise PolicyError(
                f'joint_names: it is missing, and {count} joints have no usual order'
            )
        names = MOTOR_ORDER[count]
        assumed.append('the order of the joints is the usual one of its maker')
    if not isinstance(names, (list, tuple)) or len(names) != count:
        raise PolicyError(f'joint_names: wanted {count} names')
    if said.get('joint_mapping') is None:  # older files: `joint_names` are the policy's own
        return tuple(map(str, names))
    return tuple(str(names[index]) for index in _order(said, 'joint_mapping', count))


# unitree_rl_gym's clock of the steps of its G1 [s], which its scripts have and its files have not.
_GYM_PHASE = 0.8


def from_rl_gym(values: Mapping[str, Any]) -> PolicySpec:
    """
    Return what unitree_rl_gym's file says of its G1: twelve joints of legs, nothing else moves.

    It is of deploy_mujoco (simulation_dt, control_decimation) or of deploy_real (control_dt).

    Raises:
        PolicyError: what is missing or wrong, by its name.
    """
    paths = f'{values.get("xml_path", "")} {values.get("policy_path", "")}'
    if 'g1' not in paths:
        raise PolicyError(
            f'policy_path: got {paths.strip()[:60]!r}, in doubt: only the order of the legs of a '
            'G1 is known, whose path says g1'
        )
    joints = MOTOR_ORDER[29][:12]
    count = _numbers(values, 'num_actions')[0]
    if count != len(joints):
        raise PolicyError(f'num_actions: got {count:g}, a G1 has {len(joints)} joints of legs')
    terms = [
        Term(name='angular_velocity', scale=_numbers(values, 'ang_vel_scale')),
        Term(name='gravity'),
        Term(name='command', scale=_numbers(values, 'cmd_scale', 3)),
        Term(name='joint_position', scale=_numbers(values, 'dof_pos_scale')),
        Term(name='joint_velocity', scale=_numbers(values, 'dof_vel_scale')),
        Term(name='last_action'),
    ]
    shown = _numbers(values, 'num_obs')[0]
    if shown not in (45, 47):
        raise PolicyError(f'num_obs: got {shown:g}, wanted 45, or 47 with a clock')
    has_clock = shown == 47
    most = values.get('max_cmd')
    default = _numbers(values, 'default_angles', len(joints))
    return PolicySpec(
        source='the file of unitree_rl_gym',
        joints=joints,
        stiffness=_numbers(values, 'kps', len(joints)),
        damping=_numbers(values, 'kds', len(joints)),
        default_position=default,
        action_scale=_numbers(values, 'action_scale', len(joints)),
        action_offset=default,
        terms=(*terms, Term(name='phase')) if has_clock else tuple(terms),
        period=_gym_period(values),
        phase_period=_GYM_PHASE if has_clock else 0.0,
        ranges=None
        if most is None
        else tuple((-one, one) for one in map(abs, check_numbers(most, 3, 'max_cmd'))),
        assumed=(
            'the order of the joints is that of a G1',
            *([f'a clock of {_GYM_PHASE:g} s'] if has_clock else []),
        ),
    )


def _gym_period(values: Mapping[str, Any]) -> float:
    if 'control_dt' in values:
        return check_numbers(values['control_dt'], 1, 'control_dt')[0]
    parts = [_need(values, key) for key in ('simulation_dt', 'control_decimation')]
    return math.prod(check_numbers(parts, 2, 'simulation_dt, control_decimation'))


def legged_gym() -> PolicySpec:
    """Return what legged_gym's Go2 is trained with by default: 48 numbers, 50 Hz."""
    default = tuple(
        angle
        for side, thigh in ((0.1, 0.8), (-0.1, 0.8), (0.1, 1.0), (-0.1, 1.0))
        for angle in (side, thigh, -1.5)
    )
    return PolicySpec(
        source='the preset legged_gym',
        joints=tuple(
            f'{leg}_{part}_joint'
            for leg in ('FL', 'FR', 'RL', 'RR')
            for part in ('hip', 'thigh', 'calf')
        ),
        stiffness=(20.0,) * 12,
        damping=(0.5,) * 12,
        default_position=default,
        action_scale=(0.25,) * 12,
        action_offset=default,
        terms=(
            Term(name='linear_velocity', scale=(2.0,)),
            Term(name='angular_velocity', scale=(0.25,)),
            Term(name='gravity'),
            Term(name='command', scale=(2.0, 2.0, 0.25)),
            Term(name='joint_position'),
            Term(name='joint_velocity', scale=(0.05,)),
            Term(name='last_action'),
        ),
        action_clip=((-100.0,) * 12, (100.0,) * 12),
        observation_clip=100.0,
        ranges=((-1.0, 1.0),) * 3,
        assumed=('all settings: legged_gym writes none for a policy',),
    )


def legged_gym_rough() -> PolicySpec:
    """Return what legged_gym is trained with on rough terrain: 187 heights beside the 48."""
    flat = legged_gym()
    heights = Term(name='height_scan_by_row', scale=(5.0,), clip=(-1.0, 1.0))
    return replace(flat, source='the preset legged_gym_rough', terms=(*flat.terms, heights))


def playground() -> PolicySpec:
    """Return what MuJoCo Playground's joystick tasks are trained with: 48 numbers, 50 Hz."""
    default = (0.1, 0.9, -1.8, -0.1, 0.9, -1.8) * 2
    return PolicySpec(
        source='the preset playground',
        joints=MOTOR_ORDER[12],
        stiffness=(35.0,) * 12,
        damping=(0.5,) * 12,
        default_position=default,
        action_scale=(0.5,) * 12,
        action_offset=default,
        terms=tuple(
            Term(name=name)
            for name in (
                *('linear_velocity', 'angular_velocity', 'gravity', 'joint_position'),
                *('joint_velocity', 'last_action', 'command'),
            )
        ),
        ranges=((-1.5, 1.5), (-0.8, 0.8), (-1.2, 1.2)),
        assumed=('all settings: MuJoCo Playground writes none for a policy',),
    )


PRESETS: dict[str, Callable[[], PolicySpec]] = {
    'legged_gym': legged_gym,
    'legged_gym_rough': legged_gym_rough,
    'playground': playground,
}


def _need(values: Mapping[str, Any], key: str, where: str = '') -> Any:
    if values.get(key) is None:
        raise PolicyError(f'{where}{"." if where else ""}{key}: it is missing')
    return values[key]


def _order(values: Mapping[str, Any], key: str, count: int | None = None) -> list[int]:
    """Return numbers that put `count` things, or however many they are, into another order."""
    order = _need(values, key)
    if not isinstance(order, list) or sorted(map(str, order)) != sorted(
        map(str, range(count or len(order)))
    ):
        last = 'n - 1' if count is None else count - 1
        raise PolicyError(f'{key}: got {str(order)[:60]}, wanted each of 0 to {last} once')
    return [int(index) for index in order]


def _numbers(values: Mapping[str, Any], key: str, count: int = 1) -> Numbers:
    return check_numbers(_need(values, key), count, key)


def _mapping(values: Mapping[str, Any], key: str, where: str = '') -> dict[str, Any]:
    found = _need(values, key)
    if not isinstance(found, dict):
        raise PolicyError(f'{where or key}: wanted names with values, got {str(found)[:40]}')
    return found
