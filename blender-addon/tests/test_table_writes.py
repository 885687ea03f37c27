# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that a live view which reads only what the extension wrote into a label table sees what a whole reading sees, and that it reads all
soon after, so that it finds what others wrote."""

import time

import numpy as np
import pytest

from stand_ins import Engine
from test_real_volumes import imported, load, settle, viewport_of

LABELS = 300


@pytest.fixture
def volume(blender, tmp_path):
    import pumice

    ids = np.zeros(8 * 8 * 8, dtype=np.uint64)
    ids[:LABELS] = np.arange(1, LABELS + 1) * 7
    pumice.compress(ids.reshape(8, 8, 8)).save(tmp_path / "many.pumice")
    obj = imported(blender, tmp_path / "many.pumice")
    blender.context.view_layer.objects.active = obj
    for name in ("ghost", "metal"):
        obj.data.materials.append(blender.data.materials.new(name))
    return obj


def columns(styles, blender, obj):
    style, _ = styles.read(obj.evaluated_get(blender.context.evaluated_depsgraph_get()))
    return style.columns


def equal(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("ids", "visible", "group", "color"))


def test_what_follows_writes_sees_what_a_whole_reading_sees(blender, extension, volume):
    """Random writes, up to more than are remembered between two readings, in three views that read at different times."""
    instances, label_table = load(extension, "sync.instances"), load(extension, "label_table")
    views = [instances.Styles(follows_writes=True) for _ in range(3)]
    rng, table, short = np.random.default_rng(5), volume.pumice.table, 0
    for styles in views:
        columns(styles, blender, volume)
    for round_ in range(120):
        for _ in range(rng.integers(0, 25 if round_ % 10 == 0 else 4)):
            kind, rows = rng.integers(4), np.flatnonzero(rng.random(LABELS) < rng.choice([0.01, 0.9]))
            if kind == 0:
                label_table.set_visible(table, rng.random(LABELS) < 0.5)
            elif kind == 1:
                label_table.set_slots(table, rows, int(rng.integers(5)))  # past the last too
            else:
                label_table.set_color(table, rows, rng.random(3) * (2.0 if kind == 3 else 1.0))
        for styles in views[: 1 + round_ % 3]:
            styles.owes_reading = False
            former = styles._kept[volume.session_uid].columns
            found = columns(styles, blender, volume)
            whole = columns(instances.Styles(), blender, volume)
            assert equal(found, whole), round_
            # What differs is known without a comparison, and is what a comparison finds.
            rows = found.recolored(former)
            if rows is not None:
                assert rows.tolist() == np.flatnonzero((whole.color != former.color).any(axis=1)).tolist()
            short += styles.owes_reading
    assert short > 50, "most readings took what was written alone"


def test_what_others_wrote_is_found_by_the_next_reading(blender, extension, volume):
    instances, label_table = load(extension, "sync.instances"), load(extension, "label_table")
    styles, table = instances.Styles(follows_writes=True), volume.pumice.table
    columns(styles, blender, volume)
    table.attributes["color"].data[7].color = (0.5, 0.25, 0.125, 1.0)
    label_table.set_color(table, [3], (0.0, 0.0, 1.0))
    # A control: the reading that follows the own write alone does not see the other one, and says that it owes a reading.
    found = columns(styles, blender, volume)
    assert styles.owes_reading and found.color[3].tolist() == [0.0, 0.0, 1.0, 1.0] and found.color[7].tolist() != [0.5, 0.25, 0.125, 1.0]
    styles.owes_reading = False
    assert equal(columns(styles, blender, volume), columns(instances.Styles(), blender, volume)) and not styles.owes_reading
    # Renders and exports never follow writes.
    label_table.set_color(table, [4], (0.0, 1.0, 0.0))
    plain = instances.Styles()
    assert equal(columns(plain, blender, volume), columns(instances.Styles(), blender, volume)) and not plain.owes_reading


def test_another_table_or_number_of_groups_is_read_whole(blender, extension, volume):
    instances, label_table = load(extension, "sync.instances"), load(extension, "label_table")
    styles = instances.Styles(follows_writes=True)
    columns(styles, blender, volume)
    volume.pumice.table = volume.pumice.table.copy()
    volume.pumice.table.attributes["visible"].data[2].value = False
    label_table.set_color(volume.pumice.table, [3], (0.0, 0.0, 1.0))
    assert not columns(styles, blender, volume).visible[2] and not styles.owes_reading
    label_table.set_slots(volume.pumice.table, [1], 2)
    columns(styles, blender, volume)
    volume.data.materials.pop(index=2)
    label_table.set_color(volume.pumice.table, [3], (0.0, 1.0, 1.0))
    assert columns(styles, blender, volume).group[1] == 1


def test_a_viewport_reads_all_half_a_second_after_an_edit(blender, extension, volume, monkeypatch):
    blender.context.scene.pumice.viewport_samples, blender.context.scene.pumice.backend = 1, "CPU"
    engine, label_table = Engine(), load(extension, "label_table")
    context, view = viewport_of(blender, extension, monkeypatch, engine)
    settle(blender, view, context)
    table, now = volume.pumice.table, [time.monotonic()]
    monkeypatch.setattr(load(extension, "viewport").time, "monotonic", lambda: now[0])
    drawn = lambda: next(iter(view.sent.placed.values())).style.columns  # noqa: E731

    def sync():
        view.sync(context, blender.context.evaluated_depsgraph_get())

    table.attributes["visible"].data[9].value = False
    label_table.set_color(table, [3], (0.0, 0.0, 1.0))
    sync()
    assert drawn().color[3].tolist() == [0.0, 0.0, 1.0, 1.0] and drawn().visible[9]
    updates = engine.updates
    view.poll()
    assert engine.updates == updates
    now[0] += 0.6
    assert view.poll() is not None and engine.updates == updates + 1
    sync()
    assert not drawn().visible[9]
    now[0] += 0.6
    view.poll()
    assert engine.updates == updates + 1
