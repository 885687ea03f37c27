"""Tests the writers of USD files with Pixar's own library: the example `write_stages` of pumice-export writes one stage that has everything
that a stage can have, as text (`usda`) and as a crate file (`usdc`)."""

import subprocess

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade
from stage_validators import of_stage

FORMS = ["usda", "usdc"]
# A file that the stage refers to.
ODD_NAME = "a@b@@@@ 'µ'@"
LENGTHS = [0, 1, 15, 16, 17, 70_000]


@pytest.fixture(scope="module")
def files(rust_example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stages")
    (folder / ODD_NAME).touch()
    subprocess.run([rust_example("write_stages"), folder], check=True)
    return {form: folder / f"sample.{form}" for form in FORMS}


def test_both_forms_say_the_same(files):
    text, crate = (Sdf.Layer.FindOrOpen(str(files[form])).ExportToString() for form in FORMS)
    assert len(text) > 1_000_000 and text == crate
    # The version that readers from 2020 on know.
    assert files["usdc"].read_bytes()[:11] == b"PXR-USDC\x00\x08\x00"


@pytest.mark.parametrize("form", FORMS)
def test_validators_find_nothing(files, form, tmp_path):
    assert of_stage(Usd.Stage.Open(str(files[form]))) == []
    # Control: they notice what a stage lacks.
    layer = Sdf.Layer.FindOrOpen(str(files[form]))
    broken = Sdf.Layer.CreateNew(str(tmp_path / f"broken.{form}"))
    broken.TransferContent(layer)
    broken.defaultPrim = ""
    broken.Save()
    stage = Usd.Stage.Open(str(tmp_path / f"broken.{form}"))
    assert any("default" in fault.lower() for fault in of_stage(stage))


@pytest.mark.parametrize("form", FORMS)
def test_values_come_back(files, form):
    stage = Usd.Stage.Open(str(files[form]))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetDefaultPrim().GetPath() == "/Figure"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == "component"
    prim = stage.GetPrimAtPath("/Figure/values")
    values = {a.GetName(): a.Get() for a in prim.GetAttributes()}
    assert values["yes"] is True and values["int"] == -7 and values["long"] == 0.1 and values["short"] == 0.25
    assert values["float"] == float(np.float32(0.1)) and values["small"] == float(np.float32(1e-30))
    assert values["userProperties:json"] == "line\nquote \" back\\slash\ttab 'µ' 日本 \x01" and values["nothing"] == ""
    assert values["rule"] == "none" and values["file"].path == "./sample.usda"
    assert values["odd_file"].path == f"./{ODD_NAME}"
    assert np.array_equal(np.array(values["pair"]), np.float32([1, 0.1]))
    assert np.array_equal(np.array(values["color"]), np.float32([0.2, 0.3, 1]))
    assert np.array_equal(np.array(values["matrix"]), [[0.1, 2, 1e-300, 0], [-0.5, 1e300, 3, 0], [0, 0, 1 / 3, 0], [7, 8, 9, 1]])
    assert list(values["names"]) == ["a", "b c"] and len(values["no_names"]) == 0
    custom = {a.GetName(): a.IsCustom() for a in prim.GetAuthoredAttributes()}
    assert all(custom[name] == (name != "rule") for name in custom)
    assert prim.GetAttribute("rule").GetVariability() == Sdf.VariabilityUniform
    assert stage.GetPrimAtPath("/Figure/_33__20__b5_m_20__7b_x_7d_")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("length", LENGTHS)
def test_arrays_come_back(files, form, length):
    stage = Usd.Stage.Open(str(files[form]))
    prim = stage.GetPrimAtPath("/Figure/arrays")
    i = np.arange(length, dtype=np.int64)
    ints = np.where(i % 7 == 3, i * 2_654_435, i // 3).astype(np.int32)
    floats = ints.astype(np.float32) / np.float32(7)
    got = [np.array(prim.GetAttribute(f"{kind}{length}").Get()) for kind in ("ints", "floats", "triples")]
    assert [len(g) for g in got] == [length] * 3
    if length:
        assert np.array_equal(got[0], ints) and np.array_equal(got[1], floats)
        assert np.array_equal(got[2], np.stack([floats, -floats, np.float32(1e-20) * floats], axis=1))


@pytest.mark.parametrize("form", FORMS)
def test_variants_payload_and_material(files, form):
    stage = Usd.Stage.Open(str(files[form]))
    figure = stage.GetPrimAtPath("/Figure")
    assert figure.HasPayload() and stage.GetPrimAtPath("/Contents").IsAbstract()
    forms = figure.GetVariantSet("form")
    assert forms.GetVariantNames() == ["boxes", "voxels"] and forms.GetVariantSelection() == "boxes"
    for name, size in [("boxes", 1.0), ("voxels", 2.0)]:
        forms.SetVariantSelection(name)
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Figure/surface"))
        assert np.array(mesh.GetPointsAttr().Get()).max() == size and figure.GetAttribute("form").Get() == name
        label = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("label")
        assert label.GetInterpolation() == "uniform" and list(label.Get()) == [5]
        material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0]
        assert shader.GetIdAttr().Get() == "UsdPreviewSurface"
        assert np.allclose(shader.GetInput("diffuseColor").Get(), [0.8, 0.1, 0.1])
    # Without its payload there is no surface.
    empty = Usd.Stage.Open(str(files[form]), Usd.Stage.LoadNone)
    assert not empty.GetPrimAtPath("/Figure/surface") and empty.GetPrimAtPath("/Figure/values")


def test_a_damaged_file_is_noticed(files, tmp_path):
    """Control: Pixar's library does not open what is not as it should be."""
    data = bytearray(files["usdc"].read_bytes())
    for name, place, value in [("version", 9, 99), ("contents", 16, data[16] ^ 0x55), ("magic", 0, 0)]:
        broken = bytearray(data)
        broken[place] = value
        (tmp_path / f"{name}.usdc").write_bytes(broken)
        with pytest.raises(Exception):  # noqa: B017: pxr raises its own Tf.ErrorException
            Usd.Stage.Open(str(tmp_path / f"{name}.usdc"))
