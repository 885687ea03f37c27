"""Tests backends: what `devices` lists, what `--backend` accepts and refuses, and that every backend renders the same picture.

`cargo xtask test` provides a Vulkan device that computes on the CPU (target/mesa). Without any device these tests fail.
"""

import ctypes.util
import json
import os
import signal
import subprocess
import sys
import time

import pytest
from command import run
from share import one_of_today

VULKAN = ["vulkan-rt", "vulkan-query", "vulkan-compute"]
LOADER = "PUMICE_VULKAN_LOADER"


def devices(pumice, **env):
    listed = json.loads(run(pumice, "devices", "--json", env=env).fine())["devices"]
    assert sum(d["chosen"] for d in listed) == 1 and all(d["reason"] and d["device"] for d in listed)
    return listed


@pytest.fixture
def without(tmp_path):
    """Pairs of environment variables with which Vulkan does not start, and the expected reason."""
    (tmp_path / "letter.so").write_text("Dear loader,")
    (tmp_path / "icd.json").write_text("{")
    no_driver = {"VK_DRIVER_FILES": str(tmp_path / "none.json"), "VK_ICD_FILENAMES": str(tmp_path / "none.json")}
    bad_driver = {"VK_DRIVER_FILES": str(tmp_path / "icd.json"), "VK_ICD_FILENAMES": str(tmp_path / "icd.json")}
    other = ctypes.util.find_library("m")
    assert other is not None
    return [
        ({LOADER: str(tmp_path / "nowhere.so")}, "no Vulkan here: no loader ("),
        ({LOADER: str(tmp_path / "letter.so")}, "no Vulkan here: no loader ("),
        ({LOADER: other}, "no Vulkan here: no loader ("),
        (no_driver, "no Vulkan here: "),
        (bad_driver, "no Vulkan here: "),
    ]


@pytest.fixture(scope="module")
def volume(pumice, data, tmp_path_factory):
    path = tmp_path_factory.mktemp("volume") / "ct.pumice"
    run(pumice, "compress", data / "slicer_Segmentation.seg.nrrd", "-o", path).fine()
    return path


def test_without_vulkan_the_cpu_is_there_and_says_why(pumice, without, volume, tmp_path):
    size = ["--size", "16x12", "--spp", 1]
    for env, why in without:
        (cpu,) = devices(pumice, **env)
        assert cpu["backend"] == "cpu" and cpu["chosen"] and why in cpu["reason"], (env, cpu)
        text = run(pumice, "devices", env=env).fine()
        assert cpu["reason"] in text and len(text.splitlines()) == 2
        line = run(pumice, "render", volume, "-o", tmp_path / "o.png", "--backend", "vulkan-rt", *size, env=env).refused()
        assert line.startswith("pumice: backend vulkan-rt: ") and why in line, line
        assert not (tmp_path / "o.png").exists()
        for backend in ["auto", "cpu"]:
            run(pumice, "render", volume, "-o", tmp_path / "o.png", "--backend", backend, *size, env=env).fine()
        (tmp_path / "o.png").unlink()


def test_a_device_is_listed_with_each_backend(pumice):
    listed = devices(pumice)
    software = [d for d in listed if d["kind"] == "software"]
    assert [d["backend"] for d in software[:3]] == VULKAN, "cargo xtask test provides a software device"
    for d in software:
        assert not d["chosen"] and "computes on the CPU: auto prefers our own CPU path tracer" in d["reason"]
        assert d["usable"] and d["driver"].startswith("Vulkan 1.")
    for d in listed:
        # Devices that nobody has tried say so. The CPU, software devices, and two backends on a card of NVIDIA's have been tried.
        on_nvidia = "NVIDIA" in d["device"] and d["backend"] != "vulkan-query"
        tried = d["kind"] in ("software", "cpu") or not d["usable"] or on_nvidia
        assert ("not yet run on hardware" in d["reason"]) != tried, d
    # Without a graphics processor the CPU is chosen.
    if all(d["kind"] in ("software", "cpu") for d in listed):
        assert [d["backend"] for d in listed if d["chosen"]] == ["cpu"]
    text = run(pumice, "devices").fine()
    assert all(d["reason"] in text and d["device"] in text for d in listed)
    assert len([line for line in text.splitlines() if line.startswith("  *")]) == 1


def test_backends_that_are_not_here_are_refused(pumice, volume, tmp_path):
    for name, what in [
        ("abacus", "no such backend; expected auto, cpu, vulkan-rt"),
        ("cpu:0", "no such backend"),
        ("", "no such backend"),
        ("vulkan-rt:99", "no such device; here are 0 "),
        ("vulkan-rt:a card that was sold", "no such device"),
        ("vulkan-rt:", "device"),
        ("vulkan-rt:-1", "no such device"),
    ]:
        done = run(pumice, "render", volume, "-o", tmp_path / "o.png", "--size", "8x8", "--spp", 1, "--backend", name)
        line = done.refused()
        assert line.startswith(f"pumice: backend {name}: ") and what in line, line
    assert list(tmp_path.iterdir()) == []


def picture(pumice, volume, path, backend, *more, bounces=2, env=None):
    args = ["--size", "64x48", "--bounces", bounces, "--backend", backend, *more]
    run(pumice, "render", volume, "-o", path, *args, "--json", path.with_suffix(".json"), env=env).fine()
    return json.loads(path.with_suffix(".json").read_text())


def chance(pumice, a, b, tmp_path):
    run(pumice, "compare", a, b, "--json", tmp_path / "chance.json").fine()
    return json.loads((tmp_path / "chance.json").read_text())["chance"]


# (Compiling takes a minute on a CPU.)
@pytest.mark.parametrize("backend", [b for turn in one_of_today([t for b in VULKAN for t in ([], [b])]) for b in turn])
def test_every_backend_draws_the_picture_of_the_cpu(pumice, volume, tmp_path, backend):
    number = next(d["number"] for d in devices(pumice) if d["backend"] == backend and d["kind"] == "software")
    cache = {"PUMICE_CACHE": str(tmp_path / "cache")}
    gpu, cpu = tmp_path / "gpu.exr", tmp_path / "cpu.exr"
    report = picture(pumice, volume, gpu, f"{backend}:{number}", "--spp", 32, "--seed", 1, env=cache)
    assert (report["backend"], report["notices"], report["spp"]) == (backend, [], 32)
    assert report["device"] and report["curve"]
    # All parts on the device; the driver's own hierarchy is listed separately.
    parts = report["bytes"]
    assert all(parts[p] > 0 for p in ("boxes", "nodes", "leaves", "labels", "materials", "film")), parts
    # Ray tracing finds bricks through a hierarchy; compute shaders need none.
    assert parts["bricks"] > 0 and (parts["acceleration"] > 0) == (backend != "vulkan-compute"), parts
    assert parts["acceleration"] == report["acceleration_bytes"]
    [kept] = (tmp_path / "cache" / "pipelines").iterdir()
    assert kept.suffix == ".pipelines"
    if backend == "vulkan-compute":
        # Whoever names a backend that did not come back has it tried again, and the marks removed.
        for kind in ("1-0.unfinished", "2-0.unfinished", "3-0.hung"):
            kept.with_suffix(f".{backend}.{kind}").touch()
        picture(pumice, volume, tmp_path / "again.exr", f"{backend}:{number}", "--spp", 1, env=cache)
        assert list(kept.parent.iterdir()) == [kept]
    # With another seed, the two pictures are independent estimates and may differ only by chance.
    picture(pumice, volume, cpu, "cpu", "--spp", 32, "--seed", 2)
    found = chance(pumice, gpu, cpu, tmp_path)
    assert found["tests"] > 100 and found["rejected"] == 0, found
    assert all(abs(z) <= 4 for z in found["mean_difference_in_standard_errors"]), found
    # Negative control: the test detects a picture without bounces.
    picture(pumice, volume, cpu, "cpu", "--spp", 32, "--seed", 2, bounces=0)
    assert chance(pumice, gpu, cpu, tmp_path)["rejected"] > 0
    # A picture carries all that is needed to render it again by the same backend.
    run(pumice, "render", "--again", gpu, "-o", tmp_path / "again.exr", env=cache).fine()
    assert (tmp_path / "again.exr").read_bytes() == gpu.read_bytes()
    # If that backend is missing, the error says so, and another backend can be selected.
    gone = {LOADER: str(tmp_path / "nowhere.so")}
    line = run(pumice, "render", "--again", gpu, "-o", tmp_path / "o.exr", env=gone).refused()
    assert "drawn by a backend that is not available here" in line and "no Vulkan here" in line
    run(pumice, "render", "--again", gpu, "-o", tmp_path / "o.exr", "--backend", "cpu", env=gone).fine()


# Creates a Vulkan instance with the structure type `sys.argv[1]`, of which 1 is valid: the shortest way to make an invalid call.
INSTANCE = """
import ctypes, sys
words = (ctypes.c_uint32 * 16)(int(sys.argv[1]))
vulkan = ctypes.CDLL(sys.argv[2])
assert vulkan.vkCreateInstance(ctypes.byref(words), None, ctypes.byref(ctypes.c_void_p())) == 0
"""


def test_every_call_is_checked(pumice):
    """The tests run with the validation layer, which ends a process at its first message."""
    loaded = 'Insert instance layer "VK_LAYER_KHRONOS_validation"'
    for env, expected in [({}, True), ({"VK_INSTANCE_LAYERS": ""}, False)]:
        done = run(pumice, "devices", env={"VK_LOADER_DEBUG": "layer", **env})
        assert (loaded in done.err) == expected, done.err
    loader = os.environ.get(LOADER, "libvulkan.so.1")
    for kind, layers, code in [("1", None, 0), ("77", None, -signal.SIGTRAP), ("77", "", 0)]:
        env = dict(os.environ) if layers is None else {**os.environ, "VK_INSTANCE_LAYERS": layers}
        done = subprocess.run([sys.executable, "-c", INSTANCE, kind, loader], env=env, capture_output=True, text=True)
        assert done.returncode == code, (kind, layers, done)
        assert ("VUID-VkInstanceCreateInfo-sType" in done.stdout) == (code != 0), done


def aborts_at_a_normal_end(folder):
    """A library that aborts the process that has loaded it when that ends as processes do, by `exit`."""
    source, library = folder / "end.c", folder / "end.so"
    source.write_text("#include <stdlib.h>\n__attribute__((destructor)) static void end(void) { abort(); }\n")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True)
    return library


def test_a_normal_end_is_seen(pumice, tmp_path):
    """The control of the test below."""
    env = {"LD_PRELOAD": str(aborts_at_a_normal_end(tmp_path))}
    assert run(pumice, "--version", env=env, meanwhile=lambda process: None).code == -signal.SIGABRT


def test_an_interrupt_does_not_wait_for_a_compiler(pumice, volume, tmp_path):
    """Nor does it count against the backend that its driver was still compiling, even where a second interrupt ends the
    process at once, in the middle of the first one's end."""
    command = ["render", volume, "--size", "64x48", "--spp", "1", "--backend", "vulkan-compute", "-o", tmp_path / "no.exr"]
    env = {"PUMICE_CACHE": str(tmp_path / "cache"), "MESA_SHADER_CACHE_DISABLE": "true"}
    # At a normal end the driver would take memory away that its compiler uses; here any normal end is seen.
    env["LD_PRELOAD"] = str(aborts_at_a_normal_end(tmp_path))

    def interrupted(times):
        def interrupt(process):
            while not list(tmp_path.rglob("*.unfinished")):
                assert process.poll() is None, "a driver compiles before there is a picture"
            for _ in range(times):
                process.send_signal(signal.SIGINT)
                time.sleep(0.0003)

        done = run(pumice, *command, env=env, meanwhile=interrupt)
        # What a driver has compiled is kept, so it has not.
        assert not list(tmp_path.rglob("*.pipelines")) and not list(tmp_path.rglob("*.unfinished"))
        return done

    interrupted(1).cancelled()
    # The second may come after the line was printed.
    said = {(done.code, done.err) for done in [interrupted(2) for _ in range(8)]}
    assert said <= {(2, ""), (2, "pumice: cancelled\n")}, said


def test_a_cache_that_cannot_be_written_is_no_error(pumice, volume, tmp_path):
    (tmp_path / "file").write_text("no folder")
    for folder in one_of_today(["", str(tmp_path / "file" / "cache")]):
        report = picture(
            pumice, volume, tmp_path / "o.exr", "vulkan-compute", "--spp", 1, env={"PUMICE_CACHE": folder}
        )
        assert report["notices"] == []
    assert (tmp_path / "file").read_text() == "no folder"


def test_the_demonstration_says_what_drew(pumice, data, tmp_path):
    args = ["--volume", data / "platynereis_nuclei.tif", "--out", tmp_path, "--time", "0.2", "--size", "64x48"]
    said = run(pumice, "demo", *args).out
    chosen = next(d for d in devices(pumice) if d["chosen"])
    assert f"path traced by {chosen['backend']} on {chosen['device']}: " in said
    assert f"by the backend {chosen['backend']} on {chosen['device']}: " in (tmp_path / "report.md").read_text()
