# SPDX-License-Identifier: Apache-2.0
"""Who may talk to ROS here, as environments say it."""

import xml.etree.ElementTree as ElementTree

from cases import for_all
from wasd_core.network import keep_to_this_machine, PROFILE, PROFILES_FILE, RANGE

FAST = 'rmw_fastrtps_cpp'


def kept(environment, middleware=FAST):
    changed = dict(environment)
    keep_to_this_machine(changed, middleware)
    return {name: value for name, value in changed.items() if environment.get(name) != value}


def test_who_has_said_nothing_is_bound_to_this_machine():
    assert kept({}) == {RANGE: 'SYSTEM_DEFAULT', PROFILES_FILE: str(PROFILE)}
    assert kept({RANGE: ''}) == kept({}), 'ROS takes an empty text for none, too'


@for_all('value', ['OFF', 'LOCALHOST', 'SUBNET', 'SYSTEM_DEFAULT'])
def test_a_range_of_the_users_stays(value):
    assert kept({RANGE: value}) == {}
    assert kept({'ROS_LOCALHOST_ONLY': '1'}) == {}


@for_all('name', [PROFILES_FILE, 'ROS_STATIC_PEERS', 'ROS_DISCOVERY_SERVER'])
def test_peers_and_profiles_of_the_users_stay(name):
    assert kept({name: 'mine'}) == {RANGE: 'LOCALHOST'}


def test_another_middleware_is_told_to_look_no_further():
    assert kept({}, 'rmw_cyclonedds_cpp') == {RANGE: 'LOCALHOST'}


def test_a_domain_says_nothing_about_machines():
    assert kept({'ROS_DOMAIN_ID': '5'}) == kept({})


def test_the_profile_has_one_address_and_no_transport_of_fast_dds_own():
    root = ElementTree.parse(PROFILE).getroot()
    values = {e.tag.partition('}')[2]: e.text for e in root.iter()}
    addresses = [e.text for e in root.iter() if e.tag.endswith('}address')]
    assert set(addresses) == {'127.0.0.1'}
    assert values['useBuiltinTransports'] == 'false'
