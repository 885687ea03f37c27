"""Tests Cryptomatte passes: decodes them independently, and compares coverages with label counts on a finer film."""

import json

import numpy as np
import pytest
from command import run
from cryptomatte_oracle import Mattes, id_of, murmur3
from exr_planes import planes

SIZE, FINER, SPP = (30, 20), 16, 256
# Type names by id modulo 2, with characters that a manifest must escape and characters that it must not.
TYPE_OF = ('even "äß漢\\', "odd")
LABELS, TYPES = "ViewLayer.CryptoObject", "ViewLayer.CryptoAsset"


def test_the_oracle_hashes_as_the_specification_does():
    # Published values of the reference implementation, and an id whose exponent is replaced.
    assert murmur3("") == 0 and murmur3("hello") == 0x248BFA47 and murmur3("hello, world") == 0x149BBB7F
    assert murmur3("The quick brown fox jumps over the lazy dog") == 0x2E4FF723
    assert id_of("").view(np.uint32) == 0x00800000 and np.isfinite(id_of("hello"))


@pytest.fixture(scope="module")
def scene(pumice, data, tmp_path_factory):
    """(path, fields) of a scene with a box filter, of a shipped volume whose labels have types, one of them without."""
    folder = tmp_path_factory.mktemp("cryptomatte")
    (folder / "types.csv").write_text("id,type\n" + "".join(f"{i},{TYPE_OF[i % 2]}\n" for i in range(1, 7)))
    source = data / "slicer_Segmentation.seg.nrrd"
    run(pumice, "compress", source, "-o", folder / "v.pumice", "--types", folder / "types.csv").fine()
    wishes = ["--size", "x".join(map(str, SIZE)), "--spp", "1", "--save-scene", folder / "s.json"]
    run(pumice, "render", folder / "v.pumice", "-o", folder / "a.exr", *wishes).fine()
    fields = json.loads((folder / "s.json").read_text())
    fields["film"].update(filter={"box": {"width": 1.0}}, transparent=True, cryptomatte_ranks=16)
    (folder / "s.json").write_text(json.dumps(fields))
    return folder / "s.json", fields


@pytest.fixture(scope="module")
def drawn(pumice, scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("drawn") / "a.exr"
    run(pumice, "render", scene[0], "-o", out, "--spp", SPP, "--backend", "cpu", "--passes", "cryptomatte").fine()
    return out


@pytest.fixture(scope="module")
def counted(pumice, scene, tmp_path_factory):
    """Coverage of each pixel by each label: (height, width, labels), counted in the label pass of a film that is FINER times finer."""
    out = tmp_path_factory.mktemp("counted") / "a.exr"
    size = "x".join(str(s * FINER) for s in SIZE)
    run(pumice, "render", scene[0], "-o", out, "--spp", "1", "--size", size, "--backend", "cpu", "--passes", "label").fine()
    seen = planes(out)["label.index"]
    width, height = SIZE
    tiles = seen.reshape(height, FINER, width, FINER).swapaxes(1, 2).reshape(height, width, -1)
    return np.stack([(tiles == label + 1).mean(axis=-1) for label in range(int(seen.max()))], axis=-1)




def off(mattes, names, counted):
    """Root mean square of the difference, in units of the expected standard deviation of the two counts."""
    found = mattes.matte(*names)
    spread = np.sqrt(counted * (1 - counted) / SPP + (0.5 / FINER) ** 2)
    return float(np.sqrt(np.mean(((found - counted) / spread) ** 2)))


def test_coverages_are_what_is_seen(drawn, counted):
    mattes = Mattes(drawn, LABELS)
    assert mattes.said["name"] == LABELS and mattes.said["hash"] == "MurmurHash3_32"
    assert mattes.said["conversion"] == "uint32_to_float32" and mattes.ids.shape[-1] == 16
    assert {name: murmur3(name) for name in mattes.manifest} == mattes.manifest
    # The labels of this volume are 1, 2, …; the manifest may name only these.
    seen = [str(i + 1) for i in range(counted.shape[-1]) if counted[..., i].any()]
    assert len(seen) > 3 and set(mattes.manifest) <= {str(i + 1) for i in range(counted.shape[-1])}
    for name in seen:
        expected = counted[..., int(name) - 1]
        edges = ((expected > 0) & (expected < 1)).sum()
        # Stratified samples vary less than independent ones, and the finer film is off by half of its pixels at an edge.
        assert off(mattes, [name], expected) < 1, name
        # Negative control: the coverage of another label, and that of the neighbouring pixel, do not match.
        if edges > 30:
            assert off(mattes, [name], np.roll(expected, 1, axis=1)) > 2, name
            assert off(mattes, [seen[(seen.index(name) + 1) % len(seen)]], expected) > 2, name
    alpha = planes(drawn)["A"]
    assert 0 < alpha.mean() < 1 and np.abs(mattes.coverages.sum(axis=-1) - alpha).max() <= 2.0**-22
    assert (np.diff(mattes.coverages, axis=-1) <= 0).all()


def test_types_are_their_labels_together(drawn, counted):
    labels, types = Mattes(drawn, LABELS), Mattes(drawn, TYPES)
    assert set(types.manifest) <= {*TYPE_OF, "no type"} and len(types.manifest) >= 2
    names = [str(i + 1) for i in range(counted.shape[-1])]
    groups = {"no type": names[6:]}
    groups.update({TYPE_OF[odd]: [n for n in names[:6] if int(n) % 2 == odd] for odd in (0, 1)})
    for name, members in groups.items():
        # Both come from the same 256 samples, so they are equal.
        np.testing.assert_array_equal(types.matte(name), labels.matte(*members))
    assert all(types.matte(name).any() for name in TYPE_OF)


def test_fewer_ranks_keep_the_greatest(pumice, scene, drawn, tmp_path):
    fields = {**scene[1], "film": {**scene[1]["film"], "cryptomatte_ranks": 2, "passes": ["cryptomatte_label"]}}
    few = scene[0].with_name("few.json")
    few.write_text(json.dumps(fields))
    run(pumice, "render", few, "-o", tmp_path / "a.exr", "--spp", SPP, "--backend", "cpu").fine()
    few, many = Mattes(tmp_path / "a.exr", LABELS), Mattes(drawn, LABELS)
    assert few.ids.shape[-1] == 2 and not any(name.startswith(TYPES) for name in planes(tmp_path / "a.exr"))
    # Pixels that see at most four labels; there the two greatest ranks are exact.
    simple = (many.coverages > 0).sum(axis=-1) <= 4
    assert simple.mean() > 0.9 and np.array_equal(few.coverages[simple], many.coverages[simple][:, :2])
    run(pumice, "render", "--again", tmp_path / "a.exr", "-o", tmp_path / "b.exr").fine()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_threads_do_not_matter(pumice, scene, tmp_path):
    wishes = ["--spp", "5", "--backend", "cpu", "--passes", "cryptomatte"]
    for threads in (1, 3):
        run(pumice, "render", scene[0], "-o", tmp_path / f"{threads}.exr", *wishes, "--threads", threads).fine()
    assert (tmp_path / "1.exr").read_bytes() == (tmp_path / "3.exr").read_bytes()


@pytest.mark.parametrize("ranks", [0, 3, 18, -2, 6.5, "6"])
def test_ranks_that_are_none_are_refused(pumice, scene, tmp_path, ranks):
    fields = {**scene[1], "film": {**scene[1]["film"], "cryptomatte_ranks": ranks}}
    (tmp_path / "s.json").write_text(json.dumps(fields))
    line = run(pumice, "render", tmp_path / "s.json", "-o", tmp_path / "a.exr").refused()
    assert "cryptomatte_ranks" in line or "expected u32" in line or "invalid" in line, line
    assert not (tmp_path / "a.exr").exists()
