# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: expand, load into MuJoCo and Pinocchio, publish."""
