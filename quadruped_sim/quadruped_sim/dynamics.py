# SPDX-License-Identifier: Apache-2.0
"""The equations of motion of a base and four legs, in the base's axes [Featherstone2008]."""

import math
from typing import NamedTuple

import numpy as np
from wasd_core.jit import jit
from wasd_core.robot_io import GRAVITY

from quadruped_sim.algebra import cross3, put, rotate, rotate_back

# How fast a joint turns whose dry friction counts by three quarters [rad/s]: at rest its sign is
# that of noise.
_CREEPING = 0.5


class Dynamics(NamedTuple):
    """
    Terms of M dv + h = tau + J' f, with v = (base linear, base angular, legs), base axes.

    `mass` (18, 18); `bias` (18,) is h at the present velocity, gravity included; `momentum` (12,)
    is the legs' part of M v and `momentum_drift` (12,) that of C' v - g, less the joints' drag.
    `com` (3,) is the centre of mass by the mass matrix, base axes [m].
    """

    mass: np.ndarray
    bias: np.ndarray
    momentum: np.ndarray
    momentum_drift: np.ndarray
    com: np.ndarray


class Bodies(NamedTuple):
    """
    The base and what the twelve joints move, leg by leg from the hip on.

    Of each joint where its frame is in that of the body before it, `turn` (12, 3, 3) and `place`
    (12, 3) [m], its `axis` (12, 3) there, the leg angle at which it is so, `zero` (12,) [rad], and
    the inertia of its `rotor` (12,) [kg m^2], and what it loses as it turns: viscous `damping`
    (12,) [N m s/rad] and dry `friction` (12,) [N m]. Of the base and each body, in its frame:
    `mass` (13,) [kg], centre of mass `com` (13, 3) [m], `inertia` (13, 3, 3) about that
    [kg m^2].
    """

    turn: np.ndarray
    place: np.ndarray
    axis: np.ndarray
    zero: np.ndarray
    rotor: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray


class Links(NamedTuple):
    """
    What is found of the bodies in a tick: axes of the base, moments about its origin.

    `R` (13, 3, 3) and `place` (13, 3) of each frame; `axis` (13, 3) of its joint, and `arm` (13,
    3), the velocity of the base's origin as it turns about that. Velocity `v`, `w`, and
    acceleration `a`, `b`, linear at the base's origin and angular, (13, 3). Of the body with all
    that it carries: `mass` (13,), first `moment` (13, 3), `inertia` (13, 3, 3), momentum `p`, `L`
    and force `f`, `n`, linear and angular (13, 3).
    """

    R: np.ndarray
    place: np.ndarray
    axis: np.ndarray
    arm: np.ndarray
    v: np.ndarray
    w: np.ndarray
    a: np.ndarray
    b: np.ndarray
    mass: np.ndarray
    moment: np.ndarray
    inertia: np.ndarray
    p: np.ndarray
    L: np.ndarray
    f: np.ndarray
    n: np.ndarray


def blank_dynamics() -> Dynamics:
    """Return dynamics to be written into."""
    return Dynamics(*(np.zeros(shape) for shape in ((18, 18), 18, 12, 12, 3)))


def blank_links() -> Links:
    """Return links to be written into."""
    three, square = np.zeros((13, 3)), np.zeros((13, 3, 3))
    moving = (three,) * 7
    return Links(square, *moving, np.zeros(13), three, square, *(three,) * 4)


@jit
def drag(bodies: Bodies, joint: int, rate: float) -> float:
    """Torque [N m] that a joint takes to go on turning at a `rate` [rad/s]."""
    dry = bodies.friction[joint] * math.tanh(rate / _CREEPING)
    return float(bodies.damping[joint] * rate + dry)


@jit
def find_dynamics(flat_bodies: np.ndarray, flat_links: np.ndarray, robot: np.ndarray) -> None:
    """Write the dynamics of a flat `RobotState` that knows its joints and how its base moves."""
    bodies, links, state = flat_bodies[0], flat_links[0], robot[0]
    base, up = state.base, state.base.R[2]
    put(links.v[0], rotate_back(base.R, base.velocity))
    put(links.w[0], base.omega)
    for k in range(3):
        # Against gravity: that is felt as if the base were accelerated.
        links.a[0, k], links.b[0, k] = GRAVITY * up[k], 0.0
        for m in range(3):
            links.R[0, k, m] = 1.0 if k == m else 0.0
    for joint in range(12):
        before = 0 if joint % 3 == 0 else joint
        angle = state.joint_position[joint] - bodies.zero[joint]
        _move_link(bodies, links, joint, before, (angle, state.joint_velocity[joint]))
    for i in range(13):
        _find_momenta(bodies, links, i)
    for joint in range(11, -1, -1):
        _add_link(links, 0 if joint % 3 == 0 else joint, joint + 1)
    _write_base(links, state.dynamics)
    for joint in range(12):
        rate = state.joint_velocity[joint]
        _write_joint(links, joint, rate, bodies.rotor[joint], state.dynamics)
        state.dynamics.momentum_drift[joint] -= drag(bodies, joint, rate)


@jit
def _move_link(
    bodies: Bodies, links: Links, joint: int, before: int, turned: tuple[float, float]
) -> None:
    """Write where a body is and how it moves by the one `before`; `turned` are angle and rate."""
    own = joint + 1
    R, axis, arm = links.R[own], links.axis[own], links.arm[own]
    c, s, x, rate = math.cos(turned[0]), math.sin(turned[0]), bodies.axis[joint], turned[1]
    for row in range(3):
        line = rotate_back(bodies.turn[joint], links.R[before, row])
        along = line[0] * x[0] + line[1] * x[1] + line[2] * x[2]
        across = cross3(line, x)  # as a row, line [x] is (line x x)
        for k in range(3):
            R[row, k] = c * line[k] + s * across[k] + (1.0 - c) * along * x[k]
        axis[row] = along
    offset = rotate(links.R[before], bodies.place[joint])
    for k in range(3):
        links.place[own, k] = links.place[before, k] + offset[k]
    put(arm, cross3(links.place[own], axis))
    v, w = links.v[before], links.w[before]
    # The joint's axis moves with the body before it.
    swept, lifted, spun = cross3(w, arm), cross3(v, axis), cross3(w, axis)
    for k in range(3):
        links.v[own, k], links.w[own, k] = v[k] + rate * arm[k], w[k] + rate * axis[k]
        links.a[own, k] = links.a[before, k] + rate * (swept[k] + lifted[k])
        links.b[own, k] = links.b[before, k] + rate * spun[k]


@jit
def _find_momenta(bodies: Bodies, links: Links, i: int) -> None:
    """Write inertia, momentum and force of one body alone."""
    R, mass, inertia = links.R[i], bodies.mass[i], links.inertia[i]
    c = rotate(R, bodies.com[i])
    com = c[0] + links.place[i, 0], c[1] + links.place[i, 1], c[2] + links.place[i, 2]
    square = com[0] ** 2 + com[1] ** 2 + com[2] ** 2
    links.mass[i] = mass
    for row in range(3):
        turned = rotate(bodies.inertia[i], R[row])
        for k in range(row, 3):
            own = turned[0] * R[k, 0] + turned[1] * R[k, 1] + turned[2] * R[k, 2]
            own += mass * ((square if row == k else 0.0) - com[row] * com[k])
            inertia[row, k] = inertia[k, row] = own
        links.moment[i, row] = mass * com[row]
    moment, v, w, a, b = links.moment[i], links.v[i], links.w[i], links.a[i], links.b[i]
    p, L = _times(mass, moment, inertia, v, w)
    f, n = _times(mass, moment, inertia, a, b)
    turning, tilting, pulling = cross3(w, p), cross3(w, L), cross3(v, p)
    for k in range(3):
        links.p[i, k], links.L[i, k] = p[k], L[k]
        links.f[i, k], links.n[i, k] = f[k] + turning[k], n[k] + (tilting[k] + pulling[k])


@jit
def _times(
    mass: float, moment: np.ndarray, inertia: np.ndarray, linear: np.ndarray, angular: np.ndarray
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return an inertia times a motion, linear and angular."""
    swept, lifted, spun = cross3(angular, moment), cross3(moment, linear), rotate(inertia, angular)
    return (
        (mass * linear[0] + swept[0], mass * linear[1] + swept[1], mass * linear[2] + swept[2]),
        (lifted[0] + spun[0], lifted[1] + spun[1], lifted[2] + spun[2]),
    )


@jit
def _add_link(links: Links, before: int, own: int) -> None:
    """Let a body carry another, with all that this carries."""
    links.mass[before] += links.mass[own]
    for k in range(3):
        links.moment[before, k] += links.moment[own, k]
        links.p[before, k] += links.p[own, k]
        links.L[before, k] += links.L[own, k]
        links.f[before, k] += links.f[own, k]
        links.n[before, k] += links.n[own, k]
        for m in range(3):
            links.inertia[before, k, m] += links.inertia[own, k, m]


@jit
def _write_base(links: Links, out: Dynamics) -> None:
    """Write the rows of the base: the inertia of all, and the force that keeps it up."""
    mass, moment = links.mass[0], links.moment[0]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out.mass[k, k] = mass
        out.mass[i, 3 + j] = out.mass[3 + j, i] = moment[k]
        out.mass[j, 3 + i] = out.mass[3 + i, j] = -moment[k]
        for m in range(3):
            out.mass[3 + k, 3 + m] = links.inertia[0, k, m]
        out.bias[k], out.bias[3 + k] = links.f[0, k], links.n[0, k]
        out.com[k] = moment[k] / mass


@jit
def _write_joint(links: Links, joint: int, rate: float, rotor: float, out: Dynamics) -> None:
    """Write the row of a joint, and its column."""
    own, row = joint + 1, 6 + joint
    mass, moment, axis, arm = links.mass[own], links.moment[own], links.axis[own], links.arm[own]
    force, turn = _times(mass, moment, links.inertia[own], arm, axis)
    for k in range(3):
        out.mass[row, k] = out.mass[k, row] = force[k]
        out.mass[row, 3 + k] = out.mass[3 + k, row] = turn[k]
    for other in range(joint - joint % 3, joint + 1):
        total = rotor if other == joint else 0.0
        for k in range(3):
            total += links.arm[other + 1, k] * force[k] + links.axis[other + 1, k] * turn[k]
        out.mass[row, 6 + other] = out.mass[6 + other, row] = total
    v, w, p, L = links.v[own], links.w[own], links.p[own], links.L[own]
    turning, tilting, pulling = cross3(w, p), cross3(w, L), cross3(v, p)
    lift = links.a[0]
    tipping = cross3(moment, lift)
    bias = drift = 0.0
    momentum = rotor * rate
    for k in range(3):
        bias += arm[k] * links.f[own, k] + axis[k] * links.n[own, k]
        momentum += arm[k] * p[k] + axis[k] * L[k]
        # C' v = (C + C') v - C v: what the momentum changes by as the body and its axis turn.
        drift -= arm[k] * (turning[k] + mass * lift[k])
        drift -= axis[k] * (tilting[k] + pulling[k] + tipping[k])
    out.bias[row], out.momentum[joint], out.momentum_drift[joint] = bias, momentum, drift
