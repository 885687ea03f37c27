# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests Vulkan inside Blender's process, on the device that `cargo xtask test` provides: F12 and a live viewport give the same bits as the
command with the same backend and the exported scene, and errors are one line. The backend changes daily."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pumice
import pytest

from stand_ins import Engine
from test_devices import preferences  # noqa: F401  (a fixture)
from test_real_volumes import SIZE, SPP, exr, load, scene, settle, viewport_of  # noqa: F401  (scene is a fixture)

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/python"))
from share import one_of_today  # noqa: E402

BACKENDS = one_of_today(["vulkan-query", "vulkan-compute"])


@pytest.fixture
def choose(scene, extension, preferences):  # noqa: F811
    """A function that chooses a backend as a user does, in the preferences, while the scene's device is automatic."""

    def choose(backend):
        names = [c[0] for c in load(extension, "preferences")._choices(preferences)]
        scene.pumice.backend = "AUTO"
        preferences.device = next(n for n in names if n.split(":")[0] == backend)

    return choose


def colors(path):
    channels = exr(path)
    return np.stack([next(v for k, v in channels.items() if k.endswith(f".{c}")) for c in "RGB"], axis=2)


@pytest.mark.parametrize("backend", BACKENDS)
def test_f12_and_the_command_draw_the_same_bits(scene, blender, extension, preferences, choose, pumice_command, tmp_path, backend):  # noqa: F811
    choose(backend)
    scene.render.filepath = str(tmp_path / "blender.exr")
    blender.ops.render.render(write_still=True)
    assert blender.ops.pumice.export_scene(filepath=str(tmp_path / "scene.json")) == {"FINISHED"}
    report = tmp_path / "report.json"
    command = [pumice_command, "render", "scene.json", "-o", "command.exr", "--spp", str(SPP), "--backend", backend]
    command += ["--passes", "none", "--json", report]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    figures = json.loads(report.read_text())
    assert (figures["backend"], figures["notices"]) == (backend, [])
    ours, theirs = colors(tmp_path / "blender.exr"), colors(tmp_path / "command.exr")
    assert ours.shape == (*SIZE[::-1], 3) and np.ptp(ours) > 0.1
    assert np.array_equal(ours.view(np.uint32), theirs.view(np.uint32))
    # Within a limit of memory the pages of the volume are on the device, and the bits are the same.
    preferences.memory_limit = 512
    blender.ops.render.render(write_still=True)
    assert np.array_equal(colors(tmp_path / "blender.exr").view(np.uint32), theirs.view(np.uint32))
    loads = load(extension, "registry").page_memory().figures.loads
    preferences.memory_limit = 0
    assert loads > 0
    # Negative control: another seed gives another picture.
    scene.pumice.seed = 8
    blender.ops.render.render(write_still=True)
    assert not np.array_equal(colors(tmp_path / "blender.exr"), theirs)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_viewport_draws_the_bits_of_a_render(scene, blender, extension, choose, monkeypatch, backend):  # noqa: F811
    choose(backend)
    scene.pumice.viewport_samples = SPP
    engine = Engine()
    context, view = viewport_of(blender, extension, monkeypatch, engine)
    frame = settle(blender, view, context)
    view.draw(context, blender.context.evaluated_depsgraph_get())
    device = view.session.status.device.split(" (")[0]
    assert engine.line.startswith(f"{backend} on {device} · {SPP} samples"), engine.line
    live = np.array(np.asarray(frame)[::-1, :, :3])
    volume = pumice.open(blender.context.object.pumice.filepath)
    same = pumice.render(view.session.scene, [volume], spp=SPP, backend=backend)
    assert np.array_equal(live.view(np.uint32), same.color.view(np.uint32))
    # The picture follows changes of the scene and of the device.
    background = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    background.default_value = 2.0
    brighter = np.asarray(settle(blender, view, context))[::-1, :, :3]
    assert brighter.mean() > 1.2 * live.mean()
    session = view.session
    scene.pumice.backend = "CPU"
    settle(blender, view, context)
    view.draw(context, blender.context.evaluated_depsgraph_get())
    assert view.session is not session and engine.line.startswith("cpu · ")


def test_a_device_that_is_gone_is_one_line(scene, blender, extension, preferences, monkeypatch, tmp_path):  # noqa: F811
    scene.pumice.backend = "AUTO"
    preferences.backend = "vulkan-rt:a card that was sold"
    engine = Engine()
    context, view = viewport_of(blender, extension, monkeypatch, engine)
    for entry in [*view.waiting.values()]:
        assert entry.done.wait(60)
    view.sync(context, blender.context.evaluated_depsgraph_get())
    view.draw(context, blender.context.evaluated_depsgraph_get())
    assert "backend vulkan-rt:a card that was sold: no such device" in engine.line and "\n" not in engine.line
    scene.render.filepath = str(tmp_path / "a.exr")
    with pytest.raises(RuntimeError, match="no such device") as raised:
        blender.ops.render.render(write_still=True)
    assert "defect" not in str(raised.value)
