# SPDX-License-Identifier: Apache-2.0
"""
The distance from each cell to the nearest obstacle.

Exact squared distances by two passes of lower envelopes of parabolas (Felzenszwalb and
Huttenlocher, Distance Transforms of Sampled Functions, 2012); the first pass, over a binary
picture, is two sweeps.
"""

from wasd_navigation.planning.distances import FARTHEST, Field, measure_distances

__all__ = ['FARTHEST', 'Field', 'measure_distances']
