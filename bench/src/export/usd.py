"""Pixar's library beside Pumice: `pumice bench export` runs it once for each task. The request is a JSON file with `task` and `report`:

    packages   reports the library's version, or what is missing
    arrays     reads the composed stage `stage`, writes the arrays of its surface or instancer as files into `folder`, and ARRAYS.json,
               which describes them (bench/openusd/src/main.rs draws it)
    write      reads those arrays into numpy, then writes `out` through Vt's FromNumpy and a Usd.Stage: that is measured, with the file
               synced
    check      compares what the stage `out` has with the arrays; `differing` names the first attribute that differs

Materials and notes of the volume are left out of the arrays: they do not grow with the faces.
"""

import importlib.metadata
import json
import os
import pathlib
import resource
import sys
import time

try:
    import numpy as np
    from pxr import Sdf, Usd, UsdGeom, Vt
except ImportError as error:
    print(error)
    np = None

ARRAYS = {"int[]", "float3[]", "point3f[]", "color3f[]", "normal3f[]"}
WRITTEN = {"Xform", "Scope", "Mesh", "PointInstancer", "GeomSubset"}


def peak_rss_bytes():
    with open("/proc/self/status") as status:
        return 1024 * int(next(line for line in status if line.startswith("VmHWM:")).split()[1])


def clocked(work):
    """Wall seconds and CPU seconds of all threads of work()."""

    def cpu():
        used = resource.getrusage(resource.RUSAGE_SELF)
        return used.ru_utime + used.ru_stime

    wall, before = time.monotonic(), cpu()
    work()
    return {"seconds": time.monotonic() - wall, "cpu_seconds": cpu() - before}


def attributes_of(prim, folder, count):
    """The arrays and tokens of a prim."""
    for attribute in prim.GetAuthoredAttributes():
        name, kind = attribute.GetName(), str(attribute.GetTypeName())
        value = attribute.Get()
        described = {"name": name, "type": kind, "uniform": attribute.GetVariability() == Sdf.VariabilityUniform}
        described["interpolation"] = attribute.GetMetadata("interpolation")
        if kind == "token":
            yield described | {"token": value}
        elif kind in ARRAYS and value is not None:
            values = np.array(value)
            sort, dtype = ("int", "<i4") if values.ndim == 1 else ("float3", "<f4")
            file = f"{next(count)}.raw"
            values.astype(dtype).tofile(folder / file)
            yield described | {"kind": sort, "file": file}


def arrays(job):
    folder, count = pathlib.Path(job["folder"]), iter(range(1 << 30))
    stage = Usd.Stage.Open(job["stage"])
    prims = []
    for prim in stage.Traverse(Usd.PrimDefaultPredicate):
        if prim.GetTypeName() not in WRITTEN or prim.GetName() == "Materials":
            continue
        relationships = [
            {"name": r.GetName(), "targets": [str(t) for t in r.GetTargets()]}
            for r in prim.GetAuthoredRelationships()
            if r.GetName() == "prototypes"
        ]
        prims.append({
            "path": str(prim.GetPath()),
            "type": str(prim.GetTypeName()),
            "children": [c.GetName() for c in prim.GetChildren() if c.GetTypeName() in WRITTEN and c.GetName() != "Materials"],
            "attributes": list(attributes_of(prim, folder, count)),
            "relationships": relationships,
        })
    described = {"default_prim": stage.GetDefaultPrim().GetName(), "prims": prims}
    (folder / "ARRAYS.json").write_text(json.dumps(described))
    return {}


def loaded(attribute, folder):
    """The array of an attribute; none where it has a token."""
    if "file" not in attribute:
        return None
    values = np.fromfile(folder / attribute["file"], "<i4" if attribute["kind"] == "int" else "<f4")
    return values if attribute["kind"] == "int" else values.reshape(-1, 3)


def stage_of(described, values, out):
    """Writes a stage with the values of all attributes, in their order."""
    stage = Usd.Stage.CreateNew(out)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    for prim in described["prims"]:
        made = stage.DefinePrim(prim["path"], prim["type"])
        for attribute in prim["attributes"]:
            kind = Sdf.ValueTypeNames.Find(attribute["type"])
            variability = Sdf.VariabilityUniform if attribute["uniform"] else Sdf.VariabilityVarying
            authored = made.CreateAttribute(attribute["name"], kind, False, variability)
            array = next(values)
            if array is None:
                authored.Set(attribute["token"])
            else:
                authored.Set((Vt.IntArray if attribute["kind"] == "int" else Vt.Vec3fArray).FromNumpy(array))
            if attribute["interpolation"]:
                authored.SetMetadata("interpolation", attribute["interpolation"])
        for relationship in prim["relationships"]:
            made.CreateRelationship(relationship["name"], False).SetTargets([Sdf.Path(t) for t in relationship["targets"]])
    stage.SetDefaultPrim(stage.GetPrimAtPath(f"/{described['default_prim']}"))
    stage.GetRootLayer().Save()
    with open(out, "rb") as file:
        os.fsync(file)


def write(job):
    described = json.loads(pathlib.Path(job["arrays"]).read_text())
    folder = pathlib.Path(job["arrays"]).parent
    values = [loaded(attribute, folder) for prim in described["prims"] for attribute in prim["attributes"]]
    took = clocked(lambda: stage_of(described, iter(values), job["out"]))
    return took | {"peak_rss_bytes": peak_rss_bytes()}


def check(job):
    described = json.loads(pathlib.Path(job["arrays"]).read_text())
    folder = pathlib.Path(job["arrays"]).parent
    stage = Usd.Stage.Open(job["out"])
    for prim in described["prims"]:
        for attribute in prim["attributes"]:
            found = stage.GetPrimAtPath(prim["path"]).GetAttribute(attribute["name"])
            expected, got = loaded(attribute, folder), found.Get() if found else None
            if expected is None:
                same = got == attribute["token"]
            else:
                got = np.array(got if got is not None else []).astype(expected.dtype).reshape(-1, *expected.shape[1:])
                same = np.array_equal(got, expected)
            if not same or found.GetMetadata("interpolation") != attribute["interpolation"]:
                return {"differing": f"{prim['path']}.{attribute['name']}"}
    return {"differing": None}


def packages(job):
    return {"version": importlib.metadata.version("usd-core") if np else None}


def main():
    job = json.loads(pathlib.Path(sys.argv[1]).read_text())
    report = {"packages": packages, "arrays": arrays, "write": write, "check": check}[job["task"]](job)
    pathlib.Path(job["report"]).write_text(json.dumps(report))


main()
