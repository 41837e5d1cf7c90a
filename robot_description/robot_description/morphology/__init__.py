# SPDX-License-Identifier: Apache-2.0
"""What names of joints and links say: sides, and which of several names was meant."""
