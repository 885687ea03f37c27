"""Tests Flamenco's job type `blender-addon/flamenco/pumice_render.js`: what a job compiles to, in a stand-in of Flamenco's manager.

The jobs and the commands that they must become are `blender-addon/tests/flamenco_jobs.json`, written by hand; `blender-addon/tests/test_farm.py` runs
these commands in Blender.
"""

import json
import subprocess
from pathlib import Path

import npm_package
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "blender-addon/flamenco/pumice_render.js"
JOBS = json.loads((ROOT / "blender-addon/tests/flamenco_jobs.json").read_text())


def compiled(settings, script=SCRIPT, *options):
    """What the manager's stand-in says of a job."""
    command = [npm_package.node(), Path(__file__).with_name("flamenco_manager.js"), script, *options]
    done = subprocess.run(command, input=json.dumps({"settings": settings}), capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def expected(job):
    parameters = {"exe": "{blender}", "exeArgs": "{blenderArgs}", "argsBefore": [], "blendfile": "{blend}"}
    tasks = zip(job["tasks"].items(), job["steps"], strict=True)
    return [[name, "blender", [["blender-render", {**parameters, "args": args}, steps]]] for (name, args), steps in tasks]


@pytest.mark.parametrize("name", JOBS)
def test_a_job_becomes_these_commands(name):
    assert compiled(JOBS[name]["settings"])["tasks"] == expected(JOBS[name])


def test_another_script_is_convicted(tmp_path):
    """Negative control: five faults of a script, each of which the comparison sees."""
    text = SCRIPT.read_text()
    faults = [('join("..")', 'join("-")'), ('"--engine", "PUMICE"', '"--engine", "CYCLES"'), ("p.memory_limit", "p.limit")]
    faults += [("render.use_overwrite = ", ""), ("parameters, steps)", "parameters)")]
    for right, wrong in faults:
        assert text.count(right) >= 1
        (tmp_path / "wrong.js").write_text(text.replace(right, wrong))
        assert compiled(JOBS["whole"]["settings"], tmp_path / "wrong.js")["tasks"] != expected(JOBS["whole"]), right


def test_every_frame_is_in_one_task_whatever_the_chunks():
    for size in (1, 2, 7, 40):
        job = compiled({**JOBS["plain"]["settings"], "frames": "3, 5-10, 47-60", "chunk_size": size})
        frames = []
        for _, _, [[_, parameters, steps]] in job["tasks"]:
            before = len(frames)
            for part in parameters["args"][-1].split(","):
                first, _, last = part.partition("..")
                frames += range(int(first), int(last or first) + 1)
            assert steps == len(frames) - before
        assert frames == [3, *range(5, 11), *range(47, 61)]


def test_a_manager_without_steps_gets_the_same_tasks():
    older = compiled(JOBS["whole"]["settings"], SCRIPT, "--older")["tasks"]
    assert older == [[name, kind, [[command, parameters, None]]] for name, kind, [[command, parameters, _]] in expected(JOBS["whole"])]


@pytest.mark.parametrize("frames, size, names", [
    ("1-3, 5", 3, ["1-3", "5"]),
    ("1-2,5", 3, ["1,2,5"]),
    ("5, 1-3, 2..4", 2, ["1,2", "3,4", "5"]),
    ("1-3, 5", 2.5, ["1,2", "3,5"]),
    ("1-3, 5", "3", ["1-3", "5"]),
])
def test_chunks_are_those_of_the_real_manager(frames, size, names):
    """What Flamenco 3.9-beta1 answered. Two frames in a row are a list, not a range."""
    job = compiled({**JOBS["plain"]["settings"], "frames": frames, "chunk_size": size})
    assert [name for name, *_ in job["tasks"]] == [f"render-{name}" for name in names]


def test_settings_have_defaults_or_come_from_blender():
    """Nothing is left to the one who submits but the folder of pictures; Flamenco itself gives `blendfile`."""
    job = compiled(JOBS["plain"]["settings"])
    assert job["label"] == "Pumice Render"
    given = {**job["defaults"], **job["evals"]}
    assert set(job["keys"]) - set(given) == {"render_output_root", "blendfile"}
    assert [job["defaults"][key] for key in ("chunk_size", "memory_limit", "device", "samples")] == [10, 0, "node", 0]
    for expression in job["evals"].values():
        compile(expression, "eval", "eval")


@pytest.mark.parametrize("wrong, line", [
    ({"format": "FFMPEG"}, "choose a file format other than FFMPEG"),
    ({"render_output_path": ""}, "needs render_output_path"),
    ({"frames": ""}, "empty range"),
    ({"frames": "3-1"}, "empty range"),
    ({"frames": "-3--1"}, "invalid range"),
    ({"frames": "1-3 x2"}, "invalid range"),
    ({"chunk_size": 0}, "must be positive number: 0"),
    ({"chunk_size": None}, "must be positive number: 0"),
])
def test_what_it_cannot_do_is_refused(wrong, line):
    with pytest.raises(RuntimeError, match=line):
        compiled({**JOBS["plain"]["settings"], **wrong})


def test_settings_that_it_does_not_know_are_let_alone():
    assert compiled({**JOBS["plain"]["settings"], "fps": 24})["tasks"] == expected(JOBS["plain"])
