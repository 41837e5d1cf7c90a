# SPDX-License-Identifier: Apache-2.0
"""What a robot is by its links, its joints and their names: legs, wheels, casters, kinds."""
