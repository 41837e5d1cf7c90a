# SPDX-License-Identifier: Apache-2.0
"""`--lidar` in a run: what is measured is as it says."""

from cases import for_all
import numpy as np
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.run import Run


@for_all(
    ('lidar', 'times', 'rate'), [('honest', True, 5.5), ('ideal', False, 5.5), ('s2', True, 10.0)]
)
def test_a_scan_is_of_one_instant_or_of_a_turn_by_its_name(lidar, times, rate):
    options = RunOptions(
        robot='mbot', description='mbot', preset='mbot', world='room', speed=0.0, lidar=lidar
    )
    run = Run(options)
    heard = []
    run.robots[0].sensors.listen('scan', lambda now, fields: heard.append((now, fields)))
    run.simulation.advance(round(0.5 / run.world.time_step))
    began, fields = zip(*heard, strict=True)
    assert (fields[0]['time_increment'] > 0.0) == times
    np.testing.assert_allclose(np.diff(began), 1.0 / rate, atol=6e-3)
    run.close()
