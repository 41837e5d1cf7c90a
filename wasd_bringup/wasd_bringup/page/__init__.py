# SPDX-License-Identifier: Apache-2.0
"""What the cockpit has to know of a robot, whatever it walks or rolls on."""
