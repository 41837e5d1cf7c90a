# SPDX-License-Identifier: Apache-2.0
"""Checks of Gazebo's sensors: what a simulator leaves out, or takes the other way round."""

from collections.abc import Iterator

from robot_description import sensor_tags
from robot_description.lint.model import Element, Model
from robot_description.lint.rules import Finding, finding


def check_sensors(model: Model) -> Iterator[Finding]:
    """Lidars and cameras have numbers that can be, and the lower limit below the upper one."""
    for gazebo in model.robot.all('gazebo'):
        for sensor in gazebo.all('sensor'):
            name = repr(sensor.name or sensor.attributes.get('type', ''))
            for text in _odd(sensor):
                yield finding('bad-sensor', sensor.place, f'sensor {name}: {text}')


def _odd(sensor: Element) -> Iterator[str]:
    """Yield what is odd about a sensor."""
    kind = sensor.attributes.get('type', '')
    if kind in sensor_tags.HOLDERS:

        def find(path: str) -> str | None:
            element = sensor.find(path)
            return element.text if element is not None else None

        wrong = sensor_tags.why_broken(kind, find)
        yield from [wrong] if wrong else sensor_tags.exchanged(kind, find)
    elif kind not in sensor_tags.OTHER_TYPES:
        yield f'the type {kind!r} is unknown to Gazebo'
