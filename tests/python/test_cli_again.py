"""`pumice render --again`: the same pixels from wherever picture and files are, or one line that says why not.

A picture may come from anybody. `forged` changes what a PNG carries, by Pillow, which knows nothing of Pumice.
"""

import json
import shutil

import numpy as np
import pytest
from command import run
from exr_planes import planes
from PIL import Image
from PIL.PngImagePlugin import PngInfo

SMALL = ["--size", "24x16", "--spp", "2", "--backend", "cpu"]


def labels(seed=0):
    return np.random.default_rng(seed).integers(0, 4, (5, 6, 7)).astype(np.uint8)


@pytest.fixture
def study(pumice, tmp_path):
    """A folder with volumes/a.pumice and pictures/a.png, rendered of it."""
    root = tmp_path / "study"
    (root / "volumes").mkdir(parents=True)
    (root / "pictures").mkdir()
    np.save(tmp_path / "a.npy", labels())
    run(pumice, "compress", tmp_path / "a.npy", "-o", root / "volumes/a.pumice").fine()
    run(pumice, "render", root / "volumes/a.pumice", "-o", root / "pictures/a.png", *SMALL).fine()
    return root


def held(png):
    return json.loads(Image.open(png).text["pumice"])


def forged(png, out, change):
    """`out`: the picture `png` with another account of how it was made."""
    image = Image.open(png)
    made = json.loads(image.text["pumice"])
    change(made)
    info = PngInfo()
    info.add_itxt("pumice", json.dumps(made))
    image.save(out, pnginfo=info)
    return out


def pixels(path):
    return np.asarray(Image.open(path))


def again(pumice, picture, out, *more, **how):
    return run(pumice, "render", "--again", picture, "-o", out, *more, **how)


def test_a_folder_that_moves_takes_its_pictures_with_it(pumice, study, tmp_path):
    expected = pixels(study / "pictures/a.png")
    assert held(study / "pictures/a.png")["scene"]["instances"][0]["source"] == "../volumes/a.pumice"
    assert str(tmp_path).encode() not in (study / "pictures/a.png").read_bytes()
    moved = tmp_path / "elsewhere" / "deep" / "study"
    moved.parent.mkdir(parents=True)
    shutil.move(study, moved)
    again(pumice, moved / "pictures/a.png", tmp_path / "b.png", cwd=tmp_path).fine()
    assert np.array_equal(pixels(tmp_path / "b.png"), expected)
    # Written elsewhere, the new picture leads to the same volume.
    assert held(tmp_path / "b.png")["scene"]["instances"][0]["source"] == "elsewhere/deep/study/volumes/a.pumice"
    again(pumice, tmp_path / "b.png", moved / "c.png").fine()
    # Nothing else is tried: neither the working folder nor the place where the volume was.
    shutil.move(moved / "volumes", study)
    for folder in (study, study.parent):
        assert "volumes/a.pumice" in again(pumice, moved / "pictures/a.png", tmp_path / "d.png", cwd=folder).refused()
    assert not (tmp_path / "d.png").exists()


def test_other_names_and_types_are_said(pumice, study, tmp_path):
    """The content hash knows ids and voxels alone."""
    volume, picture, table = study / "volumes/a.pumice", study / "pictures/a.png", tmp_path / "table.csv"
    for row in ("1,alpha,", "1,alpha,axon", "1,beta,axon"):
        assert "names or types" not in again(pumice, picture, tmp_path / "same.png").err
        table.write_text(f"id,name,type\n{row}\n")
        run(pumice, "compress", tmp_path / "a.npy", "-o", volume, "--table", table).fine()
        done = again(pumice, picture, tmp_path / "other.png")
        assert done.code == 0 and "a.pumice: names or types of its labels have changed" in done.err, done
        run(pumice, "render", volume, "-o", picture, *SMALL).fine()
    # A label that is not shown, and a picture of before this was known.
    run(pumice, "render", volume, "-o", picture, *SMALL, "--labels", "2").fine()
    table.write_text("id,name\n3,gamma\n")
    run(pumice, "compress", tmp_path / "a.npy", "-o", volume, "--table", table).fine()
    assert "names or types" not in again(pumice, picture, tmp_path / "same.png").err
    table.write_text("id,name\n2,gamma\n")
    run(pumice, "compress", tmp_path / "a.npy", "-o", volume, "--table", table).fine()
    assert "names or types" in again(pumice, picture, tmp_path / "other.png").err
    old = forged(picture, tmp_path / "old.png", lambda made: made.pop("label_hashes"))
    assert "names or types" not in again(pumice, old, tmp_path / "same.png", "--source", volume).err


def test_absolute_paths_of_older_pictures_still_work(pumice, study, tmp_path):
    def change(made):
        made["scene"]["instances"][0]["source"] = str(study / "volumes/a.pumice")

    old = forged(study / "pictures/a.png", tmp_path / "old.png", change)
    again(pumice, old, tmp_path / "b.png").fine()
    assert np.array_equal(pixels(tmp_path / "b.png"), pixels(old))


def test_a_picture_without_paths_takes_its_files_from_flags(pumice, study, tmp_path):
    volume, out = study / "volumes/a.pumice", tmp_path / "b.exr"
    for ending in ("png", "exr"):
        bare = tmp_path / f"bare.{ending}"
        run(pumice, "render", volume, "-o", bare, *SMALL, "--no-paths").fine()
        assert b"a.pumice" not in bare.read_bytes() and b"volumes" not in bare.read_bytes()
        line = again(pumice, bare, out).refused()
        assert "--source" in line and "instances[0].source" in line, line
        assert "expected 1 files, got 2" in again(pumice, bare, out, "--source", volume, "--source", volume).refused()
        np.save(tmp_path / "other.npy", labels(1))
        assert "other.npy" in again(pumice, bare, out, "--source", tmp_path / "other.npy").refused()
        assert not out.exists()
        made = tmp_path / f"made.{ending}"
        again(pumice, bare, made, "--source", volume, "--no-paths").fine()
        assert made.read_bytes() == bare.read_bytes()
    # The same labels in another file will do; the control above was another volume.
    again(pumice, study / "pictures/a.png", tmp_path / "c.png", "--source", tmp_path / "a.npy").fine()
    assert np.array_equal(pixels(tmp_path / "c.png"), pixels(study / "pictures/a.png"))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda made: made["volume_hashes"].clear(), "volume, 1 in all, got 0"),
        (lambda made: made["volume_hashes"].append("0" * 32), "volume, 1 in all, got 2"),
        (lambda made: made.update(mesh_hashes=["0" * 32]), "mesh, 0 in all, got 1"),
        (lambda made: made.update(volume_hashes=["0" * 32]), "a.pumice now has"),
        (lambda made: made.update(sky_hash="0" * 32), "sky"),
        (lambda made: made.update(spp=0), "spp"),
        (lambda made: made["scene"]["film"].update(width=65536, height=65536), "film.width"),
        (lambda made: made["scene"]["instances"][0].update(source=""), "--source"),
        (lambda made: made["scene"]["camera"].update(shift=[1e400, 0]), "pumice"),
        (lambda made: made.update(more=1), "more"),
    ],
)
def test_what_a_picture_says_of_itself_is_not_trusted(pumice, study, tmp_path, change, what):
    picture = forged(study / "pictures/a.png", study / "pictures/forged.png", change)
    line = again(pumice, picture, tmp_path / "b.png").refused()
    assert what in line and not (tmp_path / "b.png").exists(), line
    # The control: an account that is only written anew is accepted.
    same = forged(study / "pictures/a.png", study / "pictures/same.png", lambda made: None)
    again(pumice, same, tmp_path / "b.png").fine()


def test_a_film_is_refused_before_any_file_is_opened(pumice, study, tmp_path):
    def change(made):
        made["scene"]["film"].update(width=65536, height=65536)
        made["scene"]["instances"][0]["source"] = "nowhere.pumice"

    done = again(pumice, forged(study / "pictures/a.png", tmp_path / "f.png", change), tmp_path / "b.png")
    assert "film.width" in done.refused() and done.peak_rss_bytes < 200 << 20


def test_time_limits_a_picture_that_asks_for_too_much(pumice, study, tmp_path):
    endless = forged(study / "pictures/a.png", study / "pictures/endless.png", lambda made: made.update(spp=4_000_000_000))
    done = again(pumice, endless, tmp_path / "b.png", "--time", "0.2")
    assert done.code == 0 and "of 4000000000 samples" in done.err and "not the same picture" in done.err, done
    done = again(pumice, study / "pictures/a.png", tmp_path / "c.png", "--time", "60")
    assert done.fine() and np.array_equal(pixels(tmp_path / "c.png"), pixels(study / "pictures/a.png"))


def test_a_replaced_sky_is_noticed(pumice, study, tmp_path):
    sky, scene, out = study / "sky.exr", study / "s.json", study / "pictures/sky.exr"
    run(pumice, "render", study / "volumes/a.pumice", "-o", sky, *SMALL, "--save-scene", scene).fine()
    fields = json.loads(scene.read_text())
    fields["world"] = {"environment": {"image": {"path": "sky.exr"}}}
    scene.write_text(json.dumps(fields))
    run(pumice, "render", scene, "-o", out, *SMALL).fine()
    run(pumice, "render", scene, "-o", study / "pictures/sky.png", *SMALL).fine()
    again(pumice, out, tmp_path / "b.exr").fine()
    first = planes(out)
    assert all(np.array_equal(first[name], plane, equal_nan=True) for name, plane in planes(tmp_path / "b.exr").items())
    bare = forged(study / "pictures/sky.png", study / "pictures/bare.png", lambda made: made.pop("sky_hash"))
    assert "sky" in again(pumice, bare, tmp_path / "c.png").refused()
    run(pumice, "render", study / "volumes/a.pumice", "-o", sky, *SMALL, "--seed", "9").fine()
    line = again(pumice, out, tmp_path / "c.exr").refused()
    assert "sky" in line and "hash" in line and not (tmp_path / "c.exr").exists(), line
    sky.unlink()
    assert "sky.exr" in again(pumice, out, tmp_path / "c.exr").refused()
