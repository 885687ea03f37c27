# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the import of Neuroglancer's states: the scene that Blender exports is that of the command's figure of the same state, field by field, and
what is not taken over is said.
"""

import importlib
import json
import subprocess
import types
import urllib.parse
from pathlib import Path

import bpy
import numpy as np
import pumice
import pytest
from store_server import serving

from test_import_files import Layout

SIZE = (160, 90)
IDS = [11, 12, 13, 2**63 + 9]


@pytest.fixture
def stage(blender, extension, pumice_command, tmp_path):
    system, render = bpy.context.preferences.system, bpy.context.scene.render
    former, system.use_online_access = system.use_online_access, False
    labels = np.zeros((24, 20, 16), np.uint64)
    for number, label in enumerate(IDS):
        labels[6 * number : 6 * number + 3, 2 * number : 2 * number + 9, 3:12] = label
    matrix = np.array([[16, 0, 0, 1600], [0, 16, 0, 800], [0, 0, 40, 280], [0, 0, 0, 1]], float)
    pumice.compress(labels, axes="xyz", world_from_index=matrix, unit="nm").write(tmp_path / "cells", format="precomputed")
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    kept = Path(bpy.utils.extension_path_user(extension.__name__, path="volumes", create=True))
    before = set(kept.iterdir())
    yield types.SimpleNamespace(
        folder=tmp_path,
        command=pumice_command,
        system=system,
        labels=labels,
        load=lambda name: importlib.import_module(f"{extension.__name__}.{name}"),
        kept=lambda: sorted(set(kept.iterdir()) - before),
    )
    for path in set(kept.iterdir()) - before:
        path.unlink()
    system.use_online_access = former


def state(url="precomputed://cells", **changes):
    layer = {"type": "segmentation", "name": "cells", "source": url, "segments": [str(IDS[0]), str(IDS[1]), f"!{IDS[2]}", str(IDS[3])]}
    layer |= {"segmentColors": {str(IDS[1]): "#ff8000"}, "objectAlpha": 0.5}
    fields = {
        "dimensions": {"x": [16e-9, "m"], "y": [16e-9, "m"], "z": [40e-9, "m"]},
        "position": [112.5, 60.0, 14.0],
        "projectionScale": 60.0,
        "projectionOrientation": [-0.1, 0.62, 0.2, 0.75],
        "layers": [layer, {"type": "image", "name": "em", "source": "precomputed://gs://bucket/em"}],
        "layout": "3d",
    }
    return fields | changes


def written(stage, fields):
    path = stage.folder / "state.json"
    path.write_text(json.dumps(fields))
    return path


def of_command(stage, path):
    """The scene that the command draws of a state."""
    scene = stage.folder / "command.json"
    call = [stage.command, "render", path, "-o", stage.folder / "a.png", "--save-scene", scene, "--spp", "1", "--size", "x".join(map(str, SIZE))]
    done = subprocess.run(list(map(str, [*call, "--backend", "cpu"])), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(scene.read_text()), done.stderr


def of_blender(stage):
    """The scene that Blender exports."""
    assert bpy.ops.pumice.export_scene(filepath=str(stage.folder / "blender.json")) == {"FINISHED"}
    return json.loads((stage.folder / "blender.json").read_text())


def looks(instance):
    """{id: (color, fields of the material)} of the labels that an instance shows."""
    style = instance["style"]
    grouped = {label for group in style["groups"] for label in group["labels"]}
    show = {"except": []} if style["show"] == "all" else style["show"]
    shown = set(show["only"]) if "only" in show else grouped - set(show["except"])
    found = {}
    for group in style["groups"]:
        dress = {name: value for name, value in group["material"].items() if name != "base_color"}
        found |= {label: (color, dress) for label, color in zip(group["labels"], group["colors"]) if label in shown}
    assert set(found) == shown
    return found


def differences(ours, theirs):
    """Names of the fields in which two scenes differ by more than single precision, and which show."""
    wrong = []

    def compare(name, one, other, tolerance=1e-5):
        if not np.allclose(np.array(one, dtype=float), np.array(other, dtype=float), rtol=tolerance, atol=tolerance):
            wrong.append(f"{name}: {one} {other}")

    if len(ours["instances"]) != len(theirs["instances"]):
        return ["instances"]
    for one, other in zip(ours["instances"], theirs["instances"]):
        compare("world_from_index", one["world_from_index"], other["world_from_index"])
        mine, its = looks(one), looks(other)
        if set(mine) != set(its):
            wrong.append(f"shown: {sorted(mine)} {sorted(its)}")
            continue
        for label in mine:
            compare(f"color of {label}", mine[label][0], its[label][0])
            for field in set(mine[label][1]) & set(its[label][1]):
                compare(field, mine[label][1][field], its[label][1][field])
    camera, its = ours["camera"], theirs["camera"]
    compare("camera", camera["world_from_camera"], its["world_from_camera"])
    compare("shift", camera["shift"], its["shift"])
    if camera["fit"] != its["fit"] or set(camera["projection"]) != set(its["projection"]):
        wrong.append("projection")
    else:
        for kind, values in camera["projection"].items():
            for field in values:
                compare(field, values[field], its["projection"][kind][field])
    for one, other in zip(ours["suns"], theirs["suns"], strict=True):
        unit = [np.array(sun["direction"]) / np.linalg.norm(sun["direction"]) for sun in (one, other)]
        compare("sun", *unit)
        for field in ("strength", "color", "angle_rad"):
            compare(field, one[field], other[field])
    compare("sky", *(s["world"]["environment"]["constant"]["radiance"] for s in (ours, theirs)))
    compare("film", *([s["film"]["width"], s["film"]["height"]] for s in (ours, theirs)))
    return wrong


def refused(filepath, **arguments):
    with pytest.raises(RuntimeError) as raised:
        bpy.ops.pumice.import_state(filepath=str(filepath), **arguments)
    line = str(raised.value).strip().removeprefix("Error: ")
    assert len(line.splitlines()) == 1 and "defect" not in line, line
    return line


ORTHOGRAPHIC = {"layout": {"type": "3d", "orthographicProjection": True}, "relativeDisplayScales": {"z": 2.0}}


@pytest.mark.parametrize("changes", [{}, ORTHOGRAPHIC, {"projectionBackgroundColor": "#204080"}], ids=["perspective", "parallel", "background"])
def test_the_scene_is_that_of_the_commands_figure(stage, capfd, changes):
    path = written(stage, state(**changes))
    theirs, said = of_command(stage, path)
    capfd.readouterr()
    assert bpy.ops.pumice.import_state(filepath=str(path)) == {"FINISHED"}
    left_out = "layer em is left out: image, not segmentation"
    assert left_out in said and left_out in capfd.readouterr().out
    ours = of_blender(stage)
    assert differences(ours, theirs) == []
    assert set(looks(ours["instances"][0])) == {IDS[0], IDS[1], IDS[3]}
    (obj,) = [o for o in bpy.context.scene.objects if o.pumice.filepath]
    assert obj.name == "cells" and obj.pumice.source_path == str(stage.folder / "cells") and len(list(stage.folder.glob("cells-*.pumice"))) == 1
    figure = bpy.context.scene.pumice_figure
    if "projectionBackgroundColor" in changes:
        shown = stage.load("label_table").srgb_from_linear(np.array(figure.backdrop))
        np.testing.assert_allclose(shown, np.array([0x20, 0x40, 0x80]) / 255, atol=1e-5)
    assert figure.use_backdrop and bpy.context.scene.render.engine == "PUMICE"
    # Controls: what differs is convicted.
    camera = bpy.context.scene.camera
    camera.location.x += 0.01
    bpy.context.view_layer.update()
    assert [line.split(":")[0] for line in differences(of_blender(stage), theirs)] == ["camera"]
    camera.location.x -= 0.01
    bpy.ops.pumice.labels_select(ids=str(IDS[0]))
    bpy.ops.pumice.labels_color(color=(0.1, 0.2, 0.3))
    bpy.context.view_layer.update()
    assert [line.split(":")[0] for line in differences(of_blender(stage), theirs)] == [f"color of {IDS[0]}"]


def test_the_dialog_names_layers_and_what_it_sets_up(stage):
    operator, log = stage.load("import_state").PUMICE_OT_import_state, []
    dialog = types.SimpleNamespace(_browsing=False, layout=Layout(log), filepath=str(written(stage, state())))
    dialog._state = lambda: operator._state(dialog)
    dialog._layers = operator._sources(dialog)
    operator.draw(dialog, bpy.context)
    assert ("label", f"cells: {stage.folder / 'cells'}", "NONE") in log
    assert [entry[1] for entry in log if entry[0] == "prop"] == ["roi", "scale", "use_engine", "use_light", "use_camera"]
    bpy.ops.pumice.import_state(filepath=dialog.filepath)
    log.clear()
    operator.draw(dialog, bpy.context)
    assert [entry[1] for entry in log if entry[0] == "prop"] == ["roi", "scale"]


def test_a_link_with_a_layer_on_a_server(stage):
    with serving(stage.folder) as server:
        fields = state(f"precomputed://{server.url}/cells")
        link = "https://neuroglancer-demo.appspot.com/#!" + urllib.parse.quote(json.dumps(fields))
        assert "Allow Online Access" in refused(link) and server.asked == []
        stage.system.use_online_access = True
        assert bpy.ops.pumice.import_url(url=link) == {"FINISHED"}
    obj = bpy.context.object
    (kept,) = stage.kept()
    assert obj.pumice.filepath == str(kept) and obj.pumice.source_path == f"precomputed://{server.url}/cells"
    np.testing.assert_array_equal(pumice.open(kept).decode(), stage.labels)
    theirs, _ = of_command(stage, written(stage, state()))
    assert differences(of_blender(stage), theirs) == []


def test_two_layers_of_one_source_are_two_objects(stage):
    fields = state()
    fields["layers"].append(fields["layers"][0] | {"name": "third", "segments": [str(IDS[2])]})
    path = written(stage, fields)
    assert bpy.ops.pumice.import_state(filepath=str(path)) == {"FINISHED"}
    visible = stage.load("label_table").visible
    shown = {o.name: int(visible(o.pumice.table).sum()) for o in bpy.context.scene.objects if o.pumice.filepath}
    assert shown == {"cells": 3, "third": 1} and len(list(stage.folder.glob("cells-*.pumice"))) == 1
    assert differences(of_blender(stage), of_command(stage, path)[0]) == []


def test_a_part_of_a_layer_keeps_its_place(stage):
    path = written(stage, state())
    assert bpy.ops.pumice.import_state(filepath=str(path), roi="0:12,:,:") == {"FINISHED"}
    obj = bpy.context.object
    np.testing.assert_array_equal(pumice.open(obj.pumice.filepath).decode(), stage.labels[:12])
    theirs, _ = of_command(stage, path)
    assert set(looks(of_blender(stage)["instances"][0])) == {IDS[0], IDS[1]}
    np.testing.assert_allclose(of_blender(stage)["instances"][0]["world_from_index"], theirs["instances"][0]["world_from_index"], rtol=1e-5, atol=1e-5)


def test_a_scene_with_volumes_keeps_what_it_has(stage):
    path = written(stage, state())
    bpy.ops.pumice.import_state(filepath=str(path))
    scene = bpy.context.scene
    before = scene.camera, scene.world, len(bpy.data.lights)
    bpy.ops.pumice.import_state(filepath=str(path))
    assert (scene.camera, scene.world, len(bpy.data.lights)) == before
    assert len([o for o in scene.objects if o.pumice.filepath]) == 2


def test_what_cannot_be_imported_is_one_line_and_leaves_nothing(stage):
    assert "No such file" in refused(stage.folder / "none.json")
    assert "expected a state of Neuroglancer, got another file" in refused(_written(stage, "letter.json", "{}"))
    assert "no segment is chosen" not in refused(written(stage, state(layers=[])))
    assert "layer cells: graphene://https://server/table: expected a file, or a store" in refused(written(stage, state("graphene://https://server/table")))
    assert "none" in refused(written(stage, state("precomputed://none")))
    layer = state()["layers"][0] | {"segments": ["77"]}
    assert "it has none of the 1 segments, such as 77" in refused(written(stage, state(layers=[layer])))
    assert "the state lies on a server" in refused("https://neuroglancer-demo.appspot.com/#!gs://bucket/state.json")
    assert not [o for o in bpy.context.scene.objects if o.pumice.filepath] and len(bpy.data.worlds) <= 1 and stage.kept() == []


def _written(stage, name, text):
    (stage.folder / name).write_text(text)
    return stage.folder / name
