"""Tests scenes and renders: pictures equal those of the command bit for bit."""

import json
import subprocess
import time

import numpy as np
import pumice
import pytest
from share import one_of_today


@pytest.fixture
def scene(volume, tmp_path):
    volume.save(tmp_path / "blobs.pumice")
    return pumice.figure(volume, source=tmp_path / "blobs.pumice", size=(60, 40))


def test_the_command_makes_the_same_picture(scene, volume, command, tmp_path):
    scene.save(tmp_path / "scene.json")
    picture = pumice.render(scene, volume, spp=5, backend="cpu")
    picture.save(tmp_path / "python.exr")
    run = [command, "render", tmp_path / "scene.json", "-o", tmp_path / "command.exr", "--spp", "5", "--backend", "cpu"]
    subprocess.run(run, check=True, capture_output=True)
    compared = subprocess.run(
        [command, "compare", tmp_path / "python.exr", tmp_path / "command.exr", "--json", "-"],
        check=True,
        capture_output=True,
        text=True,
    )
    report = json.loads(compared.stdout)
    assert report["rel_mse"] == 0 and report["flip"] == 0
    again = pumice.render(scene, spp=5, backend="cpu")
    np.testing.assert_array_equal(again.color, picture.color)
    other = scene.to_dict()
    other["settings"]["seed"] += 1
    different = pumice.render(pumice.Scene.from_dict(other), volume, spp=5, backend="cpu")
    assert (different.color != picture.color).any(), "the comparison detects a difference"


def test_what_a_picture_holds(scene, volume, labels):
    points = []
    picture = pumice.render(scene, [volume], spp=8, backend="cpu", on_progress=points.append)
    assert picture.color.shape == (40, 60, 3) and picture.color.dtype == np.float32
    assert np.isfinite(picture.color).all() and (picture.color >= 0).all()
    assert picture.spp == 8 == points[-1].spp and picture.backend == "cpu"
    assert picture.error_estimate == points[-1].error_estimate and 0 < picture.error_estimate < 1
    assert len(picture.curve) == len(points) and picture.variance.shape == (40, 60, 3)
    seen = picture.label > 0
    assert seen.any() and not seen.all()
    np.testing.assert_array_equal(np.isfinite(picture.depth), seen)
    assert picture.label.max() <= len(volume.labels)
    lengths = np.linalg.norm(picture.normal, axis=-1)
    np.testing.assert_allclose(lengths[seen], 1, atol=1e-5)
    assert any(line.startswith("needed:") for line in picture.explanation)
    for array in (picture.color, picture.depth, picture.label):
        assert not array.flags.writeable and not array.flags.owndata


LIGHT = [f"{kind}_{part}" for kind in ("diffuse", "glossy", "transmission") for part in ("direct", "indirect", "color")]


def with_film(scene, **film):
    fields = scene.to_dict()
    fields["film"].update(film)
    return pumice.Scene.from_dict(fields)


def test_cryptomatte(scene, volume):
    asked = ["cryptomatte_label", "cryptomatte_type"]
    picture = pumice.render(with_film(scene, passes=asked, transparent=True, cryptomatte_ranks=8), volume, spp=4, backend="cpu")
    labels, types = (picture.passes[name] for name in asked)
    assert labels.shape == types.shape == (40, 60, 8, 2) and labels.dtype == np.float32
    np.testing.assert_array_equal(labels[..., 1].sum(axis=-1), picture.alpha)
    # This volume has no types. Ids with replaced exponents do not occur, so each float has the bits of its hash.
    assert picture.manifests["cryptomatte_type"] == {"no type": pumice.cryptomatte_hash("no type")}
    np.testing.assert_array_equal(types[:, :, 0, 1], picture.alpha)
    hashes = {int(h) for h in np.unique(labels[..., 0][labels[..., 1] > 0].view(np.uint32))}
    names = picture.manifests["cryptomatte_label"]
    assert set(names) <= {str(i) for i in volume.labels.ids} and hashes == set(names.values())
    assert all(pumice.cryptomatte_hash(name) == h for name, h in names.items())
    assert pumice.cryptomatte_hash("hello") == 0x248BFA47
    plain = pumice.render(scene, volume, spp=1, backend="cpu")
    assert plain.manifests == {} and "cryptomatte_label" not in plain.passes


def test_passes_of_light(scene, volume):
    asked = [*LIGHT, "emission", "environment", "samples", "albedo"]
    picture = pumice.render(with_film(scene, passes=asked), volume, spp=4, backend="cpu")
    passes = picture.passes
    assert set(asked) | {"depth", "position", "normal", "label", "variance"} == set(passes)
    light = sum(
        (passes[f"{kind}_direct"] + passes[f"{kind}_indirect"]) * passes[f"{kind}_color"]
        for kind in ("diffuse", "glossy", "transmission")
    )
    # Both are sums of some dozen contributions in 32 bits.
    np.testing.assert_allclose(light + passes["emission"] + passes["environment"], picture.color, rtol=3e-5, atol=3e-8)
    assert (passes["samples"] == 4).all() and passes["samples"].shape == (40, 60)
    # Pixels without a surface, and only these, have position 0.
    np.testing.assert_array_equal((passes["position"] == 0).all(axis=-1), picture.label == 0)
    plain = pumice.render(scene, volume, spp=4, backend="cpu")
    assert not set(LIGHT) & set(plain.passes) and "samples" not in plain.passes
    np.testing.assert_array_equal(plain.color, picture.color)
    assert (plain.passes["albedo"] != passes["albedo"]).any(), "a requested albedo pass is a mean over samples"


def test_a_floor_that_catches_shadows(scene, volume):
    fields = scene.to_dict()
    height = float(np.min(np.array(fields["instances"][0]["world_from_index"]).reshape(4, 3)[3][2])) - 0.2
    place = [50, 0, 0, 0, 50, 0, 0, 0, 1, 0, 0, height]
    fields["meshes"] = [{"id": 1, "source": "floor", "world_from_mesh": place, "materials": [{}], "shadow_catcher": True}]
    fields["film"]["transparent"] = True
    floor = pumice.Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    picture = pumice.render(pumice.Scene.from_dict(fields), volume, meshes=[floor], spp=8, backend="cpu")
    dark = (picture.alpha > 0.1) & (picture.color == 0).all(axis=-1)
    assert dark.sum() > 20 and "shadow_catcher" not in picture.passes
    fields["film"]["passes"] = ["shadow_catcher"]
    apart = pumice.render(pumice.Scene.from_dict(fields), volume, meshes=[floor], spp=8, backend="cpu")
    shadow = apart.passes["shadow_catcher"]
    # Excludes parts of the volume that are as black as a shadow.
    dark &= apart.alpha == 0
    np.testing.assert_allclose(picture.alpha[dark], 1 - shadow[dark].mean(axis=-1), atol=1e-6)
    np.testing.assert_array_equal(apart.color, picture.color)
    assert dark.sum() > 20 and apart.alpha.max() == 1


def test_a_transparent_film(scene, volume, tmp_path):
    clear = with_film(scene, transparent=True, passes=["environment"])
    picture = pumice.render(clear, volume, spp=4, backend="cpu")
    opaque = pumice.render(scene, volume, spp=4, backend="cpu")
    assert opaque.alpha is None and picture.alpha.shape == (40, 60)
    assert set(np.unique(picture.alpha)) <= {0, 0.25, 0.5, 0.75, 1} and 0 < picture.alpha.mean() < 1
    np.testing.assert_allclose(picture.color + picture.passes["environment"], opaque.color, rtol=1e-5)
    assert (picture.color[picture.alpha == 0] == 0).all()
    picture.save(tmp_path / "a.png")
    # Colour type 6 in the header of a PNG is RGB with alpha.
    assert (tmp_path / "a.png").read_bytes()[25] == 6
    with pumice.Session(clear, volume, backend="cpu", spp=4) as session:
        while session.status.state == "rendering":
            time.sleep(0.01)
        frame = np.asarray(session.latest())[::-1]
    np.testing.assert_array_equal(frame[..., :3], picture.color)
    np.testing.assert_array_equal(frame[..., 3], picture.alpha)


def test_pixels_rest_once_they_are_good_enough(scene, volume):
    fields = scene.to_dict()
    fields["settings"]["adaptive"] = {"threshold": 0.1, "min_spp": 8}
    fields["film"]["passes"] = ["samples"]
    rested = pumice.render(pumice.Scene.from_dict(fields), volume, backend="cpu")
    assert rested.samples.min() == 8 and rested.samples.max() == rested.spp > 8
    assert rested.mean_spp == pytest.approx(rested.samples.mean(), rel=1e-6)
    assert rested.error_estimate < 0.1
    fields["settings"]["adaptive"] = None
    even = pumice.render(pumice.Scene.from_dict(fields), volume, spp=8, backend="cpu")
    assert even.mean_spp == 8 and (even.samples == 8).all()
    same = (even.color == rested.color).all(axis=-1)
    assert same[rested.samples == 8].all() and not same.all()


def test_limits(scene, volume):
    assert pumice.render(scene, volume, seconds=0.05).seconds >= 0.05
    assert pumice.render(scene, volume, error=0.3, spp=1000).spp < 1000
    with pytest.raises(pumice.InputError, match="it would never end"):
        pumice.render(scene, volume)
    for limit in ({"spp": 0}, {"spp": 1 << 32}, {"spp": 2.5}, {"seconds": -1.0}, {"error": float("nan")}):
        for call in (pumice.render, pumice.Session):
            with pytest.raises(pumice.InputError, match=f"^{next(iter(limit))}: expected "):
                call(scene, volume, **limit)


def test_volumes_by_source(scene, volume):
    source = scene.to_dict()["instances"][0]["source"]
    assert pumice.render(scene, {source: volume}, spp=1).spp == 1
    with pytest.raises(pumice.InputError, match=r"instances\[0\].source"):
        pumice.render(scene, {"other": volume}, spp=1)
    with pytest.raises(pumice.InputError, match="one volume for each of 1, got 2"):
        pumice.render(scene, [volume, volume], spp=1)


def test_files(scene, volume, tmp_path):
    picture = pumice.render(scene, volume, spp=4)
    picture.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    picture.save(tmp_path / "a.exr", passes=["depth", "label"])
    picture.save(tmp_path / "a.exr", passes="depth")
    for bad, what in [("a.jpg", "ends in .exr or .png"), ("no/folder/a.png", "no/folder")]:
        with pytest.raises(pumice.InputError, match=what):
            picture.save(tmp_path / bad)
    with pytest.raises(pumice.InputError, match="beauty"):
        picture.save(tmp_path / "b.exr", passes=["beauty"])
    assert not (tmp_path / "b.exr").exists()


def test_scenes_are_values(scene, tmp_path):
    fields = scene.to_dict()
    fields["film"]["width"] = 5
    assert scene.to_dict()["film"]["width"] == 60, "a copy"
    assert pumice.Scene.from_dict(scene.to_dict()) == scene
    assert pumice.Scene.from_dict(fields) != scene
    scene.save(tmp_path / "scene.json")
    assert pumice.Scene.load(tmp_path / "scene.json") == scene
    assert pumice.Scene.from_json(scene.to_json()) == scene and len({scene, pumice.Scene.from_json(scene.to_json())}) == 1


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda f: f["camera"].update(clip=[2, 1]), "camera.clip"),
        (lambda f: f["film"].update(width=0), "film.width"),
        (lambda f: f["film"].update(passes=["beauty"]), "beauty"),
        (lambda f: f.update(sky="blue"), "unknown field `sky`"),
        (lambda f: f.pop("camera"), "missing field `camera`"),
        (lambda f: f["camera"].update(shift=[float("nan"), 0]), "scene: "),
        (lambda f: f["camera"].update(shift=[object(), 0]), "scene: "),
        (lambda f: f.update(version=99), "version"),
    ],
)
def test_scenes_that_make_no_sense(scene, change, what):
    fields = scene.to_dict()
    change(fields)
    with pytest.raises(pumice.InputError, match=what):
        pumice.Scene.from_dict(fields)


def test_figures_of_labels(volume):
    ids = volume.labels.ids
    shown = pumice.figure(volume, labels=ids[:3]).to_dict()["instances"][0]["style"]["show"]
    assert sorted(shown["only"]) == ids[:3].tolist()
    assert len(pumice.figure(volume, pick=5).to_dict()["instances"][0]["style"]["show"]["only"]) == 5
    for bad, what in [
        ({"labels": [251]}, "no label 251"),
        ({"labels": [-1]}, "labels: expected 0 to"),
        ({"labels": ids[:1], "pick": 2}, "not both"),
        ({"pick": -1}, "pick: expected 1 to"),
        ({"size": (0, 5)}, "size: expected 1 to"),
        ({"size": (-1, 5)}, "size: expected 1 to"),
        ({"size": (1, 5, 3)}, "size: expected two numbers"),
        ({"view": (float("nan"), 0)}, "view: expected degrees"),
    ]:
        with pytest.raises(pumice.InputError, match=what):
            pumice.figure(volume, **bad)


def test_devices():
    listed = pumice.devices()
    assert any(d["backend"] == "cpu" for d in listed) and sum(d["chosen"] for d in listed) == 1
    for d in listed:
        assert d["device"] and d["kind"] and d["reason"]
        assert (d["backend"] == "cpu") != ("number" in d and "driver" in d)


BACKENDS = ["vulkan-rt", "vulkan-query", "vulkan-compute"]


@pytest.mark.parametrize("backend", one_of_today(BACKENDS))
def test_a_named_backend_draws_the_picture_of_the_cpu(scene, volume, backend):
    """Needs a Vulkan device, which `cargo xtask test` provides. The backend changes daily."""
    picture = pumice.render(scene, volume, spp=4, backend=backend)
    assert (picture.backend, picture.notices) == (backend, [])
    device = next(d for d in pumice.devices() if d["backend"] == backend and d["usable"])
    assert picture.device == device["device"]
    same = pumice.render(scene, volume, spp=4, backend=f"{backend}:{device['number']}")
    np.testing.assert_array_equal(same.color, picture.color)
    cpu = pumice.render(scene, volume, spp=4, backend="cpu")
    np.testing.assert_array_equal(picture.label, cpu.label)
    np.testing.assert_array_equal(picture.depth, cpu.depth)
    # A session renders with the same code as `render`.
    with pumice.Session(scene, volume, backend=backend, spp=4) as session:
        while session.status.state == "rendering":
            time.sleep(0.01)
        frame = session.latest()
        np.testing.assert_array_equal(np.asarray(frame)[::-1, :, :3], picture.color)
        status = session.status
        assert (status.backend, status.device, status.notices) == (backend, picture.device, [])
        while (film := session.label_film()) is None:
            assert session.status.error is None
            time.sleep(0.01)
        np.testing.assert_array_equal(film.pixels[..., 1], cpu.label)
        np.testing.assert_array_equal(film.pixels[..., 0], cpu.label > 0)


@pytest.mark.parametrize("backend", one_of_today(BACKENDS))
def test_first_surfaces_of_shipped_data_are_those_of_the_cpu(backend, ct):
    """Depths and labels are equal to the last bit. The backend changes daily. (Colours are compared statistically in the tests of the command.)"""
    scene = pumice.figure(ct, size=(160, 120))
    picture, cpu = (pumice.render(scene, ct, spp=1, backend=name) for name in (backend, "cpu"))
    assert picture.backend == backend and (cpu.label > 0).any() and not (cpu.label > 0).all()
    np.testing.assert_array_equal(picture.label, cpu.label)
    np.testing.assert_array_equal(picture.depth.view(np.uint32), cpu.depth.view(np.uint32))
    # Negative control: a camera that is moved a little gives other depths.
    fields = scene.to_dict()
    fields["camera"]["world_from_camera"][9] += 0.01
    moved = pumice.render(pumice.Scene.from_dict(fields), ct, spp=1, backend="cpu")
    assert (moved.depth != picture.depth).any()


@pytest.mark.parametrize("backend", ["abacus", "cpu:0", "vulkan-rt:99", "vulkan-rt:no such name", ""])
def test_a_backend_that_is_not_here_is_an_input_error(scene, volume, backend):
    with pytest.raises(pumice.InputError, match="^backend ") as raised:
        pumice.render(scene, volume, spp=1, backend=backend)
    assert "--" not in str(raised.value)
    with pytest.raises(pumice.InputError, match="^backend "):
        pumice.Session(scene, volume, backend=backend)
