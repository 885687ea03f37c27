# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the choice of a device: the list of choices, the preference that stores one, the text about it."""

import importlib
import types

import bpy
import pytest


def load(extension, name):
    return importlib.import_module(f"{extension.__name__}.{name}")


def card(number, name, backend="vulkan-rt", usable=True):
    reason = "auto takes another first" if usable else "lacks VK_KHR_ray_query"
    return dict(backend=backend, device=name, number=number, kind="discrete", usable=usable, chosen=False, reason=reason)


CPU = dict(backend="cpu", device="Xeon on 8 threads", kind="cpu", usable=True, chosen=True, reason="runs everywhere")


def test_choices_name_devices_and_number_those_of_one_name(extension):
    choices = load(extension, "devices").choices
    listed = [card(0, "Radeon"), card(1, "radeon"), card(2, "GeForce"), card(2, "GeForce", "vulkan-query", usable=False), CPU]
    found = choices(listed)
    assert [c[0] for c in found] == ["auto", "vulkan-rt:0", "vulkan-rt:1", "vulkan-rt:GeForce", "cpu"]
    assert found[3][1] == "GeForce: vulkan-rt" and "auto takes another first" in found[3][2]
    # Two backends of one device do not count as two devices with one name.
    both = choices([card(0, "Radeon"), card(0, "Radeon", "vulkan-compute"), CPU])
    assert [c[0] for c in both] == ["auto", "vulkan-rt:Radeon", "vulkan-compute:Radeon", "cpu"]
    assert [c[0] for c in choices([])] == ["auto"]


def test_a_choice_that_is_gone_stays_visible(extension):
    choices = load(extension, "devices").choices
    assert choices([CPU], kept="vulkan-rt:Radeon")[-1][:2] == ("vulkan-rt:Radeon", "vulkan-rt:Radeon (not here)")
    assert len(choices([CPU], kept="cpu")) == 2


def test_the_line_names_backend_and_device_and_what_was_overcome(extension):
    overlay = load(extension, "overlay")
    frame = types.SimpleNamespace(spp=3, error_estimate=0.021, seconds=3.4, filtered=False)
    fields = dict(state="rendering", error=None, revision=1, compiling=None, notices=[])
    gpu = types.SimpleNamespace(backend="vulkan-rt", device="Radeon (RADV NAVI31)", **fields)
    assert overlay.line(gpu, frame, []) == "vulkan-rt on Radeon · 3 samples · error 2.1 % · 3.4 s"
    cpu = types.SimpleNamespace(backend="cpu", device="Xeon on 8 threads", **fields)
    assert overlay.line(cpu, frame, []) == "cpu · 3 samples · error 2.1 % · 3.4 s"
    cpu.compiling = "vulkan-rt"
    assert overlay.line(cpu, frame, []).startswith("cpu until vulkan-rt is compiled · 3 samples · ")
    cpu.notices = ["older", "vulkan-rt on Radeon: out of GPU memory; going on with cpu"]
    assert overlay.line(cpu, frame, ["a note"]).endswith("3.4 s · a note · " + cpu.notices[1])


@pytest.fixture
def preferences(blender, extension):
    """The extension's preferences with their defaults; restores them after the test."""
    import addon_utils

    addon_utils.enable(extension.__name__, default_set=True, persistent=True)
    kept = bpy.context.preferences.addons[extension.__name__].preferences
    former = kept.backend
    yield kept
    kept.backend = former


def test_the_preference_is_what_automatic_means(extension, preferences):
    backend = load(extension, "preferences").backend
    wishes = bpy.context.scene.pumice
    assert (preferences.device, backend(wishes)) == ("auto", "auto")
    names = [c[0] for c in load(extension, "preferences")._choices(preferences)]
    # `cargo xtask test` provides a Vulkan device.
    chosen = next(n for n in names if n.startswith("vulkan-compute:"))
    preferences.device = chosen
    assert (preferences.backend, preferences.device, backend(wishes)) == (chosen, chosen, chosen)
    wishes.backend = "CPU"
    assert backend(wishes) == "cpu"
    wishes.backend = "AUTO"
    preferences.backend = "vulkan-rt:a card that was sold"
    assert preferences.device == "vulkan-rt:a card that was sold"
    preferences.device = "auto"
    assert backend(wishes) == "auto"
    with pytest.raises(TypeError):
        preferences.device = "abacus"


def test_a_changed_preference_reaches_the_viewports(extension, preferences):
    told = []
    changed = load(extension, "preferences").changed
    changed.append(lambda: told.append(preferences.backend))
    try:
        preferences.device = "cpu"
    finally:
        changed.pop()
    assert told == ["cpu"]
    assert load(extension, "viewport").redraw_all in changed
