# SPDX-License-Identifier: Apache-2.0
"""The simulator's settings, also those unknown to controllers; loads no MuJoCo."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
import math
from typing import NamedTuple, Self

from wasd_core.arguments import check
from wasd_core.command_line import Executable
from wasd_core.errors import UserError
from wasd_core.parameters import fixed, InvalidParameter, parameter, Parameters
from wasd_core.robot_io import LEG_RATE

WORLD_NAMES = (
    'flat, room, office, slope:DEG, stairs:RISE[,TREAD], step:HEIGHT, boxes:HEIGHT, '
    'rough:HEIGHT, ice:MU, gap:WIDTH, stepping:GAP, course:SEED, flat:SEED'
)
WORLD_KINDS = (
    'an MJCF or URDF file, or a floor plan: FILE.yaml of a map, or PICTURE,METRES_PER_PIXEL'
)
# MuJoCo tells the kind of a file by its ending.
WORLD_FILES = ('.xml', '.urdf')
# Of feet or wheels on a floor.
FRICTION = (0.01, 2.0)
# The most that a robot is loaded with [kg]. A Go2 carries 8, at most 12; others here weigh more.
HEAVIEST = 100.0
# From the origin of the base to the load's centre, along each axis [m].
FARTHEST = 1.0
NEAR = f', X, Y and Z within {FARTHEST:g} m'
# Rates of joint_states [Hz]: for controllers in other processes, and (SHOWN_RATE) for watchers.
STATE_RATE = 100.0
# Lidars by name: as the tag says, all rays of one instant, or a planar one that is sold.
HONEST, IDEAL = 'honest', 'ideal'
LIDAR_NAMES = (HONEST, IDEAL, 'a1', 'lds', 's2')
SHOWN_RATE = 50.0
simulator = Executable(
    name='simulator',
    module='mujoco_sim.simulator_node',
    about='Simulates a robot in MuJoCo: joint_commands in, joint_states, imu/data and /clock out.',
    parameters=('mujoco_sim.parameters:SimulatorParameters',),
    example='simulator --ros-args -p description:=go2 -p world:=stairs:0.1',
)


class BoxSize(NamedTuple):
    """The size of a box that stands on the floor [m]: higher than a lidar on a Go2's back."""

    length: float = 0.4
    width: float = 0.4
    height: float = 0.7


class SimulatorParameters(Parameters):
    """What the simulator loads and how fast it runs and publishes."""

    description: str = fixed('mbot', doc='Robot: a built-in name, or a xacro or URDF file')
    controller: str = fixed(
        '', doc='YAML file of a drive controller: the wheels that it names get the motors'
    )
    world: str = fixed('flat', doc=f'World: {WORLD_NAMES}, {WORLD_KINDS}')
    seed: int = fixed(0, minimum=0, maximum=2**63 - 1, doc='Seed of all random numbers')
    speed: float = parameter(
        1.0,
        minimum=0.001,
        maximum=1000.0,
        or_zero=True,
        doc='Target real-time factor; 0 is as fast as possible',
    )
    clock_rate: float = fixed(100.0, minimum=1.0, maximum=1000.0, doc='Rate of /clock', unit='Hz')
    state_rate: float = fixed(
        math.nan,
        minimum=1.0,
        maximum=1000.0,
        doc='Rate of imu/data, joint_states, foot_contacts and ground_truth/odom',
        unit='Hz',
        nan=f'{LEG_RATE:g} for legs, as their controller needs, {STATE_RATE:g} for another robot, '
        f'{SHOWN_RATE:g} beside a controller in the same process',
    )
    sensor_noise: bool = fixed(
        True, doc='Add noise to lidars, cameras and the sensors of a legged robot'
    )
    lidar: str = fixed(
        HONEST,
        doc='What lidars are like: as their tags say, all rays of one instant, or a planar model',
        choices=LIDAR_NAMES,
    )
    friction: float = fixed(
        math.nan,
        doc='Friction of feet or wheels on any floor; the controller does not know it',
        minimum=FRICTION[0],
        maximum=FRICTION[1],
        nan='what the description says',
    )
    payload: str = fixed(
        '', doc='Load on the base, KG or KG@X,Y,Z in its frame; the controller does not know it'
    )
    randomise: float = fixed(
        0.0,
        doc='Random difference of a quadruped from its description, by the seed',
        minimum=0.0,
        maximum=1.0,
    )
    hoist: bool = fixed(
        False,
        doc='Begin on a hoist, upright: for a robot on two legs, until its controller holds it',
    )
    imu_drift: float = fixed(
        1.0, minimum=0.0, maximum=100.0, doc='Drift of the noisy IMU, in multiples of the default'
    )
    camera_scale: float = parameter(
        1.0,
        minimum=0.05,
        maximum=1.0,
        doc='Scale of camera images, relative to the description',
    )
    command_timeout: float = parameter(
        0.1,
        minimum=0.01,
        maximum=10.0,
        doc='Silence on joint_commands after which motors brake',
        unit='s',
    )
    answer_patience: float = parameter(
        5.0,
        minimum=0.0,
        maximum=60.0,
        doc='Wall time for which physics waits for a controller that was answering each state and '
        'is still there; then the motors brake',
        unit='s',
    )


class Payload(NamedTuple):
    """A load of a mass [kg] with its centre at `place` [m] in the base's frame, welded on."""

    mass: float
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def parse(cls, text: str) -> Self:
        """
        Return the load that `KG` or `KG@X,Y,Z` says.

        Raises:
            UserError: it is not a mass that a robot is loaded with and three lengths near it.
        """
        mass, at, place = text.partition('@')
        try:
            x, y, z = map(float, place.split(',') if at else (0, 0, 0))
            payload = cls(float(mass), (x, y, z))
            if not payload.is_possible:
                raise ValueError
        except ValueError:
            wanted = f'wanted KG or KG@X,Y,Z with KG > 0 and <= {HEAVIEST:g}{NEAR}'
            raise UserError(f'payload: got {text!r}, {wanted}') from None
        return payload

    @property
    def is_possible(self) -> bool:
        """Whether there is such a load."""
        return 0.0 < self.mass <= HEAVIEST and all(abs(one) <= FARTHEST for one in self.place)


@dataclass(frozen=True)
class Untold:
    """
    Changes of the robot that the controller does not know.

    `friction` is what its feet have on any ground, or of a robot without feet all that it touches
    the ground with, wheels too; without one it is what the description says. `payload` is what the
    base carries. `imu_drift` is how many times the usual an IMU drifts that has noise. `randomise`
    is how much a quadruped differs from its description at random, 0 to 1.
    """

    friction: float | None = None
    payload: Payload | None = None
    randomise: float = 0.0
    imu_drift: float = 1.0

    def __post_init__(self) -> None:
        """
        Check the numbers.

        Raises:
            UserError: one that no robot or floor can have.
        """
        for one in fields(self):
            check(one.name, getattr(self, one.name), one.type)
        low, high = FRICTION
        if self.friction is not None and not low <= self.friction <= high:
            wanted = f'>= {low:g} and <= {high:g}'
            raise InvalidParameter(f'friction must be {wanted}, got {self.friction!r}')
        for name in ('randomise', 'imu_drift'):
            SimulatorParameters.checked(name, float(getattr(self, name)))
        if self.payload is not None and not self.payload.is_possible:
            wanted = f'wanted a mass > 0 and <= {HEAVIEST:g} kg{NEAR}'
            raise UserError(f'payload: got {tuple(self.payload)}, {wanted}')

    @classmethod
    def from_parameters(cls, settings: SimulatorParameters) -> Self:
        """
        Return what the simulator's parameters say.

        Raises:
            UserError: one that no robot can have.
        """
        return cls(
            friction=None if math.isnan(settings.friction) else settings.friction,
            payload=Payload.parse(settings.payload) if settings.payload else None,
            randomise=settings.randomise,
            imu_drift=settings.imu_drift,
        )

    def as_parameters(self) -> dict[str, float | str]:
        """Return these as the simulator's parameters, by name."""
        payload = ''
        if self.payload is not None:
            payload = f'{self.payload.mass}@{",".join(map(str, self.payload.place))}'
        return {
            'friction': math.nan if self.friction is None else self.friction,
            'payload': payload,
            'randomise': self.randomise,
            'imu_drift': self.imu_drift,
        }


NOTHING = Untold()


@dataclass(frozen=True)
class Drawn:
    """
    How a robot differs from its description.

    `mass` [kg] is added to its base, whose centre of mass moves by `centre` [m]; commands and
    readings come later by their delays [s], `noise` is a factor. A motor's torque is what it was
    told times its `strength`. Without `friction` its feet have their own.
    """

    mass: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float | None = None
    command_delay: float = 0.0
    sensor_delay: float = 0.0
    noise: float = 1.0
    strength: Mapping[str, float] = field(default_factory=dict)
