# SPDX-License-Identifier: Apache-2.0
"""
Writes the samples of golden/ by the SDK's own classes: run in an environment of its own.

    python3 -m venv sdk && sdk/bin/pip install cyclonedds==11.0.1 unitree-sdk2py-dimos==1.0.3
    sdk/bin/python tests/unitree_bridge/make_golden.py

Each sample is a message as the SDK sends it (*.cdr) and its values (*.json). It imports nothing
of ours.
"""

import dataclasses
import importlib
import json
from pathlib import Path
import random

from unitree_sdk2py.idl import default, unitree_api
from unitree_sdk2py.utils.crc import CRC

FOLDER = Path(__file__).with_name('golden')
FIXED = {
    'low_cmd': default.unitree_go_msg_dds__LowCmd_,
    'low_state': default.unitree_go_msg_dds__LowState_,
    'sport_mode_state': default.unitree_go_msg_dds__SportModeState_,
    'wireless_controller': default.unitree_go_msg_dds__WirelessController_,
}
MODULES = (
    'go2.sport.sport_api',
    'go2.obstacles_avoid.obstacles_avoid_api',
    'go2.robot_state.robot_state_api',
    'go2.video.video_api',
    'go2.vui.vui_api',
    'comm.motion_switcher.motion_switcher_api',
)
SEED = 20261125


def draw(name, rng):
    """Return a number of a type that all its bytes are needed for."""
    if name == 'float32':
        return rng.randrange(-(2**20), 2**20) / 1024.0
    # The SDK's checksum takes some short numbers as signed ones: they have no highest bit here.
    size = {'uint8': 7, 'uint16': 15}.get(name) or int(name.lstrip('uint'))
    low = 0 if name[0] == 'u' else -(2 ** (size - 1))
    return rng.randrange(low, low + 2**size)


def fill(message, rng):
    """Give every field of a message a number of its own."""
    for name, kind in members(message):
        value = getattr(message, name)
        if dataclasses.is_dataclass(value):
            fill(value, rng)
        elif isinstance(value, list) and value and dataclasses.is_dataclass(value[0]):
            for part in value:
                fill(part, rng)
        elif isinstance(value, list):
            setattr(message, name, [draw(kind, rng) for _ in value])
        else:
            setattr(message, name, draw(kind, rng))


def members(message):
    """Yield the name of each field and the type of its numbers."""
    for field in dataclasses.fields(message):
        text = str(field.type)
        known = ('uint8', 'uint16', 'uint32', 'int16', 'int32', 'int8', 'float32')
        yield field.name, next((name for name in known if name in text), '')


def write(name, message):
    """Write a message and its values."""
    (FOLDER / f'{name}.cdr').write_bytes(message.serialize())
    (FOLDER / f'{name}.json').write_text(json.dumps(dataclasses.asdict(message)) + '\n')


def main():
    """Write all samples."""
    FOLDER.mkdir(exist_ok=True)
    rng = random.Random(SEED)
    for name, make in FIXED.items():
        message = make()
        fill(message, rng)
        if hasattr(message, 'crc'):
            message.crc = CRC().Crc(message)
        write(name, message)
    api = unitree_api.msg.dds_
    identity = api.RequestIdentity_(id=2**40 + 3, api_id=1008)
    header = api.RequestHeader_(identity, api.RequestLease_(7), api.RequestPolicy_(1, True))
    write('request', api.Request_(header, '{"x": 0.3, "y": 0.0, "z": 0.0}', []))
    header = api.ResponseHeader_(identity, api.ResponseStatus_(3203))
    write_ids()
    write('response', api.Response_(header, '{"name": "mcf"}', [255, 216, 255]))


def write_ids():
    """Write the ids of every service that the SDK has a client of, and its version."""
    ids = {}
    for name in MODULES:
        module = importlib.import_module(f'unitree_sdk2py.{name}')
        said = {key: value for key, value in vars(module).items() if key.isupper()}
        (service,) = (value for key, value in said.items() if key.endswith('_SERVICE_NAME'))
        (version,) = (value for key, value in said.items() if key.endswith('_API_VERSION'))
        known = {key.split('_API_ID_')[1]: n for key, n in said.items() if '_API_ID_' in key}
        ids[service] = {'version': version, 'ids': known}
    (FOLDER / 'ids.json').write_text(json.dumps(ids) + '\n')


if __name__ == '__main__':
    main()
