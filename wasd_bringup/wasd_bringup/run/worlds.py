# SPDX-License-Identifier: Apache-2.0
"""Loads what the options name into one world, and makes the robots in it."""

import dataclasses

from mujoco_sim.robot_setup import randomise, RobotSetup, upright_setup, usual_setup
from mujoco_sim.sensors.table import has_camera
from mujoco_sim.simulation import Simulation
from mujoco_sim.world import build_shared_world, build_world, World
from robot_description.description import Description, load_robot
from robot_description.morphology.wheels import ANY_WHEELS
from wasd_core.loading import loading

from wasd_bringup.robots import HUMANOID, LEGGED, load_class, ROBOTS, WHEELED
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.robot import Robot


def build_robots(options: RunOptions, visuals: bool) -> list[Robot]:
    """
    Load what the options name into one world, each robot with its controller.

    Raises:
        UserError: an option is wrong; the text says how, in one line.
    """
    robots: list[Robot] = []
    for part, loaded, world in build_worlds(options, visuals):
        simulation = robots[0].simulation if robots else Simulation(world, options.speed)
        # Here, because the controllers of the other robots take a second to load.
        with loading(is_ours=False):
            make = load_class(ROBOTS[part.robot].kind.robot)
        robots.append(make(part, loaded, world, simulation))
    return robots


def build_worlds(
    options: RunOptions, visuals: bool
) -> list[tuple[RunOptions, Description, World]]:
    """
    Load what the options name into one world; return each robot's options and part of it.

    Raises:
        UserError: an option is wrong; the text says how, in one line.
    """
    parts = tuple(map(_with_files, options.per_robot()))
    loaded = [_load(part) for part in parts]
    setups = [_setup(part, robot) for part, robot in zip(parts, loaded, strict=True)]
    visuals = visuals or any(has_camera(robot.robot) for robot in loaded)
    boxes = [box.size for box in options.boxes]
    if len(parts) == 1:
        built = loaded[0]
        if parts[0].is_fake:
            built = dataclasses.replace(built, robot=built.robot.with_stand_in_masses())
        world = build_world(built, options.world, options.seed, setups[0], visuals, boxes)
        return [(parts[0], loaded[0], world)]
    prefixes = [f'{part.namespace}/' for part in parts]
    members = list(zip(prefixes, loaded, setups, strict=True))
    worlds = build_shared_world(members, options.world, options.seed, visuals, boxes)
    return list(zip(parts, loaded, worlds, strict=True))


def _with_files(options: RunOptions) -> RunOptions:
    if ROBOTS[options.robot].kind is not WHEELED or options.controller is None:
        return options
    # Here, because legs do without.
    from diff_drive_sim.controller_file import read_controller_file

    file = read_controller_file(str(options.controller))
    return dataclasses.replace(options, drive_file=file)


def _load(options: RunOptions) -> Description:
    file = options.drive_file
    return load_robot(
        options.description,
        options.package_path,
        options.xacro_arguments,
        options.strict,
        options.urdfs.get(options.namespace),
        wheels=file.parameters.wheel_choice() if file is not None else ANY_WHEELS,
    )


def _setup(options: RunOptions, loaded: Description) -> RobotSetup:
    if ROBOTS[options.robot].kind is HUMANOID:
        # Here, because few runs have a robot that stands by joints alone.
        from wasd_bringup.run.legged import standing_pose

        setup = upright_setup(loaded, standing_pose(loaded.robot), options.untold)
        return randomise(setup, options.seed, loaded)
    setup = usual_setup(loaded, options.estimator == 'kalman', options.untold)
    if ROBOTS[options.robot].kind is LEGGED:
        setup = randomise(setup, options.seed, loaded)
    place = ROBOTS[options.robot].place
    if not options.namespace or place is None:
        return setup
    return dataclasses.replace(setup, place=place)
