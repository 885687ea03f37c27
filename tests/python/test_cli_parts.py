"""Parts of a volume through the command: merged, they are the bytes of the whole volume, whatever the source, the partition and the order; what is
interrupted goes on. Negative controls: parts that do not belong together, damaged parts, sources that changed."""

import gzip
import json
import os
import random
import re
import resource
import shutil
import signal
import time
import zipfile

import numpy as np
import pytest
import tifffile
import zarr
from command import run
from share import one_of_today

# Chunks 3 × 2 × 1; the last along x and y are a few voxels wide.
SHAPE = (2053, 1030, 3)

# Sources beside a store.
OTHERS = ["rows along z", "rows along x", "pages", "stream", "layers"]


@pytest.fixture(scope="module")
def labels():
    """Labels that cross all faces of chunks, with ids beyond 2³², and one chunk with none."""
    x, y, z = np.ogrid[: SHAPE[0], : SHAPE[1], : SHAPE[2]]
    ids = ((x // 41 + y // 23 + z // 2) % 7).astype(np.uint64) * np.uint64(1_234_567_891_011)
    ids[1020:1030, :, :] = (y % 5 + 3)[0, :, :]
    ids[2048:, :1024, :] = 0
    return ids


@pytest.fixture(scope="module")
def sources(labels, tmp_path_factory):
    """The same volume in a store, in files whose voxels lie open, with z and with x as the fastest axis, in compressed pages, and in streams with x
    and with z as the fastest axis: one layer of chunks, and three."""
    folder = tmp_path_factory.mktemp("sources")
    store = zarr.create_array(folder / "a.zarr", shape=SHAPE, dtype="u8", chunks=(300, 256, 3))
    store[:] = labels
    np.save(folder / "c.npy", labels)
    np.save(folder / "f.npy", np.asfortranarray(labels))
    tifffile.imwrite(folder / "a.tif", labels.transpose(2, 1, 0), photometric="minisblack", compression="zlib")
    raw = labels.tobytes(order="F")
    (folder / "a.raw.gz").write_bytes(gzip.compress(raw, 1))
    np.savez_compressed(folder / "a.npz", labels)
    gz = ["--raw-dims", ",".join(map(str, SHAPE)), "--raw-type", "u64"]
    return {
        "store": [folder / "a.zarr", "--axes", "xyz"],
        "rows along z": [folder / "c.npy", "--axes", "xyz"],
        "rows along x": [folder / "f.npy", "--axes", "xyz"],
        "pages": [folder / "a.tif"],
        "stream": [folder / "a.raw.gz", *gz],
        "layers": [folder / "a.npz", "--axes", "xyz"],
    }


@pytest.fixture(scope="module")
def whole(pumice, sources, tmp_path_factory):
    """The bytes of the file at each level, made at once."""
    folder = tmp_path_factory.mktemp("whole")

    def at(level):
        out = folder / f"{level}.pumice"
        if not out.exists():
            run(pumice, "compress", *sources["store"], "--level", level, "-o", out).fine()
        return out.read_bytes()

    return at


@pytest.mark.parametrize("kind", ["store", *one_of_today(OTHERS)])
def test_merged_parts_are_the_whole_volume(pumice, sources, whole, tmp_path, kind):
    parts = []
    for chunks in ("0,5", "4", "1-3"):
        parts.append(tmp_path / f"{chunks}.part")
        said = run(pumice, "compress", *sources[kind], "--chunks", chunks, "-o", parts[-1]).fine()
        assert f"chunks {chunks} of 6" in said
    for level in ("default", "fast", "small") if kind == "store" else ("default",):
        out = tmp_path / f"{level}.pumice"
        report = json.loads(run(pumice, "merge", *parts[::-1], "--level", level, "-o", out, "--json", "-").fine())
        assert out.read_bytes() == whole(level)
        assert report["bytes_disk"] == out.stat().st_size and report["dims"] == list(SHAPE)


def test_parts_join_to_a_part(pumice, sources, whole, tmp_path):
    made = {}
    for chunks in ("0", "1-2", "3", "4-5", "0,3"):
        made[chunks] = tmp_path / f"{chunks}.part"
        run(pumice, "compress", *sources["store"], "--chunks", chunks, "-o", made[chunks]).fine()
    out = tmp_path / "joined.part"
    report = json.loads(run(pumice, "merge", "--part", made["3"], made["0"], "-o", out, "--json", "-").fine())
    assert out.read_bytes() == made["0,3"].read_bytes()
    assert (report["chunks"], report["of"], report["bytes_disk"]) == ("0,3", 6, out.stat().st_size)
    run(pumice, "merge", made["4-5"], out, made["1-2"], "-o", tmp_path / "out.pumice").fine()
    assert (tmp_path / "out.pumice").read_bytes() == whole("default")
    wrong = tmp_path / "wrong.part"
    assert "both have chunk 3" in run(pumice, "merge", "--part", made["3"], out, "-o", wrong).refused()
    for option in (["--level", "small"], ["--types", "a.csv"], ["--table", "a.csv"]):
        assert option[0] in run(pumice, "merge", "--part", made["0"], "-o", wrong, *option).refused()
    assert not wrong.exists()


def test_parts_that_do_not_belong_together_are_refused(pumice, sources, labels, tmp_path):
    source = sources["store"]
    paths = {name: tmp_path / name for name in ("all", "zero", "rest", "other", "roi")}
    for name, chunks in (("all", "0-5"), ("zero", "0"), ("rest", "1-5")):
        run(pumice, "compress", *source, "--chunks", chunks, "-o", paths[name]).fine()
    changed = labels.copy()
    changed[5, 5, 1] += 1
    np.save(tmp_path / "other.npy", changed)
    run(pumice, "compress", tmp_path / "other.npy", "--axes", "xyz", "--chunks", "1-5", "-o", paths["other"]).fine()
    run(pumice, "compress", *source, "--roi", ":,:,:2", "--chunks", "1-5", "-o", paths["roi"]).fine()
    out = tmp_path / "out.pumice"

    def refused(*names):
        line = run(pumice, "merge", *(paths[name] for name in names), "-o", out).refused()
        assert not out.exists()
        return line

    assert "lack 5 of the volume's 6 chunks: 1-5" in refused("zero")
    assert "both have chunk 0" in refused("all", "zero")
    assert "another source" in refused("zero", "other")
    assert "expected 2053 × 1030 × 3 voxels, got 2053 × 1030 × 2" in refused("zero", "roi")
    run(pumice, "merge", paths["rest"], paths["zero"], "-o", out).fine()
    # A part is no volume.
    assert "pumice merge" in run(pumice, "info", paths["zero"]).refused()
    assert "pumice merge" in run(pumice, "decompress", paths["zero"], "-o", tmp_path / "x.npy").refused()
    assert "expected a part" in run(pumice, "merge", out, "-o", tmp_path / "again.pumice").refused()
    # An output is no input.
    before = paths["zero"].read_bytes()
    run(pumice, "merge", paths["zero"], paths["rest"], "-o", paths["zero"]).refused()
    assert paths["zero"].read_bytes() == before


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (["--chunks", "6"], "expected numbers from 0 to 5 (3 × 2 × 1 chunks"),
        (["--chunks", "3-1"], "expected numbers of chunks such as"),
        (["--chunks", "1,0-2"], "chunk 1 comes twice"),
        (["--chunks", "0", "--level", "small"], "--level"),
        (["--chunks", "0", "--resume"], "--resume"),
        (["--resume", "--restart"], "--restart"),
    ],
)
def test_bad_requests_are_refused(pumice, sources, tmp_path, more, why):
    out = tmp_path / "out"
    assert why in run(pumice, "compress", *sources["store"], "-o", out, *more).refused()
    assert not any(tmp_path.iterdir())


def test_damaged_parts_are_refused(pumice, sources, tmp_path):
    good, bad, out = (tmp_path / name for name in ("good", "bad", "out.pumice"))
    run(pumice, "compress", *sources["store"], "--chunks", "0", "-o", good).fine()
    run(pumice, "compress", *sources["store"], "--chunks", "1-5", "-o", bad).fine()
    data = bad.read_bytes()
    rng = random.Random(5)
    for damaged in [b"", data[:50], data[: len(data) // 2], data[:-8], *(data[:at] + bytes([data[at] ^ 255]) + data[at + 1 :] for at in rng.sample(range(64, len(data) - 64), 6))]:
        bad.write_bytes(damaged)
        done = run(pumice, "merge", good, bad, "-o", out)
        # A byte between two sections decides nothing.
        assert done.code == 0 or "bad: " in done.refused()
        assert done.code == 0 or not out.exists()


def interrupted(pumice, args, moment, how):
    """Runs the command and ends it after so many seconds."""

    def end(process):
        time.sleep(moment)
        # (`Popen.send_signal` would take the exit status of a process that has ended.)
        os.kill(process.pid, how)

    return run(pumice, *args, meanwhile=end)


def goes_on(pumice, args, out, expected, moments, how):
    """Ends the command at each of some moments, then lets it go on to its end; the bytes are those of a run that was not interrupted."""
    for moment in moments:
        shutil.rmtree(f"{out}.parts", ignore_errors=True)
        out.unlink(missing_ok=True)
        done = interrupted(pumice, [*args, "--resume"], moment, how)
        if done.code != 0:
            # Killed while it removes the parts, it leaves the whole file.
            assert not out.exists() or out.read_bytes() == expected
            if how == signal.SIGINT and "kept in" in done.err:
                done.cancelled()
        run(pumice, *args, "--resume").fine()
        assert out.read_bytes() == expected, moment
        # A process that was killed may leave the file that it was writing.
        assert sorted(p.name for p in out.parent.iterdir() if not p.name.startswith(".pumice-")) == [out.name]


@pytest.mark.parametrize("kind", one_of_today(["store", "rows along z", "layers"]))
def test_what_is_killed_goes_on(pumice, sources, whole, tmp_path, kind):
    out = tmp_path / "out.pumice"
    args = ["compress", *sources[kind], "--threads", "1", "-o", out]
    start = time.monotonic()
    run(pumice, *args, "--resume").fine()
    assert out.read_bytes() == whole("default") and not os.path.exists(f"{out}.parts")
    took = time.monotonic() - start
    goes_on(pumice, args, out, whole("default"), [0.6 * took], signal.SIGKILL)
    goes_on(pumice, args, out, whole("default"), [0.4 * took], signal.SIGINT)


@pytest.mark.full
@pytest.mark.parametrize("kind", ["store", "layers"])
def test_what_is_killed_at_any_moment_goes_on(pumice, sources, whole, tmp_path, kind):
    out = tmp_path / "out.pumice"
    args = ["compress", *sources[kind], "--threads", "1", "-o", out]
    start = time.monotonic()
    run(pumice, *args, "--resume").fine()
    took = time.monotonic() - start
    rng = random.Random(11)
    goes_on(pumice, args, out, whole("default"), [took * rng.uniform(0, 1.1) for _ in range(50)], signal.SIGKILL)


@pytest.mark.full
def test_what_was_read_of_a_stream_is_kept(pumice, tmp_path):
    """Four chunks that are read together, in slabs of 256 slices: one that was read is not read again, whether the command is killed while it reads or
    while it makes parts. Damage to what is kept is named."""
    shape = (1030, 1030, 600)
    x, y, z = np.ogrid[: shape[0], : shape[1], : shape[2]]
    labels = ((x // 13 + y // 7 + z // 5) % 11 * ((x // 64 + y // 64 + z // 64) % 3 == 0)).astype(np.uint8)
    source, out = tmp_path / "a.raw.gz", tmp_path / "out.pumice"
    source.write_bytes(gzip.compress(labels.tobytes(order="F"), 1))
    del labels
    args = ["compress", source, "--raw-dims", ",".join(map(str, shape)), "--raw-type", "u8", "-o"]
    run(pumice, *args, tmp_path / "whole.pumice").fine()
    expected = (tmp_path / "whole.pumice").read_bytes()
    description, records = (tmp_path / "out.pumice.parts" / name for name in ("000000.read", "000000.records"))

    def reached():
        return json.loads(description.read_text().splitlines()[0])["reached"] if description.exists() else 0

    def killed(is_due):
        def end(process):
            deadline = time.monotonic() + 300
            while not is_due() and time.monotonic() < deadline:
                time.sleep(0.002)
            os.kill(process.pid, signal.SIGKILL)

        assert run(pumice, *args, out, "--resume", meanwhile=end).code != 0 and not out.exists()
        return reached()

    # (A slab ends with the block that reaches its end.)
    first = killed(lambda: reached() > 0)
    assert 256 <= first < 300
    data = records.read_bytes()
    records.write_bytes(data[:1000] + bytes([data[1000] ^ 1]) + data[1001:])
    line = run(pumice, *args, out, "--resume").refused()
    assert "000000.read: the file or its records are damaged; --restart removes what is there" in line
    records.write_bytes(data)
    assert 512 <= killed(lambda: reached() > first) < 600
    assert killed(lambda: any(records.parent.glob("*.part"))) == 600
    run(pumice, *args, out, "--resume").fine()
    assert out.read_bytes() == expected
    assert not records.parent.exists()


@pytest.mark.parametrize("kind", one_of_today(["store", *OTHERS]))
def test_each_part_is_that_of_one_chunk(pumice, sources, whole, tmp_path, kind):
    """Also where a layer of chunks is read at once. The command is killed once all parts are there, while it codes the voxels of all."""
    out, folder = tmp_path / "out.pumice", tmp_path / "out.pumice.parts"
    args = ["compress", *sources[kind], "-o", out, "--resume"]
    parts = [folder / f"{chunk:06}.part" for chunk in range(6)]

    def end(process):
        deadline = time.monotonic() + 60
        while not all(part.exists() for part in parts) and time.monotonic() < deadline:
            time.sleep(0.002)
        os.kill(process.pid, signal.SIGKILL)

    assert run(pumice, *args, "--level", "small", meanwhile=end).code != 0 and not out.exists()
    for chunk, part in enumerate(parts):
        alone = tmp_path / "alone.part"
        run(pumice, "compress", *sources[kind], "--chunks", str(chunk), "-o", alone).fine()
        assert part.read_bytes() == alone.read_bytes()
    # Those of some chunks are made again, whatever layers they are in; the others are not.
    stamp = parts[1].stat().st_mtime_ns
    for chunk in (0, 3, 4):
        parts[chunk].unlink()
    assert "3 of 6 parts are kept in" in run(pumice, *args, file_size_limit=500).refused()
    assert run(pumice, *args, "--level", "small", meanwhile=end).code != 0
    assert parts[1].stat().st_mtime_ns == stamp
    run(pumice, *args).fine()
    assert out.read_bytes() == whole("default") and not folder.exists()


@pytest.mark.parametrize(("kind", "kept"), [("stream", "0"), ("layers", "[024]")])
def test_a_stream_with_a_wrong_checksum_is_refused(pumice, sources, tmp_path, kind, kept):
    """It stands behind the last voxel, and is found when that is inflated, which is done ahead: layers of chunks before the last may be kept."""
    source, *args = sources[kind]
    data, bad, out = source.read_bytes(), tmp_path / source.name, tmp_path / "out.pumice"
    if kind == "layers":
        with zipfile.ZipFile(source) as archive:
            crc = archive.infolist()[0].CRC.to_bytes(4, "little")
        assert data.count(crc) == 2
        bad.write_bytes(data.replace(crc, bytes([crc[0] ^ 1]) + crc[1:]))
    else:
        bad.write_bytes(data[:-8] + bytes([data[-8] ^ 1]) + data[-7:])
    for _ in range(2):
        line = run(pumice, "compress", bad, *args, "--resume", "-o", out).refused()
        assert "damaged" in line and re.search(f"; {kept} of 6 parts are kept in", line) and not out.exists()


def test_leftovers_are_named_and_another_source_is_refused(pumice, labels, whole, tmp_path):
    source, out = tmp_path / "a.npy", tmp_path / "out.pumice"
    np.save(source, labels)
    args = ["compress", source, "--axes", "xyz", "-o", out]
    parts = tmp_path / "out.pumice.parts"
    # The second part does not fit on the disk: a limit on the size of files stands for it.
    done = run(pumice, *args, "--threads", "1", "--resume", file_size_limit=20_000)
    assert "parts are kept in" in done.refused() and not out.exists()
    assert (parts / "manifest.json").exists() and not [p for p in parts.iterdir() if p.name.startswith(".pumice-")]
    assert "--resume goes on" in run(pumice, *args).refused()
    assert "other options" in run(pumice, *args, "--roi", ":,:,1:", "--resume").refused()
    stamp = source.stat().st_mtime_ns
    os.utime(source, ns=(stamp, stamp + 10**9))
    assert "has changed since" in run(pumice, *args, "--resume").refused()
    # What somebody else put there is not removed.
    (parts / "notes.txt").write_text("mine")
    assert "notes.txt" in run(pumice, *args, "--restart").refused()
    (parts / "notes.txt").unlink()
    run(pumice, *args, "--restart").fine()
    assert out.read_bytes() == whole("default") and not parts.exists()
