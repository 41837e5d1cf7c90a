# SPDX-License-Identifier: Apache-2.0
"""The training settings of a policy: the common record of all file formats."""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any

from wasd_core.errors import suggest, UserError
from wasd_core.parameters import shown

# Terms of an observation: how many numbers each has; 0 is one a joint.
WIDTHS = {
    'linear_velocity': 3,  # of the base, in its own axes [m/s]: estimated
    'angular_velocity': 3,  # of the base, in its own axes [rad/s]: the gyroscope's
    'gravity': 3,  # unit vector down, in base axes: (0, 0, -1) when level
    'command': 3,  # ahead, left [m/s], turn [rad/s]
    'joint_position': 0,  # less the default position [rad]
    'joint_velocity': 0,  # [rad/s]
    'phase': 2,  # sine and cosine of a clock that begins with the policy
    'last_action': 0,  # what the network said last, within its clip
    # How far the base is above the ground, less 0.5 m, at 17 x 11 places 0.1 m apart that turn
    # with its yaw, x fastest; or y fastest.
    'height_scan': 187,
    'height_scan_by_row': 187,
}
SCAN_ROWS = 11  # of a height scan, along x
# What training frameworks call them.
NAMES = {
    'base_lin_vel': 'linear_velocity',
    'lin_vel': 'linear_velocity',
    'base_ang_vel': 'angular_velocity',
    'ang_vel': 'angular_velocity',
    'ang_vel_body': 'angular_velocity',
    'projected_gravity': 'gravity',
    'gravity_vec': 'gravity',
    'velocity_commands': 'command',
    'generated_commands': 'command',
    'commands': 'command',
    'command': 'command',
    'joint_pos_rel': 'joint_position',
    'dof_pos': 'joint_position',
    'joint_vel_rel': 'joint_velocity',
    'joint_vel': 'joint_velocity',
    'dof_vel': 'joint_velocity',
    'phase': 'phase',
    'last_action': 'last_action',
    'actions': 'last_action',
    'height_scan': 'height_scan',
    'height_scanner': 'height_scan',
    'height_scan_by_row': 'height_scan_by_row',
}
# The order of a robot's motors in its maker's interface, by how many there are: it is not written
# in deploy.yaml. Of a Go2 it begins with the right front leg.
_LEG_ORDER = ('FR', 'FL', 'RR', 'RL')
_G1_LEG = ('hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll')
_G1_WAIST = ('waist_yaw', 'waist_roll', 'waist_pitch')
_G1_ARM = (
    *('shoulder_pitch', 'shoulder_roll', 'shoulder_yaw', 'elbow'),
    *('wrist_roll', 'wrist_pitch', 'wrist_yaw'),
)
MOTOR_ORDER = {
    12: tuple(f'{leg}_{part}_joint' for leg in _LEG_ORDER for part in ('hip', 'thigh', 'calf')),
    29: (
        *(f'{side}_{part}_joint' for side in ('left', 'right') for part in _G1_LEG),
        *(f'{part}_joint' for part in _G1_WAIST),
        *(f'{side}_{part}_joint' for side in ('left', 'right') for part in _G1_ARM),
    ),
}
# Steps of a policy [s], and how far back it may look.
SHORTEST_PERIOD, LONGEST_PERIOD, LONGEST_HISTORY = 0.001, 0.2, 200
MOST_JOINTS = 100
# No number of a policy is larger: products of them with any action are finite.
LARGEST = 1e12


class PolicyError(UserError):
    """A policy cannot be played; the text is one line that says the file, what, and the cure."""


Numbers = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Term:
    """
    A part of the observation: clipped, scaled, and remembered.

    `scale` has one number each, or one for all; `clip` is applied before the scale, or after it
    with `scales_first`. `ages` are the steps ago that are shown, in their order: (0,) is now.
    """

    name: str
    scale: Numbers = (1.0,)
    clip: tuple[float, float] = (-math.inf, math.inf)
    scales_first: bool = False
    ages: tuple[int, ...] = (0,)


@dataclass(frozen=True, kw_only=True)
class PolicySpec:
    """
    How a network is to be used, in the order of its own joints.

    Joint targets are `action_offset + action_scale * action` [rad] within `target_clip`; motors
    apply `stiffness` [N m/rad] and `damping` [N m s/rad] at every physics step. The action is cut
    to `action_clip` first. The robot is to stand in `default_position` [rad] when it begins.

    An observation is its terms one after the other, each within `observation_clip` in the end:
    each with all its ages, or with `by_time` all terms of an age, then those of the next. Before
    there is a past it is the first observation, or zeros with `begins_with_zeros`.

    `phase_period` is that of the clock of the term phase [s]; 0: there is none.

    `ranges` are those of the command's three numbers in training. `source` says where it was
    read, `assumed` what no file said.
    """

    source: str
    joints: tuple[str, ...]
    stiffness: Numbers
    damping: Numbers
    default_position: Numbers
    action_scale: Numbers
    action_offset: Numbers
    terms: tuple[Term, ...]
    period: float = 0.02
    phase_period: float = 0.0
    action_clip: tuple[Numbers, Numbers] = ((-math.inf,), (math.inf,))
    target_clip: tuple[Numbers, Numbers] = ((-math.inf,), (math.inf,))
    observation_clip: float = math.inf
    by_time: bool = False
    begins_with_zeros: bool = False
    ranges: tuple[tuple[float, float], ...] | None = None
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """
        Check that all goes together.

        Raises:
            PolicyError: what does not, by the name of the term in doubt.
        """
        count = len(self.joints)
        if not 0 < count <= MOST_JOINTS or len(set(self.joints)) != count:
            raise PolicyError(f'joints: got {count}, wanted 1 to {MOST_JOINTS} different names')
        for name in ('stiffness', 'damping', 'default_position', 'action_scale', 'action_offset'):
            check_numbers(getattr(self, name), count, name)
        if min(self.stiffness) < 0.0 or min(self.damping) < 0.0:
            raise PolicyError('stiffness, damping: got a negative gain')
        if not any(self.stiffness):
            raise PolicyError('stiffness: all are zero, so joint targets would do nothing')
        if not SHORTEST_PERIOD <= self.period <= LONGEST_PERIOD:
            raise PolicyError(
                f'period: got {self.period:g} s, wanted {SHORTEST_PERIOD:g} to {LONGEST_PERIOD:g}'
            )
        if self.phase_period and not SHORTEST_PERIOD <= self.phase_period <= LARGEST:
            raise PolicyError(
                f'phase_period: got {self.phase_period:g} s, '
                f'wanted {SHORTEST_PERIOD:g} to {LARGEST:g}'
            )
        for name, (lows, highs) in (('action', self.action_clip), ('target', self.target_clip)):
            if not all(low < high for low, high in zip(lows, highs, strict=True)):
                raise PolicyError(f'{name} clip: wanted low < high')
        if not self.observation_clip > 0.0:
            raise PolicyError(
                f'observation clip: got {self.observation_clip:g}, wanted more than 0'
            )
        if not all(low <= high for low, high in self.ranges or ()):
            raise PolicyError(f'ranges of the command: got {self.ranges}, wanted low <= high')
        if not self.terms:
            raise PolicyError('observations: there are none')
        for term in self.terms:
            self._check_term(term)
        if self.by_time and len({term.ages for term in self.terms}) > 1:
            raise PolicyError('history: stacked by time, all terms must have the same length')

    def _check_term(self, term: Term) -> None:
        if term.name not in WIDTHS:
            raise PolicyError(f'observation {term.name!r}: not known{suggest(term.name, WIDTHS)}')
        if term.name == 'phase' and not self.phase_period:
            raise PolicyError('observation phase: phase_period is missing, in seconds')
        width = 1 if len(term.scale) == 1 else self.width_of(term)
        check_numbers(term.scale, width, f'observation {term.name}: scale')
        if not term.clip[0] < term.clip[1]:
            raise PolicyError(f'observation {term.name}: clip {term.clip} leaves nothing')
        if not term.ages or not all(0 <= age < LONGEST_HISTORY for age in term.ages):
            raise PolicyError(
                f'observation {term.name}: history of 1 to {LONGEST_HISTORY} steps is wanted'
            )

    def width_of(self, term: Term) -> int:
        """Return how many numbers a term has at one time."""
        return width_of(term.name, len(self.joints))

    @property
    def has_height_scan(self) -> bool:
        """Whether the network is shown the heights around the robot."""
        return any(term.name.startswith('height_scan') for term in self.terms)

    @property
    def width(self) -> int:
        """How many numbers the network is shown."""
        return sum(self.width_of(term) * len(term.ages) for term in self.terms)

    def check_widths(self, takes: int, gives: int) -> None:
        """
        Compare with the network, which takes and gives so many numbers.

        Raises:
            PolicyError: the widths differ; says which terms there are.
        """
        if takes != self.width:
            terms = ', '.join(
                f'{term.name} {self.width_of(term)}'
                + (f' x {len(term.ages)}' if len(term.ages) > 1 else '')
                for term in self.terms
            )
            raise PolicyError(
                f'observations: the network takes {takes} numbers, {self.source} tells of '
                f'{self.width} ({terms}){self._missing(takes)}'
            )
        if gives != len(self.joints):
            raise PolicyError(
                f'actions: the network gives {gives} numbers, {self.source} tells of '
                f'{len(self.joints)} joints'
            )

    def _missing(self, takes: int) -> str:
        """Return what would explain another width of the input."""
        if takes % self.width == 0:
            return f': a history of {takes // self.width} steps?'
        known = {term.name for term in self.terms}
        more, count = takes - self.width, len(self.joints)
        fits = [name for name in WIDTHS if name not in known and width_of(name, count) == more]
        return f': without {" or ".join(fits)}?' if fits else ''


def width_of(name: str, joints: int) -> int:
    """Return how many numbers a term has at one time, of a robot of so many joints."""
    return WIDTHS[name] or joints


def term_name(called: str, names: Mapping[str, str] = NAMES) -> str:
    """
    Return our name of what a file calls a term.

    Raises:
        PolicyError: it is not known.
    """
    if called not in names:
        raise PolicyError(
            f'observation {shown(called)}: this robot does not measure it{suggest(called, names)}'
        )
    return names[called]


def check_numbers(values: Any, count: int, name: str) -> Numbers:
    """
    Return finite numbers as they are kept: `count` of them; one stands for all.

    Raises:
        PolicyError: they are others, or not as many.
    """
    many = values if isinstance(values, (list, tuple)) else [values] * count
    is_plain = all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in many)
    if not is_plain or not all(abs(one) <= LARGEST for one in many):
        raise PolicyError(f'{name}: got {shown(values)}, wanted numbers up to {LARGEST:g}')
    if len(many) != count:
        raise PolicyError(f'{name}: got {len(many)} numbers, wanted {count}')
    return tuple(float(one) for one in many)
