# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The devices of this machine that can compute the picture, as a list of choices. Does not use Blender.

A choice is the text that the compiled module takes as its backend: `auto`, `cpu`, or `vulkan-rt:NAME OF THE DEVICE`. It has the name
and not the number, because numbers change with what is plugged in. Only devices with equal names are told apart by their numbers.
"""

import collections
import functools

AUTOMATIC = ("auto", "Automatic", "The best graphics processor, and the processor where there is none or where it fails")

KINDS = {
    "vulkan-rt": "ray tracing pipeline",
    "vulkan-query": "ray queries",
    "vulkan-compute": "no ray tracing hardware needed",
}


def choices(devices, kept="auto"):
    """(backend, name, description) of each choice, the automatic one first. `devices` as from `pumice.devices()`; a choice that was
    `kept` from before and no longer exists stays in the list, so that the user sees it and can change it."""
    usable = [d for d in devices if d["usable"]]
    numbers = collections.defaultdict(set)
    for device in usable:
        numbers[device["device"].lower()].add(device.get("number"))
    found = [AUTOMATIC]
    for device in usable:
        if device["backend"] == "cpu":
            found.append(("cpu", f"Processor: {device['device']}", sentence(device["reason"])))
            continue
        same = len(numbers[device["device"].lower()]) > 1
        which = device["number"] if same else device["device"]
        name = f"{device['device']}: {device['backend']}"
        kind = KINDS.get(device["backend"], device["backend"])
        found.append((f"{device['backend']}:{which}", name, sentence(f"{kind}; {device['reason']}")))
    if kept not in [choice[0] for choice in found]:
        found.append((kept, f"{kept} (not here)", "It was chosen before, and this machine does not have it"))
    return found


def sentence(text):
    """The text with a capital first letter and without a full stop, as Blender's descriptions."""
    return text[:1].upper() + text[1:]


def short(device):
    """A device's name without the parts in brackets, in which drivers put versions and processor types."""
    return device.split(" (")[0].strip() or device


@functools.cache
def listed(pumice):
    """`pumice.devices()`, called only once, because it loads every graphics driver of the machine."""
    return tuple(pumice.devices())
