# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that random use breaks nothing: rounds of actions of `abuse_driver`, undo among them, with two viewports that follow and with F12.

    viewport      the picture of a viewport that followed every action equals that of one that reads the scene afresh, to the last bit
    F12           its picture equals that of `pumice render` of the exported scene, in a process of its own, to the last bit. A volume
                  whose file another object reloaded may be refused, by name
    console       no traceback, no panic; a refusal is one line
    memory        after 100 rounds within 5 % of that after 20

A failure names the seed, the round and the actions before it: the seed repeats it.
"""

import ctypes
import gc
import os
import subprocess
import sys

import numpy as np
import pumice
import pytest
from mathutils import Matrix

from abuse_actions import SAMPLES, make_quick
from abuse_driver import User
from pick_scene import SIZE, made, passes
from stand_ins import Context, Engine
from test_real_volumes import exr, load, replace_drawing, settle

# What must not be in the console: of Python, of Rust, of this project's own report of a defect.
DEFECTS = ("Traceback", "panicked", "has a defect")


class Watched:
    """A viewport that is told of every update of the scene, as Blender tells it. It looks through the camera, or from beside it."""

    def __init__(self, bpy, extension, number):
        self.bpy, self.viewport, self.number = bpy, load(extension, "viewport"), number
        self.engine, self.context = Engine(1000 + number), Context(bpy, SIZE)

    @property
    def view(self):
        """The viewport; a new one where Blender has opened another file."""
        return self.viewport.of(self.engine)

    def follow(self, depsgraph):
        """Looks as the camera of the scene does now."""
        camera = depsgraph.scene.camera
        view = self.context.region_data
        view.view_matrix = camera.matrix_world.normalized().inverted()
        view.window_matrix = camera.calc_matrix_camera(depsgraph, x=SIZE[0], y=SIZE[1])
        # The second viewport sees the scene turned about its vertical axis.
        view.view_matrix = view.view_matrix @ Matrix.Rotation(0.7 * self.number, 4, "Z")
        self.context.space_data.camera = camera

    def update(self, depsgraph):
        self.follow(depsgraph)
        self.view.sync(self.context, depsgraph)

    def picture(self, view=None):
        """The finished picture of this viewport, or of another one that looks as it does; and its lines about the scene."""
        self.follow(self.bpy.context.evaluated_depsgraph_get())
        view = view or self.view
        pixels = np.array(np.asarray(settle(self.bpy, view, self.context)), dtype=np.float32)
        return pixels, view.notes

    def afresh(self):
        """The picture of a viewport that has just been opened."""
        view = self.viewport.of(Engine(2000 + self.number))
        try:
            return self.picture(view)
        finally:
            view.close()


class Abuse:
    """A user who acts, two viewports that follow, and the checks."""

    def __init__(self, bpy, extension, folder, seed, command, capfd):
        self.bpy, self.folder, self.seed, self.command, self.capfd = bpy, folder, seed, command, capfd
        made(bpy, folder)
        make_quick(bpy)
        self.user = User(bpy, folder, seed)
        self.user.push("made")
        self.watched = [Watched(bpy, extension, number) for number in range(2)]
        self.done = []

    def round(self):
        """One action, which the viewports follow."""
        handlers = self.bpy.app.handlers

        @handlers.persistent
        def on_update(_scene, depsgraph):
            for watched in self.watched:
                watched.update(depsgraph)

        handlers.depsgraph_update_post.append(on_update)
        try:
            name, refusal = self.user.act()
        finally:
            handlers.depsgraph_update_post.remove(on_update)
        self.done.append(name + (" (refused)" if refusal else ""))
        assert refusal is None or (len(refusal.splitlines()) == 1 and "defect" not in refusal), self.said(refusal)
        console = "".join(self.capfd.readouterr())
        assert not any(word in console for word in DEFECTS), self.said(console)

    def said(self, what):
        """A line that tells how to repeat what failed."""
        return f"seed {self.seed}, round {len(self.done)}: {what}\n" + "\n".join(self.done[-12:])

    def check_viewports(self):
        for watched in self.watched:
            (live, notes), (fresh, fresh_notes) = watched.picture(), watched.afresh()
            differ = int((live.view(np.uint32) != fresh.view(np.uint32)).any(axis=-1).sum())
            assert differ == 0, self.said(f"viewport {watched.number}: {differ} pixels differ from those of a new viewport")
            assert notes == fresh_notes, self.said(f"viewport {watched.number}: says {notes}, a new one {fresh_notes}")

    def has_changed_volume(self):
        """Whether the file of a volume is another one than that of its label table."""
        return any(pumice.open(self.bpy.path.abspath(o.pumice.filepath)).content_hash != o.pumice.content_hash for o in self.user.volumes())

    def check_f12(self):
        refusal = None
        try:
            passes(self.bpy, self.folder)
        except RuntimeError as error:  # refused, for a volume that has changed since it was imported
            refusal = str(error)
        path = self.folder / "scene.json"
        assert self.bpy.ops.pumice.export_scene(filepath=str(path)) == {"FINISHED"}
        command = [self.command, "render", path.name, "-o", "fresh.exr", "--spp", str(SAMPLES), "--backend", "cpu", "--passes", "label"]
        ended = subprocess.run(command, cwd=self.folder, capture_output=True, text=True)
        if refusal is not None:
            assert "press Reload" in refusal and self.has_changed_volume(), self.said(refusal)
            return
        assert ended.returncode == 0, self.said(f"a new process: {ended.stderr}")
        ours = exr(self.folder / "picture.exr")
        theirs = exr(self.folder / "fresh.exr")
        for channel in "RGB":
            expected = next(theirs[name] for name in theirs if name.endswith(f".{channel}") and "abel" not in name)
            differ = (ours[f"Combined.{channel}"].view(np.uint32) != expected.view(np.uint32)).sum()
            assert differ == 0, self.said(f"F12: {differ} values of {channel} differ from those of a new process")


@pytest.fixture
def abuse(blender, extension, tmp_path, monkeypatch, pumice_command, capfd):
    """A function that makes an `Abuse` of a seed."""
    replace_drawing(extension, monkeypatch)
    load(extension, "registry")._entries.clear()
    return lambda seed: Abuse(blender, extension, tmp_path, seed, pumice_command, capfd)


def run(abused, rounds, viewports_every, f12_every, after=None):
    for number in range(1, rounds + 1):
        abused.round()
        if number % viewports_every == 0:
            abused.check_viewports()
        if number % f12_every == 0:
            abused.check_f12()
        if after is not None:
            after(number)


def resident_bytes():
    """Memory of this process after everything that is free has gone back to the system."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def leaks(after_20, after_100):
    """Whether memory grew by more than 5 %, which the user's scene may grow by: a few more volumes, undo steps up to Blender's 32."""
    return after_100 > 1.05 * after_20


def test_random_use_leaves_the_pictures_of_a_fresh_reading(abuse):
    run(abuse(11), 24, viewports_every=3, f12_every=8)


def test_an_edit_that_is_not_sent_is_noticed(abuse, monkeypatch):
    """Negative control of the viewports' comparison."""
    abused = abuse(1)
    abused.check_viewports()
    with monkeypatch.context() as broken:
        broken.setattr(abused.watched[0].view, "_send", lambda *_: None)
        abused.bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value *= 1.25
        with pytest.raises(AssertionError, match="seed 1, round 0: viewport 0: .* pixels differ"):
            abused.check_viewports()
    abused.check_viewports()


def test_another_picture_of_f12_is_noticed(abuse, monkeypatch):
    """Negative control of the comparison with a new process."""
    abused = abuse(1)
    abused.check_f12()

    def passes_and_edit(bpy, folder, draw=passes):
        draw(bpy, folder)
        bpy.context.scene.pumice.seed += 1

    monkeypatch.setattr(sys.modules[__name__], "passes", passes_and_edit)
    with pytest.raises(AssertionError, match="F12: .* values of R differ"):
        abused.check_f12()


@pytest.mark.parametrize("said", ["Traceback (most recent call last):", "thread 'worker' panicked at", None])
def test_a_defect_in_the_console_or_in_a_report_is_noticed(abuse, monkeypatch, said):
    """Negative control of the watch on the console."""
    abused = abuse(1)
    report = None if said else "Error: Pumice has a defect: KeyError"
    monkeypatch.setattr(abused.user, "act", lambda: (os.write(2, f"{said}\n".encode()) and "act", report))
    with pytest.raises(AssertionError, match="seed 1, round 1"):
        abused.round()


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hundred_rounds_of_random_use_break_nothing_and_keep_no_memory(blender, abuse, seed):
    # What is loaded once, such as code and Blender's caches, comes first: 50 MB in the first 50 rounds of a process. In the 500 rounds
    # after the first 100, memory grows by 2 %.
    run(abuse(0), 60, viewports_every=5, f12_every=15)
    blender.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    measured, abused = {}, abuse(seed)

    def after(number):
        if number in (20, 100):
            measured[number] = resident_bytes()

    run(abused, 100, viewports_every=3, f12_every=10, after=after)
    print(f"seed {seed}: {measured[20] / 1e6:.1f} MB after 20 rounds, {measured[100] / 1e6:.1f} MB after 100")
    assert not leaks(measured[20], measured[100]), measured
    # Negative control: a leak of one megabyte for each of 80 rounds is noticed.
    kept = [bytearray(b"x" * 1_000_000) for _ in range(80)]
    assert leaks(measured[20], resident_bytes()) and len(kept) == 80
