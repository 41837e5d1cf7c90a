# SPDX-License-Identifier: Apache-2.0
"""Where the base is, which feet touch, the plane on which they stand, their grip and a load."""
