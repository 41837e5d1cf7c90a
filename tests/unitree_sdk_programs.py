# SPDX-License-Identifier: Apache-2.0
"""Programs of Unitree's SDK, as users write them: DOMAIN PROGRAM; each prints what it saw."""

import json
import os
from pathlib import Path
import runpy
import sys
import threading
import time

from terminals import PATIENCE
from unitree_sdk2py.comm.motion_switcher.motion_switcher_client import MotionSwitcherClient
from unitree_sdk2py.core.channel import (
    ChannelFactoryInitialize,
    ChannelPublisher,
    ChannelSubscriber,
)
from unitree_sdk2py.go2.obstacles_avoid.obstacles_avoid_client import ObstaclesAvoidClient
from unitree_sdk2py.go2.robot_state.robot_state_client import RobotStateClient
from unitree_sdk2py.go2.sport import sport_api
from unitree_sdk2py.go2.sport.sport_client import SportClient
from unitree_sdk2py.idl.default import unitree_go_msg_dds__LowCmd_
from unitree_sdk2py.idl.unitree_go.msg.dds_ import LowCmd_, LowState_, SportModeState_
from unitree_sdk2py.rpc.client_base import ClientBase
from unitree_sdk2py.utils.crc import CRC
from unitree_sdk2py.utils.thread import RecurrentThread

STANDING, CROUCHED = 4 * [0.0, 0.67, -1.3], 4 * [0.0, 1.2, -2.4]


class LowLevel:
    """LowState in, LowCmd out."""

    def __init__(self):
        self.states, self.came = [], threading.Event()
        self.command, self.crc = unitree_go_msg_dds__LowCmd_(), CRC()
        self.command.head[:] = [0xFE, 0xEF]
        self.command.level_flag = 0xFF
        for motor in self.command.motor_cmd:
            motor.mode, motor.q, motor.dq = 1, 2.146e9, 16000.0
        self.publisher = ChannelPublisher('rt/lowcmd', LowCmd_)
        self.publisher.Init()
        self.on_state = lambda state: None
        self.subscriber = ChannelSubscriber('rt/lowstate', LowState_)
        self.subscriber.Init(self.hear, 10)

    def hear(self, state):
        self.states.append((state.tick, [motor.q for motor in state.motor_state[:12]]))
        self.came.set()
        self.on_state(state)

    def send(self, aims, kp=60.0, kd=5.0, reserve=0):
        for motor, aim in zip(self.command.motor_cmd[:12], aims, strict=True):
            motor.q, motor.dq, motor.kp, motor.kd, motor.tau = aim, 0.0, kp, kd, 0.0
        self.command.reserve = reserve
        self.command.crc = self.crc.Crc(self.command)
        self.publisher.Write(self.command)


def between(a, b, share):
    """Return a pose on the way from one to another."""
    share = min(max(share, 0.0), 1.0)
    return [(1.0 - share) * x + share * y for x, y in zip(a, b, strict=True)]


def client(kind):
    """Return a client."""
    made = kind()
    made.SetTimeout(PATIENCE)
    made.Init()
    return made


def heights():
    """Return a list to which sportmodestate's time and height are added."""
    heard = []
    subscriber = ChannelSubscriber('rt/sportmodestate', SportModeState_)
    subscriber.Init(
        lambda said: heard.append((said.stamp.sec + 1e-9 * said.stamp.nanosec, said)), 10
    )
    return heard


def pass_time(heard, seconds, each=lambda: None):
    """Wait for so much simulated time, by what was heard; do something meanwhile, at 20 Hz."""
    patience = time.monotonic() + PATIENCE
    while not heard and time.monotonic() < patience:
        time.sleep(0.05)
    end = heard[-1][0] + seconds
    while heard[-1][0] < end and time.monotonic() < patience:
        each()
        time.sleep(0.05)


def stand_by_motors():
    """Release the sport mode as the SDK's stand example does, then stand by a thread of 2 ms."""
    began = time.monotonic()
    low = LowLevel()
    low.came.wait(PATIENCE)
    discovery = time.monotonic() - began
    sport, switcher, heard = client(SportClient), client(MotionSwitcherClient), heights()
    _, mode = switcher.CheckMode()
    while mode['name']:
        sport.StandDown()
        switcher.ReleaseMode()
        _, mode = switcher.CheckMode()
        time.sleep(0.2)
    begin, count = low.states[-1][1], iter(range(10**9))

    def write():
        n = next(count)
        crouched = between(begin, CROUCHED, n / 250.0)
        low.send(crouched if n < 250 else between(CROUCHED, STANDING, n / 400.0 - 0.625))

    thread = RecurrentThread(interval=0.002, target=write, name='write')
    thread.Start()
    begin_of_stand = low.states[-1][0]
    patience = time.monotonic() + PATIENCE
    while low.states[-1][0] < begin_of_stand + 2200 and time.monotonic() < patience:
        time.sleep(0.05)
    ticks = [tick for tick, _ in low.states]
    lost = sum(b - a != 2 for a, b in zip(ticks, ticks[1:], strict=False))
    return {
        'height': heard[-1][1].body_height,
        'aim': max(abs(a - b) for a, b in zip(low.states[-1][1], STANDING, strict=True)),
        'lost': lost,
        'heard': len(ticks),
        'seconds': 1e-3 * (ticks[-1] - ticks[0]),
        'discovery': discovery,
    }


def sport():
    """Stand up and move, by the high level."""
    sport, heard = client(SportClient), heights()
    version = sport.GetServerApiVersion()
    code = sport.StandUp()
    pass_time(heard, 2.5)
    height, start = heard[-1][1].body_height, list(heard[-1][1].position)
    sport.BalanceStand()
    pass_time(heard, 2.0, lambda: sport.Move(0.3, 0, 0))
    sport.StopMove()
    pass_time(heard, 1.5)
    end, last = list(heard[-1][1].position), heard[-1][1]
    sport.StandDown()
    return {
        'version': version,
        'code': code,
        'height': height,
        'moved': end[0] - start[0],
        'velocity': list(last.velocity),
    }


def calls():
    """Ask every id of the sport service, and the other clients what they can be asked."""
    sport, switcher = client(SportClient), client(MotionSwitcherClient)
    state, avoid = client(RobotStateClient), client(ObstaclesAvoidClient)
    codes, took = {}, []
    for name in dir(sport_api):
        if name.startswith('SPORT_API_ID'):
            parameter = json.dumps({'x': 0, 'y': 0, 'z': 0, 'data': True})
            began = time.perf_counter()
            codes[name], _ = sport._Call(getattr(sport_api, name), parameter)
            took.append(time.perf_counter() - began)
    return {
        'codes': codes,
        'took': sorted(took),
        'mode': switcher.CheckMode(),
        'services': [each.name for each in state.ServiceList()[1]],
        'switch': state.ServiceSwitch('sport_mode', True),
        'avoid': [avoid.SwitchGet(), avoid.SwitchSet(False)],
        'select': switcher.SelectMode('mcf')[0],
    }


def in_sync(ticks=2000):
    """Squat and stand by what each LowState says, answer its tick; return what was measured."""
    low, over, ticks = LowLevel(), threading.Event(), int(ticks)

    def answer(state):
        if state.tick > 2 * ticks:
            over.set()
            return
        depth = 0.5 - 0.5 * min(state.tick / 1000.0, 1.0)
        if state.tick > 2000:
            depth = 0.5 if state.tick // 1000 % 2 else 0.0
        aims = between(STANDING, CROUCHED, depth)
        # By what is measured, too: a late answer would be another one.
        measured = [motor.q for motor in state.motor_state[:12]]
        low.send(between(aims, measured, 0.05), reserve=state.tick)

    low.on_state = answer
    assert over.wait(PATIENCE)
    return {'samples': {tick: q for tick, q in low.states if tick <= 2 * ticks}}


def round_trip(seconds=4.0, patience=PATIENCE):
    """Answer each LowState at once, with its tick; wait so long for the first."""
    low = LowLevel()
    low.on_state = lambda state: low.send(STANDING, kp=0.0, kd=0.0, reserve=state.tick)
    began = time.monotonic()
    low.came.wait(float(patience))
    first = time.monotonic()
    time.sleep(max(0.0, float(seconds) - (first - began)))
    over, ticks = time.monotonic(), [tick for tick, _ in list(low.states)]
    missed = sum((b - a) // 2 - 1 for a, b in zip(ticks, ticks[1:], strict=False))
    return {'heard': len(ticks), 'missed': missed, 'seconds': over - first}


def example(path):
    """
    Run an example of the SDK as it is; the network that it names is not this one.

    It waits seconds after each call for who reads along, which nobody does here, and three seconds
    for an answer, which takes a busy machine longer.
    """
    set_timeout, sleep = ClientBase.SetTimeout, time.sleep
    ClientBase.SetTimeout = lambda self, seconds: set_timeout(self, max(seconds, PATIENCE))
    time.sleep = lambda seconds: sleep(min(seconds, 0.1))
    sys.path.insert(0, str(Path(path).parent))
    runpy.run_path(path, run_name='__main__')
    return {}


PROGRAMS = (stand_by_motors, sport, calls, in_sync, round_trip, example)


def main():
    domain, name, *words = sys.argv[1:]
    # The first that initialises the SDK's factory does; later calls find that done.
    ChannelFactoryInitialize(int(domain), os.environ.get('SDK_NETWORK', 'lo'))
    (program,) = (program for program in PROGRAMS if program.__name__ == name)
    print(json.dumps(program(*words)), flush=True)


if __name__ == '__main__':
    main()
