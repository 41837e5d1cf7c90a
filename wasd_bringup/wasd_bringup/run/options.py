# SPDX-License-Identifier: Apache-2.0
"""What a run is asked to be: the options of `wasd go2` and the like, as they were read."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
import math
import os
from pathlib import Path
from typing import Any, TYPE_CHECKING

from mujoco_sim.parameters import HONEST, Untold
from teleop_keyboard.key_script import KeyPress
from wasd_core.network import SAYS_WHO, set_range
from wasd_core.output_file import OutputFile

from wasd_bringup.robots import BOTH, robots_of
from wasd_bringup.run.inputs import Command, Goal, ScriptedBox, ScriptedPush, ScriptedTwist

if TYPE_CHECKING:
    from diff_drive_sim.controller_file import ControllerFile

# A namespace also separates these: a robot alone in its world has its own time and frames.
NAMESPACED = (('/clock', 'clock'), ('/tf', 'tf'), ('/tf_static', 'tf_static'))
# Values of --discovery; rcl knows them in capitals.
RANGES = ('off', 'localhost', 'subnet')
# Values of --height-scan.
MAPPED_SCAN, TRUE_SCAN = SCANS = 'map', 'truth'
# A scripted run without --duration goes on for so long after its last line [s].
AFTERGLOW = 2.0


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """One run; files are read, times in simulated seconds."""

    robot: str
    description: str
    namespace: str = ''
    package_path: tuple[Path, ...] = ()
    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    strict: bool = False
    world: str = 'flat'
    preset: str = ''
    layout: str = 'qwerty'
    viewer: str | None = None
    port: int = 0
    opens_page: bool = True
    keys: tuple[KeyPress, ...] | None = None
    twists: tuple[ScriptedTwist, ...] | None = None
    pushes: tuple[ScriptedPush, ...] = ()
    boxes: tuple[ScriptedBox, ...] = ()
    duration: float = math.inf
    speed: float = 1.0
    seed: int = 0
    untold: Untold = Untold()
    lidar: str = HONEST
    record: OutputFile | None = None
    report: OutputFile | None = None
    save_keys: OutputFile | None = None
    # Whether Run.report has samples; with a report to write they are kept anyway.
    samples: bool = False
    uses_ros: bool = True
    discovery: str | None = None
    estimator: str = 'kalman'
    eyes: bool = False  # whether legs walk by what the lidar has seen
    limits: str | None = None
    gait: str | None = None
    mode: str | None = None
    controller: Path | None = None
    drive_file: 'ControllerFile | None' = None  # what that says of wheels, once it is read
    policy: Any = None  # the file of a network that walks, or a `Walker`
    policy_config: str | None = None  # what says how it was trained
    height_scan: str = MAPPED_SCAN  # whose heights a network sees that was trained with them
    gamepad: str | None = None  # None: no pad; '': the first that comes
    foxglove: int | None = None  # the port
    interface: str | None = None  # beside our own: 'unitree'
    domain: int = 0  # of DDS, for that interface
    network: str = 'lo'
    sync: bool = False  # whether time waits for the programs that command motors
    # The map to localise in; '' makes one, None does neither.
    map: str | None = None
    continues: bool = False  # whether that map is gone on with
    keepout: str | None = None  # a YAML of map_server, or PICTURE,METRES_PER_PIXEL
    save_map: str | None = None  # without .yaml
    goals: tuple[Goal, ...] = ()
    patrol: bool = False  # whether those come again after the last
    explore: bool = False  # whether the robot maps by itself, before its goals
    latched: bool = False  # whether an e-stop holds until it is released
    guard: bool = False  # whether no source drives into what the lidar sees
    interactive: bool = False
    words: tuple[str, ...] = ()  # of the command line, where there is one
    # Of a recording: the descriptions by namespace, and the commands in place of all others.
    urdfs: Mapping[str, str] = field(default_factory=dict)
    commands: tuple[Command, ...] | None = None

    @property
    def scripted(self) -> bool:
        """Whether keys or velocities come from a file."""
        return self.keys is not None or self.twists is not None

    @property
    def prints_data(self) -> bool:
        """Whether standard output is a file of data, between which no words may come."""
        outputs = (self.record, self.report, self.save_keys)
        return any(output is not None and output.is_standard_output for output in outputs)

    @property
    def has_guests(self) -> bool:
        """Whether drivers may come and go."""
        given = (self.gamepad, self.foxglove, self.interface)
        return any(each is not None for each in given)

    @property
    def drive_mode(self) -> str | None:
        """
        The mode that the command line asks for; None: the file's, or the default.

        `sim` is whichever loop the file asks for, as long as there is one.
        """
        if self.mode != 'sim':
            return self.mode
        return 'float' if self._mode_of_file == 'fake' else None

    @property
    def is_fake(self) -> bool:
        """Whether the robot is to move without physics."""
        return (self.mode or self._mode_of_file) == 'fake'

    @property
    def _mode_of_file(self) -> str | None:
        return None if self.drive_file is None else self.drive_file.parameters.mode

    def per_robot(self) -> tuple['RunOptions', ...]:
        """Return the options of each robot: themselves, or those of the robots of `both`."""
        if self.robot != BOTH:
            return (self,)
        return tuple(
            replace(
                self,
                robot=row.name,
                description=row.description,
                namespace=row.name,
                preset=row.preset,
            )
            for row in robots_of(self.robot)
        )


def choose_range(asked: str | None, is_experiment: bool) -> None:
    """
    Set the range of a run: as asked, else off for an experiment, else what the user has set.

    If the user has set nothing, `init_ros` keeps ROS on this machine: in a classroom that shares a
    network nobody drives a neighbour's robot by accident. `localhost` asks for the same, whatever
    the environment says.
    """
    if asked == 'localhost':
        for name in SAYS_WHO:
            os.environ.pop(name, None)
    elif asked is not None:
        set_range(os.environ, asked)
    elif is_experiment:
        set_range(os.environ, 'off')  # no other run may join: it would not repeat bit for bit
