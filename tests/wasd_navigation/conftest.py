# SPDX-License-Identifier: Apache-2.0
"""A navigator of stand-ins on topics, and who talks to it."""

from navigation_stand_ins import StandInLocator, StandInPilot
from navigator_rig import Rig
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from wasd_core.topics import LATCHED
from wasd_navigation.navigator_node import NavigatorNode
from wasd_navigation.parameters import NavigatorParameters
from wasd_navigation.robot_navigator import RobotNavigator

from wasd_navigation import robot_navigator


@pytest.fixture
def make(spawn):
    """Return a function that makes the face of a navigator of stand-ins with parameters."""

    def make(**values):
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        settings = NavigatorParameters().changed(values)
        navigation = RobotNavigator(settings, (StandInLocator(), StandInPilot()))
        return spawn(NavigatorNode(navigation, parameter_overrides=overrides))

    return make


@pytest.fixture
def lone(spawn, monkeypatch):
    """Return a navigator of stand-ins that is a node of its own."""
    parts = StandInLocator(), StandInPilot()
    monkeypatch.setattr(robot_navigator, 'make_parts', lambda *_: parts)
    return spawn(NavigatorNode())


@pytest.fixture
def rig(make):
    return Rig(make())


@pytest.fixture
def peer(spawn, spin_until):
    """Return a node of somebody else's."""
    return spawn(Node('peer'))


@pytest.fixture
def publish(peer, spawn, spin_until):
    """Return a function that publishes a message to whoever has the topic."""
    publishers = {}

    def publish(topic, message):
        if topic not in publishers:
            publishers[topic] = peer.create_publisher(type(message), topic, LATCHED)
            spin_until(spawn.pump, lambda: publishers[topic].get_subscription_count() > 0)
        publishers[topic].publish(message)

    return publish
