"""Renders the references of passes with Cycles: `python make_pass_references.py --blender PYTHON [RUNG …]`, with `pumice` and scipy.

`PYTHON` has Blender as a module. --judge also compares Pumice's passes with them. Takes a minute or two per rung on two cores.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import by_cycles
import pass_reference
import rung as rungs

SEEDS, SPP = 16, 256


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rungs", nargs="*", default=pass_reference.RUNGS)
    parser.add_argument("--blender", help="a Python that has bpy; without it the checked-in references are used")
    parser.add_argument("--judge", action="store_true")
    args = parser.parse_args()
    for name in args.rungs:
        with tempfile.TemporaryDirectory() as folder:
            rung = rungs.Rung(name, folder)
            if args.blender:
                out = Path(folder) / "passes.npy"
                _, told = by_cycles.pictures(args.blender, rung, 0, SEEDS, spp=SPP, passes=str(out))
                about = {"blender": told["blender"], "spp": SPP, "digest": rung.digest}
                pictures = np.load(out)
                if not all((pictures[i] != pictures[j]).any() for i in range(SEEDS) for j in range(i)):
                    raise SystemExit(f"{name}: two seeds gave the same picture")
                pass_reference.save(name, pictures, about)
                print(f"{name}: {path_size(name)} bytes, {json.dumps(about)}", flush=True)
            if args.judge:
                found = pass_reference.judge(pass_reference.drawn(rung, 0, rung.seeds), pass_reference.load(name))
                print(f"{name}: {found}", flush=True)


def path_size(name):
    return pass_reference.path_of(name).stat().st_size


if __name__ == "__main__":
    sys.exit(main())
