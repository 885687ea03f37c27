"""Tests what a picture tells of its labels, its display values and its mattes, against the volume's own table and other programs' readers."""

import sys
from pathlib import Path

import numpy as np
import pumice
import pytest
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/python"))
from cryptomatte_oracle import Mattes  # noqa: E402


@pytest.fixture(scope="module")
def scene(volume):
    fields = pumice.figure(volume, size=(60, 40)).to_dict()
    fields["film"].update(passes=["cryptomatte_label", "cryptomatte_type"], cryptomatte_ranks=4, transparent=True)
    return pumice.Scene.from_dict(fields)


@pytest.fixture(scope="module")
def picture(scene, volume):
    return pumice.render(scene, volume, spp=4, backend="cpu")


@pytest.fixture(scope="module")
def opened(picture, tmp_path_factory):
    path = tmp_path_factory.mktemp("opened") / "a.exr"
    picture.save(path)
    return path, pumice.open_picture(path)


def test_ids_are_those_of_the_label_table(picture, volume):
    seen = picture.label > 0
    ids = picture.ids()
    assert ids.dtype == np.uint64 and ids.shape == (40, 60)
    np.testing.assert_array_equal(ids[seen], volume.labels.ids[picture.label[seen] - 1])
    assert (ids[~seen] == 0).all() and seen.any() and not seen.all()
    np.testing.assert_array_equal(picture.instances(), np.where(seen, 1, 0))
    assert picture.instance is None and "instance" not in picture.passes


def two_instances(volume, **how):
    """A picture of a volume, as instance 5, beside one of a single label with the greatest of all ids, as instance 0."""
    other = pumice.compress(np.full((16, 15, 14), 2**64 - 1, np.uint64))
    fields = pumice.figure(volume, size=(60, 40)).to_dict()
    first = fields["instances"][0]
    place = list(first["world_from_index"])
    fields["instances"].append({**first, "id": 0, "source": "other", "style": {}})
    first.update(id=5, world_from_index=[*place[:9], place[9] + 3.0, *place[10:]])
    return pumice.render(pumice.Scene.from_dict(fields), [volume, other], spp=1, **how)


def test_two_instances_are_told_apart(volume):
    picture = two_instances(volume, backend="cpu")
    of_other = (picture.label > 0) & (picture.instances() == 0)
    assert of_other.sum() > 20 and (picture.instances() == 5).sum() > 20
    assert (picture.ids()[of_other] == 2**64 - 1).all() and (picture.ids()[~of_other] < 250).all()
    np.testing.assert_array_equal(picture.passes["instance"], picture.instances())


@pytest.mark.full
@pytest.mark.parametrize("backend", ["vulkan-rt", "vulkan-query", "vulkan-compute"])
def test_a_graphics_processor_tells_the_same_instances_and_ids(volume, backend):
    """Needs a Vulkan device, which `cargo xtask test` provides, and tens of seconds to compile shaders for a CPU."""
    picture, cpu = (two_instances(volume, backend=name) for name in (backend, "cpu"))
    assert picture.backend == backend
    np.testing.assert_array_equal(picture.instances(), cpu.instances())
    np.testing.assert_array_equal(picture.ids(), cpu.ids())


def test_a_picked_pixel_has_the_voxel_that_the_volume_has_there(picture, volume, labels):
    ys, xs = np.nonzero(picture.label)
    for x, y in list(zip(xs.tolist(), ys.tolist()))[::97]:
        found = picture.pick(x, y, volume=volume)
        assert found.label == picture.ids()[y, x] == labels[found.voxel] and found.instance == 1
        assert np.float32(found.depth) == picture.depth[y, x]
        np.testing.assert_array_equal(np.float32(found.position), picture.position[y, x])
        assert picture.pick(x, y).voxel is None
    y, x = np.argwhere(picture.label == 0)[0].tolist()
    assert picture.pick(x, y) == pumice.PickedPixel(None, None, None, None, None, None, None)
    other = pumice.compress(np.ones((2, 2, 2), np.uint8))
    for pixel, wishes, said in [
        ((60, 0), {}, "x: expected 0 to 59"),
        ((0, -1), {}, "y: expected 0 to 39"),
        ((0, 0.5), {}, "y: expected"),
        ((int(xs[0]), int(ys[0])), {"volume": other}, "hash"),
    ]:
        with pytest.raises(pumice.InputError, match=said):
            picture.pick(*pixel, **wishes)


def test_an_opened_picture_is_the_one_that_was_saved(picture, opened, scene, volume):
    _, back = opened
    for name, array in picture.passes.items():
        np.testing.assert_array_equal(back.passes[name], array, err_msg=name)
    np.testing.assert_array_equal(back.color, picture.color)
    np.testing.assert_array_equal(back.ids(), picture.ids())
    assert (back.spp, back.backend, back.error_estimate) == (4, "cpu", picture.error_estimate)
    assert np.isnan(back.seconds) and back.curve == [] and back.manifests == picture.manifests
    for path, said in [(opened[0].with_name("no.exr"), "No such file"), ("/dev/null", "ordinary file")]:
        with pytest.raises(pumice.InputError, match=said):
            pumice.open_picture(path)
    bare = opened[0].with_name("bare.exr")
    picture.save(bare, passes="none")
    for call in (lambda p: p.ids(), lambda p: p.instances(), lambda p: p.pick(0, 0), lambda p: p.matte(ids=[1])):
        with pytest.raises(pumice.InputError, match="pass"):
            call(pumice.open_picture(bare))


@pytest.mark.parametrize("view", ["standard", "agx"])
def test_display_values_are_the_bytes_of_the_png(picture, opened, scene, volume, tmp_path, view):
    fields = scene.to_dict()
    fields["film"].update(view_transform=view, passes=[], transparent=view == "agx")
    shown = pumice.render(pumice.Scene.from_dict(fields), volume, spp=4, backend="cpu")
    shown.save(tmp_path / "a.png")
    png = np.asarray(Image.open(tmp_path / "a.png"))
    assert shown.srgb().dtype == np.uint8 and png.shape == (40, 60, 4 if view == "agx" else 3)
    np.testing.assert_array_equal(shown.srgb(), png)
    if view == "agx":
        np.testing.assert_array_equal(opened[1].srgb("agx"), png)
        assert (opened[1].srgb() != png).any(), "the transform of the picture's own scene is another"
    with pytest.raises(pumice.InputError, match='view_transform: expected standard, filmic or agx, got "x"'):
        shown.srgb("x")


def test_mattes_by_id_are_those_of_an_independent_decoder(picture, opened, volume):
    path, back = opened
    decoded = Mattes(path, "ViewLayer.CryptoObject")
    ids = np.unique(picture.ids())[1:].tolist()
    for chosen in ([ids[0]], ids[:3], ids):
        expected = decoded.matte(*map(str, chosen))
        # At most four coverages of whole quarters: their sums are exact.
        np.testing.assert_array_equal(picture.matte(ids=chosen), expected)
        np.testing.assert_array_equal(back.matte(ids=chosen), expected)
        assert expected.any()
    assert (picture.matte(ids=[ids[0]]) != picture.matte(ids=[ids[1]])).any(), "each label has a matte of its own"
    np.testing.assert_array_equal(picture.matte(types=["no type"]), picture.alpha)
    assert not picture.matte(ids=[251]).any() and picture.matte(ids=[]).shape == (40, 60)
    for wishes, said in [({}, "either"), ({"ids": [1], "types": ["a"]}, "either"), ({"ids": [-1]}, "ids: expected 0"), ({"types": [1]}, "types")]:
        with pytest.raises(pumice.InputError, match=said):
            picture.matte(**wishes)
