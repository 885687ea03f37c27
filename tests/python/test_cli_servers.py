"""Stores on a server, on loopback: the same files as from the folder itself, few requests, many at once, and each fault in one line."""

import json
import shutil
import socket
import subprocess

import numpy as np
import pytest
import tensorstore as ts
import zarr
from command import run
from share import one_of_today
from store_server import serving

SHAPE = (40, 36, 50)
# Of five chunks along x, so that several are under way at once.
CHUNK = (20, 18, 10)


def labels():
    """Blocks of ids, one whole chunk of background among them."""
    z, y, x = np.indices(SHAPE)
    ids = (z // 8 * 100 + y // 7 * 10 + x // 9 + 1).astype("u4")
    ids[:20, :18, :10] = 0
    return ids


def zarr_3(folder):
    zarr.create_array(folder, data=labels(), chunks=CHUNK, dimension_names=["z", "y", "x"])


def zarr_2(folder):
    zarr.create_array(folder, data=labels(), chunks=CHUNK, zarr_format=2)


def sharded_zarr(folder):
    zarr.create_array(folder, data=labels(), chunks=CHUNK, shards=(40, 36, 50), dimension_names=["z", "y", "x"])


def ome_zarr(folder):
    group = zarr.open_group(folder, mode="w", zarr_format=2)
    group.create_array("0", data=labels(), chunks=CHUNK)
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    steps = [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [2.0, 0.5, 0.5]}]}]
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": steps}]


def n5(folder):
    spec = {"driver": "n5", "kvstore": {"driver": "file", "path": str(folder)}}
    metadata = {"dimensions": SHAPE[::-1], "blockSize": CHUNK[::-1], "dataType": "uint32", "compression": {"type": "gzip"}}
    ts.open({**spec, "metadata": metadata}, create=True).result()[...] = labels().T


def precomputed(folder, sharding=None):
    spec = {"driver": "neuroglancer_precomputed", "kvstore": {"driver": "file", "path": str(folder)}}
    scale = {"size": SHAPE[::-1], "chunk_size": CHUNK[::-1], "resolution": [8, 8, 40], "voxel_offset": [3, 2, 1], "encoding": "raw"}
    if sharding:
        scale["sharding"] = {"@type": "neuroglancer_uint64_sharded_v1", "preshift_bits": 1, **sharding}
    many = {"data_type": "uint32", "num_channels": 1, "type": "segmentation"}
    ts.open({**spec, "multiscale_metadata": many, "scale_metadata": scale}, create=True).result()[...] = labels().T[..., None]
    info = json.loads((folder / "info").read_text())
    (folder / "info").write_text(json.dumps({**info, "segment_properties": "names"}))
    (folder / "names").mkdir()
    inline = {"ids": ["1", "11"], "properties": [{"id": "label", "type": "label", "values": ["one", "eleven"]}]}
    (folder / "names" / "info").write_text(json.dumps({"@type": "neuroglancer_segment_properties", "inline": inline}))


def sharded_precomputed(folder):
    bits = {"hash": "identity", "minishard_bits": 1, "shard_bits": 2}
    precomputed(folder, {**bits, "data_encoding": "gzip", "minishard_index_encoding": "gzip"})


STORES = [zarr_3, zarr_2, sharded_zarr, ome_zarr, n5, precomputed, sharded_precomputed]


def compressed(pumice, source, out, *flags, env=None):
    done = run(pumice, "compress", source, *flags, "-o", out, env=env)
    done.fine()
    return out.read_bytes(), done


@pytest.mark.parametrize("write", one_of_today(STORES), ids=lambda write: write.__name__)
def test_a_store_gives_the_same_from_a_server(pumice, tmp_path, write):
    write(tmp_path / "store")
    expected, said = compressed(pumice, tmp_path / "store", tmp_path / "a.pumice")
    with serving(tmp_path) as server:
        for kind in ("", "precomputed://" if "precomputed" in write.__name__ else ""):
            got, done = compressed(pumice, f"{kind}{server.url}/store/", tmp_path / "b.pumice")
            assert got == expected
            assert [w.split(": ", 1)[-1] for w in done.warnings] == [w.split(": ", 1)[-1] for w in said.warnings]
        local, remote = (json.loads(run(pumice, "info", s, "--json").fine()) for s in (tmp_path / "store", f"{server.url}/store"))
        same = [{k: v for k, v in told.items() if k != "warnings"} for told in (local, remote)]
        assert same[0] == same[1]


def test_a_region_asks_for_its_chunks_alone(pumice, tmp_path):
    precomputed(tmp_path / "store")
    flags = ["--roi", "0:10,0:18,20:40"]
    expected, _ = compressed(pumice, tmp_path / "store", tmp_path / "a.pumice", *flags)
    with serving(tmp_path) as server:
        got, _ = compressed(pumice, f"{server.url}/store", tmp_path / "b.pumice", *flags)
    assert got == expected
    chunks = [path for path, _ in server.asked if "_" in path.rsplit("/", 1)[-1] and path.count("-") >= 3]
    assert len(chunks) == 1, chunks
    # Each description is asked for once.
    others = [path for path, _ in server.asked if path not in chunks]
    assert len(others) == len(set(others)), others


def test_shards_are_read_in_parts(pumice, tmp_path):
    for write in (sharded_zarr, sharded_precomputed):
        shutil.rmtree(tmp_path / "store", ignore_errors=True)
        write(tmp_path / "store")
        with serving(tmp_path) as server:
            compressed(pumice, f"{server.url}/store", tmp_path / "b.pumice", "--roi", "0:10,0:18,20:40")
            of_shards = [part for path, part in server.asked if path.endswith(".shard") or "/c/" in path]
            assert of_shards and None not in of_shards
            server.fault = lambda path, tries: "whole"
            line = run(pumice, "compress", f"{server.url}/store", "-o", tmp_path / "c.pumice").refused()
            assert "the server sends whole files only" in line and not (tmp_path / "c.pumice").exists()


def test_many_chunks_are_under_way_at_once(pumice, tmp_path):
    zarr_3(tmp_path / "store")
    with serving(tmp_path) as server:
        server.delay = 0.05
        compressed(pumice, f"{server.url}/store", tmp_path / "b.pumice")
    assert 4 < server.most_at_once <= 16, server.most_at_once


def test_buckets_are_read_through_an_endpoint(pumice, tmp_path):
    precomputed(tmp_path / "bucket" / "a store")
    expected, _ = compressed(pumice, tmp_path / "bucket" / "a store", tmp_path / "a.pumice")
    with serving(tmp_path) as server:
        # The server's handler does not undo %20: it looks for this name.
        (tmp_path / "bucket" / "a%20store").symlink_to(tmp_path / "bucket" / "a store")
        for scheme, env in [("gs", "STORAGE_EMULATOR_HOST"), ("s3", "AWS_ENDPOINT_URL"), ("s3", "AWS_ENDPOINT_URL_S3")]:
            got, _ = compressed(pumice, f"{scheme}://bucket/a store", tmp_path / "b.pumice", env={env: server.url})
            assert got == expected


@pytest.mark.full
def test_what_passes_is_asked_again(pumice, tmp_path):
    zarr_3(tmp_path / "store")
    expected, _ = compressed(pumice, tmp_path / "store", tmp_path / "a.pumice")
    with serving(tmp_path) as server:
        for fault in (503, 429, "cut"):
            server.asked.clear()
            # Every fourth file fails once.
            server.fault = lambda path, tries, fault=fault: fault if sum(path.encode()) % 4 == 0 and tries == 1 else None
            got, _ = compressed(pumice, f"{server.url}/store", tmp_path / "b.pumice")
            assert got == expected and len(server.asked) > len({path for path, _ in server.asked})
        for coding in ("gzip", "zstd"):
            server.fault = lambda path, tries, coding=coding: coding
            assert compressed(pumice, f"{server.url}/store", tmp_path / "b.pumice")[0] == expected
        server.fault = lambda path, tries: "deflate"
        assert "zarr.json: the server sends the file compressed by deflate" in run(pumice, "info", f"{server.url}/store").refused()


@pytest.mark.full
def test_faults_are_one_line(pumice, tmp_path):
    zarr_3(tmp_path / "store")
    out = tmp_path / "b.pumice"
    with serving(tmp_path) as server:
        url = f"{server.url}/store"

        def line(source=url, *flags):
            said = run(pumice, "compress", source, "-o", out, *flags).refused()
            assert not out.exists()
            return said

        assert "gives none of the files that describe a store" in line(f"{server.url}/none")
        assert "without ? and #" in line(f"{url}?token=1")
        assert "raw voxels are not read from a server" in line(url, "--raw-dims", "4,4,4", "--raw-type", "u8")
        server.fault = lambda path, tries: 401
        assert f"{url}/zarr.json: the server answers 401 Unauthorized" in line()
        server.fault = lambda path, tries: 500 if "/c/0/0/3" in path else None
        assert "the server answers 500 Internal Server Error, 4 times" in line() and sum("/c/0/0/3" in p for p, _ in server.asked) == 4
        # What may not be listed is refused where it is absent, as is the chunk of background: counted, or an error by choice.
        server.fault = lambda path, tries: 403 if "/c/0/0/3" in path else None
        done = run(pumice, "compress", url, "-o", out)
        assert done.fine() and any("2 of 20 chunks are not there" in w for w in done.warnings), done
        out.unlink()
        assert "is not there" in line(url, "--missing-chunks", "error")
        server.fault = lambda path, tries: None
        (tmp_path / "store" / "c" / "0" / "0" / "4").write_bytes(b"damaged")
        assert "chunk (0, 0, 4) cannot be read" in line()
        assert "it lies on a server" in run(pumice, "render", url, "-o", tmp_path / "a.png").refused()
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        assert "the server cannot be read" in line(f"http://127.0.0.1:{closed.getsockname()[1]}/store")
    # Nobody answers in the name of what is no server of TLS.
    with serving(tmp_path) as server:
        assert "the server cannot be read" in line(f"{server.url.replace('http', 'https')}/store")


def test_a_group_is_not_searched(pumice, tmp_path):
    group = zarr.open_group(tmp_path / "a.zarr", mode="w")
    for name in ("cells", "nuclei"):
        group.create_array(name, data=labels(), chunks=CHUNK)
    with serving(tmp_path) as server:
        assert "a server does not list what a folder holds; name the array by --dataset" in run(pumice, "info", f"{server.url}/a.zarr").refused()
        expected, _ = compressed(pumice, tmp_path / "a.zarr", tmp_path / "a.pumice", "--dataset", "cells")
        assert compressed(pumice, f"{server.url}/a.zarr", tmp_path / "b.pumice", "--dataset", "cells")[0] == expected
        assert compressed(pumice, f"{server.url}/a.zarr/cells", tmp_path / "b.pumice")[0] == expected


def test_parts_and_resuming_take_servers(pumice, tmp_path):
    zarr_3(tmp_path / "store")
    expected, _ = compressed(pumice, tmp_path / "store", tmp_path / "a.pumice")
    with serving(tmp_path) as server:
        url = f"{server.url}/store"
        run(pumice, "compress", url, "--chunks", "0", "-o", tmp_path / "part").fine()
        run(pumice, "merge", tmp_path / "part", "-o", tmp_path / "m.pumice").fine()
        assert (tmp_path / "m.pumice").read_bytes() == expected
        assert compressed(pumice, url, tmp_path / "b.pumice", "--resume")[0] == expected
        # A part knows its source by what describes it.
        described = tmp_path / "store" / "zarr.json"
        described.write_text(described.read_text().replace("{", "{ ", 1))
        run(pumice, "compress", url, "--chunks", "0", "-o", tmp_path / "other").fine()
        assert "source" in run(pumice, "merge", tmp_path / "part", tmp_path / "other", "-o", tmp_path / "n.pumice").refused()


@pytest.mark.parametrize("command", [["info"], ["compress"], ["compress", "--resume"]], ids=" ".join)
def test_an_interrupt_is_heard_while_a_server_is_silent(pumice, tmp_path, command):
    """A server that takes connections and answers nothing is asked for two minutes; of a header, too, nobody has to wait for the end."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}/store"
        silent.settimeout(60.0)
        asking = []

        def interrupt(process):
            asking.append(silent.accept()[0])
            assert asking[0].recv(1000).startswith(b"GET /store/")
            process.send_signal(subprocess.signal.SIGINT)

        out = [] if command == ["info"] else ["-o", tmp_path / "b.pumice"]
        # A server counts as silent after 30 seconds.
        run(pumice, *command, url, *out, meanwhile=interrupt, limit_seconds=20).cancelled()
        asking[0].close()
    assert list(tmp_path.iterdir()) == []


def test_the_file_that_describes_a_store_stands_for_it(pumice, tmp_path):
    """As in a folder of this machine; a store of that name is still a store."""
    for write, names in ((zarr_3, ["zarr.json"]), (zarr_2, [".zarray"]), (precomputed, ["info"]), (n5, ["attributes.json"])):
        shutil.rmtree(tmp_path / "store", ignore_errors=True)
        write(tmp_path / "store")
        with serving(tmp_path) as server:
            of_folder = json.loads(run(pumice, "info", f"{server.url}/store", "--json").fine())
            for name in names:
                of_file = json.loads(run(pumice, "info", f"{server.url}/store/{name}", "--json").fine())
                assert of_file == of_folder
    (tmp_path / "store").rename(tmp_path / "info")
    with serving(tmp_path) as server:
        assert json.loads(run(pumice, "info", f"{server.url}/info", "--json").fine())["dims"] == of_folder["dims"]


def test_an_interrupt_ends_it(pumice, tmp_path):
    """While the server thinks: the answers that are under way are not waited for."""
    zarr_3(tmp_path / "store")
    with serving(tmp_path) as server:
        server.fault = lambda path, tries: server.__setattr__("delay", 1.0) if "/c/" in path else None

        def interrupt(process):
            while not any("/c/" in path for path, _ in server.asked):
                assert process.poll() is None
            process.send_signal(subprocess.signal.SIGINT)

        done = run(pumice, "compress", f"{server.url}/store", "-o", tmp_path / "b.pumice", meanwhile=interrupt)
        done.cancelled()
        assert not (tmp_path / "b.pumice").exists()
