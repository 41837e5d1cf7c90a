# SPDX-License-Identifier: Apache-2.0
"""The cockpit in the browser: it shows a run and takes orders from its driver."""
