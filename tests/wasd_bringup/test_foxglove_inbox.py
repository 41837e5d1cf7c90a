# SPDX-License-Identifier: Apache-2.0
"""What Foxglove's clients say is done while they are alive, and for nobody else."""

import struct
from types import SimpleNamespace

import pytest
from wasd_bringup.ros.foxglove_inbox import AT_ONCE, Inbox, LARGEST, LONGEST_QUEUE, SILENCE, Target
from wasd_bringup.run.drivers import Drivers
from wasd_core.errors import UserError

STEP = 0.02
FAST, SLOW, STOP = (0.5, 0.0, 0.1), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0)


class Robot:
    """A robot whose letters latch; STOP stops it, and it moves again without a release."""

    stop_words = ''

    def __init__(self, name):
        self.target = Target(self, f'/{name}/cmd_vel', f'/{name}/keys')
        self.keys, self.velocities, self.stops = [], [], []
        self.drivers = Drivers(lambda key: key == 'STOP', lambda key: key in ('i', 'j'))

    def heeds_e_stop(self, key, by):
        self.stops += [by] * (key == 'ESC')
        return key == 'ESC'

    def press(self, key, by):
        self.drivers.take(by, key=key)
        self.keys.append(key)

    def drive(self, velocity, by):
        if not self.drivers.take(by, velocity=velocity):
            return False
        self.velocities.append(velocity)
        return True

    def release(self, by):
        self.end(self.drivers.release(by))

    def disarm(self, by=''):
        self.end(self.drivers.disarm(by))

    def end(self, held):
        self.velocities += [STOP] * held.velocity
        self.keys += ['STOP'] * held.keys


def read_velocity(sender, data):
    if len(data) != 24:
        raise UserError('no velocity')
    return struct.unpack('<ddd', data)


@pytest.fixture
def robots():
    return [Robot('go2'), Robot('mbot')]


@pytest.fixture
def inbox(robots):
    inbox = Inbox(read_velocity, lambda sender, data: data.decode())
    inbox.targets = [robot.target for robot in robots]
    return inbox


class Client:
    """One connection, by what the server's threads tell of it."""

    def __init__(self, inbox, number):
        self.inbox, self.id = inbox, number

    def advertise(self, *topics):
        for number, topic in enumerate(topics):
            channel = SimpleNamespace(id=number, topic=topic, encoding='cdr', schema_name='x')
            self.inbox.on_client_advertise(self, channel)
        return self

    def drive(self, velocity, channel=0):
        self.inbox.on_message_data(self, channel, struct.pack('<ddd', *velocity))

    def key(self, name, channel=0):
        self.inbox.on_message_data(self, channel, name.encode())

    def leave(self, channel=0):
        self.inbox.on_client_unadvertise(self, channel)


@pytest.fixture
def client(inbox):
    return Client(inbox, 1)


def pass_time(inbox, seconds):
    return [word for _ in range(round(seconds / STEP)) for word in inbox.step(STEP)]


def test_a_velocity_drives_the_robot_of_its_topic(inbox, client, robots):
    client.advertise('/mbot/cmd_vel').drive(FAST)
    assert inbox.step(STEP) == []
    assert (robots[0].velocities, robots[1].velocities) == ([], [FAST])


def test_a_client_that_falls_silent_stops_what_it_drives_once(inbox, client, robots):
    client.advertise('/go2/cmd_vel').drive(FAST)
    pass_time(inbox, SILENCE - STEP)
    assert robots[0].velocities == [FAST]
    pass_time(inbox, 1.0)
    assert robots[0].velocities == [FAST, STOP]


def test_a_client_that_goes_on_is_not_stopped(inbox, client, robots):
    client.advertise('/go2/cmd_vel')
    for _ in range(20):
        client.drive(FAST)
        pass_time(inbox, 0.1)
    assert robots[0].velocities == [FAST] * 20


def test_a_client_that_leaves_stops_at_once_what_it_drives(inbox, client, robots):
    client.advertise('/go2/cmd_vel').drive(FAST)
    client.leave()
    inbox.step(STEP)
    assert robots[0].velocities == [FAST, STOP]


def test_who_has_stopped_itself_is_not_stopped_again(inbox, client, robots):
    client.advertise('/go2/cmd_vel').drive(FAST)
    client.drive(STOP)
    client.leave()
    pass_time(inbox, 1.0)
    assert robots[0].velocities == [FAST, STOP]


def test_a_silent_client_is_stopped_though_another_drives(inbox, client, robots):
    other = Client(inbox, 2).advertise('/mbot/cmd_vel')
    client.advertise('/go2/cmd_vel').drive(FAST)
    for _ in range(10):
        other.drive(SLOW)
        pass_time(inbox, 0.1)
    assert robots[0].velocities == [FAST, STOP]
    assert robots[1].velocities == [SLOW] * 10


@pytest.mark.parametrize('how', ['silent', 'left'])
def test_a_key_that_latches_lasts_no_longer_than_its_client(inbox, client, robots, how):
    client.advertise('/mbot/keys').key('i')
    inbox.step(STEP)
    assert robots[1].keys == ['i']
    if how == 'left':
        client.leave()
        inbox.step(STEP)
    else:
        pass_time(inbox, SILENCE + 2 * STEP)
    assert robots[1].keys == ['i', 'STOP']


def test_a_key_that_moves_nothing_is_followed_by_nothing(inbox, client, robots):
    client.advertise('/go2/keys').key('2')
    client.leave()
    pass_time(inbox, 1.0)
    assert robots[0].keys == ['2']


def test_an_e_stop_that_waited_while_the_process_stood_still_stops(inbox, client, robots):
    client.advertise('/go2/keys')
    inbox.step(STEP)
    client.key('ESC')
    inbox.step(SILENCE + 0.1)
    assert robots[0].stops == ['foxglove 1']


def test_what_waited_while_the_process_stood_still_is_not_taken(inbox, client, robots):
    client.advertise('/go2/cmd_vel')
    inbox.step(STEP)
    client.drive(FAST)
    inbox.step(3.0)
    client.drive(FAST)  # as a socket's buffer hands it over
    inbox.step(STEP)
    assert robots[0].velocities == []
    pass_time(inbox, 0.3)
    client.drive(SLOW)  # it goes on, and nobody has seen it let go
    client.drive(STOP)
    client.drive(SLOW)
    inbox.step(STEP)
    assert robots[0].velocities == [STOP, SLOW]


def test_other_topics_are_refused_by_name(inbox, client):
    client.advertise('/odom').drive(FAST)
    (words,) = inbox.step(STEP)
    assert words.startswith(
        '/odom: clients cannot publish there; wanted /go2/cmd_vel or /go2/keys or'
    )


def test_what_cannot_be_read_moves_nothing_and_is_said(inbox, client, robots):
    client.advertise('/go2/cmd_vel').key('nonsense')
    assert inbox.step(STEP) == ['no velocity']
    assert robots[0].velocities == []


def test_a_flood_is_cut_and_never_holds_up_a_look(inbox, client, robots):
    client.advertise('/go2/cmd_vel')
    for _ in range(3 * LONGEST_QUEUE):
        client.drive(FAST)
    inbox.step(STEP)
    assert len(robots[0].velocities) < AT_ONCE
    pass_time(inbox, 1.0)
    assert len(robots[0].velocities) <= LONGEST_QUEUE
    client.key('x' * (LARGEST + 1))
    assert inbox.step(STEP) == []


def test_an_e_stop_and_its_client_are_heard_while_others_flood(inbox, robots):
    for number in range(1, 4):
        flooder = Client(inbox, number).advertise('/go2/cmd_vel')
        for _ in range(LONGEST_QUEUE):
            flooder.drive(FAST)
    other = Client(inbox, 4).advertise('/mbot/keys')
    other.key('ESC')
    inbox.step(STEP)
    assert robots[1].stops == ['foxglove 4']
    assert len(robots[0].velocities) < AT_ONCE
    other.leave()
    pass_time(inbox, 1.0)
    Client(inbox, 5).advertise('/mbot/cmd_vel').drive(SLOW)
    inbox.step(STEP)
    assert robots[1].velocities == [SLOW]


def test_a_channel_that_was_not_advertised_says_nothing(inbox, client, robots):
    client.drive(FAST, channel=7)
    assert inbox.step(STEP) == []
    assert robots[0].velocities == []


def test_halted_what_has_come_until_then_does_nothing(inbox, client, robots):
    client.advertise('/go2/cmd_vel').drive(FAST)
    inbox.disarm()
    inbox.step(STEP)
    pass_time(inbox, 1.0)
    assert robots[0].velocities == []


def halt(inbox, robots):
    """Stop as a session does."""
    for robot in robots:
        robot.disarm()
    inbox.disarm()


def go_on(inbox, client, velocity, times, channel=0):
    """Have a client send a velocity at 10 Hz; return what it is told."""
    told = []
    for _ in range(times):
        client.drive(velocity, channel)
        told += pass_time(inbox, 0.1)
    return told


@pytest.mark.parametrize('suspended', [0.0, 3.0])
def test_halted_the_last_word_is_zero_and_who_goes_on_drives_after_it_let_go(
    inbox, client, robots, suspended
):
    client.advertise('/go2/cmd_vel', '/mbot/cmd_vel')
    go_on(inbox, client, FAST, 3)
    halt(inbox, robots)
    stopped = [FAST, FAST, FAST, STOP]
    assert robots[0].velocities == stopped
    inbox.step(suspended)
    assert go_on(inbox, client, FAST, 20)[-1] == (
        '/go2/cmd_vel: stopped; to drive again send a zero, or nothing for 0.5 s'
    )
    client.drive(STOP, channel=1)  # another robot's
    go_on(inbox, client, FAST, 5)
    assert robots[0].velocities == stopped
    client.drive(STOP)
    assert go_on(inbox, client, SLOW, 2) == []
    assert robots[0].velocities == [*stopped, STOP, SLOW, SLOW]


def test_halted_a_client_that_was_silent_for_long_drives_again(inbox, client, robots):
    client.advertise('/go2/cmd_vel')
    go_on(inbox, client, FAST, 1)
    halt(inbox, robots)
    for _ in range(5):  # as seldom as a client that lives may
        pass_time(inbox, SILENCE - 8 * STEP)
        client.drive(FAST)
        inbox.step(STEP)
    assert robots[0].velocities == [FAST, STOP]
    pass_time(inbox, SILENCE + 2 * STEP)
    go_on(inbox, client, SLOW, 1)
    assert robots[0].velocities == [FAST, STOP, SLOW]


def test_halted_what_a_key_has_set_going_is_stopped_and_keys_are_taken(inbox, client, robots):
    client.advertise('/mbot/keys').key('i')
    inbox.step(STEP)
    halt(inbox, robots)
    assert robots[1].keys == ['i', 'STOP']
    pass_time(inbox, 0.3)
    client.key('k')
    inbox.step(STEP)
    assert robots[1].keys == ['i', 'STOP', 'k']


def test_the_end_stops_what_clients_drive(inbox, client, robots):
    client.advertise('/go2/cmd_vel', '/mbot/keys').drive(FAST)
    client.key('j', channel=1)
    inbox.step(STEP)
    inbox.stop()
    assert robots[0].velocities == [FAST, STOP]
    assert robots[1].keys == ['j', 'STOP']


def test_subscriptions_come_in_their_order(inbox, client):
    channel = SimpleNamespace(id=3, topic='/odom')
    inbox.on_subscribe(client, channel)
    inbox.on_unsubscribe(client, channel)
    assert list(inbox.subscriptions()) == [('/odom', 1, True), ('/odom', 1, False)]
    assert list(inbox.subscriptions()) == []


def test_an_e_stop_ends_what_another_client_said_before_it(inbox, robots):
    driver, other = (Client(inbox, number) for number in (1, 2))
    driver.advertise('/mbot/cmd_vel')
    other.advertise('/mbot/keys')
    inbox.step(STEP)
    robots[1].heeds_e_stop = lambda key, by: key == 'ESC' and robots[1].disarm() is None
    other.key('x')
    driver.drive(FAST)
    other.key('ESC')
    driver.drive(FAST)
    inbox.step(STEP)
    assert robots[1].velocities == [FAST, STOP]


def test_clients_that_are_gone_drive_no_longer_however_many_they_were(inbox, robots):
    clients = [Client(inbox, number).advertise('/mbot/cmd_vel') for number in range(1, 11)]
    for _ in range(LONGEST_QUEUE):
        for client in clients:
            client.drive(FAST)
    for client in clients:
        client.leave()
    pass_time(inbox, 2.0 * STEP * LONGEST_QUEUE / AT_ONCE)
    robots[1].velocities.clear()
    pass_time(inbox, 1.0)
    assert robots[1].velocities == []
