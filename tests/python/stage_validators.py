"""Validators of USD stages, and what they find in files.

    newest     Pixar's own, of the usd-core of this environment
    of_2024    the ComplianceChecker of usd-core 24.3, which was the only one then
    nvidia     NVIDIA's asset validator with all its rules

Each looks at every form (the variants of the set `form`) that a stage has.
A process can have one USD alone, and NVIDIA's brings plugins, so the last two run in processes of their own. usd-core 24.3 is the folder that
USD_CORE_2024 names, or target/usd-core, where pip unpacks it once (27 MB to download, 450 MB on disk). Its wheels end with Python 3.11.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from pxr import Usd, UsdValidation

VERSION_OF_2024 = "24.3"
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", Path(__file__).resolve().parents[2] / "target"))

COMPLIANCE = """
import json, sys
from pxr import UsdUtils
found = []
for file in sys.argv[1:]:
    checker = UsdUtils.ComplianceChecker()
    checker.CheckCompliance(file)
    found.append([["", said] for said in checker.GetErrors() + checker.GetWarnings() + checker.GetFailedChecks()])
print(json.dumps(found))
"""
NVIDIA = """
import json, re, sys
from omni.asset_validator import ValidationEngine
engine = ValidationEngine(variants=True)
assert len(engine.rules) >= 40
found = []
for file in sys.argv[1:]:
    issues = engine.validate(file).issues()
    forms = ["".join(sorted(set(re.findall(r"{form=(\\w+)}", str(issue.at))))) for issue in issues]
    rules = [issue.rule.__name__ if issue.rule else "no rule" for issue in issues]
    found.append([[form, f"{rule}: {issue.message}"] for form, rule, issue in zip(forms, rules, issues)])
print(json.dumps(found))
"""


def of_stage(stage):
    """What Pixar's validators of this environment find in a stage: a text each, `validator: message`."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 30
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    return [f"{fault.GetValidator().GetMetadata().name}: {fault.GetMessage()}" for fault in found]


def newest(files):
    """What they find in each file: [form, text]. The form is empty where a stage has no variants, and where a validator does not name it."""
    return [[[form, said] for form in shown(stage) for said in of_stage(stage)] for stage in map(Usd.Stage.Open, map(str, files))]


def shown(stage):
    """The forms of a stage, one after the other, while it shows them."""
    sets = [prim.GetVariantSet("form") for prim in stage.Traverse() if prim.GetVariantSets().HasVariantSet("form")]
    for form in sorted({name for variants in sets for name in variants.GetVariantNames()}) or [""]:
        for variants in sets:
            variants.SetVariantSelection(form)
        yield form


def of_2024(files):
    """The same by usd-core 24.3; the text ends with the rule."""
    python = sys.executable if sys.version_info[:2] == (3, 11) else shutil.which("python3.11")
    assert python, f"usd-core {VERSION_OF_2024} has no wheel for Python 3.12 and later: install Python 3.11"
    return answer(python, COMPLIANCE, files, {**os.environ, "PYTHONPATH": str(usd_core_of_2024())})


def nvidia(files):
    """The same by NVIDIA's validator: the text is `rule: message`."""
    return answer(sys.executable, NVIDIA, files, None)


def answer(python, script, files, env):
    done = subprocess.run([python, "-c", script, *map(str, files)], check=True, capture_output=True, text=True, env=env)
    # Plugins may print lines before.
    return json.loads(done.stdout.splitlines()[-1])


def usd_core_of_2024():
    if chosen := os.environ.get("USD_CORE_2024"):
        return Path(chosen)
    unpacked = TARGET / "usd-core" / VERSION_OF_2024
    if not unpacked.is_dir():
        part = unpacked.parent / "part"
        shutil.rmtree(part, ignore_errors=True)
        wheel = ["--no-deps", "--only-binary", ":all:", "--python-version", "3.11", f"usd-core=={VERSION_OF_2024}"]
        pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "--no-input"]
        subprocess.run([*pip, "install", "--target", part, *wheel], check=True)
        part.rename(unpacked)
    return unpacked
