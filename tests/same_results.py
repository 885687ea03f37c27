"""Checks whether two builds of Pumice give the same results, bit for bit, as a change that only moves code must.

    PYTHON tests/same_results.py record OLD.json --pumice OLD/target/release/pumice --labels FOLDER…
    PYTHON tests/same_results.py compare OLD.json NEW.json

PYTHON has numpy and the module `pumice` of that build. `record` writes:

    volumes    of every volume in the folders: bytes of its `.pumice` file at each level (without the header), content hash, all
               voxels, label_at
    pictures   every pass of every rung of the Cycles ladder and of VARIANTS of them on the CPU; some also on each Vulkan backend
               that works on this machine
    reports    names of the fields of `info --json`, `compress --json` and `render --json`
    shaders    the compiled shaders without names of variables

Pictures depend on the processor's instructions and on the device's driver, so record both builds on one machine. `compare` prints every
difference and exits with 1 if there is one.
"""

import argparse
import hashlib
import json
import struct
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "cycles_ladder"))

# Length of the header of a `.pumice` file, which is skipped: its version may change, and with it its checksum.
HEADER_BYTES = 64
SPP = 4
SIZE = (48, 40)
ENDINGS = (".nrrd", ".nii.gz", ".tif", ".npy", ".mha")

LIGHT = [f"{kind}_{part}" for kind in ("diffuse", "glossy", "transmission") for part in ("direct", "indirect", "color")]
ALL_PASSES = ["depth", "position", "normal", "label", "albedo", *LIGHT, "emission", "environment"]
ALL_PASSES += ["cryptomatte_label", "cryptomatte_type", "variance", "samples"]
# Rungs with changed scenes: name, rung, and a patch of the scene (RFC 7386 JSON merge patch).
VARIANTS = [
    ("ambient occlusion", "03_eight_bounces", {"settings": {"mode": "ambient_occlusion"}}),
    ("one bounce", "03_eight_bounces", {"settings": {"mode": "one_bounce"}}),
    ("cells", "03_eight_bounces", {"settings": {"lod": "cells"}}),
    ("boxes", "10_metal_and_plastic", {"settings": {"lod": "boxes"}}),
    ("by distance", "10_metal_and_plastic", {"settings": {"lod": {"distance": {"pixels": 4.0}}}}),
    ("smooth voxels", "10_metal_and_plastic", {"settings": {"smooth_voxels": True}}),
    ("roulette", "11_glass", {"settings": {"russian_roulette": True, "bounces": 32}}),
    ("clamped", "06_hdr_world", {"settings": {"clamp_direct": 0.5, "clamp_indirect": 0.5}}),
    ("transparent", "08_point_and_spot", {"film": {"transparent": True}}),
    ("all passes", "12_coat_and_sheen", {"film": {"passes": ALL_PASSES}}),
    ("all passes with a mesh", "17_floor", {"film": {"passes": ALL_PASSES}}),
    ("all passes of emission", "13_emissive", {"film": {"passes": ALL_PASSES}}),
]
ON_DEVICES = ["10_metal_and_plastic", "11_glass", "13_emissive", "17_floor", "18_cut", "cells"]


def digest(data):
    return hashlib.sha256(data).hexdigest()


def of_array(array):
    array = np.ascontiguousarray(array)
    return digest(str((array.dtype, array.shape)).encode() + array.tobytes())


def volumes(pumice_command, folders, scratch):
    import pumice

    found = {}
    files = [p for folder in folders for p in sorted(Path(folder).iterdir()) if p.name.endswith(ENDINGS)]
    for path in files:
        record = found[path.name] = {}
        for level in ("fast", "default", "small"):
            out, report = scratch / "volume.pumice", scratch / "report.json"
            args = ["compress", path, "-o", out, "--level", level, "--json", report]
            args += ["--layer", "0"] if "Overlapping" in path.name else []
            subprocess.run([pumice_command, *map(str, args)], check=True, capture_output=True)
            record[level] = digest(out.read_bytes()[HEADER_BYTES:])
        volume = pumice.open(out)
        record["content"] = volume.content_hash
        voxels = volume.decode()
        record["voxels"] = of_array(voxels)
        points = np.random.default_rng(7).integers(0, voxels.shape, (500, 3))
        record["label_at"] = [int(volume.label_at(*map(int, p))) for p in points]
        assert record["label_at"] == [int(voxels[tuple(p)]) for p in points], path
        record["compress fields"] = sorted(json.loads(report.read_text()))
        said = subprocess.run([pumice_command, "info", str(out), "--json"], check=True, capture_output=True)
        record["info fields"] = sorted(json.loads(said.stdout))
        out.unlink()
    return found


def pictures(backends, scratch):
    import pumice
    import rung

    wanted = [(name, name, {}) for name in rung.names()] + VARIANTS
    found = {}
    for name, base, patch in wanted:
        made = rung.Rung(base, scratch)
        scene = rung.merged(made.scene, patch)
        scene["film"]["width"], scene["film"]["height"] = SIZE
        scene["settings"]["seed"] = 5
        for backend in ["cpu", *(backends if name in ON_DEVICES else [])]:
            with warnings.catch_warnings():
                # Makes a failed device an error; it would fall back to another backend otherwise.
                warnings.simplefilter("error", pumice.PumiceWarning)
                picture = pumice.render(
                    pumice.Scene.from_dict(scene), made.volumes, meshes=made.meshes, spp=SPP, backend=backend
                )
            assert picture.backend == backend, (picture.backend, backend)
            planes = {"color": picture.color, "alpha": picture.alpha, **picture.passes}
            found[f"{name} by {backend}"] = {k: of_array(v) for k, v in sorted(planes.items()) if v is not None}
    return found


def report_fields(pumice_command, labels, scratch):
    out, report = scratch / "picture.exr", scratch / "render.json"
    args = ["render", labels, "-o", out, "--pick", "8", "--size", "48x32", "--spp", "2", "--backend", "cpu", "--json", report]
    subprocess.run([pumice_command, *map(str, args)], check=True, capture_output=True)
    return sorted(json.loads(report.read_text()))


def shaders():
    """Digests of the SPIR-V (Khronos, *SPIR-V Specification*, §2.3) without debug instructions such as OpName and OpSource."""
    found = {}
    for path in sorted((HERE.parent / "vulkan-renderer" / "spirv").glob("*.spv")):
        words = struct.unpack(f"<{path.stat().st_size // 4}I", path.read_bytes())
        kept, at = list(words[:5]), 5
        while at < len(words):
            length, opcode = words[at] >> 16, words[at] & 0xFFFF
            if opcode not in (2, 3, 4, 5, 6, 7, 8, 330):
                kept += words[at : at + length]
            at += length
        found[path.name] = digest(struct.pack(f"<{len(kept)}I", *kept))
    return found


def record(args):
    import pumice

    usable = [d["backend"] for d in pumice.devices() if d["usable"] and d["backend"] != "cpu"]
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        made = {
            "volumes": volumes(args.pumice, args.labels, scratch),
            "pictures": {} if args.without_pictures else pictures(sorted(set(usable)), scratch),
            "render fields": report_fields(args.pumice, HERE.parent / "data" / "platynereis_nuclei.tif", scratch),
            "shaders": shaders(),
        }
    Path(args.out).write_text(json.dumps(made, indent=1, sort_keys=True))
    print(f"{len(made['volumes'])} volumes, {len(made['pictures'])} pictures (backends: cpu {' '.join(usable)})")


def differences(old, new, at=""):
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            yield from differences(old.get(key), new.get(key), f"{at}/{key}")
    elif old != new:
        yield at


def compare(args):
    old, new = (json.loads(Path(p).read_text()) for p in (args.old, args.new))
    found = list(differences(old, new))
    for line in found:
        print(f"differs: {line}")
    print(f"{len(found)} differences, {len(list(differences(old, {})))} parts, {len(old['pictures'])} pictures")
    sys.exit(1 if found else 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    commands = parser.add_subparsers(required=True)
    of_record = commands.add_parser("record")
    of_record.add_argument("out")
    of_record.add_argument("--pumice", required=True)
    of_record.add_argument("--labels", nargs="+", required=True)
    of_record.add_argument("--without-pictures", action="store_true")
    of_record.set_defaults(run=record)
    of_compare = commands.add_parser("compare")
    of_compare.add_argument("old")
    of_compare.add_argument("new")
    of_compare.set_defaults(run=compare)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
