# SPDX-License-Identifier: Apache-2.0
"""What every node says of itself: its topics, services and parameters."""

from collections.abc import Callable
import functools
from importlib import import_module, metadata
from typing import Any, NamedTuple

from diff_drive_sim.diff_drive_controller_node import DiffDriveControllerNode
from mujoco_sim.simulator_node import SimulatorNode
from quadruped_sim.leg_controller_node import LegControllerNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from wasd_bringup.ros.drivers_node import DriversNode
from wasd_core.command_line import Executable

# What rclpy gives every node.
USUAL_PARAMETERS = ('use_sim_time', 'start_type_description_service')
USUAL_TOPICS = ('/parameter_events', '/rosout')
USUAL_SERVICES = ('rcl_interfaces', 'type_description_interfaces')
# Names that no namespace prefixes.
ABSOLUTE = ('/clock', '/diagnostics', '/tf', '/tf_static')


class End(NamedTuple):
    """A publisher or a subscription."""

    topic: str
    type: str
    node: str
    sends: bool
    is_latched: bool
    is_best_effort: bool


class Entry(NamedTuple):
    """A parameter with its default; `range` is '' when any value will do."""

    name: str
    value: Any
    range: str
    meaning: str
    is_fixed: bool


class NodeFacts(NamedTuple):
    """What one node says of itself; services are (name, type)."""

    package: str
    name: str
    ends: list[End]
    services: list[tuple[str, str]]
    parameters: list[Entry]


def make(kind: Callable[..., Node], **values: Any) -> Callable[[], Node]:
    """Return a function that makes a node with parameters that are not the default."""
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return functools.partial(kind, parameter_overrides=overrides)


def nodes_of_programs() -> dict[Callable[[], Node], str]:
    """Return the nodes that the project's programs run, and the package of each."""
    scripts = metadata.distribution('wasd-robots').entry_points.select(group='console_scripts')
    nodes: dict[Callable[[], Node], str] = {}
    for home in sorted({script.module for script in scripts}):
        for program in vars(import_module(home)).values():
            if isinstance(program, Executable):
                for kind in vars(import_module(program.module)).values():
                    if getattr(kind, '__module__', '') == program.module and _is_node(kind):
                        nodes[kind] = home.partition('.')[0]
    return nodes


def _is_node(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Node)


# All nodes with their package, then those again whose parameters give them more topics.
NODES = nodes_of_programs()
VARIANTS: dict[Callable[[], Node], str] = {
    make(DiffDriveControllerNode, publish_limited_velocity=True): 'diff_drive_sim',
    make(SimulatorNode, description='go2'): 'mujoco_sim',
    make(SimulatorNode, description='mbot_kinect'): 'mujoco_sim',
    make(LegControllerNode, estimator='truth'): 'quadruped_sim',
    DriversNode: 'wasd_bringup',
}


def ask(make_node: Callable[[], Node], package: str) -> NodeFacts:
    """Make a node and let it tell of itself; rclpy must be initialised."""
    node = make_node()
    ends = [_end(node, publisher, True) for publisher in node.publishers]
    ends += [_end(node, subscription, False) for subscription in node.subscriptions]
    services = [
        (service.srv_name, _type_name(service.srv_type))
        for service in node.services
        if service.srv_type.__module__.split('.')[0] not in USUAL_SERVICES
    ]
    facts = NodeFacts(
        package,
        node.get_name(),
        [end for end in ends if end.topic not in USUAL_TOPICS],
        services,
        _parameters(node),
    )
    node.destroy_node()
    return facts


def _end(node: Node, end: Any, sends: bool) -> End:
    own, topic = f'/{node.get_name()}/', end.topic_name
    if topic.startswith(own):
        topic = '~/' + topic.removeprefix(own)
    elif topic not in ABSOLUTE + USUAL_TOPICS:
        topic = topic.removeprefix('/')
    return End(
        topic,
        _type_name(end.msg_type),
        node.get_name(),
        sends,
        end.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        end.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT,
    )


def _type_name(kind: type) -> str:
    """Return a type as ROS tools say it."""
    package, middle, _ = kind.__module__.split('.')
    return f'{package}/{middle}/{kind.__name__}'


def _parameters(node: Node) -> list[Entry]:
    """Return the parameters in the order of their declaration."""
    values = node.get_parameters_by_prefix('')
    wanted = [name for name in values if name not in USUAL_PARAMETERS]
    return [
        Entry(
            name,
            _plain(values[name].value),
            found.additional_constraints,
            found.description.removesuffix('.'),
            found.read_only,
        )
        for name, found in zip(wanted, node.describe_parameters(wanted), strict=True)
    ]


def _plain(value: Any) -> Any:
    """Return a value as YAML has it: arrays as lists."""
    return value if isinstance(value, (bool, int, float, str)) else list(value)
