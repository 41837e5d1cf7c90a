# SPDX-License-Identifier: Apache-2.0
"""
The Go2 as a Gymnasium environment, for those who train; needs the extra `gym`.

    import gymnasium
    import wasd.environment

    env = gymnasium.make('wasd/Go2-v0', world='rough:0.05', randomise=0.5)
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
"""

from dataclasses import replace
from functools import partial
import math
import os
from typing import Any

import gymnasium
from mujoco_sim.parameters import Untold
from mujoco_sim.robot_setup import foot_links, usual_setup
from mujoco_sim.robot_setup import randomise as draw
from mujoco_sim.sensors.camera import Frustum, Offscreen
from mujoco_sim.sensors.heights import true_heights
from mujoco_sim.world import build_world, FALL_TILT, LONG_STEP
import numpy as np
from policy_player.observations import Observer
from policy_player.spec import PolicySpec, Term
from quadruped_sim.height_scan import height_scan
from quadruped_sim.leg_kinematics import LEGS
from robot_description.description import Description, load_robot
from wasd_core.arguments import check, checked
from wasd_core.errors import suggest, UserError
from wasd_core.parameters import shown
from wasd_core.robot_io import JointCommand, Senses
from wasd_core.rotations import Pose, rpy_matrix

NAME = 'wasd/Go2-v0'
DEFAULT = (0.0, 0.8, -1.6) * 4
# What a network that is trained here is played with: 45 numbers, 50 Hz.
SPEC = PolicySpec(
    source=NAME,
    joints=tuple(f'{leg}_{part}_joint' for leg in LEGS for part in ('hip', 'thigh', 'calf')),
    stiffness=(40.0,) * 12,
    damping=(1.0,) * 12,
    default_position=DEFAULT,
    action_scale=(0.5,) * 12,
    action_offset=DEFAULT,
    terms=(
        Term(name='angular_velocity', scale=(0.25,)),
        Term(name='gravity'),
        Term(name='command'),
        Term(name='joint_position'),
        Term(name='joint_velocity', scale=(0.05,)),
        Term(name='last_action'),
    ),
    action_clip=((-1.0,) * 12, (1.0,) * 12),
    observation_clip=100.0,
    ranges=((-0.5, 1.0), (-0.3, 0.3), (-1.0, 1.0)),
)
# What is commanded, and an action.
Command = tuple[float, float, float]
ACTION: Any = tuple[(float,) * 12]  # type: ignore[misc]
# The same with the heights around the robot.
WITH_HEIGHTS = replace(SPEC, terms=(*SPEC.terms, Term(name='height_scan', clip=(-1.0, 1.0))))
# The base above the floor as it begins, and so low it has fallen [m].
START_HEIGHT, LOW = 0.29, 0.14
# Physics may step by so much [s], the last unless told. A command's delay of 2 ms is a whole
# number of the first two; with the last, the steps around that moment are half as long.
PHYSICS_STEPS = (0.001, 0.002, 0.004)
LONGEST_TIME_STEP = PHYSICS_STEPS[-1] / LONG_STEP
# Episodes end after so many steps: 20 s.
LONGEST = 1000
# How sharply the reward falls with an error of velocity [m^2/s^2], and its other weights.
SHARPNESS, EFFORT, JERK, TILT = 0.25, 2e-5, 0.02, 0.5
# What its terms do not show.
STILL = np.zeros(3)
# Pictures [pixels]: the robot from so far away [m], from ahead on its right and above.
SIZE, DISTANCE, VIEW = (640, 480), 1.8, rpy_matrix(0.0, math.radians(20.0), math.radians(130.0))
FRUSTUM = Frustum(math.radians(58.0), *SIZE, 0.05, 100.0)


class Go2Environment(gymnasium.Env[np.ndarray, np.ndarray], gymnasium.utils.EzPickle):
    """
    A Go2 that is to follow a velocity command; one step is 20 ms.

    The observation is that of `SPEC`, from sensors with noise and drift; actions are offsets of
    the joints from the default pose, in [-1, 1] of half a radian, and motors have the robot's
    limits and delay. The reward is 1 for what is asked, less with the error of velocity, effort,
    jerk and tilt. An episode ends with a fall. `info['truth']` is the base as physics knows it.

    With `heights` the observation ends with the true heights around it, as `WITH_HEIGHTS` says.
    `world` is as in `wasd.Go2`. `randomise` from 0 to 1 is how much each episode's robot differs
    at random. `noise` False makes sensors tell the truth. `command` (3,) holds in every episode;
    without one it is drawn. `physics_step` [s] is 0.004, as in MuJoCo Playground; or 0.002, as in
    `wasd.Go2` while a network walks; or 0.001, as when it does not.

    Raises:
        UserError: what is wrong with an argument, in one line.
    """

    metadata: dict[str, Any] = {'render_modes': ['rgb_array'], 'render_fps': 50}

    @checked
    def __init__(
        self,
        world: str | os.PathLike[str] = 'flat',
        *,
        randomise: float = 0.0,
        noise: bool = True,
        heights: bool = False,
        command: Command | None = None,
        physics_step: float = PHYSICS_STEPS[-1],
        render_mode: str | None = None,
    ) -> None:
        if physics_step not in PHYSICS_STEPS:
            wanted = ', '.join(map(str, PHYSICS_STEPS[:-1]))
            raise UserError(
                f'physics_step: got {physics_step!r}, wanted {wanted} or {PHYSICS_STEPS[-1]}'
            )
        if render_mode not in (None, 'rgb_array'):
            raise UserError(f'render_mode: got {render_mode!r}, wanted rgb_array or None')
        # A copy is made anew, as MuJoCo's buffers cannot be copied with what looks into them.
        gymnasium.utils.EzPickle.__init__(
            self,
            world,
            randomise=randomise,
            noise=noise,
            heights=heights,
            command=command,
            physics_step=physics_step,
            render_mode=render_mode,
        )
        self.render_mode = render_mode
        self._world_name, self._noise, self._level = os.fspath(world), noise, randomise
        self._has_heights = heights
        self._physics_step = physics_step
        self._given = None if command is None else np.array(command, float)
        self._loaded: Description = load_robot('go2')
        self.policy = WITH_HEIGHTS if heights else SPEC
        self._observer = Observer(self.policy)
        self._low, self._high = np.array(SPEC.ranges).T
        most = SPEC.observation_clip
        self.observation_space = gymnasium.spaces.Box(
            -most, most, (self.policy.width,), np.float32
        )
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (12,), np.float32)
        self._build(0)
        self._has_begun = False
        self._picture: Offscreen | None = None

    @checked
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """
        Begin an episode; `options` may have a `command`, (3,).

        Raises:
            UserError: what is wrong with an argument, in one line.
        """
        for name in options or ():
            if name != 'command':
                hint = suggest(str(name), ['command'])
                raise UserError(f'reset: unknown option {shown(name)}{hint}')
        given = (options or {}).get('command', self._given)
        check('reset: command', given, Command | None)
        if seed is not None and seed < 0:
            raise UserError(f'reset: seed: got {seed}, wanted a whole number >= 0 or None')
        super().reset(seed=None if seed is None else int(seed))
        drawn = int(self.np_random.integers(2**31))
        if self._level > 0.0:
            self._build(drawn)
        self._world.seed = drawn
        self._world.reset()
        self._world.actuation.allows_long_steps = self._physics_step > LONGEST_TIME_STEP
        self._observer.reset()
        command = self.np_random.uniform(self._low, self._high) if given is None else given
        self._command = np.array(command, float)
        self._action, self._has_begun = np.zeros(12), True
        return self._observe(), {'truth': self._world.base(), 'command': self._command.copy()}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """
        Hold joint targets for 20 ms.

        Raises:
            UserError: the action is not twelve finite numbers, or no episode has begun.
        """
        if not _is_plain(action):
            check('step: action', action, ACTION)
        if not self._has_begun:
            raise UserError('step: no episode has begun, call reset first')
        before = self._action
        self._action = np.minimum(np.maximum(np.asarray(action, float), -1.0), 1.0)
        position = (self._default + self._scale * self._action)[self._motors]
        self._world.apply(JointCommand(position, *self._others))
        late = self._world.sensor_delay
        self._world.step(self._steps - late)
        if late:
            self._world.read()  # the reading of the observation at the end, `late` ticks old
            self._world.step(late)
        truth = self._world.base()
        tilt = truth.tilt
        # The base over the lowest foot, about; all this is faster in plain numbers than by numpy.
        lowest: float = min(self._world.data.geom_xpos[self._feet, 2].tolist())
        has_fallen = tilt > FALL_TILT or float(truth.position[2]) - lowest < LOW
        off = math.dist(truth.planar_velocity.tolist(), self._command.tolist())
        effort, change = self._world.effort(), self._action - before
        strain = EFFORT * float(np.vdot(effort, effort)) + JERK * float(np.vdot(change, change))
        reward = math.exp(-(off**2) / SHARPNESS) - strain - TILT * tilt**2
        info = {'truth': truth, 'command': self._command.copy()}
        return self._observe(), reward, bool(has_fallen), False, info

    def render(self) -> np.ndarray | None:
        """Return a picture (480, 640, 3) of the robot, with `render_mode` rgb_array."""
        if self.render_mode is None:
            return None
        if self._picture is None:
            self._picture = Offscreen(self._world, *SIZE)
        eye = Pose(self._world.base().position - DISTANCE * VIEW[:, 0], VIEW)
        self._picture.look(self._world.data, eye, FRUSTUM, SIZE)
        return self._picture.colours()

    def close(self) -> None:
        """Let the pictures' renderer go."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _build(self, seed: int) -> None:
        """Make the robot of an episode."""
        untold = Untold(randomise=self._level)
        setup = draw(usual_setup(self._loaded, self._noise, untold), seed, self._loaded)
        stance = dict(zip(SPEC.joints, DEFAULT, strict=True))
        self._world = world = build_world(
            self._loaded,
            self._world_name,
            setup=replace(setup, joint_positions=stance, height=START_HEIGHT),
            visuals=self.render_mode is not None,
            time_step=min(self._physics_step, LONGEST_TIME_STEP),
        )
        joints = list(SPEC.joints)
        self._joints = np.array([world.joint_names.index(name) for name in joints])
        self._motors = np.array([joints.index(name) for name in world.motor_names])
        feet = foot_links(self._loaded)
        self._feet = np.flatnonzero([link in feet for link in world.parts.link_of_geom])
        self._steps = round(SPEC.period / world.time_step)
        self._default, self._scale = np.array(DEFAULT), np.array(SPEC.action_scale)
        gains = np.array((SPEC.stiffness, SPEC.damping))[:, self._motors]
        # Velocity, effort, kp and kd of each command.
        self._others = (*np.zeros((2, 12)), *gains)

    def _observe(self) -> np.ndarray:
        joints, imu = self._world.read()
        assert imu is not None  # a Go2 has one
        position, velocity = (part[self._joints] for part in joints[:2])
        senses = Senses(imu.orientation, imu.angular_velocity, STILL, position, velocity)
        return self._observer.step(senses, self._command, self._action, self._heights())

    def _heights(self) -> np.ndarray | None:
        """Return the true height scan [m], as low as it may be where nothing is below."""
        if not self._has_heights:
            return None
        base = self._world.base()
        heights = partial(true_heights, self._world)
        seen = height_scan(heights, base.position, float(base.rpy[2]))
        return np.where(np.isnan(seen), 1.0, seen)


def _is_plain(action: Any) -> bool:
    """Whether it is an array of twelve finite numbers, as most are; tells it fast."""
    return (
        isinstance(action, np.ndarray)
        and action.shape == (12,)
        and action.dtype.kind == 'f'
        and math.isfinite(np.vdot(action, action))
    )


if NAME not in gymnasium.registry:
    gymnasium.register(
        id=NAME, entry_point='wasd.environment:Go2Environment', max_episode_steps=LONGEST
    )
