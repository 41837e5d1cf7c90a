# SPDX-License-Identifier: Apache-2.0
"""Compiles the leg controller in a process of its own, so that a user who waits can leave."""

from collections.abc import Callable
import contextlib
import subprocess
import sys
import time
from typing import TypeVar

import numpy as np
from wasd_core.errors import Stopped
from wasd_core.jit import before_each_compilation
from wasd_core.robot_io import GRAVITY, ImuReading, JointStates, Reading
from wasd_core.streams import offer

from quadruped_sim.elevation import Elevation
from quadruped_sim.leg_controller import LegController
from quadruped_sim.leg_kinematics import all_leg_angles, foot_positions
from quadruped_sim.locomotion.feedback import pd_law, rotation_error
from quadruped_sim.locomotion.swing import foot_velocities
from quadruped_sim.parameters import LegControllerParameters
from quadruped_sim.robot_model import RobotModel
from quadruped_sim.tuning import GaitParameters

NOTICE = 'compiling, once: the leg controller, which takes up to a minute of a core'
# How long a stop may go unnoticed while the other process compiles [s].
PERIOD = 0.05
# -P: nothing is imported from the current folder, which a stranger may have written to.
COMPILE = (sys.executable, '-P', '-m', 'quadruped_sim')

Result = TypeVar('Result')


class _NotCompiled(Exception):
    """A function is not in the cache."""


def compile_once(
    use: Callable[[], Result],
    say: Callable[[str], None],
    is_stopped: Callable[[], bool] = lambda: False,
) -> Result:
    """
    Return what `use` does, which calls all that the controller compiles; `say` hears before it.

    What is in numba's cache is loaded. Otherwise another process fills the cache first, and is
    ended when `is_stopped` says so. Where no cache can be written this process compiles.

    Raises:
        Stopped: `is_stopped` said so.
    """
    with contextlib.suppress(_NotCompiled), before_each_compilation(_refuse):
        return use()
    say(NOTICE)
    _compile_elsewhere(is_stopped)

    def look() -> None:
        if is_stopped():
            raise Stopped

    with before_each_compilation(look):
        return use()


def _refuse() -> None:
    raise _NotCompiled


def _compile_elsewhere(is_stopped: Callable[[], bool]) -> None:
    # Its own session: Ctrl-C is for us, who then end it.
    process = subprocess.Popen(
        COMPILE,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    began = time.monotonic()
    shows = sys.stderr.isatty()
    try:
        while True:
            if is_stopped():
                raise Stopped
            if shows:
                offer(sys.stderr, f'\r{time.monotonic() - began:.0f} s ')
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(PERIOD)
                return
    finally:
        if shows:
            offer(sys.stderr, '\r\033[K')
        process.kill()
        process.wait()


def warm_up(model: RobotModel) -> None:
    """
    Run a controller for a moment on the reading of a robot that stands still.

    Afterwards the model is as it was: it keeps nothing from one tick to the next. How long it
    takes where numba's cache is empty is said by `NOTICE`.
    """
    controller = LegController(model, LegControllerParameters())
    upright, zero, rest = np.array((1.0, 0.0, 0.0, 0.0)), np.zeros(3), np.zeros(12)
    standing = Reading(
        JointStates(model.walking_pose, rest, rest),
        ImuReading(upright, zero, np.array((0.0, 0.0, GRAVITY))),
    )
    for key in '24':
        controller.press(key)
        for _ in range(30):
            controller.step(standing, 0.002)
    # Until here it stood on all feet, also in trotting; stepping calls other functions.
    controller.tune(LegControllerParameters(gait=GaitParameters(step_in_place=True)))
    # A map that knows something is looked at.
    terrain = Elevation()
    terrain.add(np.zeros((1, 3)), 1.0)
    controller.locomotion.sight.terrain = terrain
    for _ in range(30):
        controller.step(standing, 0.002)
    # What stages compile within themselves, other states call by itself: that is loaded, too.
    assert controller.robot is not None
    foot_velocities(controller.robot.flat)
    tilt = rotation_error(zero, controller.robot.base.R)
    pd_law(np.zeros((4, 3)), zero, zero, tilt, zero)
    all_leg_angles(model.geometry, foot_positions(model.geometry, model.walking_pose))
