# SPDX-License-Identifier: Apache-2.0
"""A Go2 of its own with Unitree's interface: world, legs and bridge, without ROS and a page."""

from collections.abc import Callable
import time

from mujoco_sim.parameters import SimulatorParameters
from mujoco_sim.robot_setup import usual_setup
from mujoco_sim.sensors.measuring import Sensors
from mujoco_sim.simulation import Simulation
from mujoco_sim.world import build_world
from quadruped_sim.legs import Legs
from quadruped_sim.parameters import LegNodeParameters
from robot_description.description import load_robot
from wasd_core.robot_io import LEG_RATE

from unitree_bridge import topics
from unitree_bridge.bridge import Bridge, INTO, OUT
from unitree_bridge.legs_robot import Commands, LegsRobot
from unitree_bridge.robot import Velocity
from unitree_bridge.utlidar import serve_lidar
from unitree_bridge.wire import Wire

ALL_OUT = (*OUT, *topics.LIDAR_OUT)
ALL_INTO = (*INTO, topics.LIDAR_SWITCH)


class SimulatedGo2:
    """
    The robot, stepped 500 times a second of simulated time.

    `seed` is that of all noise; `say` hears what a user should know, a line each.
    """

    def __init__(
        self,
        wire: Wire,
        say: Callable[[str], None],
        *,
        world: str = 'flat',
        seed: int = 0,
        estimator: str = 'kalman',
        speed: float = 1.0,
        is_synced: bool = False,
    ) -> None:
        """
        Load it.

        Raises:
            UserError: what is wrong with the world, in one line.
        """
        loaded = load_robot('go2')
        setup = usual_setup(loaded, estimator == 'kalman')
        self.world = build_world(loaded, world, seed, setup, visuals=True)
        settings = LegNodeParameters(estimator=estimator)
        self.legs = Legs(loaded, settings, inform=say)
        self.simulation = Simulation(self.world, speed)
        self.robot = LegsRobot(self.legs, self.world, Commands(self._press, self._drive))
        self._sensors = Sensors(loaded, self.world, SimulatorParameters())
        lidar = serve_lidar(self.robot, self._sensors, self.world)
        self.bridge = Bridge(self.robot, wire, say, is_synced=is_synced, lidar=lidar)
        schedule = self.simulation.schedule
        schedule.every(1.0 / LEG_RATE, self._control)
        schedule.every(1.0 / LEG_RATE, self._sensors.step)
        resets = (self.legs.reset, self._sensors.reset, self.bridge.reset)
        self.simulation.on_reset += resets

    def run(self, stop: Callable[[], bool], duration: float = float('inf')) -> None:
        """Simulate until `stop` or until `duration` [s] of simulated time; answer meanwhile."""
        may_advance = self.bridge.may_advance
        self.simulation.run(stop, self._poll, duration=duration, may_advance=may_advance)

    def close(self) -> None:
        """Be gone for all programs."""
        self.bridge.close()
        self._sensors.close()
        self.robot.close()

    def _press(self, key: str) -> bool:
        self.legs.press(key)
        return True

    def _drive(self, velocity: Velocity) -> bool:
        self.legs.command(*velocity)
        return True

    def _control(self) -> None:
        dt = 1.0 / LEG_RATE
        self.bridge.step(dt)
        truth = None
        if self.legs.settings.estimator == 'truth':
            truth = self.world.base_since_start()
        names = self.world.joint_names, self.world.motor_names
        own = self.legs.control(self.world.read(), *names, dt, truth)
        theirs = self.bridge.in_force
        self.world.apply(own if theirs is None else self.robot.motors(theirs))

    def _poll(self, timeout: float) -> None:
        time.sleep(timeout)
