# SPDX-License-Identifier: Apache-2.0
"""Unitree's interface of one robot: incoming and outgoing messages."""

from collections.abc import Callable

from quadruped_sim.keys import StateName
from wasd_core.errors import InvalidMessage
from wasd_core.robot_io import JointCommand
from wasd_core.timing import Beat, Watchdog

from unitree_bridge import topics
from unitree_bridge.legs_robot import LegsRobot
from unitree_bridge.low_level import LowLevel, LowStates, tick_of
from unitree_bridge.motion import Motion, SILENCE
from unitree_bridge.remote import read_remote, Remote
from unitree_bridge.robot import to_motors
from unitree_bridge.rpc import Leases, serve, Service
from unitree_bridge.services import (
    MotionSwitcher,
    ObstaclesAvoid,
    RobotState,
    Sport,
    VideoHub,
    Vui,
)
from unitree_bridge.sport_state import SportStates
from unitree_bridge.utlidar import LidarTopics
from unitree_bridge.video import FrontVideo
from unitree_bridge.wire import Wire

# How often LowState is told, SportModeState and the remote, the two states on `rt/lf`,
# and who listens is looked up [Hz].
LOW_STATE_RATE = 500.0
SPORT_STATE_RATE = 50.0
SLOW_RATE = 20.0
LOOK_RATE = 20.0
# What the remote says holds for so long [s].
_REMOTE_SILENCE = 0.5
# In sync physics waits so long at a time, and in all for a program that has answered [s of wall
# time]; commands that are no answer are counted as so long, too.
HOLD = 0.01
PATIENCE = 1.0
SERVICES = ('sport', 'motion_switcher', 'obstacles_avoid', 'robot_state', 'videohub', 'vui')
LEASED = 'sport'
MOVING = ('sport', 'obstacles_avoid')
OUT = (*topics.OUT, *map(topics.response, (*SERVICES, f'{LEASED}_lease')))
_REQUESTS = tuple(map(topics.request, (*SERVICES, f'{LEASED}_lease')))
INTO = (*topics.IN, *_REQUESTS)
_PICTURES = topics.response('videohub')
# What comes now and then, looked for all at once.
_ASKED = (topics.REMOTE, *_REQUESTS)


class Bridge:
    """
    Serves Unitree's interface.

    In each instant `step` comes before our controller, `in_force` after it.

    With `is_synced` time goes on only when `may_advance` says so: it begins with the first LowCmd,
    call of a service that moves, or key, and waits in each instant for the LowCmd that answers its
    LowState; no longer than PATIENCE for a program that has gone.
    """

    def __init__(
        self,
        robot: LegsRobot,
        wire: Wire,
        say: Callable[[str], None],
        *,
        is_synced: bool = False,
        lidar: LidarTopics | None = None,
    ) -> None:
        self._robot, self._wire, self._lidar = robot, wire, lidar
        self._say = Teller(say, lambda: robot.time)
        self._is_synced = is_synced
        self.low = LowLevel(self._say)
        self.motion = Motion(robot, self._say)
        self._low_states, self._sport_states = LowStates(), SportStates()
        self._video = FrontVideo(robot, self._say)
        self._wanted: list[FrontVideo | LidarTopics] = []
        self.services = self._make_services()
        self._looks, self._sport_beat, self._low_beat, self._slow_beat = (Beat() for _ in range(4))
        self._sticks, self._buttons = Watchdog(_REMOTE_SILENCE), Watchdog(_REMOTE_SILENCE)
        # Sticks that are ignored until they are centred, or silent for so long.
        self._ignored_sticks = Watchdog(SILENCE)
        self._down: frozenset[str] = frozenset()
        self._answers = False  # the program that commands the motors
        self._has_begun = not is_synced
        self._told_at = self._held_at = -1.0
        self._held, self._is_answered = 0.0, False
        self._in_force: JointCommand | None = None

    def _make_services(self) -> list[Service]:
        avoid = ObstaclesAvoid(self._robot, lambda velocity: self._sport.move(velocity))
        self._sport = Sport(self.motion, self.low, avoid, self._say)
        self._video_hub = VideoHub(self._robot, self._say)
        return [
            self._sport,
            MotionSwitcher(self.low, self.release_motors),
            avoid,
            RobotState(self.low, self.release_motors, list(SERVICES)),
            self._video_hub,
            Vui(),
            Leases(LEASED, lambda: self._robot.time),
        ]

    def may_advance(self) -> bool:
        """Return whether time may go on; where it may not, tell of this instant and wait a bit."""
        if not self._is_synced:
            return True
        now = self._robot.time
        if self._held_at != now:
            self._held_at, self._held, self._is_answered = now, 0.0, False
            self._tell(now)
        self.serve()
        self._answers &= self.low.is_live
        self._has_begun |= self._robot.coming_state != StateName.PASSIVE
        if self._is_answered or (self._has_begun and not self._answers):
            return True
        return self._await_command(now)

    def step(self, dt: float) -> None:
        """Tell of this instant, and take what has come, `dt` [s] after the one before."""
        self._tell(self._robot.time)
        if not self._is_answered or self._held_at != self._robot.time:
            self._take_command()
        has_come = self._wire.has_come(_ASKED)
        if has_come:
            self._serve()
        self._follow_remote(dt, has_come)
        if self.low.is_released and self._robot.state != StateName.PASSIVE:
            self._robot.let_go()
        self.motion.step(dt)
        self._in_force = self.low.step(dt)

    @property
    def in_force(self) -> JointCommand | None:
        """What a program has the motors do, as leg angles; None where our controller has them."""
        return None if self._in_force is None else to_motors(self._in_force)

    def serve(self) -> None:
        """Answer requests, also while simulated time stands still."""
        if self._wire.has_come(_ASKED):
            self._serve()

    def _serve(self) -> None:
        for service in self.services:
            for raw in self._wire.take(topics.request(service.name)):
                self._has_begun |= service.name in MOVING
                answer = serve(service, raw, self._say)
                if answer is not None:
                    self._wire.publish(topics.response(service.name), answer)

    def release_motors(self, why: str = 'the motors are released') -> None:
        """Take the motors from our controller, as a program that commands them itself does."""
        self._say(f'{why}; our controller is stopped')
        self.motion.forget()
        self.low.release()
        self._robot.let_go()

    def give_way(self) -> None:
        """Let another drive: what a program has asked of our controller is forgotten."""
        self.motion.forget()
        if not self.low.is_live:
            self.low.select()

    def disarm(self) -> None:
        """Ignore what programs command now: the motors damp."""
        self.motion.disarm()
        if self._sticks.is_alive:
            self._ignored_sticks.hear()
        self._forget_commands()

    def _forget_commands(self) -> None:
        self.low.stop()
        self._in_force = None
        self._sticks.reset()

    def reset(self) -> None:
        """Forget the past: the robot is back at its start."""
        self._forget_commands()
        self.low.reset()
        self.motion.reset()
        self._has_begun = not self._is_synced

    def close(self) -> None:
        """Be gone for all programs."""
        self._wire.close()

    def _tell(self, time: float) -> None:
        """Tell of an instant, once."""
        if self._told_at == time:
            return
        self._told_at = time
        wire = self._wire
        if self._looks.is_due(time, LOOK_RATE):
            self._look()
        wants_sport = self._sport_beat.is_due(time, SPORT_STATE_RATE)
        wants_slow = self._slow_beat.is_due(time, SLOW_RATE)
        due = (
            (topics.LOW_STATE, self._low_beat.is_due(time, LOW_STATE_RATE)),
            (topics.SPORT_MODE_STATE, wants_sport),
            (topics.SLOW_LOW_STATE, wants_slow),
            (topics.SLOW_SPORT_STATE, wants_slow),
        )
        told = [topic for topic, is_due in due if is_due and wire.is_heard(topic)]
        if told:
            self._tell_states(time, told)
        if wants_sport and wire.is_heard(topics.REMOTE):
            wire.publish(topics.REMOTE, self._robot.remote.message())
        for slow in self._wanted:
            slow.step(wire)

    def _look(self) -> None:
        """Find out who listens, and so what else is to be told in each instant."""
        wire = self._wire
        wire.look()
        self._wanted = [self._video] if wire.is_heard(topics.VIDEO) else []
        if wire.is_heard(_PICTURES):  # a client that will ask soon, and wait for a second or three
            self._video_hub.prepare()
        if self._lidar is not None:
            self._lidar.take_switch(wire)
            if any(map(wire.is_heard, topics.LIDAR_OUT)):
                self._wanted.append(self._lidar)

    def _tell_states(self, time: float, told: list[topics.Topic]) -> None:
        """Tell of what is measured now, on topics of LowState and SportModeState."""
        senses = self._robot.senses()
        for topic in told:
            if topic.shape is topics.LOW_STATE.shape:
                raw = self._low_states.write(time, senses, self._robot.remote.in_low_state())
            else:
                raw = self._sport_states.write(self._robot, senses)
            self._wire.publish(topic, raw)

    def _take_command(self) -> bool:
        """Take the last LowCmd that has come; return whether it counts."""
        taken = self._wire.take(topics.LOW_CMD)
        was_released = self.low.is_released
        sender = self._wire.sender(topics.LOW_CMD)
        if not taken or not self.low.take(taken[-1], self._robot.take_motors, sender):
            return False
        self._answers = self._has_begun = True
        if not was_released:
            self.release_motors('LowCmd: an SDK program has the motors')
        return True

    def _await_command(self, now: float) -> bool:
        """Wait for the answer to an instant: a command that names its tick, or none at all."""
        if self._wire.wait(topics.LOW_CMD, HOLD) and self._take_command():
            self._is_answered = self.low.tick in (0, tick_of(now))
        if self._is_answered:
            return True
        if not self._has_begun:
            # A program that joined meanwhile has not got the LowState of this instant.
            self._look()
            if self._wire.is_heard(topics.LOW_STATE):
                self._tell_states(now, [topics.LOW_STATE])
            return False
        self._held += HOLD
        if self._held < PATIENCE:
            return False
        self._say(f'no LowCmd for {PATIENCE:g} s: time no longer waits for it')
        self._answers = False
        return True

    def _follow_remote(self, dt: float, has_come: bool) -> None:
        """Drive as a program says by wirelesscontroller that a hand does."""
        was_held = self._sticks.is_alive
        self._sticks.step(dt)
        self._buttons.step(dt)
        self._ignored_sticks.step(dt)
        for raw in self._wire.take(topics.REMOTE) if has_come else ():
            try:
                self._take_remote(read_remote(raw))
            except InvalidMessage as error:
                self._say(f'wirelesscontroller ignored: {error}')
        if not self._buttons.is_alive:
            self._down = frozenset()
        if was_held and not self._sticks.is_alive:
            self.motion.stop()

    def _take_remote(self, remote: Remote) -> None:
        is_ignored = self._ignored_sticks.is_alive and not remote.is_centred
        if is_ignored:
            self._ignored_sticks.hear()
        else:
            self._ignored_sticks.reset()
        if not self._sport.follows_remote:
            return
        self._buttons.hear()
        pressed, self._down = remote.down - self._down, remote.down
        self._obey(remote.down, pressed)
        is_held = self._sticks.is_alive
        if is_ignored or self.low.is_released:
            return
        if remote.is_centred:
            if is_held:
                self._sticks.reset()
                self.motion.stop()
            return
        full = self._robot.full_speed
        velocity = (full[0] * remote.ly, -full[1] * remote.lx, -full[2] * remote.rx)
        if self.motion.move(velocity):
            self._sticks.hear()

    def _obey(self, down: frozenset[str], pressed: frozenset[str]) -> None:
        """Do what newly pressed buttons of Unitree's remote ask for."""
        if 'L2' in down and 'B' in pressed:
            self._sport.damp()
        elif self.low.is_released:
            return
        elif 'L2' in down and 'A' in pressed:
            stands = self._robot.state == StateName.FIXED_STAND
            self.motion.go(StateName.LIE_DOWN if stands else StateName.FIXED_STAND)
        elif 'START' in pressed:
            self.motion.go(StateName.MOVE_BASE)


# A line that goes on coming is said once; again, when it has not come for so long [s].
_FRESH = 10.0
# So many different ones are remembered.
MOST_LINES = 100


class Teller:
    """Says a line that comes again and again once; `now` returns the time [s]."""

    def __init__(self, say: Callable[[str], None], now: Callable[[], float]) -> None:
        self._say, self._now = say, now
        self._came: dict[str, float] = {}

    def __call__(self, text: str) -> None:
        """Say a line, if it is a new one."""
        now = self._now()
        is_new = now - self._came.get(text, -_FRESH) >= _FRESH
        if is_new and len(self._came) >= MOST_LINES:
            self._came = {line: at for line, at in self._came.items() if now - at < _FRESH}
        if text in self._came or len(self._came) < MOST_LINES:
            self._came[text] = now
            if is_new:
                self._say(text)
