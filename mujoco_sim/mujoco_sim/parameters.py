# SPDX-License-Identifier: Apache-2.0
"""Parameters of the simulator node."""

from dataclasses import dataclass
import math
from typing import NamedTuple

from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

WORLD_NAMES = (
    'flat, room, office, slope:DEG, stairs:RISE, step:HEIGHT, boxes:HEIGHT, rough:HEIGHT, '
    'ice:MU, gap:WIDTH, flat:SEED'
)
# Of feet or wheels on a floor.
FRICTION = (0.01, 2.0)


class BoxSize(NamedTuple):
    """The size of a box that stands on the floor [m]: higher than a lidar on a Go2's back."""

    length: float = 0.4
    width: float = 0.4
    height: float = 0.7


@dataclass(frozen=True, kw_only=True)
class SimulatorParameters(Parameters):
    """What the simulator loads and how fast it runs and publishes."""

    description: str = parameter(
        'mbot', doc='Robot: a built-in name, or a xacro or URDF file', read_only=True
    )
    world: str = parameter(
        'flat', doc=f'World: {WORLD_NAMES}, or an MJCF or URDF file', read_only=True
    )
    seed: int = parameter(0, doc='Seed of everything random', minimum=0, read_only=True)
    speed: float = parameter(
        1.0, doc='Real-time factor aimed at; 0 is as fast as it goes', minimum=0.0
    )
    clock_rate: float = parameter(
        100.0, doc='Rate of /clock', unit='Hz', above=0.0, maximum=1000.0, read_only=True
    )
    state_rate: float = parameter(
        50.0,
        doc='Rate of imu/data, joint_states, foot_contacts and ground_truth/odom',
        unit='Hz',
        above=0.0,
        maximum=1000.0,
        read_only=True,
    )
    sensor_noise: bool = parameter(
        True,
        doc='Whether lidars, cameras and the sensors of a legged robot have noise',
        read_only=True,
    )
    friction: float = parameter(
        math.nan,
        doc='Friction of feet or wheels on any floor; the controller is not told',
        minimum=FRICTION[0],
        maximum=FRICTION[1],
        read_only=True,
        nan='what the description says',
    )
    payload: str = parameter(
        '',
        doc='Load welded to the base, KG or KG@X,Y,Z in its frame; the controller is not told',
        read_only=True,
    )
    randomise: float = parameter(
        0.0,
        doc='How much a quadruped differs from its description at random, by the seed',
        minimum=0.0,
        maximum=1.0,
        read_only=True,
    )
    imu_drift: float = parameter(
        1.0, doc='How many times the usual a noisy IMU drifts', minimum=0.0, read_only=True
    )
    camera_scale: float = parameter(
        1.0,
        doc='Size of camera images, as a share of what the description says',
        above=0.0,
        maximum=1.0,
    )
    command_timeout: float = parameter(
        0.1, doc='Motors brake when joint_commands is silent for so long', unit='s', above=0.0
    )
    answer_patience: float = parameter(
        5.0,
        doc='Wall time for which physics waits for a controller that was answering each state and '
        'is still there; then the motors brake',
        unit='s',
        minimum=0.0,
    )
