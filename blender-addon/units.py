# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Length units of volumes. Does not use Blender."""

METERS = {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "m": 1.0}


def ratio(unit, other):
    """Number of `other` in one `unit`; 1 where either is not known, as if they were the same."""
    if unit == other or unit not in METERS or other not in METERS:
        return 1.0
    return METERS[unit] / METERS[other]


def differ_unknown(given):
    """Whether some of these units are known and some are not, so that the lengths cannot be compared."""
    known = [unit in METERS for unit in given]
    return any(known) and not all(known)
