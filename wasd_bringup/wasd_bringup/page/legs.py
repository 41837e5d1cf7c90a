# SPDX-License-Identifier: Apache-2.0
"""A quadruped in the cockpit: its states as buttons, the stick by the keys of its sticks."""

import numpy as np
from quadruped_sim.keys import (
    EYES_KEY,
    GAIT_KEYS,
    StateName,
    STEP,
    STICK_KEYS,
    StickValues,
    ZERO_KEYS,
)
from quadruped_sim.leg_kinematics import LEGS
from quadruped_sim.presets import GAITS
from quadruped_sim.robot_state import RobotState
from wasd_cockpit.link import Elevation, KeyCap, Marks, PlanarPose, Setting, Stick, StickUse
from wasd_core.rotations import matrix_from_quaternion, yaw_of

from wasd_bringup.page.robot_view import Motion, RobotView
from wasd_bringup.run.go2 import Go2

# The page is shown the elevation five times a second: once in so many clouds.
CLOUDS_EACH = 3
NO_GAIT_KEYS = "the keys for gaits are the preset's: ros2 param set gait"


class LegsView(RobotView):
    """A quadruped's leg controller."""

    def __init__(self, robot: Go2) -> None:
        super().__init__(robot)
        self._controller = robot.legs.controller
        self.feet = LEGS
        self._shown: Elevation | None = None  # of the map
        if robot.elevation.mapper is not None:
            self.no_elevation = ''
            robot.elevation.wanted_by.append(lambda: self.is_looked_at())

    def settings(self) -> tuple[Setting, ...]:
        """Return what is chosen."""
        refusal = '' if self._gait_keys else NO_GAIT_KEYS
        return (Setting('gait', tuple(GAITS), self._controller.gait, refusal),)

    @property
    def _gait_keys(self) -> dict[str, int]:
        """The keys that choose a gait here, each so many steps on in the table."""
        words = self._controller.words
        return {key: by for key, by in GAIT_KEYS.items() if words.is_for_legs(key)}

    def keys_to_choose(self, setting: str, option: str) -> tuple[str, ...]:
        """Return the keys that choose a gait."""
        gaits, keys = tuple(GAITS), self._gait_keys
        if setting != 'gait' or option not in gaits or not keys:
            return ()
        onward = gaits.index(option) - gaits.index(self._controller.gait)
        # The shorter way round.
        steps, key = min((by * onward % len(gaits), key) for key, by in keys.items())
        return steps * (self._robot.named(key),)

    def keys(self) -> tuple[KeyCap, ...]:
        """Return the keymap."""
        states = super().keys()
        if self._robot.logic is not None:
            return states
        sticks = tuple(
            KeyCap(self._robot.named(key), f'stick {axis} {direction:+d}')
            for key, (axis, direction) in STICK_KEYS.items()
        )
        gaits = tuple(
            KeyCap(self._robot.named(key), 'next gait' if by > 0 else 'gait before')
            for key, by in GAIT_KEYS.items()
        )
        eyes = KeyCap(self._robot.named(EYES_KEY), 'eyes')
        return (*states, *sticks, KeyCap(ZERO_KEYS[0], 'sticks centred'), *gaits, eyes)

    def stick_use(self) -> StickUse:
        """Return what the stick does now."""
        controller, state = self._controller, self._controller.state
        limits = controller.command_filter.limits
        full = (limits.forward, limits.lateral, limits.yaw)
        if state == StateName.POLICY:
            return StickUse(full, 'drives the policy', backward=limits.backward)
        if state == StateName.MOVE_BASE or state == StateName.TROTTING:
            words = f'drives, gait {controller.gait}'
            return StickUse(full, words, backward=limits.backward)
        wanted = controller.words.drive
        words = 'moves the body' if state not in (StateName.PASSIVE, StateName.FIXED_STAND) else ''
        return StickUse((0.0, 0.0, 0.0), words or f'drives in {wanted.value}')

    def stick_keys(self, stick: Stick) -> tuple[str, ...] | None:
        """Return the keys that bring the sticks there, None where velocities drive."""
        if self._controller.state == StateName.MOVE_BASE or self._robot.logic is not None:
            return None
        if self._controller.lies_fallen:
            return ()  # they would be asked for again and again, and never get there
        now = self._controller.sticks.pressed
        if stick == Stick():
            return () if now == StickValues() else (ZERO_KEYS[0],)
        wanted = {'ly': stick.forward, 'lx': -stick.left, 'rx': -stick.turn}
        keys: list[str] = []
        for key, (axis, direction) in STICK_KEYS.items():
            if axis in wanted:
                steps = round(wanted[axis] / STEP) - round(getattr(now, axis) / STEP)
                keys += max(0, direction * steps) * [self._robot.named(key)]
        return tuple(keys)

    def motion(self) -> Motion:
        """Return this instant for the plots."""
        controller = self._controller
        odometry, robot = controller.odometry, controller.robot
        if odometry is None or robot is None:
            none = np.zeros(4)
            return Motion(np.zeros(3), np.zeros(3), none, none)
        vx, vy, _ = odometry.linear_velocity
        measured = (vx, vy, odometry.angular_velocity[2])
        stances = controller.locomotion.is_stance
        return Motion(self._robot.commanded(), measured, robot.normal_forces, stances)

    def marks(self, place: np.ndarray, rotation: np.ndarray) -> Marks:
        """Return what is drawn beside the robot."""
        controller = self._controller
        odometry, robot = controller.odometry, controller.robot
        size = controller.model.scale.of('m')
        if odometry is None or robot is None:
            return Marks(place=place, rotation=rotation, size=0.4 * size)
        # Forces and feet are known in the base's axes: the estimate's error is not theirs.
        feet = robot.motion.position @ rotation.T + place
        start = (*self._robot.start, 0.0)
        motion = self.motion()
        return Marks(
            place=place,
            rotation=rotation,
            command=motion.command,
            measured=motion.odometry,
            estimate=odometry.position + start,
            estimated_rotation=matrix_from_quaternion(odometry.orientation),
            footholds=self._footholds(robot, place, rotation),
            feet=feet,
            forces=robot.forces @ rotation.T * robot.is_contact[:, None],
            size=0.4 * size,
            height=float(feet[:, 2].min()) - controller.model.geometry.foot_radius,
        )

    def _footholds(
        self, robot: RobotState, place: np.ndarray, rotation: np.ndarray
    ) -> np.ndarray | None:
        """Return where the feet that swing are to land, beside a robot that is there."""
        locomotion = self._controller.locomotion
        if not locomotion.gait.is_stepping:
            return None
        aims = locomotion.landing[~locomotion.is_stance]
        # They are where the controller believes the ground to be; its error is the same as ours.
        return np.asarray((aims - robot.base.position) @ robot.base.R @ rotation.T + place)

    def elevation(self) -> Elevation | None:
        """Return the heights around it, and where its feet are and will be."""
        controller, mapped = self._controller, self._robot.elevation
        mapper, odometry, robot = mapped.mapper, controller.odometry, controller.robot
        if mapped.mapped_at > self._robot.world.time:  # none, or from before a reset
            self._shown = None
        elif mapper and (self._shown is None or mapped.clouds >= self._shown.number + CLOUDS_EACH):
            x, y = mapper.elevation.corner.tolist()
            heights, resolution = mapper.elevation.heights(), mapper.elevation.resolution
            self._shown = Elevation(mapped.clouds, heights, resolution, (x, y))
        if self._shown is None or odometry is None or robot is None:
            return None
        x, y, _ = odometry.position.tolist()
        yaw = yaw_of(odometry.orientation)
        locomotion = controller.locomotion
        is_landing = ~locomotion.is_stance & locomotion.gait.is_stepping
        return self._shown._replace(
            pose=PlanarPose(x, y, yaw),
            feet=robot.feet[:, :2].copy(),
            footholds=locomotion.landing[is_landing, :2],
        )
