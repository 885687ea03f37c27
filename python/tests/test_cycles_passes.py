"""Tests passes of light against Cycles': tests/cycles_ladder/pass_reference.py documents the comparison, docs/passes.md the differences.

Cycles' passes are checked in as means of tiles with their variances, so this needs no Blender.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/cycles_ladder"))
import pass_reference
import rung as rungs
from share import one_of_today

SEEDS = 12
# Kinds of light that are present in each rung.
SEEN = {
    "10_metal_and_plastic": ["diffuse_color", "diffuse_direct", "diffuse_indirect", "environment", "glossy_direct", "glossy_indirect"],
    "11_glass": ["environment", "glossy_direct", "glossy_indirect", "transmission_indirect"],
    "12_coat_and_sheen": ["diffuse_color", "diffuse_direct", "diffuse_indirect", "environment", "glossy_direct", "glossy_indirect"],
    "13_emissive": ["diffuse_color", "diffuse_direct", "diffuse_indirect", "emission", "environment"],
}
# Factor of brightness that must be detected, where it is not the usual 2 %, or 5 % for the noisier indirect light. Clear glass reflects
# little light, and after further surfaces only a thousandth of the picture's, from a small bright window.
NOISIER = {("11_glass", "glossy_direct"): 1.05, ("11_glass", "glossy_indirect"): 1.2}


@pytest.fixture(scope="module", params=one_of_today(pass_reference.RUNGS))
def drawn(request, tmp_path_factory):
    """(name, pictures by kind, reference) of a rung."""
    rung = rungs.Rung(request.param, tmp_path_factory.mktemp("rung"))
    reference = pass_reference.load(rung.name)
    assert reference[2]["digest"] == rung.digest, "the rung has changed: make its reference again with make_pass_references.py"
    assert reference[2]["kinds"] == list(pass_reference.KINDS)
    return rung.name, pass_reference.drawn(rung, 0, SEEDS), reference


def test_passes_are_cycles(drawn):
    name, pictures, reference = drawn
    there = [kind for kind, light in zip(pass_reference.KINDS, reference[0]) if light.any()]
    assert sorted(there) == SEEN[name]
    found = pass_reference.judge(pictures, reference)
    print(found)
    assert pass_reference.guilty(found) == [], found


def test_faults_are_convicted(drawn):
    """Each kind of light made a little brighter must be detected in that kind and no other; swapped kinds must be detected too."""
    name, pictures, reference = drawn
    for kind in SEEN[name]:
        factor = NOISIER.get((name, kind), 1.05 if "indirect" in kind else 1.02)
        faulty = pictures.copy()
        faulty[:, pass_reference.KINDS.index(kind)] *= factor
        found = pass_reference.judge(faulty, reference)
        assert pass_reference.guilty(found) == [kind], (kind, found)
    pair = [pass_reference.KINDS.index(kind) for kind in SEEN[name] if "direct" in kind][:2]
    faulty = pictures.copy()
    faulty[:, pair] = faulty[:, pair[::-1]]
    assert pass_reference.guilty(pass_reference.judge(faulty, reference)) == sorted(pass_reference.KINDS[i] for i in pair)


def test_other_seeds_of_cycles_are_not_convicted():
    """Pictures that agree pass: skewed noise about a gradient, as a path tracer's, with black areas."""
    random = np.random.default_rng(3)
    mean = np.linspace(0.0, 1.0, 24)[None, None, None, :, None].clip(0.3) - 0.3
    noise = lambda n: mean * random.exponential(size=(n, len(pass_reference.KINDS), 16, 24, 3))  # noqa: E731
    parts = pass_reference.of_seeds(noise(400))
    reference = parts.mean(axis=0), parts.var(axis=0, ddof=1) / 400, {"seeds": 400}
    guilty = sum(bool(pass_reference.guilty(pass_reference.judge(noise(SEEDS), reference))) for _ in range(60))
    # At 1 % each, 4 or more false alarms in 60 occur once in 300.
    assert guilty < 4, guilty
