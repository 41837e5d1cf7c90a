# SPDX-License-Identifier: Apache-2.0
"""A hoist: two straps at the shoulders of a robot that would fall, up to a gantry."""

import math

import numpy as np
from wasd_core.robot_io import GRAVITY
from wasd_core.rotations import cross

from mujoco_sim.world import World

# Where the straps are, as shares of the height at which the robot's root begins: above the torso's
# centre of mass, and to each side.
ABOVE, ASIDE = 0.2, 0.2
# How fast a robot swings in the straps [rad/s], and how much of that is damped.
FREQUENCY, DAMPING_RATIO = 2.0 * math.pi * 1.5, 0.7
# The gantry raises at this speed [m/s]; a strap bears this many times half the weight, at most.
RAISING_SPEED, STRONGEST = 0.3, 3.0
# The lean [rad] from which on the frame turns no harder, and how slim a robot is: its radius of
# gyration over its height.
MOST_LEAN, SLIM = 0.15, 0.3
# By this share of the root's height it raises higher than the start, so that feet come free.
LIFT = 0.03
_UP = np.array((0.0, 0.0, 1.0))


class Hoist:
    """
    Bears a robot's weight while it `is_on`, at the heaviest link, and so keeps it upright.

    A strap is a spring with a damper, with half the weight where the gantry is; it does not push
    down. A frame between the straps turns the link upright, no harder than at a small lean: feet
    that touch the ground would else keep the robot leaning. The gantry stays where the hoist was
    taken, at the height of the start; from further down it raises, a little higher than that.
    State: where the gantry is. `step` comes with each control step.
    """

    def __init__(self, world: World) -> None:
        self._world, model = world, world.model
        own = np.flatnonzero(model.body_rootid == world.root)
        self._body = int(own[np.argmax(model.body_mass[own])])
        mass = float(model.body_subtreemass[world.root])
        self._weight = mass * GRAVITY
        self._stiffness = 0.5 * mass * FREQUENCY**2
        self._damping = DAMPING_RATIO * mass * FREQUENCY
        height = float(world.data.xpos[world.root, 2])
        self._uprightness = self._weight * height
        self._turn_damping = (
            2.0 * DAMPING_RATIO * math.sqrt(self._uprightness * mass) * SLIM * height
        )
        self.reset()

    def reset(self) -> None:
        """Hold the robot where it is, which is its start."""
        data = self._world.data
        height = float(data.xpos[self._world.root, 2])
        centre = data.xipos[self._body]
        ends = centre + height * np.array([(0.0, side * ASIDE, ABOVE) for side in (1.0, -1.0)])
        R = data.xmat[self._body].reshape(3, 3)
        self._hooks = (ends - data.xpos[self._body]) @ R  # in the link's axes
        self._up = R[2].copy()
        self._half = 0.5 * float(np.linalg.norm(ends[0] - ends[1]))
        self._top = float(ends[0, 2])
        self._lifted = self._top + LIFT * height
        self._ends, self.is_on = ends, True

    def take(self) -> None:
        """Hold the robot where it is, and raise it until its feet come free."""
        places, _ = self._find_hooks()
        across = places[0, :2] - places[1, :2]
        length = float(np.linalg.norm(across))
        if length < 1e-3:  # one shoulder above the other: either way is as good
            across, length = np.array((0.0, 1.0)), 1.0
        middle = places.mean(axis=0)
        sides = self._half / length * np.array((across, -across))
        self._top = self._lifted
        self._ends = np.column_stack((middle[:2] + sides, np.full(2, middle[2])))
        self.is_on = True

    def let_go(self) -> None:
        """Loosen the straps."""
        self.is_on = False
        self._world.actuation.hang(self._body, np.zeros(6))

    def step(self, dt: float) -> None:
        """Pull for the next `dt` [s]."""
        if not self.is_on:
            return
        risen = self._ends[:, 2] + RAISING_SPEED * dt
        self._ends[:, 2] = np.minimum(risen, self._top)
        places, velocities = self._find_hooks()
        forces = self._stiffness * (self._ends - places) - self._damping * velocities
        forces[:, 2] = np.maximum(forces[:, 2] + 0.5 * self._weight, 0.0)
        norms = np.linalg.norm(forces, axis=1, keepdims=True)
        most = 0.5 * STRONGEST * self._weight
        forces *= np.minimum(1.0, most / np.maximum(norms, 1e-9))
        data = self._world.data
        arms = places - data.xipos[self._body]
        torque = cross(arms[0], forces[0]) + cross(arms[1], forces[1])
        lean = cross(data.xmat[self._body].reshape(3, 3) @ self._up, _UP)
        share = min(1.0, MOST_LEAN / max(float(np.linalg.norm(lean)), 1e-9))
        torque += self._uprightness * share * lean
        torque -= self._turn_damping * data.cvel[self._body, :3]
        wrench = np.concatenate((forces.sum(axis=0), torque))
        if np.isfinite(wrench).all():
            self._world.actuation.hang(self._body, wrench)

    def _find_hooks(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where the hooks are [m] and how they move [m/s], in the world's axes, (2, 3)."""
        data, body = self._world.data, self._body
        arms = self._hooks @ data.xmat[body].reshape(3, 3).T
        root = self._world.model.body_rootid[body]
        # MuJoCo's: of a point at the whole robot's centre of mass that moves with the body.
        turn, moving = data.cvel[body, :3], data.cvel[body, 3:]
        places = data.xpos[body] + arms
        off = places - data.subtree_com[root]
        return places, moving + np.array((cross(turn, off[0]), cross(turn, off[1])))
