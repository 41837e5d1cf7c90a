# SPDX-License-Identifier: Apache-2.0
from mujoco_sim.simulation import Simulation
import pytest


@pytest.fixture
def simulation(world):
    return Simulation(world, speed=0.0)


def never():
    return False


def test_tasks_see_the_world_just_before_their_step(simulation):
    seen = []
    simulation.schedule.every(0.005, lambda: seen.append(simulation.world.tick))
    simulation.advance(12)
    assert seen == [0, 5, 10]
    assert simulation.world.tick == 12


def test_an_advance_in_pieces_runs_the_same_tasks(simulation):
    seen = []
    simulation.schedule.every(0.005, lambda: seen.append(simulation.world.tick))
    for _ in range(12):
        simulation.advance(1)
    assert seen == [0, 5, 10]


def test_a_run_ends_at_its_duration_to_the_step(simulation):
    simulation.schedule.every(0.005, lambda: None)
    simulation.run(never, lambda timeout: None, duration=0.123)
    assert simulation.world.tick == 123


def test_a_run_ends_when_it_is_told_to(simulation):
    simulation.schedule.every(0.005, lambda: None)
    simulation.run(lambda: simulation.world.time >= 0.05, lambda timeout: None)
    assert simulation.world.tick == 50


def test_a_reset_tells_everyone_who_remembers(simulation):
    told = []
    simulation.on_reset += [lambda: told.append('controller'), lambda: told.append('teleop')]
    simulation.advance(10)
    simulation.reset()
    assert told == ['controller', 'teleop']
    assert simulation.world.tick == 10


def test_while_paused_messages_are_handled_and_time_stands_still(simulation):
    simulation.paused = True
    polls = []

    def poll(timeout):
        polls.append(timeout)

    simulation.run(lambda: len(polls) >= 5, poll)
    assert simulation.world.tick == 0
    assert min(polls) > 0.0


def test_at_full_speed_messages_are_handled_now_and_then(simulation):
    simulation.schedule.every(0.005, lambda: None)
    polls = []
    simulation.run(lambda: len(polls) >= 3, polls.append)
    assert set(polls) == {0.0}
    assert simulation.world.tick > 0


@pytest.mark.parametrize('speed', [0.5, 1.0, 4.0])
def test_a_run_takes_its_duration_divided_by_the_speed(world, speed, monkeypatch):
    simulation = Simulation(world, speed)
    simulation.schedule.every(0.005, lambda: None)
    now = [100.0]
    monkeypatch.setattr('mujoco_sim.simulation.time.monotonic', lambda: now[0])

    def pass_time(timeout):
        now[0] += timeout

    simulation.run(never, pass_time, duration=0.4 * speed)
    assert now[0] - 100.0 == pytest.approx(0.4, abs=0.01)  # one stride early at best
