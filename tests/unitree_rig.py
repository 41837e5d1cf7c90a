# SPDX-License-Identifier: Apache-2.0
"""A simulated Go2 with Unitree's interface on a wire that is two tables: nothing is sent."""

from collections import defaultdict
import functools
import json
from pathlib import Path

import numpy as np
from unitree_bridge.cdr import decode, encode, Layout
from unitree_bridge.crc import Checksum
from unitree_bridge.shapes import LOW_CMD, LOW_STATE, REQUEST, RESPONSE, SPORT_MODE_STATE
from unitree_bridge.simulated import SimulatedGo2

from unitree_bridge import topics

GOLDEN = Path(__file__).parent / 'unitree_bridge/golden'
LAYOUT = Layout(LOW_CMD)
CHECKSUM = Checksum(LAYOUT)
# As a Go2 stands, FR FL RR RL.
STANDING = np.tile((0.0, 0.67, -1.3), 4)


class TableWire:
    """Keeps what is published by the name of its topic, and gives what `come` has for it."""

    def __init__(self):
        self.told, self.come = defaultdict(list), defaultdict(list)
        self.on_tell = {}  # by topic: what is done with each message
        self.waits = self.sent_by = 0
        # Pictures and clouds take long: who looks at them says so.
        slow = (topics.VIDEO, topics.response('videohub'), *topics.LIDAR_OUT)
        self.unheard = {topic.name for topic in slow}

    def publish(self, topic, raw):
        self.told[topic.name].append(raw)
        if topic.name in self.on_tell:
            self.on_tell[topic.name](raw)

    def is_heard(self, topic):
        return topic.name not in self.unheard

    def take(self, topic):
        found = self.come.pop(topic.name, [])
        return found[-topic.depth :]

    def sender(self, topic):
        return self.sent_by

    def has_come(self, topics):
        return any(self.come.get(topic.name) for topic in topics)

    def wait(self, topic, seconds):
        self.waits += 1
        return bool(self.come.get(topic.name))

    def look(self):
        """Nobody comes or goes."""

    def close(self):
        """Nothing is open."""

    def last(self, topic):
        """Return the values of the last message of a topic."""
        return decode(topic.shape, self.told[topic.name][-1])


class Rig:
    """The robot, what it said, and what programs do to it."""

    def __init__(self, **options):
        self.wire, self.said = TableWire(), []
        self.go2 = SimulatedGo2(self.wire, self.said.append, speed=0.0, **options)
        self.ids = iter(range(1, 10**9))

    def run(self, seconds):
        """Simulate for so long [s]."""
        self.go2.run(lambda: False, self.go2.world.time + seconds)

    def call(self, service, api_id, noreply=False, **parameter):
        """Ask a service; return code, data and bytes, or None where there is no answer."""
        before = len(self.wire.told[f'rt/api/{service}/response'])
        self.wire.come[f'rt/api/{service}/request'].append(
            request(next(self.ids), api_id, json.dumps(parameter), noreply)
        )
        self.run(0.002)
        answers = self.wire.told[f'rt/api/{service}/response'][before:]
        if not answers:
            return None
        (raw,) = answers
        answer = decode(RESPONSE, raw)
        header = answer['header']
        assert header['identity']['api_id'] == api_id
        return header['status']['code'], answer['data'], answer['binary']

    def command(self, raw):
        """Bring a LowCmd."""
        self.wire.come['rt/lowcmd'].append(raw)

    @property
    def low_state(self):
        return self.wire.last(topics.LOW_STATE)

    @property
    def sport_state(self):
        return self.wire.last(topics.SPORT_MODE_STATE)

    @property
    def efforts(self):
        """Torques of the motors in the last physics step [N m], as the world has them."""
        return self.go2.world.joints().effort

    @property
    def position(self):
        return self.go2.world.base().position

    @property
    def state(self):
        return self.go2.legs.state

    def stand_by_motors(self, seconds, kp=60.0, kd=5.0, each=lambda tick: ()):
        """Rise within a second by LowCmds that answer LowStates, then hold the stand."""
        self.run(0.002)
        start = positions(self.low_state)
        efforts = []
        for tick in range(round(500 * seconds)):
            share = min(tick / 500.0, 1.0)
            for raw in each(tick):
                self.command(raw)
            self.command(low_cmd((1.0 - share) * start + share * STANDING, kp=kp, kd=kd))
            self.run(0.002)
            efforts.append(self.efforts)
        return np.array(efforts)


def positions(low_state):
    """Return q of the twelve motors of a LowState."""
    return np.array([motor['q'] for motor in low_state['motor_state'][:12]])


@functools.cache
def _blank():
    return encode(LOW_CMD, {'head': (0xFE, 0xEF), 'level_flag': 0xFF})


def low_cmd(q=0.0, dq=0.0, tau=0.0, kp=0.0, kd=0.0, mode=1, reserve=0, is_sealed=True):
    """Return a LowCmd for twelve motors."""
    raw = bytearray(_blank())
    for name, value in (('q', q), ('dq', dq), ('tau', tau), ('kp', kp), ('kd', kd)):
        LAYOUT.field(f'motor_cmd.{name}').of(raw)[:12] = value
    np.frombuffer(raw, np.uint8)[LAYOUT.places_of('motor_cmd.mode')[:12]] = mode
    LAYOUT.field('reserve').of(raw)[0] = reserve
    if is_sealed:
        CHECKSUM.seal(raw)
    return bytes(raw)


def request(number, api_id, parameter='', noreply=False):
    """Return a request."""
    header = {
        'identity': {'id': number, 'api_id': api_id},
        'policy': {'noreply': noreply},
    }
    return encode(REQUEST, {'header': header, 'parameter': parameter})


__all__ = ['LOW_STATE', 'SPORT_MODE_STATE', 'Rig', 'TableWire', 'low_cmd', 'positions', 'request']
