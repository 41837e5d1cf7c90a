# SPDX-License-Identifier: Apache-2.0
"""
A quadruped's run in this process, without ROS: the samples that `wasd go2` reports, and more.

What happens in one instant, and in which order, is what a session does: pushes, keys, velocities
at 20 Hz, the controller at 500 Hz, samples at 50 Hz.
"""

from dataclasses import replace
import functools
import math
from typing import Any, NamedTuple

import mujoco
from mujoco_sim.parameters import Payload, Untold
from mujoco_sim.robot_setup import randomise, RobotSetup, usual_setup
from mujoco_sim.simulation import Simulation, TickStatistics
from mujoco_sim.world import build_world, World
import numpy as np
from quadruped_sim.compilation import warm_up
from quadruped_sim.leg_controller import LegController
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import JointMap, RobotModel
from robot_description.description import Description, load_robot
from robot_description.morphology.quadruped import scale_of
from robot_description.mujoco.builder import lowest_geom_point
from robot_description.robot import Joint
from teleop_keyboard.key_script import parse_key_script
from wasd_bringup.run.inputs import parse_push, parse_twist_script, Player, TwistPlayer
from wasd_bringup.run.report import build_report, Recorder, Sample, SAMPLE_PERIOD, TrunkWatch
from wasd_core.rotations import yaw_of
from wasd_core.timing import TWIST_RATE

CONTROL = 0.002  # period of the leg controller [s]
DRIVEN = ('trotting', 'move base')
# A robot that begins anyhow is let fall from so far above the ground [m].
DROP = 0.02
# Poses in which a link is so far in another [m], of a Go2, are drawn again, at most so often.
CUT, DRAWS = 0.01, 100
# How far from its place the ground is looked at, and in how many steps each way [m].
FOOTPRINT, LOOKS = 0.5, 5


class Felt(NamedTuple):
    """What a report does not tell: at each sample, and of each foot that comes down."""

    height: np.ndarray  # of odometry [m], (n,)
    energy: (
        np.ndarray
    )  # that motors have turned over since the start, sum |torque x speed| [J], (n,)
    clearance: np.ndarray  # of the base over the highest foot [m], (n,)
    lowest: np.ndarray  # height of the lowest foot's underside [m], (n,)
    falls: np.ndarray  # how many until then, (n,)
    touchdowns: np.ndarray  # time [s] and speed of the foot then [m/s], (m, 2)
    mass: float  # of the robot as it is described [kg]


class Walk:
    """One run, from `Run` of trials.py; `report` runs it to its end."""

    def __init__(self, run: Any) -> None:
        loaded, model = load(run.description or 'go2')
        self._run = run
        self._world = build(run, loaded)
        self._parameters = parameters_of(run)
        self._controller = LegController(model, self._parameters, run.estimator)
        names = self._world.joint_names, self._world.motor_names
        self._joints = JointMap(model.quadruped, *names)
        self._feet = Feet(self._world, model.quadruped.feet)
        self._touching = (*model.quadruped.feet, *model.quadruped.trunk)
        self._trunk = TrunkWatch()
        self._recorder = Recorder(self._world)
        self._pushes = Player([parse_push(text) for text in run.push.split(';') if text])
        self._keys = Player(parse_key_script(run.keys, 'keys'))
        self._tunes = list(run.tunes)
        self._twists = TwistPlayer(parse_twist_script(run.twist, 'twist'), self._drive)
        self._energy = 0.0
        self._mass = model.mass
        self._felt: list[tuple[float, ...]] = []

    def report(self) -> tuple[dict[str, Any], Felt]:
        """Run it; return the report as `wasd go2` writes it, and what that does not tell."""
        run, world = self._run, self._world
        simulation = Simulation(world, speed=0.0)
        schedule = simulation.schedule
        schedule.every(CONTROL, self._begin_instant)
        if run.twist:
            schedule.every(1.0 / TWIST_RATE, lambda: self._twists.step(world.time))
        schedule.every(CONTROL, self._control)
        schedule.every(SAMPLE_PERIOD, self._sample)
        simulation.advance(round(run.duration / world.time_step))
        asked = {'world': run.world, 'seed': run.seed, 'estimator': run.estimator}
        ticks = TickStatistics(CONTROL).summary()
        report = build_report(self._recorder, asked, world.time, 0.0, ticks)
        report['samples'] = dict(report['samples'])
        height, energy, clearance, lowest, falls = np.array(self._felt).reshape(-1, 5).T
        return report, Felt(
            height, energy, clearance, lowest, falls, self._feet.touchdowns(), self._mass
        )

    def _begin_instant(self) -> None:
        for push in self._pushes.due(self._world.time):
            self._world.push(push.force, push.duration, push.point)
        for press in self._keys.due(self._world.time):
            self._controller.press(press.key)
        while self._tunes and self._tunes[0][0] <= self._world.time + 1e-9:
            _, name, value = self._tunes.pop(0)
            self._parameters = self._parameters.changed({name: value})
            self._controller.tune(self._parameters)

    def _drive(self, velocity: tuple[float, float, float]) -> None:
        self._controller.set_velocity(*velocity)

    def _control(self) -> None:
        world = self._world
        joints = world.joints()
        self._energy += CONTROL * float(np.abs(joints.effort * joints.velocity).sum())
        self._feet.look(world.time)
        reading = self._joints.reading(world.read())
        truth = world.base_since_start() if self._run.estimator == 'truth' else None
        world.apply(self._joints.command(self._controller.step(reading, CONTROL, truth)))

    def _sample(self) -> None:
        controller = self._controller
        state, odometry = controller.state, controller.odometry
        assert odometry is not None
        x, y, z = map(float, odometry.position)
        yaw = yaw_of(odometry.orientation)
        vx = vy = wz = 0.0
        if state in DRIVEN:
            vx, vy, wz = map(float, controller.command_filter.command)
        forces = self._world.contact_forces(self._touching)
        touching = (forces > 0.0).astype(int).tolist()
        is_down = self._trunk.is_down(
            any(touching[4:]) or controller.is_fallen, state, controller.event
        )
        self._recorder.sample(Sample(state, (vx, vy, wz), (x, y, yaw), touching[:4], is_down))
        feet, base = self._feet.heights(), float(self._world.base().position[2])
        told = z, self._energy, base - max(feet), min(feet), self._recorder.falls
        self._felt.append(told)


class Feet:
    """Notes how fast the feet of a robot are when they come down."""

    def __init__(self, world: World, feet: tuple[str, ...]) -> None:
        self._world, self._names = world, feet
        links = world.parts.link_of_geom
        self._geoms = [next(i for i, link in enumerate(links) if link == foot) for foot in feet]
        self._was_down = np.ones(len(feet), bool)
        self._speeds = np.zeros(len(feet))
        self._found: list[tuple[float, float]] = []

    def look(self, time: float) -> None:
        """Look at them at a time [s]; what counts is the speed one look before the contact."""
        is_down = self._world.contact_forces(self._names) > 0.0
        for foot in np.flatnonzero(is_down & ~self._was_down):
            self._found.append((time, float(self._speeds[foot])))
        self._was_down = is_down
        model, data, velocity = self._world.model, self._world.data, np.zeros(6)
        for index, geom in enumerate(self._geoms):
            kind = mujoco.mjtObj.mjOBJ_GEOM
            mujoco.mj_objectVelocity(model, data, kind, geom, velocity, 0)
            self._speeds[index] = np.linalg.norm(velocity[3:])

    def heights(self) -> list[float]:
        """Return how high the underside of each foot is [m]."""
        model, data = self._world.model, self._world.data
        return [float(data.geom_xpos[geom, 2] - model.geom_rbound[geom]) for geom in self._geoms]

    def touchdowns(self) -> np.ndarray:
        """Return time [s] and speed [m/s] of each, shape (m, 2)."""
        return np.array(self._found).reshape(-1, 2)


@functools.cache
def load(name: str) -> tuple[Description, RobotModel]:
    """Return a robot's description and its model, with all compiled that its controller needs."""
    loaded = load_robot(name)
    model = RobotModel(loaded)
    warm_up(model)
    return loaded, model


def build(run: Any, loaded: Description) -> World:
    """Return the world of a run with its robot at the start."""
    payload = Payload.parse(run.payload) if run.payload else None
    untold = Untold(friction=run.friction, payload=payload, randomise=run.randomise)
    setup = usual_setup(loaded, run.estimator == 'kalman', untold)
    setup = randomise(setup, run.seed, loaded)
    if run.tumbled is None:
        return build_world(loaded, run.world, run.seed, setup)
    for turn in range(DRAWS):
        world = build_world(loaded, run.world, run.seed, tumbled(run, loaded, setup, turn))
        if not _cuts_itself(world, CUT * scale_of(loaded.quadruped).length):
            break
    _tumble(world, run.seed)
    return world


def parameters_of(run: Any) -> LegControllerParameters:
    """Return the controller's usual parameters with those of a run."""
    parameters = LegControllerParameters()
    for name, value in run.parameters:
        group, _, field = name.rpartition('.')
        if group:
            parameters = replace(
                parameters, **{group: replace(getattr(parameters, group), **{field: value})}
            )
        else:
            parameters = replace(parameters, **{field: value})
    return parameters


def tumbled(run: Any, loaded: Description, setup: RobotSetup, turn: int = 0) -> RobotSetup:
    """Return a setup with joints anyhow within their limits, at the place that the run says."""
    random = np.random.default_rng((run.seed, 1, turn) if turn else (run.seed, 1))
    positions = {
        joint.name: float(random.uniform(*_range(joint))) for joint in loaded.quadruped.joints
    }
    return replace(setup, joint_positions=positions, place=(run.tumbled, 0.0))


def _range(joint: Joint) -> tuple[float, float]:
    """Return between what a joint can be anywhere [rad]: a turn, where nothing stops it."""
    if math.isfinite(joint.upper):
        return joint.lower, joint.upper
    return -math.pi, math.pi


def _cuts_itself(world: World, depth: float) -> bool:
    """Whether links are in each other by more than a depth [m], as none of a robot can be."""
    model, data = world.model, world.data
    return any(
        contact.dist < -depth and model.geom_bodyid[contact.geom].min() > 0
        for contact in data.contact
    )


def _tumble(world: World, seed: int) -> None:
    """Turn the base anyhow, evenly over all orientations, and put it just above the ground."""
    pose = world.data.qpos[world.parts.pose]
    quaternion = np.random.default_rng((seed, 2)).normal(size=4)
    pose[3:] = quaternion / np.linalg.norm(quaternion)
    ground = max(
        height_of_ground(world, pose[0] + x, pose[1] + y)
        for x in np.linspace(-FOOTPRINT, FOOTPRINT, LOOKS)
        for y in np.linspace(-FOOTPRINT, FOOTPRINT, LOOKS)
    )
    pose[2] = 5.0
    pose[2] += DROP + ground - lowest_geom_point(world.model, world.data, world.root)
    mujoco.mj_forward(world.model, world.data)


def height_of_ground(world: World, x: float, y: float) -> float:
    """Return how high the ground is [m], whatever stands on it."""
    geom = np.zeros(1, np.int32)
    pose = world.data.qpos[world.parts.pose].copy()
    world.data.qpos[world.parts.pose][2] = 50.0
    mujoco.mj_kinematics(world.model, world.data)
    above, down = np.array((x, y, 5.0)), np.array((0.0, 0.0, -1.0))
    distance = mujoco.mj_ray(world.model, world.data, above, down, None, 1, -1, geom)
    world.data.qpos[world.parts.pose] = pose
    return 5.0 - float(distance)
