# SPDX-License-Identifier: Apache-2.0
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

from leg_stages import dynamics_of
import numpy as np
import pinocchio as pin
import pytest
from quadruped_sim.dynamics import drag
from quadruped_sim.leg_kinematics import foot_positions, LEGS
from quadruped_sim.robot_model import JointMap, NO_TORQUE, RobotModel
from robot_description.description import parse_description
from robot_description.morphology.quadruped import GO2
from wasd_core.errors import RobotModelError
from wasd_core.robot_io import JointStates, Reading
from wasd_core.rotations import rpy_matrix

LEVEL = np.array((1.0, 0.0, 0.0, 0.0))


def make_model(urdf):
    return RobotModel(parse_description(urdf, Path('robot.urdf')))


def test_mass_and_legs_are_those_of_the_go2(model):
    assert model.mass == pytest.approx(16.086, abs=0.01)
    np.testing.assert_allclose((model.geometry.thigh, model.geometry.calf), 0.213)
    assert model.scale == GO2
    np.testing.assert_allclose(model.geometry.hip[0], (0.1934, 0.0465, 0.0), atol=1e-12)
    assert model.geometry.foot_radius == 0.022
    np.testing.assert_allclose(model.imu_offset, (-0.02557, 0.0, 0.04232))


def test_a_robot_hung_from_the_world_is_modelled_free(urdf, model):
    hung = urdf.replace(
        '<link name="base">',
        '<link name="world"/><joint name="hang" type="fixed"><parent link="world"/>'
        '<child link="base"/></joint><link name="base">',
        1,
    )
    assert make_model(hung).mass == pytest.approx(model.mass)


def test_joints_may_have_any_name(urdf, model, angles):
    other = make_model(urdf.replace('RR_calf_joint', 'other_joint'))
    assert other.quadruped.joint_names[-1] == 'other_joint'
    np.testing.assert_array_equal(other.foot_positions(angles), model.foot_positions(angles))


def test_how_far_it_has_risen_is_told_at_the_hips(urdf, model):
    """So a fall is one wherever the root is, also on the ground or in it."""
    weld = '<joint name="weld" type="fixed"><parent link="below"/><child link="base"/>'
    weld += '<origin xyz="0.1 0 0.45"/></joint><link name="below"/></robot>'
    low = make_model(urdf.replace('</robot>', weld))
    R = rpy_matrix(0.2, 0.3, 0.4)
    down = float(R[2] @ (0.1, 0.0, 0.45))
    for height in 0.05, 0.2, 0.3:
        assert low.risen(height - down, R) == pytest.approx(model.risen(height, R), rel=1e-12)
    feet = foot_positions(model.geometry, model.standing_pose)[:, 2]
    stand = model.geometry.foot_radius - float(feet.mean())
    assert model.risen(stand, np.eye(3)) == pytest.approx(1.0, rel=1e-12)


def test_what_is_no_quadruped_is_refused_and_its_file_named():
    with pytest.raises(RobotModelError, match=r'^robot\.urdf: a quadruped is wanted'):
        make_model('<robot name="r"><link name="a"/></robot>')


def test_weight_is_the_bias_at_rest(model, angles):
    dynamics = dynamics_of(model, LEVEL, np.zeros(3), np.zeros(3), angles, np.zeros(12))
    np.testing.assert_allclose(dynamics.bias[:3], (0.0, 0.0, model.mass * 9.81), atol=1e-9)


def test_kinetic_energy_changes_by_the_power_of_gravity_and_torque(model, angles, rng):
    """d/dt (v'Mv / 2) = v'(tau - g): the Coriolis terms do no work."""
    rates = rng.normal(size=12)
    velocity, omega = rng.normal(size=3), rng.normal(size=3)
    torque = rng.normal(size=12)
    v = np.concatenate((velocity, omega, rates))
    now = dynamics_of(model, LEVEL, velocity, omega, angles, rates)
    mass = now.mass.copy()
    gravity = dynamics_of(model, LEVEL, np.zeros(3), np.zeros(3), angles, np.zeros(12)).bias.copy()
    bias = dynamics_of(model, LEVEL, velocity, omega, angles, rates).bias.copy()
    acceleration = np.linalg.solve(mass, np.concatenate((np.zeros(6), torque)) - bias)
    h = 1e-6
    energy = []
    for sign in (1.0, -1.0):
        shifted = dynamics_of(
            model, LEVEL, velocity, omega, angles + sign * h * rates, rates
        ).mass.copy()
        moved = v + sign * h * acceleration
        energy.append(0.5 * moved @ shifted @ moved)
    power = v @ (np.concatenate((np.zeros(6), torque)) - gravity)
    assert (energy[0] - energy[1]) / (2.0 * h) == pytest.approx(power, rel=1e-5)


def lost(model, rates):
    """Return the torques (12,) that joints lose at their rates."""
    return np.array([drag(model.rigid[0][0], joint, rate) for joint, rate in enumerate(rates)])


def test_what_a_joint_loses_is_as_the_description_has_it(urdf, model):
    joint = model.quadruped.joints[0]
    assert (joint.damping, joint.friction) == (0.1, 0.2)
    rates = np.linspace(-20.0, 20.0, 12)
    wanted = joint.damping * rates + joint.friction * np.tanh(rates / 0.5)
    np.testing.assert_allclose(lost(model, rates), wanted, rtol=1e-12)
    assert not lost(model, np.zeros(12)).any()
    assert lost(model, np.full(12, -3.0)) == pytest.approx(-lost(model, np.full(12, 3.0)))
    tree = ElementTree.fromstring(urdf)
    for joint in tree.findall('joint'):
        for dynamics in joint.findall('dynamics'):
            joint.remove(dynamics)
    free = make_model(ElementTree.tostring(tree, encoding='unicode'))
    assert not lost(free, rates).any()


def test_joint_momentum_obeys_its_balance(model, angles, rng):
    """dp/dt = tau + C'v - g - drag, which the contact observer integrates."""
    rates = rng.normal(size=12)
    velocity, omega = rng.normal(size=3), rng.normal(size=3)
    v = np.concatenate((velocity, omega, rates))
    now = dynamics_of(model, LEVEL, velocity, omega, angles, rates)
    drift, mass, bias = now.momentum_drift.copy(), now.mass.copy(), now.bias.copy()
    drift += lost(model, rates)
    acceleration = np.linalg.solve(mass, -bias)
    h = 1e-6
    momentum = []
    for sign in (1.0, -1.0):
        moved = v + sign * h * acceleration
        momentum.append(
            dynamics_of(
                model, LEVEL, moved[:3], moved[3:6], angles + sign * h * rates, moved[6:]
            ).momentum.copy()
        )
    # The base's turning does not change the joint rows of M; gravity's share is in the bias.
    np.testing.assert_allclose((momentum[0] - momentum[1]) / (2.0 * h), drift, atol=1e-5)


def test_the_dynamics_are_those_of_pinocchio(urdf, model, rng):
    other = make_model(turned(urdf, model.quadruped.joint_names[3:8]))
    for robot in (model, other):
        known, data, sign = robot._model, robot._data, np.ones(18)
        known.armature = np.concatenate((np.zeros(6), robot.rigid[0]['rotor'][0]))
        joints = [known.joints[known.getJointId(name)] for name in robot.quadruped.joint_names]
        order, sign[6:] = [*range(6), *(joint.idx_v for joint in joints)], robot.quadruped.sign
        for _ in range(3):
            velocity, angles = rng.normal(size=18), rng.normal(size=12)
            turn = rng.normal(size=4)
            turn /= np.linalg.norm(turn)
            found = dynamics_of(robot, turn, velocity[:3], velocity[3:6], angles, velocity[6:])
            q, v = robot._positions(angles), np.zeros(18)
            q[3:7], v[order] = turn[[1, 2, 3, 0]], sign * velocity
            mass = pin.crba(known, data, q)
            mass = np.triu(mass) + np.triu(mass, 1).T
            bias = pin.nonLinearEffects(known, data, q, v)
            coriolis = pin.computeCoriolisMatrix(known, data, q, v)
            drift = sign * ((coriolis + coriolis.T) @ v - bias)[order]
            drift[6:] -= lost(robot, velocity[6:])
            wanted = np.outer(sign, sign) * mass[np.ix_(order, order)]
            np.testing.assert_allclose(found.mass, wanted, atol=1e-12)
            np.testing.assert_allclose(found.bias, sign * bias[order], atol=1e-11)
            np.testing.assert_allclose(found.momentum, (sign * (mass @ v)[order])[6:], atol=1e-12)
            np.testing.assert_allclose(found.momentum_drift, drift[6:], atol=1e-11)


def test_the_mass_matrix_knows_the_centre_of_mass(model, angles, rng):
    dynamics = dynamics_of(model, LEVEL, rng.normal(size=3), rng.normal(size=3), angles, angles)
    np.testing.assert_allclose(dynamics.com, model.inertia_about_com(angles)[1], atol=1e-12)


def turned(urdf, names):
    """Return a description in which some joints count the other way round."""
    tree = ElementTree.fromstring(urdf)
    for joint in tree.findall('joint'):
        if joint.get('name') in names:
            axis, limit = joint.find('axis'), joint.find('limit')
            axis.set('xyz', ' '.join(str(-float(part)) for part in axis.get('xyz').split()))
            lower, upper = limit.get('lower'), limit.get('upper')
            limit.set('lower', str(-float(upper)))
            limit.set('upper', str(-float(lower)))
    return ElementTree.tostring(tree, encoding='unicode')


@pytest.mark.slow
def test_joints_that_count_the_other_way_change_nothing(urdf, model, angles, rng):
    other = make_model(turned(urdf, model.quadruped.joint_names[3:8]))
    assert other.quadruped.sign.tolist() == [1.0] * 3 + [-1.0] * 5 + [1.0] * 4
    np.testing.assert_array_equal(other.limits.lower, model.limits.lower)
    velocity, omega, rates = rng.normal(size=3), rng.normal(size=3), rng.normal(size=12)
    one, two = (
        dynamics_of(robot, LEVEL, velocity, omega, angles, rates) for robot in (model, other)
    )
    for name in ('mass', 'bias', 'momentum', 'momentum_drift', 'com'):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), atol=1e-9)
    joints = other.quadruped.joint_names
    back = JointMap(other.quadruped, joints, joints)
    command = back.command(NO_TORQUE._replace(position=angles, velocity=rates, effort=rates))
    reading = Reading(JointStates(command.position, command.velocity, command.effort), None)
    for one, wanted in zip(back.reading(reading).joints, (angles, rates, rates), strict=True):
        np.testing.assert_allclose(one, wanted)
    assert command.effort @ command.velocity == pytest.approx(rates @ rates)


def test_a_joint_without_stops_may_turn(urdf, model, angles):
    free = make_model(
        urdf.replace('"FL_thigh_joint" type="revolute"', '"FL_thigh_joint" type="continuous"')
    )
    assert free.limits.upper[1] == np.inf
    np.testing.assert_allclose(free.foot_positions(angles), model.foot_positions(angles))


def test_whole_turns_of_a_joint_that_turns_on_are_none_of_the_controllers(urdf, model, angles):
    """Wound up by falls, it goes on to the nearest angle that is the same."""
    endless = urdf.replace(
        '"FL_thigh_joint" type="revolute"', '"FL_thigh_joint" type="continuous"'
    )
    names = model.quadruped.joint_names
    joints = JointMap(make_model(endless).quadruped, names, names)
    rates = np.arange(12.0)
    for turns in (-2, 0, 1):
        wound = angles + 2.0 * np.pi * turns * (np.arange(12) == 1)
        reading = joints.reading(Reading(JointStates(wound, rates, rates), None))
        np.testing.assert_allclose(reading.joints.position, angles, atol=1e-12)
        np.testing.assert_array_equal(reading.joints.velocity, rates)
        command = joints.command(NO_TORQUE._replace(position=angles + 0.1))
        np.testing.assert_allclose(command.position, wound + 0.1, atol=1e-12)


@pytest.mark.parametrize('hip', [-1.5, 0.0, 2.9, 4.2])
def test_a_leg_that_may_turn_round_comes_home_outside_of_the_trunk(urdf, hip):
    endless = urdf
    for name in ('FL', 'FR'):
        kind = f'"{name}_hip_joint" type="revolute"'
        endless = endless.replace(kind, kind.replace('revolute', 'continuous'))
    quadruped = make_model(endless).quadruped
    joints = JointMap(quadruped, quadruped.joint_names, quadruped.joint_names)
    position = np.zeros(12)
    position[[0, 3]] = hip, -hip
    for turns in (-1, 0, 1):
        reading = Reading(JointStates(position + 2.0 * np.pi * turns, *np.zeros((2, 12))), None)
        np.testing.assert_allclose(joints.reading(reading).joints.position[[0, 3]], (hip, -hip))


@pytest.mark.parametrize('at', [9.9, -9.9])
def test_a_joint_wound_up_to_its_stop_unwinds_as_far_as_its_legs_need(urdf, model, at):
    free = urdf.replace('lower="-1.0472" upper="1.0472"', 'lower="-10" upper="10"')
    assert free != urdf
    quadruped = make_model(free).quadruped
    joints = JointMap(quadruped, quadruped.joint_names, quadruped.joint_names)
    position = np.where(np.arange(12) % 3 == 0, at, model.standing_pose)
    joints.reading(Reading(JointStates(position, *np.zeros((2, 12))), None))
    for hip in (-1.0, 1.0):
        angles = np.where(np.arange(12) % 3 == 0, hip, model.standing_pose)
        wanted = joints.command(NO_TORQUE._replace(position=angles)).position
        assert (np.abs(wanted) <= 10.0).all()
        np.testing.assert_allclose(wanted[::3] % (2.0 * np.pi), hip % (2.0 * np.pi))


def test_a_joint_without_a_motor_is_named(urdf):
    with pytest.raises(RobotModelError, match='no motor on FL_calf_joint, FR_calf_joint'):
        make_model(urdf.replace('effort="35.55"', 'effort="0"'))


def test_motors_are_weighed_against_the_robot(urdf, model):
    assert model.overloaded(legs=4) == model.overloaded(legs=2) == {}
    assert model.motor_notes(2.0, 2.0) == ()
    weak = make_model(urdf.replace('effort="35.55"', 'effort="8"'))
    assert set(weak.overloaded(legs=2)) == {f'{leg}_calf_joint' for leg in LEGS}
    (note,) = weak.motor_notes(2.0, 2.0)
    assert note.startswith('motors too weak to trot: ')
    assert note.endswith(' N m, has 8 N m (and 3 more joints)')
    limp = make_model(urdf.replace('effort="35.55"', 'effort="2"'))
    torque = model.weight / 4 * 0.213 * np.sin(1.3 - 0.67)  # a quarter, on the calf's lever
    assert limp.overloaded(legs=4)['RR_calf_joint'] == pytest.approx(torque)
    (note,) = limp.motor_notes(2.0, 2.0)
    assert 'motors too weak to stand: ' in note
    assert 'needs 4.95 N m, has 2 N m (and 3 more joints)' in note


def test_slow_motors_make_a_slow_robot(urdf, model):
    assert model.agility == model.turning == 1.0
    assert model.slimness == (1.0, 1.0)
    slow = make_model(urdf.replace('velocity="15.7"', 'velocity="7.85"'))
    assert slow.agility == pytest.approx(0.5)
    assert slow.friction == model.friction == 0.6
    assert slow.motor_notes(1.0, 2.0) == (
        'motors of 7.85 rad/s (joint FL_calf_joint) allow 1 m/s; full stick lowered',
    )
    assert slow.motor_notes(0.4, 0.4) == ()  # by --limits guide it is not


def test_an_arm_is_weighed_where_it_is_held(urdf, model, angles):
    """As if its joint were fixed there: at the limit next to 0."""
    arm = (
        '<link name="arm"><inertial><origin xyz="0 0 0.3"/><mass value="2"/><inertia ixx="0.01" '
        'iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="elbow" '
        'type="{}"><parent link="base"/><child link="arm"/><origin xyz="0.1 0 0.05" '
        'rpy="0 {} 0.4"/><axis xyz="0 1 0"/><limit lower="0.5" upper="2" effort="9" '
        'velocity="9"/></joint>'
        '</robot>'
    )
    turned = make_model(urdf.replace('</robot>', arm.format('revolute', np.pi / 2 - 0.5)))
    fixed = make_model(urdf.replace('</robot>', arm.format('fixed', np.pi / 2)))
    assert turned.mass == pytest.approx(model.mass + 2.0)
    for held, welded in zip(
        turned.inertia_about_com(angles), fixed.inertia_about_com(angles), strict=True
    ):
        np.testing.assert_allclose(held, welded, atol=1e-12)
    names = (*model.quadruped.joint_names[:6], 'elbow', *model.quadruped.joint_names[6:])
    command = JointMap(turned.quadruped, names, names).command(
        NO_TORQUE._replace(effort=np.arange(1.0, 13.0))
    )
    assert command.effort.tolist() == [1, 2, 3, 4, 5, 6, 0, 7, 8, 9, 10, 11, 12]


def test_feet_that_sink_into_the_floor_are_refused(urdf):
    bare = re.sub(r'<collision>.*?</collision>', '', urdf, flags=re.DOTALL)
    with pytest.raises(RobotModelError, match="nothing of foot 'FL_foot' collides"):
        make_model(bare)
