# SPDX-License-Identifier: Apache-2.0
"""`import wasd`, and the two scripts of docs/your_own_script.md as they stand there."""

from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
from typing import Any

import numpy as np
import programs
import pytest
from terminals import PATIENCE

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
# Makes everything of ROS unimportable, then runs the file that is named; its robot then draws
# pictures that cannot be written.
WITHOUT_ROS = """
import runpy, sys
class NoRos:
    def find_spec(self, name, path=None, target=None):
        root = name.partition('.')[0]
        if root == 'rclpy' or root.endswith(('_msgs', '_interfaces')):
            raise ImportError(f'no {name} here')
sys.meta_path.insert(0, NoRos())
dog = runpy.run_path(sys.argv[1])['dog']
import wasd
for path in ('nowhere/dog.png', 'dog.xyz'):
    try:
        dog.picture(path)
    except wasd.UserError as error:
        print(error)
"""


def scripts() -> list[str]:
    """Return the Python blocks of the page."""
    page = (ROOT / 'docs' / 'your_own_script.md').read_text()
    return re.findall(r'```python\n(.*?)```', page, re.DOTALL)


def test_the_scripts_of_the_page_are_short():
    assert [len(text.splitlines()) <= 15 for text in scripts()] == [True, True]


def test_the_script_without_ros_walks_and_draws_and_says_why_it_cannot(tmp_path):
    (tmp_path / 'script.py').write_text(scripts()[0])
    done = subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS, 'script.py'],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    last, *refused = done.stdout.splitlines()[-3:]
    assert [line[:9] for line in refused] == 2 * ['picture: ']
    assert last.startswith('6.5 move base')
    x, y, _ = map(float, re.search(r'\[([^]]+)\]', last)[1].split())
    assert np.hypot(x, y) > 1.3
    assert (tmp_path / 'dog.png').stat().st_size > 20_000


def test_the_node_of_the_page_drives_mbot(
    environment: dict[str, str], tmp_path: Path, commands: Any
):
    (tmp_path / 'circle.py').write_text(scripts()[1])
    node = subprocess.Popen([sys.executable, 'circle.py'], cwd=tmp_path, env=environment)
    try:
        commands(0.0)  # it speaks
        done = programs.run_wasd(('mbot', '--duration', '8'), tmp_path, environment)
        node.send_signal(signal.SIGINT)
        assert node.wait(PATIENCE) == 0
    finally:
        node.kill()
        node.wait()
    assert done.returncode == 0, done.stderr
    x, y = map(float, re.search(r'mbot at (\S+) (\S+) m', done.stdout).groups())
    # On a circle of 0.4 m about (0, 0.4).
    assert np.hypot(x, y) > 0.1
    assert np.hypot(x, y - 0.4) == pytest.approx(0.4, abs=0.03)


def test_the_same_seed_and_calls_are_the_run_of_the_command(wasd: Any):
    import wasd as own

    play = '0.1 2\n2.2 4\n2.4 w w w\n'
    report = wasd.report('go2', '--seed', '3', '--duration', '3.2', play=play)
    dog = own.Go2(seed=3)
    positions = []
    for until, keys in ((0.1, '2'), (2.2, '4'), (2.4, 'www'), (3.18, '')):
        dog.run(until - dog.time)
        positions.append(dog.truth.position.tolist())
        for key in keys:
            dog.press(key)
    samples = report['samples']
    there = [samples['position'][samples['t'].index(t)] for t in (0.1, 2.2, 2.4, 3.18)]
    assert positions == there


def test_an_episode_after_a_reset_has_the_bits_of_the_first_and_of_a_new_robot():
    import wasd as own

    def episode(dog: own.Go2) -> list[list[float]]:
        dog.press('2')
        found = []
        for _ in range(5):
            dog.run(0.05)
            pose, truth = dog.odometry, dog.truth
            found.append(
                [*pose.position, *pose.orientation, *truth.position, *truth.linear_velocity]
            )
        return found

    dog = own.Go2(seed=5)
    first = episode(dog)
    dog.reset()
    assert episode(dog) == first
    assert episode(own.Go2(seed=5)) == first


def test_the_page_tells_after_which_periods_a_reset_gives_the_same_bits():
    import wasd as own

    page = (ROOT / 'docs' / 'your_own_script.md').read_text()
    assert f"the Go2's controller ({1e3 * own.Go2()._robot.period:g} ms)" in page
    period = 1.0 / own.Mbot()._robot.logic.rate
    assert f"of mbot's keys ({1e3 * period:g} ms)" in page

    def drive(car: own.Mbot) -> list[float]:
        car.drive(0.3, 0.4)
        car.run(1.0)
        return [*car.truth.position, *car.odometry.position]

    after = own.Mbot(seed=5)
    after.run(13 * period)
    after.reset()
    assert drive(after) == drive(own.Mbot(seed=5))


def test_a_velocity_ends_with_the_state_that_follows_it():
    import wasd

    dog = wasd.Go2(estimator='truth')
    for key, duration in (('2', 1.2), ('5', 0.5)):
        dog.press(key)
        dog.run(duration)
    dog.drive(0.5)
    dog.run(0.7)
    dog.press('2')
    dog.run(1.0)
    start = dog.truth.position
    dog.press('5')
    dog.run(1.5)
    assert dog.state == 'move base'
    assert np.hypot(*(dog.truth.position - start)[:2]) < 0.02
    dog.drive(0.5)
    dog.run(1.0)
    assert np.hypot(*(dog.truth.position - start)[:2]) > 0.2
    for key in '25':  # in one instant: it trots on, without its velocity
        dog.press(key)
    dog.run(0.5)
    assert dog.state == 'move base'
    assert np.hypot(*dog.truth.linear_velocity[:2]) < 0.1


def test_a_run_that_was_interrupted_in_the_midst_of_a_step_goes_on():
    import wasd

    dog = wasd.Go2(estimator='truth')
    for key in '25':
        dog.press(key)
    dog.run(1.2)
    dog.drive(0.4)
    dog.run(0.503)
    dog._robot.control()  # as by a run that Ctrl-C ends before physics goes on
    dog._robot.control()
    dog.run(0.2)
    assert dog.state == 'move base'
    assert dog.truth.position[2] > 0.25


def test_what_a_run_calls_cannot_run_the_robot_and_the_next_run_can():
    import wasd

    car = wasd.Mbot()
    before = signal.signal(signal.SIGALRM, lambda *_: car.run(0.1))
    try:
        with pytest.raises(wasd.UserError, match='run: it is running: what it calls cannot'):
            # Again and again: the first may come before the run has begun.
            signal.setitimer(signal.ITIMER_REAL, 0.05, 0.05)
            car.run(200.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    start = car.time
    car.run(0.1)
    assert car.time - start == pytest.approx(0.1)


def test_the_go2_walks_one_foot_after_the_other():
    import wasd

    dog = wasd.Go2(gait='walk')
    for key in '25':
        dog.press(key)
    dog.run(1.2)
    dog.drive(0.5)
    dog.run(1.0)
    start = dog.truth.position[0]
    feet = []
    for _ in range(40):
        dog.run(0.05)
        feet.append(dog._robot.legs.controller.locomotion.is_stance.sum())
    assert (dog.truth.position[0] - start) / 2.0 == pytest.approx(0.5, rel=0.1)
    assert dog.state == 'move base'
    assert min(feet) >= 3


def test_what_is_untold_is_that_of_the_command(wasd: Any) -> None:
    import wasd as own

    words = ('--friction', '0.5', '--payload', '3@0,0.05,0', '--randomise', '0.5', '--seed', '4')
    more = ('--imu-drift', '50', '--duration', '1')
    report = wasd.report('go2', *words, *more, play='0 2')
    payload = own.Payload(3.0, (0.0, 0.05, 0.0))
    untold = own.Untold(friction=0.5, payload=payload, randomise=0.5, imu_drift=50.0)
    dog = own.Go2(seed=4, untold=untold)
    dog.press('2')
    dog.run(0.98)
    assert dog.truth.position.tolist() == report['samples']['position'][-1]


def test_what_is_not_legal_says_why():
    import wasd

    dog = wasd.Go2()
    with pytest.raises(wasd.UserError, match='press 2'):
        dog.press('4')
    with pytest.raises(wasd.UserError, match='needs the state move base'):
        dog.drive(0.5)
    with pytest.raises(wasd.UserError, match='wanted a time >= 0'):
        dog.run(-1.0)
    with pytest.raises(wasd.UserError, match='press: key: got 2, wanted'):
        dog.press(2)
    with pytest.raises(wasd.UserError, match='wanted a time > 0'):
        dog.push((50.0, 0.0, 0.0), -1.0)
    assert 'press 2' in dog.press('w')
    with pytest.raises(wasd.UserError, match='^start with policy=FILE '):
        dog.press('p')
    assert dog.press('x') == "keys: 0-9, v, wasd, ijkl, n, e ('x' does nothing)"


def test_a_key_that_changes_nothing_is_no_mistake():
    import wasd

    dog = wasd.Go2()
    dog.press('2')
    assert dog.press('2') == 'fixed stand already'
    dog.run(1.5)
    assert dog.press('2') == 'fixed stand already'
    assert dog.state == 'fixed stand'


@pytest.mark.parametrize('kind', ['Go2', 'Mbot'])
def test_a_second_thread_is_refused_and_may_come_after_the_first(kind):
    import wasd

    robot = getattr(wasd, kind)()
    robot.run(0.1)
    is_inside, go_on = threading.Event(), threading.Event()

    def wait() -> None:
        is_inside.set()
        go_on.wait(PATIENCE)

    robot._simulation.schedule.every(0.01, wait)
    first = threading.Thread(target=robot.run, args=(0.1,))
    first.start()
    assert is_inside.wait(PATIENCE)
    calls = {
        'run': lambda: robot.run(1.0),
        'press': lambda: robot.press('k'),
        'push': lambda: robot.push((1.0, 0.0, 0.0), 0.1),
        'reset': robot.reset,
    }
    for name, call in calls.items():
        with pytest.raises(wasd.UserError, match=f'^{name}: another thread uses this robot'):
            call()
    go_on.set()
    first.join(PATIENCE)
    before = robot.time
    second = threading.Thread(target=robot.run, args=(0.1,))
    second.start()
    second.join(PATIENCE)
    assert robot.time == pytest.approx(before + 0.1)


@pytest.mark.parametrize('seed', [-1, 1.5])
def test_a_seed_that_is_none_is_refused(seed):
    import wasd

    with pytest.raises(wasd.UserError, match='seed'):
        wasd.Mbot(seed=seed)


def test_a_seed_may_be_one_of_numpys():
    import wasd

    assert wasd.Mbot(seed=np.arange(3)[1]).time == 0.0


def test_mbot_drives_by_velocity_and_a_key_takes_over():
    import wasd

    car = wasd.Mbot()
    car.drive(0.25)
    car.run(4.0)
    assert car.truth.position[0] == pytest.approx(1.0, abs=0.15)
    assert car.odometry.position == pytest.approx(car.truth.position, abs=0.01)
    assert [car.odometry.x, car.odometry.y] == car.odometry.position[:2].tolist()
    assert car.odometry.yaw == pytest.approx(car.truth.rpy[2], abs=0.01)
    car.press('k')
    car.run(2.0)
    assert car.state == 'stopped'
    with pytest.raises(wasd.UserError, match='finite'):
        car.drive(float('nan'))


def speed(robot: Any) -> float:
    return float(np.linalg.norm(robot.truth.linear_velocity))


def test_esc_stops_wheels_that_a_key_or_a_velocity_drives_and_keys_drive_again():
    import wasd

    car = wasd.Mbot(preset='ramps')
    for drive in (lambda: car.press('w'), lambda: car.drive(0.4), lambda: car.press('w')):
        drive()
        car.run(1.0)
        assert speed(car) > 0.3
        car.press('ESC')
        car.run(3.0)
        assert speed(car) < 0.001


def test_a_key_that_was_held_at_esc_drives_again():
    import wasd

    car = wasd.Mbot()
    moved = []
    for _ in range(2):
        start = car.truth.position[0]
        car.press('i')
        car.run(0.5)
        moved.append(car.truth.position[0] - start)
        car.press('ESC')
        car.run(1.0)
    assert min(moved) > 0.03


def test_esc_lets_the_legs_go_and_ends_the_velocity():
    import wasd

    dog = wasd.Go2(estimator='truth')
    for _ in range(2):
        for key in '25':
            dog.press(key)
            dog.run(1.2)
        assert (dog.state, speed(dog) < 0.1) == ('move base', True)
        dog.drive(0.5)
        dog.run(0.7)
        assert speed(dog) > 0.3
        dog.press('ESC')
        assert dog.state == 'passive'
        dog.run(2.0)


def test_parts_of_a_time_step_add_up_until_a_reset():
    import wasd

    car = wasd.Mbot()
    for rate in (60, 3000):
        start = car.time
        for _ in range(rate):
            car.run(1.0 / rate)
        assert car.time - start == pytest.approx(1.0, abs=0.001)
    car.run(0.0014)
    car.reset()
    start = car.time
    car.run(0.0014)
    assert car.time - start == pytest.approx(0.001)
