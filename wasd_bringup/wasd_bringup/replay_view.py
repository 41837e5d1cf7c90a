# SPDX-License-Identifier: Apache-2.0
"""Shows a recording in a viewer: poses from the truth, joints from their states."""

from collections.abc import Callable, Sequence
import time

from mujoco_sim.kinematic import pose_base
from mujoco_sim.kinematic import pose_joints
from mujoco_sim.kinematic import update_bodies
from mujoco_sim.page_panels import Panel
from mujoco_sim.viewer import CameraView
from mujoco_sim.viewer import WebView
from mujoco_sim.world import World
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from wasd_bringup.bag_reader import BagReader
from wasd_bringup.bag_reader import RecordedMessage
from wasd_bringup.recorded_commands import robot_topics
from wasd_bringup.recorded_commands import TRUTH
from wasd_bringup.session import FRAME_PERIOD
from wasd_bringup.session import View

JOINTS = 'joint_states'
CAMERA = CameraView(distance=2.0, azimuth=130.0, elevation=-20.0)


class ReplayView:
    """Moves the robots of some worlds as recorded, at a speed; 0 is as fast as it goes."""

    def __init__(self, bag: BagReader, worlds: Sequence[World], speed: float) -> None:
        self._bag = bag
        self._speed = speed
        self._world = worlds[0]
        by_name = {world.prefix.rstrip('/'): world for world in worlds}
        self._truths = {topic: by_name[name] for name, topic in robot_topics(bag, TRUTH).items()}
        self._joints = {topic: by_name[name] for name, topic in robot_topics(bag, JOINTS).items()}
        self._shown = bag.start
        self._view: View | None = None

    def open(self, kind: str, port: int) -> str:
        """
        Start a viewer; return where it is.

        Raises:
            SimulationError: the port is taken, or there is no display.
        """
        if kind == 'native':
            # Here, because it loads a window system.
            from mujoco_sim.native_viewer import NativeView

            self._view = NativeView(self._world, CAMERA)
            return 'a window on this display'
        panel = Panel(self._status, ['Ctrl-C in the terminal quits.'])
        web = WebView(self._world, CAMERA, panel, port=port)
        self._view = web
        return web.url

    def run(self, stop: Callable[[], bool]) -> None:
        """Show it all, then the last picture until `stop`."""
        started = time.monotonic()
        drawn = 0.0
        for message in self._bag.messages([*self._truths, *self._joints]):
            if message.time > self._shown:
                self._shown = message.time
                due = self._due(started)
                while not stop() and time.monotonic() < due:
                    time.sleep(min(FRAME_PERIOD, max(0.0, due - time.monotonic())))
                if time.monotonic() - drawn >= FRAME_PERIOD:
                    drawn = time.monotonic()
                    self._draw()
            if stop():
                return
            self._apply(message)
        while not stop():
            self._draw()
            time.sleep(FRAME_PERIOD)

    def close(self) -> None:
        """Close the viewer."""
        if self._view is not None:
            self._view.close()

    def _apply(self, message: RecordedMessage) -> None:
        if message.topic in self._truths:
            pose = deserialize_message(message.data, Odometry).pose.pose
            place, turn = pose.position, pose.orientation
            position, orientation = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
            pose_base(self._truths[message.topic], position, orientation)
        else:
            joints = deserialize_message(message.data, JointState)
            pose_joints(self._joints[message.topic], joints.name, joints.position)

    def _draw(self) -> None:
        update_bodies(self._world)
        if self._view is not None:
            self._view.sync()

    def _due(self, started: float) -> float:
        """Return the wall time [s] at which the present message is to be shown."""
        if self._speed == 0.0:
            return started
        return started + 1e-9 * (self._shown - self._bag.start) / self._speed

    def _status(self) -> list[str]:
        now, end = 1e-9 * self._shown, 1e-9 * self._bag.end
        return [f'{self._bag.path.name}  {now:.1f} of {end:.1f} s']
