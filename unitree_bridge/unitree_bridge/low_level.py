# SPDX-License-Identifier: Apache-2.0
"""The motors by themselves: LowCmd in, LowState out, both as bytes."""

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np
from wasd_core.errors import InvalidMessage
from wasd_core.robot_io import BaseState, JointCommand
from wasd_core.timing import Watchdog

from unitree_bridge.cdr import check_header, encode, Layout
from unitree_bridge.crc import Checksum
from unitree_bridge.motion import SILENCE as SILENCE_AFTER_A_STOP
from unitree_bridge.robot import Senses
from unitree_bridge.shapes import LOW_CMD, LOW_STATE

COUNT = 12  # motors that the Go2 has
# A position or velocity that is no aim, whatever its gain: PosStopF and VelStopF of the SDK.
POSITION_STOP, VELOCITY_STOP = 2.146e9, 16000.0
# What is as far away is meant so, too: numbers of 32 bits are coarse there [rad], [rad/s].
_NO_AIM = np.array(((1e6,), (0.999 * VELOCITY_STOP,)))
ENABLED = 1  # a motor's mode in which it follows commands
# Motors that hear nothing for longer damp [s].
SILENCE = 0.1

_CMD = Layout(LOW_CMD)
_CMD_SUM = Checksum(_CMD)
_Q, _DQ = (_CMD.field(f'motor_cmd.{name}') for name in ('q', 'dq'))
_MODES = _CMD.places_of('motor_cmd.mode')[:COUNT]
_RESERVE = _CMD.field('reserve')


class LowCommand(NamedTuple):
    """
    A program's command to the motors, in Unitree's order; the tick that it answers, or 0.

    `idle` are the motors that are asked for torque and have a mode in which there is none.
    """

    command: JointCommand
    tick: int
    idle: tuple[int, ...] = ()


def read_low_command(raw: bytes) -> LowCommand:
    """
    Return what a LowCmd asks for.

    A motor that is not enabled gets no torque; one without an aim, none by that aim's gain.

    Raises:
        InvalidMessage: it is no LowCmd, its checksum is wrong, or it asks for what cannot be.
    """
    if len(raw) != _CMD.size:
        raise InvalidMessage(f'got {len(raw)} bytes, wanted {_CMD.size}')
    check_header(raw)
    wanted = _CMD_SUM.of(raw)
    if _CMD_SUM.in_message(raw) != wanted:
        got = _CMD_SUM.in_message(raw)
        raise InvalidMessage(f'checksum: got {got:#010x}, wanted {wanted:#010x}')
    # q, dq, tau, kp and kd of a motor follow each other, (5, COUNT).
    aims = np.ndarray((5, COUNT), _Q.kind, raw, _Q.at, (_DQ.at - _Q.at, _Q.step)).astype(float)
    no_aim = np.abs(aims[:2]) >= _NO_AIM
    if no_aim.any():
        # What no gain multiplies need not even be a number; but NaN is never meant.
        aims[3:][no_aim] = aims[:2][no_aim] = 0.0
    if not np.isfinite(aims).all():
        raise InvalidMessage('not all of q, dq, tau, kp, kd are finite')
    if (aims[3:] < 0.0).any():
        raise InvalidMessage('a gain is below 0')
    enabled = np.frombuffer(raw, np.uint8)[_MODES] == ENABLED
    idle = tuple(np.flatnonzero(aims[2:].any(axis=0) & ~enabled).tolist())
    q, dq, tau, kp, kd = aims * enabled
    return LowCommand(JointCommand(q, dq, tau, kp, kd), int(_RESERVE.of(raw)[0]), idle)


class LowLevel:
    """
    Who commands the motors: an SDK program by LowCmd, or our controller.

    The first command that counts, or `release`, stops our controller; `select` gives the motors
    back to it. What is wrong with a command is said once, until the program was silent, and the
    command before it stays in force.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._heard = Watchdog(SILENCE)
        self._asks = Watchdog(SILENCE_AFTER_A_STOP)  # for the motors, whether that counts or not
        self.reset()

    def reset(self) -> None:
        """Leave the motors to our controller."""
        self.is_released = False
        self.refused = 0
        self._is_ignored = False
        self._senders = (0, 0)  # the last, and the other one before
        self._asks.reset()
        self.stop()

    @property
    def is_live(self) -> bool:
        """Whether a program commands the motors now."""
        return self._last is not None and self._heard.is_alive

    @property
    def tick(self) -> int:
        """The tick that the command in force answers, by its `reserve`; 0 where it says none."""
        return self._last.tick if self._last is not None else 0

    def release(self) -> None:
        """Take the motors from our controller."""
        self.is_released = True

    def select(self) -> None:
        """Give them back to it."""
        self.is_released = False
        self.stop()

    def stop(self) -> None:
        """Forget the command in force: the motors damp until the next."""
        self._last: LowCommand | None = None
        self._told: set[str] = set()
        self._heard.reset()

    def damp(self) -> None:
        """Stop, and ignore a program that commands now until it has been silent."""
        self._is_ignored = self._asks.is_alive
        self.stop()

    def take(self, raw: bytes, admit: Callable[[], bool], sender: int = 0) -> bool:
        """Take a LowCmd if it is one, and if `admit` says that it counts; return whether."""
        try:
            command = read_low_command(raw)
        except InvalidMessage as error:
            self.refused += 1
            self._complain(f'LowCmd ignored: {error}')
            return False
        self._asks.hear()
        if self._is_ignored or not admit():
            self.refused += 1
            self._complain('LowCmd ignored: the robot was stopped (end the program)')
            return False
        self._look_for_mistakes(command, sender)
        self._last = command
        self._heard.hear()
        self.release()
        return True

    def _look_for_mistakes(self, command: LowCommand, sender: int) -> None:
        if command.idle:
            motors = ', '.join(map(str, command.idle))
            self._complain(f'LowCmd: no torque, as the mode is not 1, in motors {motors}')
        last, other = self._senders
        if sender != last:
            if sender == other and self.is_live:
                self._complain('LowCmd: two programs command the motors in turn (end one of them)')
            self._senders = sender, last

    def step(self, dt: float) -> JointCommand | None:
        """Let `dt` [s] pass; return the command in force, None where our controller's is."""
        was_live = self.is_live
        self._heard.step(dt)
        self._asks.step(dt)
        self._is_ignored &= self._asks.is_alive
        if was_live and not self.is_live:
            self._say(f'no LowCmd for {SILENCE:g} s: the motors damp')
            self.stop()
        return self._last.command if self._last is not None else None

    def _complain(self, text: str) -> None:
        # The numbers in it differ; what is wrong does not.
        kind = text.partition(' got ')[0]
        if kind not in self._told:
            self._told.add(kind)
            self._say(text)


# What a simulated robot has no measure of: [degrees C], [V], [A], [%].
_TEMPERATURE, _VOLTAGE, _CURRENT, _CHARGE = 30, 29.6, 1.0, 100
_NOWHERE = np.zeros(3)


class LowStates:
    """
    Writes LowState messages, one after the other into the same memory.

    `tick` counts simulated milliseconds. Motors 12 to 19, `ddq` and `*_raw` are as nothing
    measures them: zero. Battery and temperatures are constant.
    """

    def __init__(self) -> None:
        layout = Layout(LOW_STATE)
        battery = {'soc': _CHARGE, 'current': -round(1e3 * _CURRENT)}
        ambient = {'temperature_ntc1': _TEMPERATURE, 'temperature_ntc2': _TEMPERATURE}
        power = {'power_v': _VOLTAGE, 'power_a': _CURRENT, 'bms_state': battery}
        motors = [{'mode': int(i < COUNT), 'temperature': _TEMPERATURE} for i in range(20)]
        constant = {'head': (0xFE, 0xEF), 'level_flag': 0xFF, 'motor_state': motors}
        self._raw = bytearray(encode(LOW_STATE, constant | ambient | power))
        self._sum = Checksum(layout)

        def view(path: str) -> np.ndarray:
            return layout.field(path).of(self._raw)

        self._imu = imu_view(layout, self._raw)
        view('imu_state.temperature')[:] = _TEMPERATURE
        self._joints = [view(f'motor_state.{name}')[:COUNT] for name in ('q', 'dq', 'tau_est')]
        self._foot_force, self._foot_force_est = view('foot_force'), view('foot_force_est')
        self._tick, self._remote = view('tick'), view('wireless_remote')

    def write(self, time: float, senses: Senses, remote: bytes) -> bytes:
        """Return the message of a simulated time [s]; `remote` is the remote's state (40)."""
        for view, part in zip(self._joints, senses.joints, strict=True):
            view[:] = part
        self._imu[:] = imu_numbers(senses)
        self._foot_force[:] = np.rint(senses.foot_force)
        self._foot_force_est[:] = np.rint(senses.foot_force_est)
        self._tick[0] = tick_of(time)
        self._remote[:] = np.frombuffer(remote, np.uint8)
        self._sum.seal(self._raw)
        return bytes(self._raw)


def imu_view(layout: Layout, raw: bytearray) -> np.ndarray:
    """Return where quaternion, gyroscope, accelerometer and rpy follow each other, (13,)."""
    first = layout.field('imu_state.quaternion')
    return np.ndarray((13,), first.kind, raw, first.at)


def imu_numbers(senses: Senses) -> list[float]:
    """Return what belongs there, 13 numbers."""
    imu = senses.imu
    rpy = BaseState(_NOWHERE, imu.orientation, _NOWHERE, _NOWHERE).rpy
    parts = imu.orientation, imu.angular_velocity, imu.linear_acceleration, rpy
    return [number for part in parts for number in part.tolist()]


def tick_of(time: float) -> int:
    """Return the tick of a simulated time [s]: milliseconds, in 32 bits."""
    return math.floor(1e3 * time + 0.5) % (1 << 32)
