"""Renders the references with Cycles: `python make_references.py --blender PYTHON [RUNG …]`, with the module `pumice` installed.

`PYTHON` has Blender as a module (`cargo xtask test --only blender` makes target/venv-bpy). --judge also prints the verdicts on Pumice and
on each control. Takes one to five minutes per rung on two cores.
"""

import argparse
import sys
import tempfile
import time

import by_cycles
import controls
import reference
import rung as rungs
from pumice import ReferencePicture

# Cycles takes each pair of random numbers from 256 tables. With n samples per pixel, all seeds together use only 256 n points, and the
# mean over any number of seeds keeps their error. At 32 samples this error was a fifth of the noise in a verdict; at 8 × 32, a fortieth.
TABLES = 8


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rungs", nargs="*", help="default: all rungs")
    parser.add_argument("--blender", help="a Python that has bpy; without it the checked-in references are used")
    parser.add_argument("--judge", action="store_true", help="print the verdicts on Pumice and on the controls")
    said = "number of sets of seeds, each compared with all others; 20 sets measure the rate of false alarms"
    parser.add_argument("--sets", type=int, default=2, help=said)
    parser.add_argument("--spp", type=int, help="samples per pixel of Cycles; by default eight times the rung's")
    parser.add_argument("--keep", action="store_true", help="do not write the reference")
    args = parser.parse_args()
    for name in args.rungs or rungs.names():
        with tempfile.TemporaryDirectory() as folder:
            rung = rungs.Rung(name, folder)
            if args.blender:
                made = drawn(rung, args.blender, args.sets, args.spp or TABLES * rung.spp)
                if not args.keep:
                    reference.save(name, *made)
            else:
                made = reference.load(name)
            if args.judge:
                report(rung, made[0])


def drawn(rung, blender, sets, spp):
    """Renders a rung with Cycles; returns (reference, facts about it)."""
    start = time.perf_counter()
    pictures, told = by_cycles.pictures(blender, rung, 0, sets * rung.seeds, spp=spp)
    found = reference.calibrated(pictures, rung.seeds)
    ratios = [f["ratio"] for f in found]
    about = {
        "blender": told["blender"],
        "seeds": len(pictures),
        "spp": spp,
        "digest": rung.digest,
        "false_alarms": sum(not f["agrees"] for f in found),
        "sets": len(found),
        "ratio_least": round(min(ratios), 4),
        "ratio_most": round(max(ratios), 4),
    }
    print(f"{rung.name}: {time.perf_counter() - start:.0f} s, {about}", flush=True)
    for f in found:
        if not f["agrees"]:
            print(f"    false alarm: {f['sentence']}")
    return ReferencePicture.of(pictures), about


def report(rung, made):
    start = time.perf_counter()
    found = reference.heard(lambda first, n: rung.draw(first, n), made, rung.seeds)
    print(f"{rung.name}: {found['sentence']} ({time.perf_counter() - start:.1f} s)", flush=True)
    for name in rung.fields["controls"]:
        found = made.judge(rung.draw(0, rung.seeds, scene=controls.wrong(rung.scene, name)))
        print(f"    {name}: {'NOT SEEN' if found['agrees'] else 'convicted'}: {found['sentence']}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
