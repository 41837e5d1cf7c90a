# SPDX-License-Identifier: Apache-2.0
"""Topics over Eclipse Cyclone DDS, on this machine's loopback alone; messages are bytes."""

from collections.abc import Iterable
from typing import Any

from cyclonedds.core import (
    DDSException,
    InstanceState,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic as DdsTopic
from cyclonedds.util import duration
from wasd_core.errors import one_line, UserError

from unitree_bridge.loopback import keep_to, open_sockets
from unitree_bridge.shapes import FLAG, Kind, Many, Several, Shape, TEXT
from unitree_bridge.topics import Topic

# As the SDK configures a network of its own, but for its log in /tmp. Cyclone DDS 0.10, which
# robots have, takes the loopback for one without multicast and asks at the usual ports: an index
# of our own makes us listen there, and a peer ask there, too.
CONFIGURATION = """<CycloneDDS><Domain Id="any"><General><Interfaces>
<NetworkInterface name="{network}" priority="default" multicast="default"/>
</Interfaces></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""

_NUMBERS = {
    **{'u1': types.uint8, 'u2': types.uint16, 'u4': types.uint32, 'u8': types.uint64},
    **{'i1': types.int8, 'i2': types.int16, 'i4': types.int32, 'i8': types.int64},
    **{'f4': types.float32, 'f8': types.float64},
}
_ANY_STATE = SampleState.Any | ViewState.Any | InstanceState.Any


# What a listener has not acknowledged yet is kept, to be sent again: LowStates of 0.1 s.
_KEPT = 50


class DdsWire:
    """A participant of a DDS domain: a `Wire`."""

    def __init__(
        self, domain: int, network: str, out: Iterable[Topic], into: Iterable[Topic]
    ) -> None:
        """
        Join the domain; `out` is published, `into` is taken.

        Raises:
            UserError: the domain cannot be joined.
        """
        before = open_sockets()
        try:
            self._domain = Domain(domain, CONFIGURATION.format(network=network))
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise UserError(f'domain {domain} on {network}: {one_line(error)}') from None
        keep_to(network, open_sockets() - before)
        topics = {t.name: self._topic(t) for t in (*out, *into)}
        self._writers = {t.name: self._writer(topics[t.name]) for t in out}
        self._readers = {t.name: self._reader(topics[t.name], t.depth) for t in into}
        self._arrivals: dict[tuple[str, ...], WaitSet] = {}
        self._heard: set[str] = set()
        self._senders: dict[str, int] = {}

    def publish(self, topic: Topic, raw: bytes) -> None:
        """Send a message; one that a listener has no room for is lost to it."""
        writer = self._writers[topic.name]
        try:
            writer.write(writer.data_type(raw))
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_TIMEOUT:
                raise

    def is_heard(self, topic: Topic) -> bool:
        """Return whether somebody listens, as it was when `look` was called last."""
        return topic.name in self._heard

    def look(self) -> None:
        """Find out who listens."""
        self._heard = {
            name
            for name, writer in self._writers.items()
            if writer.get_publication_matched_status().current_count
        }

    def take(self, topic: Topic) -> list[bytes]:
        """Return the messages that have come, and no more than the topic keeps."""
        samples = [
            sample
            for sample in self._readers[topic.name].take(topic.depth)
            if hasattr(sample, 'raw')  # and no word of one who is gone
        ]
        if samples:
            self._senders[topic.name] = samples[-1].sample_info.publication_handle
        return [bytes(sample.raw) for sample in samples]

    def sender(self, topic: Topic) -> int:
        """Return whose the message is that was taken last, a number."""
        return self._senders.get(topic.name, 0)

    def has_come(self, topics: tuple[Topic, ...]) -> bool:
        """Return whether there is a message of any of these topics."""
        return bool(self._arrival(*(topic.name for topic in topics)).wait(0))

    def wait(self, topic: Topic, seconds: float) -> bool:
        """Wait for a message, at most so long [s]; return whether there is one."""
        return bool(self._arrival(topic.name).wait(duration(seconds=seconds)))

    def close(self) -> None:
        """Be gone for all others."""
        self._arrivals.clear()
        self._readers.clear()
        self._writers.clear()
        del self._participant, self._domain

    def _topic(self, topic: Topic) -> 'DdsTopic[Any]':
        return DdsTopic(self._participant, topic.name, raw_type(topic.shape))

    def _writer(self, topic: 'DdsTopic[Any]') -> 'DataWriter[Any]':
        # Physics does not wait for a listener that has stopped.
        reliable = Policy.Reliability.Reliable(max_blocking_time=0)
        own, last = Policy.IgnoreLocal.Participant, Policy.History.KeepLast(_KEPT)
        return DataWriter(self._participant, topic, Qos(reliable, own, last))

    def _reader(self, topic: 'DdsTopic[Any]', depth: int) -> 'DataReader[Any]':
        reliable = Policy.Reliability.Reliable(max_blocking_time=0)
        own, last = Policy.IgnoreLocal.Participant, Policy.History.KeepLast(depth)
        return DataReader(self._participant, topic, Qos(reliable, own, last))

    def _arrival(self, *names: str) -> WaitSet:
        if names not in self._arrivals:
            waiting = WaitSet(self._participant)
            for name in names:
                waiting.attach(ReadCondition(self._readers[name], _ANY_STATE))
            self._arrivals[names] = waiting
        return self._arrivals[names]


class _Raw:
    """A message that is bytes; Cyclone asks for these methods and this name."""

    def __init__(self, raw: bytes) -> None:
        self.raw = raw

    def serialize(self, *_: Any, **__: Any) -> bytes:
        return self.raw

    @classmethod
    def deserialize(cls, data: bytes, *_: Any, **__: Any) -> '_Raw':
        return cls(data)

    deserialize_key = deserialize  # of the word that a writer has gone


def raw_type(shape: Shape) -> Any:
    """Return Cyclone's type of a shape, whose messages are bytes."""
    made = _to_struct(shape)
    for name in ('__init__', 'serialize', 'deserialize', 'deserialize_key'):
        setattr(made, name, _Raw.__dict__[name])
    return made


def _to_idl(kind: Kind) -> Any:
    """Return Cyclone's type of a kind; shapes of one name are one type."""
    if isinstance(kind, Several):
        return types.array[_to_idl(kind.kind), kind.number]
    if isinstance(kind, Many):
        return types.sequence[_to_idl(kind.kind)]
    if isinstance(kind, Shape):
        return _to_struct(kind)
    return {FLAG: bool, TEXT: str}.get(kind) or _NUMBERS[kind]


_structs: dict[str, Any] = {}


def _to_struct(shape: Shape) -> Any:
    if shape.name not in _structs:
        fields = {name: _to_idl(kind) for name, kind in shape.fields.items()}
        name = shape.name.rpartition('.')[2]
        _structs[shape.name] = make_idl_struct(name, shape.name, fields, dataclassify=False)
    return _structs[shape.name]
