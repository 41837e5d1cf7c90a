# SPDX-License-Identifier: Apache-2.0
"""`--latched`: in every state of legs an e-stop leaves motors that only brake, until its reset."""

import itertools
import json

import pytest
from quadruped_sim.keys import keys_between, STATE_KEYS, StateName
from unitree_rig import low_cmd, request, STANDING, TableWire
from wasd_bringup.run.drivers import SILENCE
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_bringup.run.unitree import UnitreeDriver

pytestmark = pytest.mark.slow

VELOCITY = (0.3, 0.0, 0.3)
KEYS = ('w', *STATE_KEYS)
ORIGINS = {
    'a key': lambda run: run.press('ESC'),
    'a key on the page': lambda run: run.press('ESC', 'page'),
    'the button': lambda run: run.e_stop('page'),
    'a script': lambda run: run.press('ESC', 'script'),
    'a client': lambda run: run.robot.press('ESC', 'foxglove 1'),
    'a service': lambda run: run.e_stop('service e_stop'),
}
GO2_STATES = [*StateName, 'gallop', 'SDK velocity', 'SDK motors']


class Held:
    """A run of legs that every source holds, and that notes what its motors are told."""

    def __init__(self, **options):
        self.run = Run(RunOptions(preset='wasd', speed=0.0, latched=True, **options))
        self.robot = self.run.robot
        self.wire = None
        if self.robot.name == 'go2':
            self.wire = TableWire()
            self.run.join(UnitreeDriver(self.robot, self.wire))
        self.told = []
        self.holds = False
        apply = self.robot.world.apply

        def note(command):
            self.told.append(command)
            apply(command)

        self.robot.world.apply = note

    def hold(self):
        """Send what each source sends while it holds."""
        for source in ('page', 'gamepad', 'foxglove 1', 'script', 'navigator'):
            self.robot.drive(VELOCITY, source)
            for key in KEYS:
                self.run.press(key, source)
        for key in KEYS:
            self.run.press(key)
            self.robot.press(key, 'recording')
        self.robot.take_topic('cmd_vel', velocity=VELOCITY)
        if self.wire is not None:
            self.program(1004)
            self.program(1008, x=0.3, y=0.0, z=0.3)
            self.wire.come['rt/lowcmd'].append(low_cmd(STANDING, kp=60.0, kd=5.0))

    def program(self, api_id, **parameter):
        """Call the service `sport`."""
        asked = request(1, api_id, json.dumps(parameter))
        self.wire.come['rt/api/sport/request'].append(asked)

    def pass_time(self, seconds, each=lambda: None):
        """Simulate for so long [s], and do something twenty times a second."""
        for _ in range(round(seconds / 0.05)):
            each()
            self.run.simulation.advance(50)

    def get_to(self, state, source):
        """Get a Go2 to do something by the keys of somebody."""
        if state == 'SDK motors':
            self.pass_time(SILENCE + 0.1)  # all let go
            motors = low_cmd(STANDING, kp=60.0, kd=5.0)
            self.pass_time(0.5, lambda: self.wire.come['rt/lowcmd'].append(motors))
            return
        wanted = {'gallop': StateName.MOVE_BASE, 'SDK velocity': StateName.TROTTING}
        for key in keys_between(StateName.PASSIVE, wanted.get(state, state)):
            self.run.press(key, source)
            self.pass_time(1.1 if key == '2' else 0.1)
        if state == 'gallop':
            self.run.press('N', source)
            self.run.press('N', source)
        drive = {
            'gallop': lambda: self.robot.drive(VELOCITY, 'page'),
            'SDK velocity': lambda: self.program(1008, x=0.3, y=0.0, z=0.3),
            StateName.MOVE_BASE: lambda: self.robot.drive(VELOCITY, 'page'),
            StateName.POLICY: lambda: self.robot.drive(VELOCITY, 'page'),
        }
        self.pass_time(0.3, drive.get(state, lambda: None))

    def motors_only_brake(self, seconds):
        """Hold everything, and return whether all that motors are told is to stand still."""
        self.told.clear()
        self.pass_time(seconds, self.hold)
        assert len(self.told) > 200 * seconds
        return not any(
            part.any() for each in self.told for part in (each.velocity, each.effort, each.kp)
        )


def stop_holds_until_its_reset(held, origin):
    """Stop a run from somewhere, and release it at the end."""
    held.hold()
    assert held.robot.drivers.state.driver
    ORIGINS[origin](held.run)
    assert not any(held.robot.press(key, 'foxglove 2') for key in KEYS)  # somebody new
    assert not held.robot.drive(VELOCITY, 'foxglove 2')
    assert held.motors_only_brake(0.2)
    assert held.robot.status().state == 'E-STOP'
    held.run.press('ENTER')
    assert held.robot.drivers.stopped_by == ''
    assert held.motors_only_brake(0.15)  # what is still held does not count either


def test_until_the_reset_motors_of_a_go2_in_any_state_only_brake():
    held = Held(robot='go2', description='go2', policy='ours')
    for state, origin in zip(GO2_STATES, itertools.cycle(ORIGINS), strict=False):
        held.get_to(state, f'client {state}')  # who is new need not let go first
        if state in list(StateName):
            assert held.robot.state == state
        stop_holds_until_its_reset(held, origin)
        held.run.press('BACKSPACE')
    held.run.close()


def test_until_the_reset_motors_of_a_g1_only_brake_and_then_a_new_press_counts():
    held = Held(robot='g1', description='g1')
    held.run.press('2')
    held.pass_time(0.5)
    assert held.robot.state == 'stand'
    stop_holds_until_its_reset(held, 'a key')
    held.pass_time(SILENCE + 0.1)
    held.run.press('2')
    held.pass_time(0.05)
    assert held.robot.state == 'stand'
    held.run.close()
