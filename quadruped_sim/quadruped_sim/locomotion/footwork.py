# SPDX-License-Identifier: Apache-2.0
"""The feet of one tick, in compiled calls: who stands, on what, how high and where others go."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit

from quadruped_sim.algebra import flatten, view_of
from quadruped_sim.estimation.grip import feel_grip
from quadruped_sim.estimation.ground import follow_plane, height_at
from quadruped_sim.locomotion.gait import GaitState
from quadruped_sim.locomotion.reference import advance, BaseReference
from quadruped_sim.locomotion.sight import find_seen_footholds, survey
from quadruped_sim.locomotion.swing import arrival_of, find_landing, FootPaths, lead, SwingTargets

# Feet that stand this far off the plane through all are the noise of a flat floor, and this far
# off are on rough ground, in full; on the Go2 [m].
_FLAT, _ROUGH = 0.012, 0.035
# Part of a swing in which a force is a stumble: before, the foot leaves; after, it lands.
_MID_SWING = (0.15, 0.85)
# How far the nose is up on rough ground [rad]: while fore feet look for the top of a first high
# stair, the chin, ahead of them, arrives at the second.
_NOSE = 0.08
# How much higher the trunk is there, on the Go2 [m]: where fore feet stub against a first stair,
# the chin is at the second before they are up.
_RAISED = 0.03
# Share of a stance after which a foot has come to rest.
_SETTLED = 0.15
# A foot that should stand but does not is led on down after this [s].
_PATIENCE = 0.03
# Share of a stance in which a foot that has landed settles: it sinks into the ground and rises
# again, up and down at 0.1 m/s, and is believed with the fourth power of the share that is over.
# On rough ground it comes down harder and settles for longer: of 1.6 mm that a foot still rises
# once it is believed, odometry would sink by 7 mm/m.
_SETTLING, _ROUGH_SETTLING = 0.6, 0.8


class StepHeight:
    """
    Steps are low on flat ground, high after a stumble [Focchi2013] or where footholds are uneven;
    there trunk and nose are up, too.

    State: how rough the ground is, from 0 to 1. It is felt at once and forgotten slowly.
    """

    def __init__(self) -> None:
        self.flat = np.zeros(1)

    def reset(self) -> None:
        """Expect flat ground."""
        self.flat[0] = 0.0

    def raised(self, rules: np.ndarray) -> float:
        """Return how much higher the trunk is than on flat ground [m], by `flat_rules`."""
        return self.roughness * float(rules['rough'][0] * _RAISED * rules['length'][0])

    @property
    def roughness(self) -> float:
        """How rough the ground is, from 0 to 1."""
        return float(self.flat[0])


@jit
def find_step_height(
    robot: np.ndarray,
    ground: tuple[np.ndarray, np.ndarray],
    legs: tuple[np.ndarray, np.ndarray],
    own: np.ndarray,
    rules: np.ndarray,
    dt: float,
) -> tuple[float, float]:
    """
    Advance the roughness `own` (1,) by a tick.

    Return the height of a step [m], and how far the nose is up when it walks ahead [rad].
    """
    rule, share = rules[0].gait, rules[0].rough
    left = own[0] * math.exp(-dt / rule.terrain_time)
    own[0] = max(left, _feel_steps(robot, ground, legs, rules))
    higher = share * (rule.rough_step_height - rule.step_height)
    return rule.step_height + own[0] * higher, own[0] * (share * _NOSE)


@jit
def _feel_steps(
    robot: np.ndarray,
    ground: tuple[np.ndarray, np.ndarray],
    legs: tuple[np.ndarray, np.ndarray],
    rules: np.ndarray,
) -> float:
    """
    Return how rough the ground is felt to be now: in full by a foot that meets something.

    `ground` is a flat `Plane`, and where feet are on it; `legs` are which stand by schedule, and
    their phases.
    """
    state, plane, force, off = robot[0], ground[0][0], rules[0].contact.force_on, 0.0
    points, (is_stance, phase) = ground[1], legs
    flat, rough = _FLAT * rules[0].length, _ROUGH * rules[0].length
    for i in range(4):
        if not is_stance[i] and _MID_SWING[0] < phase[i] < _MID_SWING[1]:
            for k in range(3):
                if abs(state.forces[i, k]) > force:
                    return 1.0
        if state.is_contact[i]:
            level = height_at(plane, points[i, 0], points[i, 1])
            off = max(off, abs(points[i, 2] - level))
    return float(min(max((off - flat) / (rough - flat), 0.0), 1.0))


class Feet(NamedTuple):
    """
    What is kept of the feet, each (4,) or (4, 3).

    `points` is where they touch or would touch, `landing` where they are to land and `lift_off`
    where they left the ground, world axes [m], `trust` in [0, 1] how surely they stand. Flags are
    who stands, touched before its time, has touched since it swung, and bears load, so that it
    tells of the ground. `sought` says for how long a foot has looked for ground below its landing
    [s].
    """

    points: np.ndarray
    landing: np.ndarray
    lift_off: np.ndarray
    trust: np.ndarray
    is_stance: np.ndarray
    is_early: np.ndarray
    has_touched: np.ndarray
    is_loaded: np.ndarray
    sought: np.ndarray


def blank_feet() -> tuple[np.ndarray, Feet]:
    """Return feet that all stand, flat and as a view on that."""
    three, flags = np.zeros((4, 3)), np.zeros(4, dtype=bool)
    blank = Feet(three, three, three, np.ones(4), ~flags, flags, ~flags, flags, np.zeros(4))
    flat = flatten(blank)
    return flat, view_of(flat, blank)


class FootStages(NamedTuple):
    """What stages keep: `Plane`, `ReferenceState`, `SightState`, flat; of others a number each."""

    plane: np.ndarray
    reference: np.ndarray
    grip: np.ndarray
    roughness: np.ndarray
    sight: np.ndarray


@jit
def step_feet(
    robot: np.ndarray,
    feet: np.ndarray,
    schedule: GaitState,
    stages: tuple[FootStages, np.ndarray],
    aims: tuple[BaseReference, SwingTargets],
    asked: tuple[np.ndarray, float, float, bool],
) -> bool:
    """
    Advance all stages of a tick by `flat_rules`; write `Feet`, flat, and `aims`.

    `aims` are the base's reference and the targets. `asked` are the velocity command (3,), the
    base's height [m], dt [s] and if the legs step. Return whether other feet stand now.
    """
    legs, schedule = feet[0], GaitState(*schedule)
    own, rules = FootStages(*stages[0]), stages[1]
    command, height, dt, is_stepping = asked
    is_new = _feel_stance(robot, feet, schedule, rules, is_stepping)
    follow_plane(own.plane, legs.points, legs.is_loaded, rules, dt)
    scheduled = schedule.is_stance, schedule.phase
    ground = own.plane, legs.points
    rise, nose = find_step_height(robot, ground, scheduled, own.roughness, rules, dt)
    survey(robot, feet, own.plane, own.sight, command)
    sight = own.sight[0]
    frame = sight.tread.frame if sight.tread_share[0] > 0.0 else own.plane[0].frame
    feel_grip(robot, legs.is_loaded, frame, own.grip, rules, dt)
    wanted, pose = aims[0], (command, height, nose * (1.0 - sight.share[0]), dt)
    plane = sight.plane if sight.share[0] > 0.0 else own.plane[0]
    advance(own.reference, rules, robot, plane, pose, wanted)
    firmness = max(schedule.pace, own.roughness[0])
    times = schedule.stance_time, schedule.swing_time, schedule.pace, schedule.footprint
    steps = GaitState(legs.is_stance, schedule.phase, *times)
    find_landing(rules, robot, own.plane, (steps, wanted, firmness), legs.landing)
    rises, arrivals = np.full(4, rise), np.full(4, arrival_of(firmness))
    seen = legs.lift_off, rises, arrivals, rules[0].geometry.foot_radius
    find_seen_footholds(robot, feet, own.plane, own.sight, steps, seen)
    paths = FootPaths(legs.lift_off, legs.landing, rises, arrivals)
    lead(robot, paths, steps, (rules, legs.sought), aims[1])
    settling = _SETTLING + own.roughness[0] * (_ROUGH_SETTLING - _SETTLING)
    _find_trust(robot, feet, (schedule.phase, schedule.pace, settling), rules, is_stepping)
    return is_new


@jit
def _feel_stance(
    robot: np.ndarray,
    feet: np.ndarray,
    schedule: GaitState,
    rules: np.ndarray,
    is_stepping: bool,
) -> bool:
    """
    Write which feet stand, from where they have just lifted, which touched early, and bear load.

    A foot stands by schedule, or from a touch late in the swing on; but while legs step, one that
    has felt no ground for a while stands nowhere and goes on down [Focchi2013]. It bears load if
    it is felt to, once it has settled: only these say where the ground is. Return if others stand
    now.
    """
    state, legs, is_new = robot[0], feet[0], False
    late, radius = rules[0].gait.early_contact_phase, rules[0].geometry.foot_radius
    for i in range(4):
        touches, phase = state.is_contact[i] != 0, schedule.phase[i]
        scheduled = schedule.is_stance[i]
        early = not scheduled and (legs.is_early[i] != 0 or (phase > late and touches))
        legs.has_touched[i] = touches or (scheduled and legs.has_touched[i] != 0)
        sought = phase * schedule.stance_time - _PATIENCE
        misses = is_stepping and scheduled and legs.has_touched[i] == 0 and sought > 0.0
        legs.sought[i] = sought if misses else 0.0
        stands, stood = (scheduled and not misses) or early, legs.is_stance[i] != 0
        legs.is_early[i], legs.is_stance[i] = early, stands
        is_new = is_new or stood != stands
        legs.is_loaded[i] = stands and touches and (phase > _SETTLED or early)
        for k in range(3):
            legs.points[i, k] = state.feet[i, k] - (radius if k == 2 else 0.0)
            if stood and not stands:
                legs.lift_off[i, k] = state.feet[i, k]
    return is_new


@jit
def _find_trust(
    robot: np.ndarray,
    feet: np.ndarray,
    steps: tuple[np.ndarray, float, float],
    rules: np.ndarray,
    is_stepping: bool,
) -> None:
    """
    Write how surely each foot stands: by schedule, phase and felt force.

    `steps` are the phases (4,), the pace, and the share of a slow stance in which a foot settles.
    """
    legs, (phase, pace, slowest) = feet[0], steps
    contact, window = rules[0].contact, max(rules[0].kalman.phase_window, 1e-6)
    slow = 1.0 - pace
    settling = slow * slowest + pace * window
    for i in range(4):
        felt = (robot[0].normal_forces[i] - contact.force_off) / (
            contact.force_on - contact.force_off
        )
        legs.trust[i] = min(max(felt, 0.0), 1.0) if legs.is_stance[i] else 0.0
        if is_stepping:
            settled, left = min(phase[i] / settling, 1.0), (1.0 - phase[i]) / window
            edge = min(settled ** (1.0 + 3.0 * slow), left)
            legs.trust[i] *= 0.5 * pace if legs.is_early[i] else edge
