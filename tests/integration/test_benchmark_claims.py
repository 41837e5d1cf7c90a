# SPDX-License-Identifier: Apache-2.0
"""What a row of the benchmark claims is what is measured: seeds, phases, touches, standstill."""

from pathlib import Path
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from wasd_navigation.navigator import Outcome

ROOT = Path(__file__).parents[2]
# Imports each file beside those before it, and no other.
SENT_IN_TURN = """
import importlib, pathlib, shutil, sys
for place in map(pathlib.Path, sys.argv[1:]):
    shutil.copy(place, '.')
    importlib.invalidate_caches()
    importlib.import_module(place.stem)
"""


def test_no_policy_is_tested_with_a_seed_that_ours_was_trained_with(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    policies, first = bench('policies'), bench('clone_policy').FIRST_SEED
    seeds = set()

    def drive(seed: int, *_: Any) -> dict[str, Any]:
        seeds.add(seed)
        return dict.fromkeys(('up', 'error', 'vx', 'vy', 'wz'), 0.0)

    monkeypatch.setattr(policies, 'drive', drive)
    monkeypatch.setattr(policies, 'measure_speed', lambda *_: [])
    policies.measure(False, lambda _: None)
    # Of docs/policies.md: 13 rounds of 8 episodes.
    trained = {first + 100 * number + index for number in range(13) for index in range(8)}
    assert len(seeds) == 20
    assert seeds.isdisjoint(trained)


@pytest.mark.slow
def test_a_worker_of_a_cluster_gets_all_that_it_imports(bench: Any, tmp_path: Path) -> None:
    places = [str(ROOT / f'benchmarks/{name}.py') for name in bench('cores').SENT]
    subprocess.run([sys.executable, '-c', SENT_IN_TURN, *places], cwd=tmp_path, check=True)


def test_pushes_are_in_each_part_of_the_gait(bench: Any) -> None:
    from quadruped_sim.presets import GAITS

    trouble, ground = bench('go2_trouble'), bench('legs_ground')
    for name, gait in GAITS.items():
        runs = ground.pushed(30.0, 0.5, [1000], 1.0, gait=name).runs
        times = np.array([float(run.push.split()[0]) for run in runs])
        phases = np.sort(times / (trouble.GAIT_PERIOD * gait.period) % 1.0)
        assert np.diff(phases, append=phases[0] + 1.0).max() < 1.5 / trouble.PHASES, name


def test_no_gait_is_asked_for_more_than_it_allows(bench: Any) -> None:
    from quadruped_sim.presets import GAITS

    for name, speed in bench('legs').GAIT_SPEEDS.items():
        assert speed <= GAITS[name].limits.forward, name


def test_the_page_says_with_which_seeds_it_walked_by_sight(bench: Any) -> None:
    text = (ROOT / 'docs/legs_math.md').read_text()
    (first,) = re.findall(r'Seeds (\d+) to \d+', text)
    assert int(first) >= bench('sight').FIRST_SEED or 'tuning knew some' in text


@pytest.fixture(scope='module')
def ride(bench: Any) -> Any:
    return bench('people').Ride('mbot', 7700)


@pytest.mark.slow
def test_who_drives_into_a_wall_on_its_way_past_people_has_not_arrived(
    bench: Any, ride: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    people = bench('people')
    goal = np.array((*ride.flat.boxes[0, :2], 0.0))

    def arrive() -> None:
        monkeypatch.setattr(ride.moving, 'pose', goal.copy())
        ride.unit.navigator.goal, ride.unit.navigator.outcome = None, Outcome('arrived')

    monkeypatch.setattr(ride, 'step', arrive)
    assert not people.is_there(people.Meeting(ride).go(goal, lambda: []))


@pytest.mark.slow
def test_a_robot_that_was_walked_into_and_drives_on_touches_somebody(
    bench: Any, ride: Any
) -> None:
    people = bench('people')
    meeting, somebody = people.Meeting(ride), people.person(ride.moving.pose[:2], 0.0)
    ride.moving.velocity = np.zeros(3)
    meeting._look([somebody])
    assert meeting.touches == 0
    ride.moving.velocity = np.array((0.3, 0.0, 0.0))
    meeting._look([somebody])
    assert meeting.touches == 1


@pytest.mark.slow
def test_drives_in_which_nobody_is_met_count_touches_too(
    bench: Any, ride: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    people, drives = bench('people'), []

    def go(meeting: Any, *_: Any) -> dict[str, Any]:
        drives.append(meeting)
        meeting.met = len(drives) == 2
        return {'touches': 2 - len(drives)}

    monkeypatch.setattr(people.Meeting, 'go', go)
    meeting = people.meet(ride, 7700, 'head-on')
    assert meeting['met']
    assert meeting['touches'] == 1


@pytest.mark.slow
def test_a_robot_that_never_got_going_was_not_stopped(
    bench: Any, monkeypatch: pytest.MonkeyPatch, ros: None
) -> None:
    stops = bench('stops')
    limp = {'go2': (0.5, (), {'robot': 'go2', 'preset': 'unitree'})}
    monkeypatch.setattr(stops, 'ROBOTS', limp)
    monkeypatch.setattr(stops, 'WAYS', {'release': stops.WAYS['release']})
    monkeypatch.setattr(stops.rclpy, 'init', lambda: None)
    (row,) = stops.measure(True, lambda _: None)
    assert not row.passed


@pytest.mark.slow
def test_a_lidar_that_turns_does_so_in_goals_with_physics(bench: Any) -> None:
    kinematic, physics = bench('kinematic'), bench('goals_physics')
    robot = physics.PhysicalRobot('mbot', kinematic.ROBOTS['mbot'], 'flat:3', 1)
    scans = []
    for _ in range(30):
        robot.step(np.array((0.5, 0.0, 0.0)))
        scans.append(robot.scan(np.empty((0, 6))))
    *_, last = filter(None, scans)
    # 5.5 times a second, at 0.5 m/s.
    assert np.ptp(last.begins[:, 0]) == pytest.approx(0.09, abs=0.02)
