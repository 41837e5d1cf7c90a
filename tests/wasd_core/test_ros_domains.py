# SPDX-License-Identifier: Apache-2.0
"""Places of runs in ROS domains: one holder each, given back however it ends."""

import os
import subprocess
import sys

from cases import for_all
import pytest
import rclpy
from rclpy.node import Node
from wasd_core.network import claim, claim_domain, join_domain, namespaces_of, running, SOCKETS

# Ahead of what ROS has, so that nothing real is in the way.
FIRST = 10_000
STRANGER = 65534  # a user who may do nothing
LIAR = """
import os, socket, sys
os.setuid(int(sys.argv[2]))
held = socket.socket(socket.AF_UNIX)
held.bind(chr(0) + sys.argv[1])
held.listen()
print(flush=True)
sys.stdin.read()
"""
HOLDER = """
import sys, time
from wasd_core.network import claim
held = claim(int(sys.argv[1]), ['/'])
print(held is not None, flush=True)
time.sleep(60)
"""


@pytest.fixture
def domains(monkeypatch):
    """Have domains that no other run on this machine is in; return them."""
    numbers = range(FIRST + os.getpid() * 10, FIRST + os.getpid() * 10 + 3)
    monkeypatch.setattr('wasd_core.network.DOMAINS', numbers)
    return numbers


def hold(domain):
    """Return a process that has a place."""
    process = subprocess.Popen(
        [sys.executable, '-c', HOLDER, str(domain)], stdout=subprocess.PIPE, text=True
    )
    return process, process.stdout.readline() == 'True\n'


@pytest.mark.slow
def test_a_place_has_one_holder_and_is_free_when_it_was_killed(domains):
    process, has_it = hold(domains[0])
    try:
        assert has_it
        assert claim(domains[0], ['/']) is None
        assert claim(domains[0], ['/', '/robot']) is None
        (run,) = (run for run in running(os.getuid()) if run.domain == domains[0])
        assert run.process == process.pid
    finally:
        process.kill()
        process.wait()
    with claim(domains[0], ['/']) as place:
        assert place.domain == domains[0]
    assert domains[0] not in [run.domain for run in running()]


@pytest.mark.slow
def test_of_many_that_start_at_once_one_gets_the_place(domains):
    started = [
        subprocess.Popen(
            [sys.executable, '-c', HOLDER, str(domains[0])], stdout=subprocess.PIPE, text=True
        )
        for _ in range(6)
    ]
    try:
        answers = [process.stdout.readline() for process in started]
    finally:
        for process in started:
            process.kill()
            process.wait()
    assert sorted(answers) == ['False\n'] * 5 + ['True\n']


@pytest.mark.slow
def test_the_second_run_takes_the_next_domain_and_says_how_to_talk_to_it(domains):
    process, _ = hold(domains[0])
    try:
        environment = {}
        place, words = claim_domain(environment, ['/'], './wasd topics')
        with place:
            assert environment == {'ROS_DOMAIN_ID': str(domains[1])}
            assert f'ROS_DOMAIN_ID={domains[1]} ./wasd topics' in words
            assert str(process.pid) in words
    finally:
        process.kill()
        process.wait()


def test_the_first_run_has_the_first_domain_and_nothing_to_say(domains):
    environment = {}
    place, words = claim_domain(environment, ['/'], '')
    with place:
        assert (environment, words) == ({'ROS_DOMAIN_ID': str(domains[0])}, '')


@pytest.mark.slow
def test_a_domain_of_the_users_stays_and_a_run_in_it_is_said(domains):
    process, _ = hold(domains[0])
    try:
        environment = {'ROS_DOMAIN_ID': str(domains[0])}
        place, words = claim_domain(environment, ['/'], '')
        assert place is None
        assert environment == {'ROS_DOMAIN_ID': str(domains[0])}
        assert words.startswith(f'domain {domains[0]} has another run')
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_runs_in_namespaces_of_their_own_share_a_domain(domains):
    first, _ = claim_domain({}, ['/robot1'], '')
    process, has_it = hold(domains[0])
    try:
        assert first.domain == domains[0]
        assert has_it
    finally:
        process.kill()
        process.wait()
        first.close()


def test_a_place_that_was_given_back_is_free_at_once(domains):
    for _ in range(200):
        place = claim(domains[0], ['/'])
        assert place is not None
        place.close()


def test_a_full_machine_is_said(domains):
    held = [claim(domain, ['/']) for domain in domains]
    # A process has one entry a domain; the places are what counts.
    assert all(held)
    environment = {'ROS_LOCALHOST_ONLY': '1'}
    place, words = claim_domain(environment, ['/'], '')
    assert place is None
    assert words.startswith('every domain is taken: this run talks to nobody')
    # Nobody drives this robot, and it takes nothing that is for another.
    assert environment == {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'}
    for one in held:
        one.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    'user',
    [
        os.getuid(),
        pytest.param(STRANGER, marks=pytest.mark.skipif(os.getuid() != 0, reason='needs root')),
    ],
    ids=['own', 'stranger'],
)
def test_who_only_says_that_he_is_a_run_of_ours_leads_nobody_to_his_domain(domains, user):
    name = f'wasd run {domains[0]} {os.getuid()} {os.getpid()}'
    liar = subprocess.Popen(
        [sys.executable, '-c', LIAR, name, str(user)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        liar.stdout.readline()
        assert f'@{name}\n' in SOCKETS.read_text()
        assert domains[0] not in [run.domain for run in running()]
        with claim(domains[1], ['/']):
            environment = {}
            join_domain(environment)
            assert environment['ROS_DOMAIN_ID'] != str(domains[0])
    finally:
        liar.communicate()


def test_a_run_answers_however_often_it_is_asked(domains):
    with claim(domains[0], ['/']):
        for _ in range(500):
            assert domains[0] in [run.domain for run in running(os.getuid())]


def test_who_joins_keeps_a_domain_of_the_users():
    environment = {'ROS_DOMAIN_ID': '9'}
    assert (join_domain(environment), environment) == ('', {'ROS_DOMAIN_ID': '9'})


@for_all(
    ('arguments', 'namespaces'),
    [
        ([], ['/']),
        (['--ros-args', '-r', '__ns:=/robot1'], ['/robot1']),
        (['--ros-args', '--remap', 'simulator:__ns:=a/b/'], ['/a/b']),
        (['--ros-args', '-p', 'speed:=2.0', '-r', 'cmd_vel:=steer'], ['/']),
    ],
)
def test_namespaces_are_read_from_ros_arguments(arguments, namespaces):
    assert namespaces_of(arguments) == namespaces


def test_no_test_gets_a_domain_that_somebody_still_is_in(isolated_ros, ros_domains):
    given = {next(ros_domains) for _ in range(100)}
    if len(given) == 1:
        pytest.skip('there is one domain only: WASD_TEST_DOMAINS')
    assert isolated_ros in given
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=isolated_ros)
    node = Node('left_behind', context=context)
    try:
        assert isolated_ros not in {next(ros_domains) for _ in range(100)}
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)
