# SPDX-License-Identifier: Apache-2.0
"""The Go2 against Unitree's own description, and as two engines read the same text."""

import math
import xml.etree.ElementTree as ElementTree

from cases import for_all
from descriptions import robot_named
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from robot_description.mujoco.builder import REFLECTED_INERTIA, to_mujoco
from robot_description.packages import description_path, share_directory
from robot_description.urdf import parse_urdf
from robot_description.xacro.session import expand_document

LEGS = ('FL', 'FR', 'RL', 'RR')
PARTS = ('hip', 'thigh', 'calf')
JOINTS = [f'{leg}_{part}_joint' for leg in LEGS for part in PARTS]
IMU_MASS = 0.001
FOOT_SHIFT = np.array((-0.002, 0.0, 0.0))


@pytest.fixture(scope='module')
def urdf() -> str:
    return robot_named('go2').urdf


@pytest.fixture(scope='module')
def go2(urdf):
    return parse_urdf(urdf)


@pytest.fixture(scope='module')
def mujoco_model(urdf, go2):
    return to_mujoco(go2).compile()


@pytest.fixture(scope='module')
def pinocchio_model(urdf):
    return pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())


@pytest.fixture(scope='module')
def others():
    """The Go2 of example-robot-data, which is Unitree's flat URDF."""
    path = share_directory('go2_description') / 'urdf/go2.urdf'
    return ElementTree.parse(path).getroot()


class Pose:
    """One random pose in both models."""

    def __init__(self, mujoco_model, pinocchio_model, seed):
        random = np.random.default_rng(seed)
        self.mujoco, self.pinocchio = mujoco.MjData(mujoco_model), pinocchio_model.createData()
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        place, angles = random.normal(size=3), random.uniform(-1.5, 1.5, size=12)
        self.mujoco.qpos[:3], self.mujoco.qpos[3:7] = place, quaternion
        q = pin.neutral(pinocchio_model)
        q[:3], q[3:7] = place, np.roll(quaternion, -1)  # Pinocchio: x y z w
        for name, angle in zip(JOINTS, angles, strict=True):
            self.mujoco.joint(name).qpos[0] = angle
            joint = pinocchio_model.joints[pinocchio_model.getJointId(name)]
            q[joint.idx_q] = angle
        mujoco.mj_forward(mujoco_model, self.mujoco)
        pin.computeAllTerms(pinocchio_model, self.pinocchio, q, np.zeros(pinocchio_model.nv))
        pin.updateFramePlacements(pinocchio_model, self.pinocchio)
        self.foot_frames = {
            leg: self.pinocchio.oMf[pinocchio_model.getFrameId(f'{leg}_foot')] for leg in LEGS
        }


@pytest.fixture(params=range(5))
def pose(request, mujoco_model, pinocchio_model):
    return Pose(mujoco_model, pinocchio_model, request.param)


@pytest.mark.slow
def test_it_has_unitrees_links_and_joints_and_a_laser(go2, others):
    links = {tag.get('name') for tag in others.findall('link')}
    joints = {tag.get('name') for tag in others.findall('joint')}
    assert set(go2.links) == links | {'laser_link'}
    assert set(go2.joints) == joints | {'laser_joint'}
    assert (go2.name, go2.root) == ('go2', 'base')
    assert [joint.name for joint in go2.movable_joints] == JOINTS


@pytest.mark.slow
def test_every_mass_is_unitrees_but_for_the_imus_gram(go2, others):
    masses = {
        tag.get('name'): float(mass.get('value'))
        for tag in others.findall('link')
        if (mass := tag.find('inertial/mass')) is not None
    }
    ours = {name: link.mass for name, link in go2.links.items() if link.mass > 0.0}
    assert ours.pop('imu') == IMU_MASS
    masses.pop('imu', None)
    assert ours == pytest.approx({name: mass for name, mass in masses.items() if mass > 0.0})
    assert go2.mass == pytest.approx(sum(masses.values()), abs=1.1 * IMU_MASS)


def test_every_inertia_is_unitrees(urdf, others):
    def inertias(tree):
        return {
            link.get('name'): [float(tag.get(axis)) for axis in sorted(tag.keys())]
            for link in tree.findall('link')
            if (tag := link.find('inertial/inertia')) is not None and link.get('name') != 'imu'
        }

    theirs, ours = inertias(others), inertias(ElementTree.fromstring(urdf))
    theirs = {name: values for name, values in theirs.items() if any(values)}
    assert set(ours) == set(theirs)
    for name, values in ours.items():
        np.testing.assert_allclose(values, theirs[name], rtol=1e-6, atol=1e-12, err_msg=name)


def test_every_joint_is_where_unitrees_is_and_turns_as_far(go2, others):
    for tag in others.findall('joint'):
        if tag.get('type') != 'revolute':
            continue
        ours = go2.joints[tag.get('name')]
        place = [float(number) for number in tag.find('origin').get('xyz').split()]
        np.testing.assert_allclose(ours.pose.position, place, atol=1e-9, err_msg=ours.name)
        axis = [float(number) for number in tag.find('axis').get('xyz').split()]
        np.testing.assert_array_equal(ours.axis, axis)


@pytest.mark.slow
def test_debug_adds_one_link_and_one_joint(go2):
    hung = parse_urdf(expand_document(description_path('go2'), {'DEBUG': 'true'}).urdf)
    assert set(hung.links) - set(go2.links) == {'world'}
    assert set(hung.joints) - set(go2.joints) == {'base_static_joint'}
    assert hung.root == 'world'
    assert hung.mass == go2.mass


def limits_of(text):
    return {
        joint.get('name'): {key: float(value) for key, value in limit.items()}
        for joint in ElementTree.fromstring(text).findall('joint')
        if (limit := joint.find('limit')) is not None
    }


@pytest.mark.slow
def test_limits_are_those_of_the_flat_urdf_or_of_the_xacro(urdf, others):
    expansion = expand_document(description_path('go2'), {'limits': 'xacro'})
    flat, xacro = limits_of(urdf), limits_of(expansion.urdf)
    for name, theirs in limits_of(ElementTree.tostring(others)).items():
        ours = flat[name]
        assert (ours['lower'], ours['upper']) == (theirs['lower'], theirs['upper']), name
        assert ours['effort'] == min(theirs['effort'], 35.55), name
        assert ours['velocity'] == theirs['velocity'], name
    assert flat['RL_thigh_joint']['upper'] == 4.5379
    for leg in LEGS:
        assert xacro[f'{leg}_thigh_joint']['upper'] == 3.4907
        assert xacro[f'{leg}_calf_joint']['velocity'] == 20.06
        assert xacro[f'{leg}_calf_joint']['effort'] == 35.55


def test_it_is_symmetric(go2):
    for part in (*PARTS, 'foot'):
        left, right, rear = (go2.joints[f'{leg}_{part}_joint'].pose for leg in ('FL', 'FR', 'RL'))
        np.testing.assert_allclose(left.position * (1, -1, 1), right.position, atol=1e-12)
        np.testing.assert_allclose(abs(left.position), abs(rear.position), atol=1e-12)


def test_both_engines_have_the_same_degrees_of_freedom_by_name(mujoco_model, pinocchio_model):
    assert (mujoco_model.nq, mujoco_model.nv, mujoco_model.nu) == (19, 18, 12)
    assert (pinocchio_model.nq, pinocchio_model.nv) == (19, 18)
    names = {mujoco_model.joint(i).name for i in range(1, mujoco_model.njnt)}
    assert names == set(list(pinocchio_model.names)[2:]) == set(JOINTS)
    assert {mujoco_model.actuator(i).name for i in range(12)} == names
    for name in names:
        joint = pinocchio_model.joints[pinocchio_model.getJointId(name)]
        limits = mujoco_model.joint(name).range
        assert limits[0] == pinocchio_model.lowerPositionLimit[joint.idx_q]
        assert limits[1] == pinocchio_model.upperPositionLimit[joint.idx_q]
        force = mujoco_model.actuator(name).forcerange
        np.testing.assert_array_equal(force[1], pinocchio_model.effortLimit[joint.idx_v])


def test_both_engines_weigh_it_the_same(mujoco_model, pinocchio_model, go2):
    mass = pin.computeTotalMass(pinocchio_model)
    assert mujoco_model.body_mass.sum() == pytest.approx(mass, abs=1e-12)
    assert mass == pytest.approx(go2.mass, abs=1e-12)


def test_both_engines_put_the_feet_in_the_same_place(pose):
    for leg, frame in pose.foot_frames.items():
        geom = pose.mujoco.geom(f'{leg}_foot/0')
        centre = geom.xpos - pose.mujoco.body(f'{leg}_calf').xmat.reshape(3, 3) @ FOOT_SHIFT
        np.testing.assert_allclose(centre, frame.translation, atol=1e-9)


def test_both_engines_have_the_same_centre_of_mass(pose, mujoco_model):
    np.testing.assert_allclose(pose.mujoco.subtree_com[0], pose.pinocchio.com[0], atol=1e-9)


def test_both_engines_have_the_same_inertia_at_the_joints(pose, mujoco_model, pinocchio_model):
    full = np.zeros((18, 18))
    mujoco.mj_fullM(mujoco_model, pose.mujoco, full)
    full -= np.diag(mujoco_model.dof_armature)
    ours = [int(mujoco_model.joint(name).dofadr[0]) for name in JOINTS]
    theirs = [pinocchio_model.joints[pinocchio_model.getJointId(name)].idx_v for name in JOINTS]
    M = np.triu(pose.pinocchio.M) + np.triu(pose.pinocchio.M, 1).T
    # MuJoCo keeps each body's inertia by its principal axes.
    np.testing.assert_allclose(full[np.ix_(ours, ours)], M[np.ix_(theirs, theirs)], atol=1e-8)


def test_rotors_are_felt_through_the_gears(mujoco_model):
    for name in JOINTS:
        assert mujoco_model.joint(name).armature == REFLECTED_INERTIA
    np.testing.assert_array_equal(mujoco_model.dof_armature[:6], 0.0)


def test_the_feet_decide_how_they_grip_whatever_the_floor(mujoco_model):
    for leg in LEGS:
        foot = mujoco_model.geom(f'{leg}_foot/0')
        assert foot.priority == 1
        assert foot.friction[0] == 0.6
        assert foot.condim == 3
        assert foot.type == mujoco.mjtGeom.mjGEOM_SPHERE
        assert foot.size[0] == 0.022
    assert mujoco_model.geom('FL_calf/0').friction[0] == 0.2


@for_all(('angle', 'slides'), [(28.0, False), (34.0, True)])
def test_a_foot_slides_where_its_own_friction_says(angle, slides):
    # atan 0.6 is 31 degrees; the floor's own friction of 1 would hold to 45.
    text = (
        '<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="1 1 0.1"/>'
        '</geometry></collision></link><gazebo reference="base"><mu1>0.6</mu1></gazebo></robot>'
    )
    spec = to_mujoco(parse_urdf(text))
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100.0
    slope = math.radians(angle)
    spec.option.gravity = [9.81 * math.sin(slope), 0.0, -9.81 * math.cos(slope)]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], friction=[1, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = 0.05
    mujoco.mj_step(model, data, 500)
    assert (data.qpos[0] > 0.05) == slides


def test_trunk_and_thighs_may_overlap(mujoco_model):
    excluded = {
        frozenset(
            (mujoco_model.body(int(pair) >> 16).name, mujoco_model.body(int(pair) & 0xFFFF).name)
        )
        for pair in mujoco_model.exclude_signature
    }
    for leg in LEGS:
        assert frozenset(('base', f'{leg}_thigh')) in excluded


def test_no_two_links_collide_in_any_ordinary_pose(mujoco_model):
    data = mujoco.MjData(mujoco_model)
    data.qpos[2] = 5.0
    for angles in ((0.0, 1.36, -2.65), (0.0, 0.67, -1.3), (0.3, 0.9, -1.8), (-0.3, 0.9, -1.8)):
        for name, angle in zip(JOINTS, 4 * angles, strict=True):
            data.joint(name).qpos[0] = angle
        mujoco.mj_forward(mujoco_model, data)
        assert data.ncon == 0, angles


def test_the_imu_is_where_unitree_has_it(mujoco_model, others):
    (joint,) = (tag for tag in others.findall('joint') if tag.get('name') == 'imu_joint')
    place = [float(number) for number in joint.find('origin').get('xyz').split()]
    np.testing.assert_allclose(mujoco_model.site('imu_site').pos, place, atol=1e-9)
    assert {mujoco_model.sensor(i).name for i in range(2)} == {'accelerometer', 'gyro'}
