# SPDX-License-Identifier: Apache-2.0
"""A quadruped's legs without ROS: keys and velocities in, joint commands and odometry out."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
from robot_description.description import Description
from wasd_core.robot_io import BaseOdometry, BaseState, JointCommand, Reading
from wasd_core.signals import stop_requested
from wasd_core.timing import NO_PRESS, Notice

from quadruped_sim.compilation import compile_once, warm_up
from quadruped_sim.elevation import Elevation
from quadruped_sim.height_scan import known_scan
from quadruped_sim.keys import FOLLOWING, StateName, StickValues
from quadruped_sim.leg_controller import LegController
from quadruped_sim.parameters import LegNodeParameters
from quadruped_sim.robot_model import JointMap, RobotModel
from quadruped_sim.states.policy import Walker

# Not empty once this process has loaded what controllers compile.
_is_warm: list[bool] = []


class Legs:
    """
    The leg controller of one robot, with its settings and what it tells the driver.

    `control` steps it on readings whose joints come in any order. What the driver should know is
    in `notice`, whose time its owner lets pass; `on_said` hears each text once. `settings` follow
    the keys that choose a gait, or open and shut the eyes.
    """

    def __init__(
        self,
        description: Description,
        settings: LegNodeParameters | None = None,
        inform: Callable[[str], None] = lambda text: None,
        walker: Walker | None = None,
    ) -> None:
        """
        Take a robot, and compile its controller where that has not been done; `inform` is told.

        A `walker` walks in the state policy.

        Raises:
            UserError: the walker is another robot's.
            RobotModelError: the description is no quadruped that can be walked; says which file.
            Stopped: a signal came while the controller was being compiled.
        """
        self.base_frame = description.robot.base
        # Before anything else calls a compiled function; loading is no part of the first tick.
        self.model = compile_once(lambda: _warm_model(description), inform, stop_requested)
        self._walker = walker
        if getattr(walker, 'has_height_scan', False):
            cast(Any, walker).heights = self._heights_around
        self._terrain: Elevation | None = None
        self.notice = Notice()
        self.answers = True  # keys, in words; False for keys that nobody pressed
        self.on_said: Callable[[str], None] = lambda text: None
        self.configure(settings or LegNodeParameters())

    def configure(self, settings: LegNodeParameters) -> None:
        """Begin with settings, also with those that only hold from the start."""
        self.settings = settings
        self.controller = LegController(self.model, settings, settings.estimator, self._walker)
        self.controller.see(self._terrain)
        self.controller.eyes = settings.eyes
        self._names: tuple[tuple[str, ...], tuple[str, ...]] = (), ()
        self._state = self.controller.state
        self._refusal: str | None = None

    def tune(self, settings: LegNodeParameters) -> None:
        """Go on with other settings, from the next step."""
        if settings != self.settings:
            self.settings = settings
            self.controller.tune(settings)
            self.controller.eyes = settings.eyes

    @property
    def wants_map(self) -> bool:
        """Whether the legs, or the network that walks, use a map now."""
        walks_by_it = getattr(self._walker, 'heights', None) == self._heights_around
        return self.controller.eyes or walks_by_it

    def _heights_around(self) -> np.ndarray | None:
        """Return the height scan of now; None before there is a map or a pose."""
        robot, odometry = self.controller.robot, self.controller.odometry
        if self._terrain is None or robot is None or odometry is None:
            return None
        height = robot.height(self.model.geometry.foot_radius)
        return known_scan(self._terrain.at, odometry.position, odometry.orientation, height)

    def see(self, terrain: Elevation | None) -> None:
        """Take the map, in odometry's frame, that they walk by with their eyes open."""
        self._terrain = terrain
        self.controller.see(terrain)

    @property
    def state(self) -> str:
        """Name of the present state."""
        return self.controller.state

    @property
    def odometry(self) -> BaseOdometry | None:
        """Estimated pose and velocity of the base; None before the first reading."""
        return self.controller.odometry

    def press(self, key: str) -> None:
        """Take what came on `keys`: the sticks go by presses alone."""
        if not key.startswith(NO_PRESS):
            answer = self.controller.press(key)
            if self.answers:
                self.say(answer)
            self._follow_keys()

    def command(self, vx: float, vy: float, wz: float) -> None:
        """Take a velocity for the state move base [m/s], [m/s], [rad/s]."""
        refusal = self.controller.set_velocity(vx, vy, wz)
        # Once: commands come twenty times a second, and would hide the answers to keys.
        if refusal is not None and refusal != self._refusal:
            self.say(refusal)
        self._refusal = refusal

    def control(
        self,
        reading: Reading,
        joint_names: tuple[str, ...],
        motor_names: tuple[str, ...],
        dt: float,
        truth: BaseState | None = None,
    ) -> JointCommand:
        """Return the motors' command for a reading `dt` [s] after the one before."""
        if (joint_names, motor_names) != self._names:
            self._names = joint_names, motor_names
            self._joints = JointMap(self.model.quadruped, joint_names, motor_names)
        controller = self.controller
        command = controller.step(self._joints.reading(reading), dt, truth)
        if remark := controller.take_remark():
            self.say(remark)
        if (state := controller.state) != self._state:
            self._state = state
            if self.controller.event is not None and self._state == StateName.PASSIVE:
                self._say_event(self.controller.event)
        return self._joints.command(command)

    def e_stop(self, why: str = 'emergency stop') -> None:
        """Go passive at once, and say so, also where they were."""
        self.controller.e_stop(why)
        self._say_event(why)

    def reset(self) -> None:
        """Forget the past: passive, in the gait of the start, with nothing said."""
        self.controller.reset()
        self._follow_keys()
        self.notice.say(None)

    def forget_velocity(self) -> bool:
        """Follow the last velocity no more; return whether it was moving the robot."""
        asked = self.controller.command_filter
        was_driven = self.state in FOLLOWING and not asked.is_silent
        asked.forget_request()
        return was_driven

    def centre_sticks(self) -> bool:
        """Centre the sticks; return whether they were off the centre."""
        were_held = self.controller.sticks.pressed != StickValues()
        self.controller.sticks.zero()
        return were_held

    def say(self, text: str | None) -> None:
        """Tell the driver a text, or that there is nothing to tell."""
        if self.notice.say(text) and text:
            self.on_said(text)

    def _follow_keys(self) -> None:
        if self.controller.eyes != self.settings.eyes:
            self.settings = replace(self.settings, eyes=self.controller.eyes)
        if self.controller.gait != self.settings.gait.name:
            gait = replace(self.settings.gait, name=self.controller.gait)
            self.settings = replace(self.settings, gait=gait)

    def _say_event(self, event: str) -> None:
        legs = self.controller
        self.say(legs.words.to_event(event, legs.is_fallen, legs.obstacle))


def _warm_model(description: Description) -> RobotModel:
    """Return the model of a robot, with all loaded that its controller compiles."""
    model = RobotModel(description)
    if not _is_warm:  # one robot's functions are another's
        warm_up(model)
        _is_warm.append(True)
    return model
