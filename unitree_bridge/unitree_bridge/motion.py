# SPDX-License-Identifier: Apache-2.0
"""Turns requests of the sport service into keys and velocities over time."""

from collections.abc import Callable

import numpy as np
from quadruped_sim.keys import FOLLOWING, keys_between, StateName, SUCCESSORS
from quadruped_sim.presets import GAITS, LIMITS
from quadruped_sim.states.driving import FULL_LEAN
from wasd_core.timing import Beat, Watchdog

from unitree_bridge.legs_robot import LegsRobot
from unitree_bridge.robot import Velocity

# A Move holds for so long [s], and is told to the controller so often [Hz].
MOVE_TIMEOUT = 1.0
# A program that goes on asking for a Move over a stop is ignored until it is silent for this [s].
SILENCE = 1.2
MOVE_RATE = 20.0
# A key that has changed nothing is pressed again after so long [s].
_PATIENCE = 0.5
# Steps of a stick from its centre to its end, and the keys that roll, pitch and yaw, up and down.
_FULL_STICK = 20
_LEAN_KEYS = (('d', 'a'), ('w', 's'), ('j', 'l'))
# What a slow robot keeps to is unitree_guide's [m/s], [m/s], [rad/s].
_SLOW = np.array(LIMITS['guide'])[[0, 2, 3]]
_UPRIGHT = (0, 0, 0)
STANDSTILL = (0.0, 0.0, 0.0)
# Where Move is heard: the robot stands, or is about to.
_LYING = (StateName.PASSIVE, StateName.LIE_DOWN)


class Motion:
    """
    Leads a robot to a state, moves it, leans it.

    `step` presses one key at a time, of those that lead to the goal. When a key or a velocity is
    refused, it gives up what it was asked for, and says so.
    """

    def __init__(self, robot: LegsRobot, say: Callable[[str], None]) -> None:
        self._robot, self._say = robot, say
        self._beat = Beat()
        self._alive = Watchdog(MOVE_TIMEOUT)
        self._asks = Watchdog(SILENCE)  # for a velocity, whether that counts or not
        self._is_ignored = False
        self.reset()

    def reset(self) -> None:
        """Be asked for nothing."""
        self.is_slow = False
        self.forget()

    def forget(self) -> None:
        """Ask for nothing any more; what moves is another's to stop."""
        self._goal: StateName | None = None
        self._pressed: tuple[StateName, str] | None = None
        self._waited = 0.0
        self._velocity: Velocity = STANDSTILL
        self._alive.reset()
        self._lean: tuple[int, ...] | None = None  # in steps of the sticks

    def disarm(self) -> None:
        """Ask for nothing, and ignore a Move that is asked for now until it has ended."""
        self.forget()
        self._is_ignored = self._asks.is_alive

    @property
    def is_moving(self) -> bool:
        """Whether a velocity is in force that is not zero."""
        return self._alive.is_alive and self._velocity != STANDSTILL

    @property
    def lies(self) -> bool:
        """Whether the robot lies, and is not about to stand."""
        return self._robot.coming_state in _LYING and self._goal in (None, *_LYING)

    def go(self, goal: StateName) -> None:
        """Lead the robot to a state; it stops moving."""
        self.halt()
        self._pressed = None
        self._aim_for(goal)
        self._lean = _UPRIGHT

    def _aim_for(self, goal: StateName) -> None:
        self._goal = goal if self._robot.coming_state != goal else None

    def move(self, velocity: Velocity) -> bool:
        """Move so [m/s], [m/s], [rad/s] for a while; return False where it lies or was stopped."""
        if any(velocity):
            self._asks.hear()
        else:
            self._end_asking()
        if self.lies or self._is_ignored:
            return False
        coming = self._robot.coming_state  # a network that walks is driven as it is
        self._aim_for(coming if coming in FOLLOWING else StateName.MOVE_BASE)
        if self.is_slow:
            vx, vy, yaw_rate = np.clip(velocity, -_SLOW, _SLOW).tolist()
            velocity = vx, vy, yaw_rate
        self._velocity = velocity
        self._alive.hear()
        return True

    def stop(self) -> None:
        """Stand still, in this instant, as a program asks for."""
        self._end_asking()
        self.halt()

    def _end_asking(self) -> None:
        self._asks.reset()
        self._is_ignored = False

    def halt(self) -> None:
        """Stand still until the next Move."""
        if self.is_moving:
            self._robot.drive(STANDSTILL)
        self._velocity = STANDSTILL
        self._alive.reset()

    def lean(self, roll: float, pitch: float, yaw: float) -> None:
        """Lean as a robot does that stands and balances [rad], as far as it can."""
        self.go(StateName.FREE_STAND)
        most = FULL_LEAN[:3]
        shares = np.clip((roll, pitch, yaw), -most, most) / most
        self._lean = tuple(round(_FULL_STICK * share) for share in shares.tolist())

    def choose_gait(self, name: str) -> None:
        """Step so, from the next steps on, by the key with the shorter way: each takes 1.5 ms."""
        gaits = tuple(GAITS)
        ahead = (gaits.index(name) - gaits.index(self._robot.gait)) % len(gaits)
        key, times = min(('n', ahead), ('N', len(gaits) - ahead), key=lambda way: way[1])
        for _ in range(times if ahead else 0):
            if not self._press(key):
                return

    def step(self, dt: float) -> None:
        """Press and command what is due, `dt` [s] after the step before."""
        self._waited += dt
        self._approach_goal()
        self._follow_lean()
        was_moving = self.is_moving
        self._alive.step(dt)
        if was_moving and not self._alive.is_alive:
            self._alive.hear()  # so that `halt` knows that it moves
            self.halt()
        self._asks.step(dt)
        self._is_ignored &= self._asks.is_alive
        due = self._beat.is_due(self._robot.time, MOVE_RATE)
        follows = self._robot.state in FOLLOWING
        if due and self._alive.is_alive and follows and not self._robot.drive(self._velocity):
            self._give_up()

    def _approach_goal(self) -> None:
        state, goal = self._robot.state, self._goal
        if goal is None or (state in SUCCESSORS and goal != StateName.PASSIVE):
            return
        if state != self._robot.coming_state:  # a key is about to act
            return
        if state == goal:
            self._goal = None
            return
        rises = state == StateName.FIXED_STAND and not self._robot.is_up
        if rises and goal != StateName.PASSIVE:
            return
        key = keys_between(state, goal)[0]
        if (state, key) == self._pressed and self._waited < _PATIENCE:
            return
        if self._press(key):
            self._pressed, self._waited = (state, key), 0.0
            # What ends by itself is over before anybody sees that it was reached.
            if len(keys_between(state, goal)) == 1 and goal in SUCCESSORS:
                self._goal = None

    def _follow_lean(self) -> None:
        if self._lean is None or self._robot.state != StateName.FREE_STAND:
            return
        sticks = self._robot.remote
        leant = sticks.lx, sticks.ly, -sticks.rx
        for (more, less), wanted, share in zip(_LEAN_KEYS, self._lean, leant, strict=True):
            missing = wanted - round(_FULL_STICK * share)
            for _ in range(abs(missing)):
                if not self._press(more if missing > 0 else less):
                    return

    def _press(self, key: str) -> bool:
        if self._robot.press(key):
            return True
        self._give_up()
        return False

    def _give_up(self) -> None:
        self.forget()
        self._say('sport: the robot was stopped, or others drive it: request ignored')
