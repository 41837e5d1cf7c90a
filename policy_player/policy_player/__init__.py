# SPDX-License-Identifier: Apache-2.0
"""A neural network as the controller: what its files say, what it sees, what it commands."""
