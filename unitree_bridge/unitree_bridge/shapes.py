# SPDX-License-Identifier: Apache-2.0
"""
The shapes of Unitree's messages, as its SDK has them in Python.

A field is a number (by NumPy's name for it), a text, a flag, another shape, several of one kind,
or any number of one kind. SportModeState is the SDK's, which has `path_point`; that of
unitree_ros2 lacks it, and an SDK program drops every sample without.
"""

from typing import NamedTuple, Union

U8, U16, U32, U64 = 'u1', 'u2', 'u4', 'u8'
I16, I32, I64 = 'i2', 'i4', 'i8'
F32, F64 = 'f4', 'f8'
FLAG, TEXT = 'flag', 'text'

MOTORS = 20  # in a message; the Go2 has the first twelve


class Several(NamedTuple):
    """A fixed number of one kind."""

    kind: Union[str, 'Shape']
    number: int


class Many(NamedTuple):
    """Any number of one kind."""

    kind: Union[str, 'Shape']


class Shape(NamedTuple):
    """A message or a part of one: its name in IDL, and its fields in order."""

    name: str
    fields: dict[str, 'Kind']


Kind = str | Shape | Several | Many


def _go(name: str, /, **fields: Kind) -> Shape:
    return Shape(f'unitree_go.msg.dds_.{name}_', fields)


def _api(name: str, /, **fields: Kind) -> Shape:
    return Shape(f'unitree_api.msg.dds_.{name}_', fields)


def _ros(package: str, name: str, /, **fields: Kind) -> Shape:
    return Shape(f'{package}.msg.dds_.{name}_', fields)


MOTOR_CMD = _go(
    'MotorCmd', mode=U8, q=F32, dq=F32, tau=F32, kp=F32, kd=F32, reserve=Several(U32, 3)
)
LOW_CMD = _go(
    'LowCmd',
    head=Several(U8, 2),
    level_flag=U8,
    frame_reserve=U8,
    sn=Several(U32, 2),
    version=Several(U32, 2),
    bandwidth=U16,
    motor_cmd=Several(MOTOR_CMD, MOTORS),
    bms_cmd=_go('BmsCmd', off=U8, reserve=Several(U8, 3)),
    wireless_remote=Several(U8, 40),
    led=Several(U8, 12),
    fan=Several(U8, 2),
    gpio=U8,
    reserve=U32,
    crc=U32,
)
IMU_STATE = _go(
    'IMUState',
    quaternion=Several(F32, 4),
    gyroscope=Several(F32, 3),
    accelerometer=Several(F32, 3),
    rpy=Several(F32, 3),
    temperature=U8,
)
MOTOR_STATE = _go(
    'MotorState',
    mode=U8,
    q=F32,
    dq=F32,
    ddq=F32,
    tau_est=F32,
    q_raw=F32,
    dq_raw=F32,
    ddq_raw=F32,
    temperature=U8,
    lost=U32,
    reserve=Several(U32, 2),
)
BMS_STATE = _go(
    'BmsState',
    version_high=U8,
    version_low=U8,
    status=U8,
    soc=U8,
    current=I32,
    cycle=U16,
    bq_ntc=Several(U8, 2),
    mcu_ntc=Several(U8, 2),
    cell_vol=Several(U16, 15),
)
LOW_STATE = _go(
    'LowState',
    head=Several(U8, 2),
    level_flag=U8,
    frame_reserve=U8,
    sn=Several(U32, 2),
    version=Several(U32, 2),
    bandwidth=U16,
    imu_state=IMU_STATE,
    motor_state=Several(MOTOR_STATE, MOTORS),
    bms_state=BMS_STATE,
    foot_force=Several(I16, 4),
    foot_force_est=Several(I16, 4),
    tick=U32,
    wireless_remote=Several(U8, 40),
    bit_flag=U8,
    adc_reel=F32,
    temperature_ntc1=U8,
    temperature_ntc2=U8,
    power_v=F32,
    power_a=F32,
    fan_frequency=Several(U16, 4),
    reserve=U32,
    crc=U32,
)
PATH_POINT = _go('PathPoint', t_from_start=F32, x=F32, y=F32, yaw=F32, vx=F32, vy=F32, vyaw=F32)
SPORT_MODE_STATE = _go(
    'SportModeState',
    stamp=_go('TimeSpec', sec=I32, nanosec=U32),
    error_code=U32,
    imu_state=IMU_STATE,
    mode=U8,
    progress=F32,
    gait_type=U8,
    foot_raise_height=F32,
    position=Several(F32, 3),
    body_height=F32,
    velocity=Several(F32, 3),
    yaw_speed=F32,
    range_obstacle=Several(F32, 4),
    foot_force=Several(I16, 4),
    foot_position_body=Several(F32, 12),
    foot_speed_body=Several(F32, 12),
    path_point=Several(PATH_POINT, 10),
)
WIRELESS_CONTROLLER = _go('WirelessController', lx=F32, ly=F32, rx=F32, ry=F32, keys=U16)
HEIGHT_MAP = _go(
    'HeightMap',
    stamp=F64,
    frame_id=TEXT,
    resolution=F32,
    width=U32,
    height=U32,
    origin=Several(F32, 2),
    data=Many(F32),
)
# Pictures of 1280 x 720, 640 x 360 and 320 x 180.
FRONT_VIDEO = _go(
    'Go2FrontVideoData',
    time_frame=U64,
    video720p=Many(U8),
    video360p=Many(U8),
    video180p=Many(U8),
)

IDENTITY = _api('RequestIdentity', id=I64, api_id=I64)
REQUEST = _api(
    'Request',
    header=_api(
        'RequestHeader',
        identity=IDENTITY,
        lease=_api('RequestLease', id=I64),
        policy=_api('RequestPolicy', priority=I32, noreply=FLAG),
    ),
    parameter=TEXT,
    binary=Many(U8),
)
RESPONSE = _api(
    'Response',
    header=_api('ResponseHeader', identity=IDENTITY, status=_api('ResponseStatus', code=I32)),
    data=TEXT,
    binary=Many(U8),
)

STRING = _ros('std_msgs', 'String', data=TEXT)
HEADER = _ros(
    'std_msgs',
    'Header',
    stamp=_ros('builtin_interfaces', 'Time', sec=I32, nanosec=U32),
    frame_id=TEXT,
)
POINT = _ros('geometry_msgs', 'Point', x=F64, y=F64, z=F64)
VECTOR = _ros('geometry_msgs', 'Vector3', x=F64, y=F64, z=F64)
QUATERNION = _ros('geometry_msgs', 'Quaternion', x=F64, y=F64, z=F64, w=F64)
POSE = _ros('geometry_msgs', 'Pose', position=POINT, orientation=QUATERNION)
POSE_STAMPED = _ros('geometry_msgs', 'PoseStamped', header=HEADER, pose=POSE)
ODOMETRY = _ros(
    'nav_msgs',
    'Odometry',
    header=HEADER,
    child_frame_id=TEXT,
    pose=_ros('geometry_msgs', 'PoseWithCovariance', pose=POSE, covariance=Several(F64, 36)),
    twist=_ros(
        'geometry_msgs',
        'TwistWithCovariance',
        twist=_ros('geometry_msgs', 'Twist', linear=VECTOR, angular=VECTOR),
        covariance=Several(F64, 36),
    ),
)
IMU = _ros(
    'sensor_msgs',
    'Imu',
    header=HEADER,
    orientation=QUATERNION,
    orientation_covariance=Several(F64, 9),
    angular_velocity=VECTOR,
    angular_velocity_covariance=Several(F64, 9),
    linear_acceleration=VECTOR,
    linear_acceleration_covariance=Several(F64, 9),
)
POINT_CLOUD = _ros(
    'sensor_msgs',
    'PointCloud2',
    header=HEADER,
    height=U32,
    width=U32,
    fields=Many(_ros('sensor_msgs', 'PointField', name=TEXT, offset=U32, datatype=U8, count=U32)),
    is_bigendian=FLAG,
    point_step=U32,
    row_step=U32,
    data=Many(U8),
    is_dense=FLAG,
)
