# SPDX-License-Identifier: Apache-2.0
"""What odometry is made from, how sure it is, and how it is published."""

from dataclasses import dataclass

from wasd_core.parameters import InvalidParameter
from wasd_core.parameters import parameter
from wasd_core.parameters import Parameters

# A planar robot knows nothing of z, roll and pitch: 1e6 tells a filter to look elsewhere.
UNKNOWN = 1e6


@dataclass(frozen=True, kw_only=True)
class OdometryParameters(Parameters):
    """Odometry, its frames and covariances."""

    odom_frame_id: str = parameter('odom', doc='Frame in which odometry is given', read_only=True)
    base_frame_id: str = parameter(
        '',
        doc="Frame of the robot that odometry follows; empty: the description's root",
        read_only=True,
    )
    enable_odom_tf: bool = parameter(
        True, doc='Publish odometry as a transform on /tf, too', read_only=True
    )
    odometry_feedback: str = parameter(
        'joint_states',
        doc='What odometry counts: wheel angles as they are, or whole encoder ticks',
        choices=('joint_states', 'ticks'),
        read_only=True,
    )
    open_loop: bool = parameter(
        False, doc='Odometry counts what is commanded, not what the wheels do', read_only=True
    )
    velocity_rolling_window_size: int = parameter(
        10,
        doc='The velocity of odometry is the mean over so many steps',
        minimum=1,
        read_only=True,
    )
    pose_covariance_diagonal: tuple[float, ...] = parameter(
        (0.0, 0.0, UNKNOWN, UNKNOWN, UNKNOWN, 0.0),
        doc='Variances of x, y, z, roll, pitch, yaw at the start, in m^2 and rad^2',
        minimum=0.0,
        read_only=True,
    )
    twist_covariance_diagonal: tuple[float, ...] = parameter(
        (1e-4, 1e-4, UNKNOWN, UNKNOWN, UNKNOWN, 1e-4),
        doc='Variances of the twist at rest, in (m/s)^2 and (rad/s)^2',
        minimum=0.0,
        read_only=True,
    )
    distance_variance: float = parameter(
        2.5e-5, doc='Growth of the variance of a path with its length', unit='m^2/m', minimum=0.0
    )
    turn_variance: float = parameter(
        1e-4, doc='Growth of the variance of the heading with turns', unit='rad^2/rad', minimum=0.0
    )
    drift_variance: float = parameter(
        1e-5, doc='Growth of the variance of the heading with paths', unit='rad^2/m', minimum=0.0
    )
    twist_error: float = parameter(
        0.02, doc='Standard deviation of a velocity as a share of it', minimum=0.0
    )
    publish_rate: float = parameter(
        50.0, doc='Rate of odom and /tf', unit='Hz', above=0.0, read_only=True
    )
    joint_names: str = parameter(
        'urdf',
        doc="Names in joint_states: the description's, arbotix's base_l_wheel_joint and "
        "base_r_wheel_joint, or both; a simulator publishes the description's in any case",
        choices=('urdf', 'arbotix', 'both'),
        read_only=True,
    )

    def __post_init__(self) -> None:
        """Refuse frames that coincide, too."""
        super().__post_init__()
        if not self.odom_frame_id or self.odom_frame_id == self.base_frame_id:
            raise InvalidParameter(
                f'odom_frame_id must be a frame other than base_frame_id, got '
                f'{self.odom_frame_id!r}'
            )
