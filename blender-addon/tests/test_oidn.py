# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests denoising by Open Image Denoise against Blender's own copy of it, which this module calls by ctypes with declarations of its own: the
command, the Python module and F12 give the same bits."""

import ctypes
import json
import subprocess

import numpy as np
import pumice
import pytest

from test_provenance import attributes
from test_real_volumes import SIZE, exr, load, scene  # noqa: F401  (scene is a fixture)


@pytest.fixture
def oidn(extension):
    return load(extension, "oidn")


@pytest.fixture
def library(oidn):
    """The path of Blender's own library."""
    path = oidn.library()
    assert path is not None and path.is_file()
    return path


def filtered(library, color, albedo, normal, hdr=True):
    """(colours (height, width, 3), version) as Open Image Denoise gives them."""
    c = ctypes.CDLL(str(library))
    c.oidnNewDevice.restype = c.oidnNewFilter.restype = ctypes.c_void_p
    device = ctypes.c_void_p(c.oidnNewDevice(1))
    c.oidnCommitDevice(device)
    filter = ctypes.c_void_p(c.oidnNewFilter(device, b"RT"))
    out = np.empty_like(color)
    height, width, _ = color.shape
    images = {b"color": color, b"albedo": albedo, b"normal": normal, b"output": out}
    images = {name: np.ascontiguousarray(image, dtype=np.float32) for name, image in images.items()}
    size = [ctypes.c_size_t(n) for n in (width, height, 0, 0, 0)]
    for name, image in images.items():
        c.oidnSetSharedFilterImage(filter, name, image.ctypes.data_as(ctypes.c_void_p), 3, *size)
    c.oidnSetFilterBool(filter, b"hdr", ctypes.c_bool(hdr))
    c.oidnCommitFilter(filter)
    c.oidnExecuteFilter(filter)
    said = ctypes.c_char_p()
    assert c.oidnGetDeviceError(device, ctypes.byref(said)) == 0, said.value
    version = [c.oidnGetDeviceInt(device, name) for name in (b"versionMajor", b"versionMinor", b"versionPatch")]
    c.oidnReleaseFilter(filter)
    c.oidnReleaseDevice(device)
    return images[b"output"], ".".join(map(str, version))


def layer(found, name, channels="RGB"):
    return np.stack([found[f"{name}.{channel}"] for channel in channels], axis=2)


def inputs(found):
    return layer(found, "Noisy Image"), layer(found, "Denoising Albedo"), layer(found, "Normal", "XYZ")


def test_the_command_gives_what_the_library_gives(library, data, pumice_command, tmp_path):
    command = [pumice_command, "render", data / "platynereis_nuclei.tif", "--spacing", "1,1,1", "-o", "a.exr", "--size", "96x64", "--spp", "4"]
    command += ["--backend", "cpu", "--denoise=oidn", "--json", "r.json"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env={"PUMICE_OIDN": str(library)})
    found = exr(tmp_path / "a.exr")
    ours = np.stack([next(v for k, v in found.items() if k.split(".")[-1] == c and k.split(".")[0] in ("", "Combined")) for c in "RGB"], axis=2)
    color, albedo, normal = inputs(found)
    theirs, version = filtered(library, color, albedo, normal)
    assert np.array_equal(ours, theirs) and not np.array_equal(ours, color)
    assert json.loads((tmp_path / "r.json").read_text())["denoised"] == f"Open Image Denoise {version}, biased"
    # Controls: each of its inputs matters.
    for others in ((color, 0 * albedo, normal), (color, albedo, 0 * normal)):
        assert not np.array_equal(filtered(library, *others)[0], theirs)
    assert not np.array_equal(filtered(library, color, albedo, normal, hdr=False)[0], theirs)


def test_the_module_gives_what_the_library_gives(library, nuclei, monkeypatch):
    volume = pumice.open(nuclei, spacing=(1, 1, 1))
    figure = pumice.figure(volume, size=(96, 64))
    raw = pumice.render(figure, volume, spp=4, backend="cpu")
    theirs, version = filtered(library, raw.color, raw.passes["albedo"], raw.passes["normal"])
    monkeypatch.setenv("PUMICE_OIDN", str(library))
    renderer = pumice.Renderer(backend="cpu")
    for smooth in (
        pumice.render(figure, volume, spp=4, backend="cpu", denoise="oidn"),
        renderer.render(figure, [volume], spp=4, denoise=f"oidn:{library}"),
    ):
        assert smooth.denoised == f"Open Image Denoise {version}, biased"
        assert np.array_equal(smooth.color, theirs) and np.array_equal(smooth.noisy, raw.color)
        assert np.array_equal(smooth.variance, raw.variance)


def test_f12_goes_through_blenders_own_library_and_says_so(scene, blender, library, tmp_path, monkeypatch):  # noqa: F811
    monkeypatch.delenv("PUMICE_OIDN", raising=False)
    scene.render.filepath = str(tmp_path / "a.exr")
    blender.context.view_layer.pumice.use_pass_denoising = True
    scene.pumice.use_denoise, scene.pumice.denoiser = True, "OIDN"
    assert blender.ops.render.render(write_still=True) == {"FINISHED"}
    found = exr(tmp_path / "a.exr")
    color, albedo = layer(found, "Noisy Image"), layer(found, "Denoising Albedo")
    theirs, version = filtered(library, color, albedo, layer(found, "Denoising Normal", "XYZ"))
    assert color.shape == (*SIZE[::-1], 3) and np.array_equal(layer(found, "Combined"), theirs)
    assert attributes(tmp_path / "a.exr")["pumice/denoised"] == f"Open Image Denoise {version}, biased"
    # Control: the statistical one, which new scenes have, gives another picture of the same samples.
    scene.pumice.denoiser = "STATISTICAL"
    blender.ops.render.render(write_still=True)
    found = exr(tmp_path / "a.exr")
    assert np.array_equal(layer(found, "Noisy Image"), color) and not np.array_equal(layer(found, "Combined"), theirs)
    assert attributes(tmp_path / "a.exr")["pumice/denoised"] == "statistical, biased"


def test_a_library_that_is_missing_is_one_line_before_the_render(scene, blender, monkeypatch, tmp_path):  # noqa: F811
    scene.render.filepath = str(tmp_path / "a.exr")
    scene.pumice.use_denoise, scene.pumice.denoiser, scene.pumice.samples = True, "OIDN", 1 << 24
    monkeypatch.setenv("PUMICE_OIDN", str(tmp_path / "none.so"))
    with pytest.raises(RuntimeError, match=r"Open Image Denoise: tried .*none\.so \(of PUMICE_OIDN\).*set PUMICE_OIDN"):
        blender.ops.render.render(write_still=True)


def test_where_blender_has_no_copy_the_system_is_asked(oidn, library, monkeypatch, tmp_path):
    monkeypatch.delenv("PUMICE_OIDN", raising=False)
    assert oidn.name() == f"oidn:{library}"
    monkeypatch.setenv("PUMICE_OIDN", "/elsewhere.so")
    assert oidn.name() == "oidn", "what the user sets comes first"
    monkeypatch.delenv("PUMICE_OIDN")
    # As Blender lies on macOS, on Windows, and in a folder without its own libraries.
    monkeypatch.setattr(oidn.bpy.utils, "resource_path", lambda _: str(tmp_path / "5.0"))
    assert oidn.library() is None and oidn.name() == "oidn"
    for place in ("lib/libOpenImageDenoise.2.3.3.dylib", "blender.shared/OpenImageDenoise.dll"):
        path = tmp_path / place
        path.parent.mkdir()
        path.touch()
        assert oidn.name() == f"oidn:{path}"
        path.unlink()
    monkeypatch.setattr(oidn.bpy.utils, "resource_path", lambda _: "")
    assert oidn.library() is None


def test_only_a_denoised_render_has_a_denoiser(blender, extension):
    denoiser, wishes = load(extension, "final_render").denoiser, blender.context.scene.pumice
    assert denoiser(wishes) is False and wishes.denoiser == "STATISTICAL"
    wishes.denoiser = "OIDN"
    assert denoiser(wishes) is False
    wishes.use_denoise = True
    assert denoiser(wishes).startswith("oidn")
