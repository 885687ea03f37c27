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


def compiled(settings, script=SCRIPT):
    """What the manager's stand-in says of a job."""
    command = [npm_package.node(), Path(__file__).with_name("flamenco_manager.js"), script]
    done = subprocess.run(command, input=json.dumps({"settings": settings}), capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def expected(job):
    parameters = {"exe": "{blender}", "exeArgs": "{blenderArgs}", "argsBefore": [], "blendfile": "{blend}"}
    return [[name, "blender", [["blender-render", {**parameters, "args": args}]]] for name, args in job["tasks"].items()]


@pytest.mark.parametrize("name", JOBS)
def test_a_job_becomes_these_commands(name):
    assert compiled(JOBS[name]["settings"])["tasks"] == expected(JOBS[name])


def test_another_script_is_convicted(tmp_path):
    """Negative control: three faults of a script, each of which the comparison sees."""
    text = SCRIPT.read_text()
    for right, wrong in [('join("..")', 'join("-")'), ('"--engine", "PUMICE"', '"--engine", "CYCLES"'), ("p.memory_limit", "p.limit")]:
        assert text.count(right) >= 1
        (tmp_path / "wrong.js").write_text(text.replace(right, wrong))
        assert compiled(JOBS["whole"]["settings"], tmp_path / "wrong.js")["tasks"] != expected(JOBS["whole"]), right


def test_every_frame_is_in_one_task_whatever_the_chunks():
    for size in (1, 2, 7, 40):
        job = compiled({**JOBS["plain"]["settings"], "frames": "3, 5-10, 47-60", "chunk_size": size})
        frames = []
        for _, _, [[_, parameters]] in job["tasks"]:
            for part in parameters["args"][-1].split(","):
                first, _, last = part.partition("..")
                frames += range(int(first), int(last or first) + 1)
        assert frames == [3, *range(5, 11), *range(47, 61)]


def test_settings_have_defaults_or_come_from_blender():
    """Nothing is left to the one who submits but the folder of pictures; Flamenco itself gives `blendfile`."""
    job = compiled(JOBS["plain"]["settings"])
    assert job["label"] == "Pumice Render"
    given = {**job["defaults"], **job["evals"]}
    assert set(job["keys"]) - set(given) == {"render_output_root", "blendfile"}
    assert [job["defaults"][key] for key in ("chunk_size", "memory_limit", "device", "samples")] == [10, 0, "node", 0]
    for expression in job["evals"].values():
        compile(expression, "eval", "eval")


def test_what_it_cannot_do_is_refused():
    with pytest.raises(RuntimeError, match="choose a file format other than FFMPEG"):
        compiled({**JOBS["plain"]["settings"], "format": "FFMPEG"})
    with pytest.raises(RuntimeError, match="needs render_output_path"):
        compiled({**JOBS["plain"]["settings"], "render_output_path": ""})
    with pytest.raises(RuntimeError, match="fps: no setting"):
        compiled({**JOBS["plain"]["settings"], "fps": 24})
