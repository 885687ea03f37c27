# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests what F12 shows while it renders, what ESC leaves, and the status line, with a mock of the compiled module."""

import time
import types

import numpy as np
import pytest

from test_final_render import channels, render, stage  # noqa: F401 (the fixture)

SIZE = (12, 8)


class Engine:
    """Forwards to a real engine; `breaks` says whether the user has pressed ESC."""

    def __init__(self, engine, breaks):
        self._engine, self._breaks = engine, breaks

    def __getattr__(self, name):
        return getattr(self._engine, name)

    def test_break(self):
        return self._breaks()


@pytest.fixture
def escape(stage, monkeypatch):  # noqa: F811
    """Calls `when()` at each look for ESC during F12."""
    final_render = stage.load("final_render")
    original, when = final_render.render, [lambda: False]
    monkeypatch.setattr(final_render, "render", lambda engine, graph: original(Engine(engine, lambda: when[0]()), graph))
    return lambda call: when.__setitem__(0, call)


@pytest.fixture
def fills(stage, monkeypatch):  # noqa: F811
    """(pass, pixels from the bottom) of each copy to Blender, in order."""
    result, done = stage.load("render_result"), []
    original = result._fill

    def fill(layer, name, pixels):
        original(layer, name, pixels)
        done.append((name, stage.seen[name].copy()))

    monkeypatch.setattr(result, "_fill", fill)
    return done


def wait(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def test_the_picture_grows_coarse_first_and_the_end_is_the_whole_picture(stage, fills, monkeypatch, tmp_path):  # noqa: F811
    monkeypatch.setattr(stage.load("final_render"), "is_watched", lambda: True)
    stage.bpy.context.view_layer.use_pass_z = True
    coarse = np.arange(24.0).reshape(2, 3, 4)
    full = np.arange(384.0).reshape(8, 12, 4)

    def during(_job, _on_progress):
        renderer = stage.module.renderers[-1]
        for serial, (pixels, is_coarse) in enumerate([(coarse, True), (full, False)], start=1):
            renderer.show(serial, pixels, is_coarse)
            wait(lambda: len(fills) >= serial)

    stage.module.during_render = during
    assert render(stage) == {"FINISHED"}
    assert stage.module.renderers[-1].growing is True
    assert [name for name, _ in fills] == ["Combined", "Combined", "Combined", "Depth"]
    # Rows from the bottom in frames and in Blender: the coarse frame's lowest row fills the lowest four.
    shown = fills[0][1]
    assert np.array_equal(shown, np.kron(coarse, np.ones((4, 4, 1)))), "each pixel of a coarse frame is a square"
    assert np.array_equal(fills[1][1], full)
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    written = channels(tmp_path / "out.exr")
    assert np.array_equal(written["Combined.G"], at * 2) and np.array_equal(written["Depth.Z"].ravel()[1:], at.ravel()[1:] + 0.5)


def so_far(plus):
    """A picture so far, whose pixels and passes count from `plus`."""
    at = np.arange(96, dtype=np.float32).reshape(8, 12) + np.float32(plus)
    found = {"depth": at, "label": at.astype(np.uint32), "normal": np.stack([at, at, at], axis=2)}
    return types.SimpleNamespace(color=np.stack([at, at, at], axis=2), alpha=None, passes=found)


def in_blender(engine, layer):
    """What Blender's own result has of each pass now, from the bottom."""
    found = {}
    for one in engine.get_result().layers[layer].passes:
        flat = np.empty(len(one.rect) * one.channels, dtype=np.float32)
        one.rect.foreach_get(flat)
        found[one.name] = flat.reshape(8, 12, one.channels)
    return found


def test_other_passes_appear_while_the_picture_grows_and_frames_keep_them(stage, monkeypatch, tmp_path):  # noqa: F811
    """Blender's result is read by the render's own thread after each step, long before the end."""
    monkeypatch.setattr(stage.load("final_render"), "is_watched", lambda: True)
    layer = stage.bpy.context.view_layer
    layer.use_pass_z, layer.use_pass_normal, layer.pumice.use_pass_label = True, True, True
    growing, work = stage.load("render_result").Growing, stage.load("render_work").Work
    # Without a rest, since the test is over in a moment.
    monkeypatch.setattr(growing, "RESTS_AFTER_FRAME", 0.0)
    monkeypatch.setattr(growing, "RESTS_AFTER_PASSES", 0.0)
    seen, engines, original, watch = [], [], growing.look, work.watch
    monkeypatch.setattr(work, "watch", lambda self, engine, shown: (engines.append(engine), watch(self, engine, shown))[1])

    def look(self, renderer):
        before = (renderer.so_far is not None, renderer.frame.serial if renderer.frame else 0)
        original(self, renderer)
        seen.append((before, in_blender(engines[0], layer.name) if not self.is_empty else None))

    monkeypatch.setattr(growing, "look", look)

    def during(_job, _on_progress):
        renderer = stage.module.renderers[-1]
        step = lambda of: wait(lambda: any(before == of and found for before, found in seen))  # noqa: E731
        renderer.show(1, np.full((8, 12, 4), 3.0))
        step((False, 1))
        renderer.so_far = so_far(100)
        step((True, 1))
        renderer.show(2, np.full((8, 12, 4), 5.0))
        step((False, 2))

    stage.module.during_render = during
    assert render(stage) == {"FINISHED"}
    assert stage.module.renderers[-1].growing_passes is True
    of = lambda step: next(found for before, found in seen if before == step and found)  # noqa: E731
    at = np.arange(96, dtype=np.float32).reshape(8, 12)[::-1, :, None] + np.float32(100)
    first, second, third = of((False, 1)), of((True, 1)), of((False, 2))
    assert (first["Combined"] == 3.0).all() and not first["Label"].any() and (first["Depth"] >= 1e10).all(), "control: nothing of them yet"
    for found in (second, third):
        assert np.array_equal(found["Depth"], at) and np.array_equal(found["Label"], at) and np.array_equal(found["Normal"][..., 1:2], at)
    assert np.array_equal(second["Combined"][..., :1], at) and (second["Combined"][..., 3] == 1.0).all()
    assert (third["Combined"] == 5.0).all()
    # The end is the whole picture, as if nothing had been shown.
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    written = channels(tmp_path / "out.exr")
    assert np.array_equal(written["Combined.G"], at * 2) and np.array_equal(written["Depth.Z"].ravel()[1:], at.ravel()[1:] + 0.5)


@pytest.mark.parametrize("rests", [True, False])
def test_showing_passes_waits_so_that_it_takes_a_fiftieth_of_the_time(stage, monkeypatch, rests):  # noqa: F811
    """With a clock of the test: each pass takes a quarter of a second, and so does each look. The control does not wait."""
    result, clock, fills = stage.load("render_result"), [1000.0], []
    monkeypatch.setattr(result, "time", types.SimpleNamespace(monotonic=lambda: clock[0]))

    def slow(_layer, name, _pixels):
        clock[0] += 0.25
        fills.append(name)

    monkeypatch.setattr(result, "_fill", slow)
    stage.bpy.context.view_layer.use_pass_z = True
    begun = types.SimpleNamespace(layers=[types.SimpleNamespace(passes={"Depth": None})])
    engine = types.SimpleNamespace(begin_result=lambda *_, **__: begun, end_result=lambda _: None)
    growing, renderer = result.Growing(engine, stage.bpy.context.view_layer, SIZE), stage.module.Renderer()
    if not rests:
        monkeypatch.setattr(growing, "RESTS_AFTER_FRAME", 0.0)
        monkeypatch.setattr(growing, "RESTS_AFTER_PASSES", 0.0)
    for step in range(2000):
        renderer.so_far = so_far(step)
        renderer.show(step + 1, np.zeros((8, 12, 4)))
        growing.look(renderer)
        assert fills[:2] == ["Combined", "Depth"], "the first comes at once"
        clock[0] += 0.25
    share = 0.25 * fills.count("Depth") / (clock[0] - 1000.0)
    # What is begun in the time counts whole, so a little more than a fiftieth is possible.
    assert 0.01 < share < 0.022 if rests else share > 0.2, share


def test_nothing_is_shown_where_nobody_looks(stage, fills):  # noqa: F811
    assert render(stage) == {"FINISHED"}
    assert stage.module.renderers[-1].growing is False, "Blender has no window here"
    assert [name for name, _ in fills] == ["Combined"]


def until_cancelled(job, _on_progress):
    wait(lambda: job.cancelled)


def test_escape_keeps_the_picture_so_far_with_all_its_passes(stage, escape, tmp_path):  # noqa: F811
    stage.bpy.context.view_layer.use_pass_z = True
    stage.module.during_render = until_cancelled
    looks = []
    escape(lambda: bool(looks.append(1)) or len(looks) > 4)
    assert render(stage) == {"FINISHED"}
    at = np.arange(96, dtype=np.float32).reshape(8, 12)
    written = channels(tmp_path / "out.exr")
    assert np.array_equal(written["Combined.G"], at * 2) and np.array_equal(written["Depth.Z"].ravel()[1:], at.ravel()[1:] + 0.5)


def test_escape_before_the_first_sample_leaves_an_empty_picture(stage, escape, fills):  # noqa: F811
    stage.module.during_render, stage.module.has_samples = until_cancelled, False
    looks = []
    escape(lambda: bool(looks.append(1)) or len(looks) > 4)
    assert render(stage) == {"FINISHED"}
    assert fills == []
    # And while the volume is opened nothing is rendered at all.
    escape(lambda: True)
    count = len(stage.module.renders)
    assert render(stage) == {"FINISHED"} and len(stage.module.renders) == count


def test_a_frame_that_cannot_be_shown_ends_the_render(stage, monkeypatch):  # noqa: F811
    """A defect while a frame is copied must not leave a thread that renders for ever."""
    monkeypatch.setattr(stage.load("final_render"), "is_watched", lambda: True)

    def broken(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(stage.load("render_result").Growing, "show_frame", broken)
    cancelled = []

    def during(job, _on_progress):
        stage.module.renderers[-1].show(1, np.zeros((8, 12, 4)))
        wait(lambda: job.cancelled)
        cancelled.append(True)

    stage.module.during_render = during
    with pytest.raises(RuntimeError, match="Pumice has a defect: ZeroDivisionError"):
        render(stage)
    assert cancelled == [True]


def test_the_status_line_tells_samples_error_and_the_time_left(stage):  # noqa: F811
    work = stage.load("render_work")
    stop = {"spp": 128, "seconds": None, "error": 0.02}
    point = types.SimpleNamespace(spp=32, seconds=2.0, error_estimate=0.04)
    # A quarter of the samples are done. The error is twice its target, which is also a quarter of the work: three times 2 s are left.
    assert work.fraction(point, stop) == pytest.approx(0.25)
    assert work.progress_line(point, stop, 0.25) == "Remaining:00:06.00 · sample 32 of 128 · error 4 % · 2.0 s"
    timed = {"spp": 1000, "seconds": 2.5, "error": None}
    assert work.fraction(point, timed) == pytest.approx(0.8), "the time limit is nearest"
    unknown = types.SimpleNamespace(spp=0, seconds=0.1, error_estimate=None)
    assert work.progress_line(unknown, stop, 0.0) == "sample 0 of 128 · 0.1 s"
    assert [work.clock(s) for s in (0.004, 59.996, 75.5, 3600.0, 7384.25)] == [
        "00:00.00", "01:00.00", "01:15.50", "01:00:00.00", "02:03:04.25"
    ]  # fmt: skip


def test_progress_reaches_blender_while_the_thread_works(stage):  # noqa: F811
    point = types.SimpleNamespace(spp=32, seconds=2.0, error_estimate=0.04)
    told = []

    class Watching:
        def test_break(self):
            return len(told) >= 2

        def update_progress(self, fraction):
            told.append(fraction)

        def update_stats(self, _title, line):
            self.line = line

    def during(job, on_progress):
        on_progress(point)
        wait(lambda: job.cancelled)

    stage.module.during_render, stage.module.has_samples = during, False
    scene = stage.module.Scene({"film": {"width": 2, "height": 2}})
    limits = {"spp": 128, "seconds": None, "error": 0.02}
    renderer = stage.module.Renderer(backend="cpu")
    work = stage.load("render_work").Work(stage.module, renderer, scene, [], [], limits, growing=True)
    engine = Watching()
    assert work.watch(engine, stage.load("render_result").Growing(engine, None, (2, 2))) is None and work.job.cancelled and not work.thread.is_alive()
    assert told[-1] == pytest.approx(0.25) and engine.line.startswith("Remaining:00:06.00 · sample 32 of 128")
