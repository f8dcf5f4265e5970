"""Common lidars by name; values of their makers' data sheets."""

import math
from types import MappingProxyType

from sim.robot_run import LidarSpec

LIDAR_PRESETS = MappingProxyType(
    {
        # SICK LMS 200/291: 180 degrees in 1 degree steps, mirror at 75 Hz.
        "sick_lms_180": LidarSpec(
            num_beams=180,
            angle_min_rad=-math.pi / 2,
            angle_increment_rad=math.radians(1.0),
            range_min_m=0.05,
            range_max_m=50.0,
            scan_period_s=0.2,
            time_increment_s=1.0 / 75.0 / 360.0,
            T_robot_lidar=(0.1, 0.0, 0.0),
        ),
        # The same in 0.5 degree steps: two turns of the mirror, interleaved.
        "sick_lms_360": LidarSpec(
            num_beams=360,
            angle_min_rad=-math.pi / 2,
            angle_increment_rad=math.radians(0.5),
            range_min_m=0.05,
            range_max_m=50.0,
            scan_period_s=0.2,
            time_increment_s=2.0 / 75.0 / 720.0,
            T_robot_lidar=(0.1, 0.0, 0.0),
        ),
        # Hokuyo UTM-30LX: 270 degrees in 0.25 degree steps, 40 Hz, 0.1 to 30 m.
        "hokuyo_utm_30lx": LidarSpec(
            num_beams=1081,
            angle_min_rad=-math.radians(135.0),
            angle_increment_rad=math.radians(0.25),
            range_min_m=0.1,
            range_max_m=30.0,
            scan_period_s=0.1,
            time_increment_s=0.025 / 1440.0,
            T_robot_lidar=(0.1, 0.0, 0.0),
        ),
        # A hobby scanner (RPLIDAR A1 class): a full turn in 1 degree steps at 5.5 Hz, 0.15 to 12 m.
        "cheap_360": LidarSpec(
            num_beams=360,
            angle_min_rad=-math.pi,
            angle_increment_rad=math.radians(1.0),
            range_min_m=0.15,
            range_max_m=12.0,
            scan_period_s=1.0 / 5.5,
            time_increment_s=1.0 / 5.5 / 360.0,
        ),
    }
)
"""Geometry of each sensor; its noise is chosen apart (`sim.sensors.lidar_noise`)."""
