# SPDX-License-Identifier: Apache-2.0
"""Programs of Unitree's SDK are one source of several: `Drivers` says that they drive."""

import json
import re

from contacts import touched
from descriptions import robot_named
import numpy as np
import pytest
from unitree_bridge.cdr import decode
from unitree_bridge.remote import Remote
from unitree_bridge.shapes import RESPONSE
from unitree_bridge.topics import LOW_STATE, REMOTE
from unitree_rig import low_cmd, positions, request, STANDING, TableWire
from wasd_bringup.run.drivers import SILENCE
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run
from wasd_bringup.run.sensing import SWAY
from wasd_bringup.run.unitree import idle_guard, UnitreeDriver
from wasd_core.errors import UserError

pytestmark = pytest.mark.slow
STOP_MOVE, STAND_UP, EULER, MOVE = 1003, 1004, 1007, 1008


class Commanded:
    """A run whose Go2 programs command over a wire that is two tables."""

    def __init__(self, guards=False, **options):
        asked = RunOptions(robot='go2', description='go2', preset='unitree', speed=0.0, **options)
        self.session = Run(asked)
        self.robot = self.session.robot
        self.wire = TableWire()
        # Five hundred a second: who commands the motors says so.
        self.wire.unheard.add(LOW_STATE.name)
        self.driver = UnitreeDriver(
            self.robot, self.wire, idle_guard(self.robot) if guards else None
        )
        self.session.join(self.driver)

    def run(self, seconds):
        """Simulate for so long [s]."""
        simulation = self.session.simulation
        end = self.robot.world.time + seconds - 1e-6
        while self.robot.world.time < end:
            simulation.advance(simulation.schedule.stride)

    def run_until(self, is_so, seconds):
        """Simulate until something holds, or for so long [s]."""
        for _ in range(round(seconds / 0.05)):
            if is_so():
                break
            self.run(0.05)

    def call(self, api_id, service='sport', **parameter):
        """Ask a service, and return its code."""
        name = f'rt/api/{service}'
        self.wire.come[f'{name}/request'].append(request(1, api_id, json.dumps(parameter)))
        self.run(0.002)
        answer = decode(RESPONSE, self.wire.told[f'{name}/response'][-1])
        return answer['header']['status']['code']

    def move(self, seconds):
        """Ask for 0.3 m/s as long [s] as a program does that repeats it."""
        for _ in range(round(seconds / 0.1)):
            self.call(MOVE, x=0.3, y=0.0, z=0.0)
            self.run(0.098)

    def hold_by_motors(self, seconds):
        """Rise within a second by LowCmds, and hold the stand; return how many counted."""
        self.wire.unheard.discard(LOW_STATE.name)
        self.run(0.002)
        low, start = self.driver.bridge.low, positions(self.wire.last(LOW_STATE))
        refused = low.refused
        for tick in range(round(500 * seconds)):
            share = min(tick / 500.0, 1.0)
            aims = (1.0 - share) * start + share * STANDING
            self.wire.come['rt/lowcmd'].append(low_cmd(aims, kp=60.0, kd=5.0))
            self.run(0.002)
        self.wire.unheard.add(LOW_STATE.name)
        return round(500 * seconds) - (low.refused - refused)

    def hold_stick(self, seconds):
        """Hold a quarter of a stick ahead, as a program does that repeats it."""
        for _ in range(round(seconds / 0.02)):
            self.wire.come['rt/wirelesscontroller'].append(Remote(ly=0.25).message())
            self.run(0.02)

    @property
    def height(self):
        return float(self.robot.world.base().position[2])

    @property
    def ahead(self):
        return float(self.robot.world.base().position[0])

    @property
    def speed(self):
        return float(np.hypot(*self.robot.world.base().linear_velocity[:2]))


@pytest.fixture
def run():
    return Commanded()


@pytest.fixture(scope='module')
def still():
    """A run that nobody drives."""
    return Commanded()


def test_a_program_drives_until_a_key_takes_over_or_an_e_stop_ends_it(run):
    run.call(STAND_UP)
    run.run(1.2)
    assert run.robot.drivers.state.driver == ''
    run.move(1.0)
    assert run.speed > 0.2
    state = run.robot.drivers.state
    assert (state.driver, state.right) == ('unitree', 'program')
    assert state.since == pytest.approx(1.2, abs=0.01)
    run.session.press('2')
    run.run_until(lambda: run.robot.state == 'fixed stand', 2.0)
    run.run(0.8)
    assert run.robot.state == 'fixed stand'
    assert run.speed < 0.02
    assert not run.driver.bridge.motion.is_moving
    run.move(0.6)
    assert run.speed > 0.2
    run.session.e_stop('page')
    assert run.robot.state == 'passive'
    run.run_until(lambda: run.height < 0.15, 1.5)
    assert (run.robot.state, run.height < 0.15) == ('passive', True)


def test_a_program_has_the_motors_whatever_keys_say_until_an_e_stop_or_a_reset(run):
    assert run.hold_by_motors(1.2) == 600
    assert run.robot.drivers.state.driver == 'unitree'
    run.session.press('4')
    assert run.hold_by_motors(0.3) == 150
    assert (run.robot.state, run.height > 0.3) == ('passive', True)
    run.session.e_stop('page')
    assert run.hold_by_motors(SILENCE + 0.2) == 0
    run.run(SILENCE + 0.2)
    assert run.height < 0.15
    assert run.robot.drivers.state.driver == ''
    # A program that has let go, and takes the motors again, has them.
    assert run.hold_by_motors(1.2) == 600
    assert run.height > 0.3
    run.session.simulation.reset()
    run.run(0.1)
    assert not run.driver.bridge.low.is_released
    run.session.press('2')
    run.run(1.1)
    assert run.robot.state == 'fixed stand'
    # And keys move the sticks that programs see.
    for key in '4wwl':
        run.session.press(key)
        run.run(0.02)
    run.run(0.1)
    remote = run.wire.last(REMOTE)
    assert (remote['ly'], remote['rx'], remote['lx']) == pytest.approx((0.1, 0.05, 0.0))


def test_a_program_that_an_e_stop_refuses_stays_so_when_another_ends_its_move(run, monkeypatch):
    assert run.hold_by_motors(0.2) == 100
    run.session.e_stop('page')
    simulate = run.run

    def repeat(seconds):
        for _ in range(round(seconds / 0.002)):
            run.wire.come['rt/lowcmd'].append(low_cmd(STANDING, kp=60.0, kd=5.0))
            simulate(0.002)

    monkeypatch.setattr(run, 'run', repeat)
    run.run(0.3)
    run.call(STAND_UP)
    run.run(1.2)
    run.move(0.5)
    assert run.speed > 0.1
    run.call(STOP_MOVE)
    run.run(0.5)
    assert not run.driver.bridge.low.is_live
    assert (run.robot.state, run.speed < 0.05) == ('move base', True)


def test_a_lean_ends_as_a_program_asks_also_after_a_key(run):
    run.call(STAND_UP)
    run.run(1.2)
    run.call(EULER, x=0.3, y=0.0, z=0.0)
    run.run(1.0)
    assert run.robot.world.base().rpy[0] > 0.25
    run.session.press('n')
    run.run(0.1)
    run.call(EULER, x=0.0, y=0.0, z=0.0)
    run.run(1.0)
    assert abs(run.robot.world.base().rpy[0]) < 0.03


def test_a_stick_held_over_an_e_stop_counts_after_a_silence(run):
    run.call(STAND_UP)
    run.run(1.2)
    run.hold_stick(0.5)
    run.session.e_stop('page')
    run.hold_stick(SILENCE + 0.3)
    run.session.press('2')
    run.run(1.0)
    run.hold_stick(0.3)  # after a silence that is not long enough
    assert run.robot.state == 'fixed stand'
    run.session.simulation.reset()
    run.run(SILENCE + 0.1)
    run.call(STAND_UP)
    run.run(1.2)
    start = run.ahead
    run.hold_stick(1.0)
    assert run.ahead - start > 0.15


def test_a_latched_e_stop_holds_until_it_is_released():
    run = Commanded(latched=True)
    assert run.hold_by_motors(0.2) == 100
    run.session.e_stop('page')
    run.run(SILENCE + 0.1)
    assert run.hold_by_motors(0.2) == 0
    run.call(STAND_UP)
    run.run(0.3)
    assert run.robot.state == 'passive'
    run.session.end_e_stop()
    run.run(SILENCE + 0.1)
    assert run.hold_by_motors(1.2) == 600
    assert run.height > 0.3


@pytest.mark.parametrize('latched', [True, False])
def test_a_move_repeated_over_an_e_stop_counts_only_after_it_has_ended(latched):
    run = Commanded(latched=latched)
    run.call(STAND_UP)
    run.run(1.2)
    run.move(0.6)
    assert run.speed > 0.2
    run.session.e_stop('page')
    run.move(SILENCE + 0.3)
    run.session.end_e_stop()
    run.move(0.3)
    run.session.press('2')
    start = run.ahead
    run.move(1.5)
    assert run.robot.state == 'fixed stand'
    assert abs(run.ahead - start) < 0.05
    run.call(STOP_MOVE)
    run.move(0.6)
    assert run.speed > 0.2


def test_programs_switch_the_guard_that_stops_before_a_wall():
    run = Commanded(world='room', guards=True)
    guard = run.driver._guard

    def walk():
        """Walk for a tenth of a second; return what the robot touched."""
        run.call(MOVE, x=0.8, y=0.0, z=0.0)
        run.run(0.098)
        return touched(run.robot.world) - {'floor'}

    deeds, told = [], []
    run.driver.on_deed = lambda: deeds.append(run.robot.world.time)
    for is_on in (False, True, False, True):
        assert run.call(1001, 'obstacles_avoid', enable=is_on) == 0
        told.append(len(deeds))
        # As much room as any guard of a Go2 keeps.
        assert guard.unit._parameters.footprint_padding == SWAY
    assert told == [0, 1, 1, 1]  # for a recording
    run.call(STAND_UP)
    run.run(1.2)
    for _ in range(50):
        assert not walk()
        if run.ahead > 2.0 and run.speed < 0.05:
            break
    for _ in range(5):
        assert not walk()
    assert run.ahead > 2.0
    assert run.speed < 0.05
    assert run.call(1001, 'obstacles_avoid', enable=False) == 0
    assert any(walk() for _ in range(30))


def test_a_guard_that_stays_on_is_said_to_be_on_and_is_not_switched_off():
    run = Commanded(guards=True, guard=True)
    for service, api_id, parameter, code in (
        ('obstacles_avoid', 1002, {}, 0),
        ('obstacles_avoid', 1001, {'enable': False}, 3203),
        ('sport', 2058, {}, 3203),
        ('obstacles_avoid', 1001, {'enable': True}, 0),
        ('obstacles_avoid', 1002, {}, 0),
    ):
        assert run.call(api_id, service, **parameter) == code
    answers = run.wire.told['rt/api/obstacles_avoid/response']
    said = [decode(RESPONSE, answers[number])['data'] for number in (0, -1)]
    assert [json.loads(each) for each in said] == [{'enable': True}] * 2


def test_without_a_lidar_there_is_no_guard_and_it_walks(tmp_path):
    whole = robot_named('go2').urdf
    file = tmp_path / 'blind.urdf'
    file.write_text(re.sub(r'<gazebo reference="[^"]*">.*?</gazebo>', '', whole, flags=re.DOTALL))
    robot = Run(RunOptions(robot='go2', description=str(file), preset='unitree', speed=0.0)).robot
    assert idle_guard(robot) is None
    for key in ('2', '5'):
        robot.press(key, 'keys')
        robot.simulation.advance(1000)
    robot.drive((0.3, 0.0, 0.0), 'page')
    robot.simulation.advance(500)
    assert robot.world.base().position[0] > 0.05


def test_without_a_lidar_no_guard_is_switched(still):
    assert still.call(1001, 'obstacles_avoid', enable=True) == 3203
    assert still.call(1001, 'obstacles_avoid', enable=False) == 0


def test_a_run_that_is_paused_answers(still):
    still.session.simulation.paused = True
    still.wire.come['rt/api/motion_switcher/request'].append(request(5, 1001))
    still.driver.look()
    assert len(still.wire.told['rt/api/motion_switcher/response']) == 1


def test_a_move_ends_with_a_pause_and_the_next_one_counts(run):
    motion = run.driver.bridge.motion
    run.call(STAND_UP)
    run.call(MOVE, x=0.3, y=0.0, z=0.0)
    assert motion.is_moving
    for tell in run.session.simulation.on_resume:
        tell()
    assert not motion.is_moving
    run.call(MOVE, x=0.3, y=0.0, z=0.0)
    assert motion.is_moving


def test_in_sync_time_waits_for_a_program():
    run = Commanded(sync=True)
    assert not run.driver.may_advance()
    run.wire.come['rt/lowcmd'].append(low_cmd(kd=1.0))
    assert run.driver.may_advance()
    assert 'time begins with a program' in run.driver.first_line


def test_another_network_is_refused():
    options = RunOptions(
        robot='go2', description='go2', preset='unitree', interface='unitree', network='nowhere'
    )
    with pytest.raises(UserError, match="network: got 'nowhere', wanted the loopback"):
        Run(options)
