# SPDX-License-Identifier: Apache-2.0
"""Questions and answers: a request names an id and gives its parameter as JSON."""

from collections.abc import Callable, Mapping
import json
import math
import sys
from typing import Any, NamedTuple

from wasd_core.errors import InvalidMessage

from unitree_bridge.cdr import decode, encode
from unitree_bridge.shapes import REQUEST, RESPONSE

OK = 0
INTERNAL = 3202
NOT_IMPLEMENTED = 3203
BAD_PARAMETER = 3204
LEASE_GONE = 3206
LEASE_TAKEN = 3207
# Asks any service for its version.
_VERSION = 1
# What follows a service's name where its lease is asked for, and the ids there.
LEASE = '_lease'
_APPLY, _RENEW = 101, 102
_TERM = 1.0  # of a lease [s]

Parameters = Mapping[str, Any]


class Refused(Exception):
    """A service does not do what it is asked; the code says why."""

    def __init__(self, code: int) -> None:
        super().__init__(str(code))
        self.code = code


class Answer(NamedTuple):
    """What a service answers: JSON, or bytes."""

    data: Any = None
    binary: bytes = b''


Handler = Callable[[Parameters], Answer | None]


class Service:
    """Something that can be asked: by id, who answers."""

    name: str
    version: str
    _handlers: dict[int, Handler]

    def handler(self, api_id: int) -> Handler | None:
        """Return who answers an id, None where nobody does."""
        return self._handlers.get(api_id)


def serve(service: Service, raw: bytes, say: Callable[[str], None]) -> bytes | None:
    """Return the response to a request, None where none is wanted, or it is no request."""
    try:
        request = decode(REQUEST, raw)
    except InvalidMessage as error:
        say(f'{service.name}: request ignored: {error}')
        return None
    header = request['header']
    code, answer = OK, None
    try:
        answer = _answer(service, header['identity']['api_id'], request['parameter'])
    except Refused as refusal:
        code = refusal.code
    if header['policy']['noreply']:
        if code != OK:  # else nobody learns it
            say(f'{service.name}: request {header["identity"]["api_id"]} refused with {code}')
        return None
    answer = answer or Answer()
    data = '' if answer.data is None else answer.data
    return encode(
        RESPONSE,
        {
            'header': {'identity': header['identity'], 'status': {'code': code}},
            'data': data if isinstance(data, str) else json.dumps(data),
            'binary': answer.binary,
        },
    )


def _answer(service: Service, api_id: int, parameter: str) -> Answer | None:
    if api_id == _VERSION:
        return Answer(service.version)
    handler = service.handler(api_id)
    if handler is None:
        raise Refused(NOT_IMPLEMENTED)
    return handler(_read_parameter(parameter))


def _read_parameter(text: str) -> Parameters:
    try:
        said = json.loads(text) if text else {}
    except (ValueError, RecursionError):
        raise Refused(BAD_PARAMETER) from None
    if not isinstance(said, dict):
        raise Refused(BAD_PARAMETER)
    return said


def number(parameters: Parameters, name: str) -> float:
    """Return a finite number of a request, or raise Refused."""
    value = parameters.get(name)
    if not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
        raise Refused(BAD_PARAMETER)
    return float(value)


def flag(parameters: Parameters, name: str) -> bool:
    """Return a yes or no of a request: true, false, 1 or 0; or raise Refused."""
    value = parameters.get(name)
    if value not in (True, False):
        raise Refused(BAD_PARAMETER)
    return bool(value)


def word(parameters: Parameters, name: str) -> str:
    """Return a text of a request, or raise Refused."""
    value = parameters.get(name)
    if not isinstance(value, str):
        raise Refused(BAD_PARAMETER)
    return value


class Leases(Service):
    """
    Gives the one lease that a service has; it is asked beside the service.

    It refuses a second client its lease, but no command: here the client that asked last drives,
    and `Drivers` says which that is.
    """

    version = ''

    def __init__(self, service: str, now: Callable[[], float]) -> None:
        """Lease a service; `now` returns the time [s]."""
        self.name = service + LEASE
        self._now = now
        self._id = 0
        self._renewed = -math.inf
        self._handlers = {_APPLY: self._apply, _RENEW: self._renew}

    def _apply(self, _: Parameters) -> Answer:
        if self._now() - self._renewed <= _TERM:
            raise Refused(LEASE_TAKEN)
        self._id += 1
        self._renewed = self._now()
        return Answer({'id': self._id, 'term': round(1e6 * _TERM)})

    def _renew(self, _: Parameters) -> None:
        if self._now() - self._renewed > _TERM:
            raise Refused(LEASE_GONE)
        self._renewed = self._now()
