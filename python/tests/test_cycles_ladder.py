"""Tests the ladder of scenes on which Pumice must agree with Cycles (tests/cycles_ladder, docs/cycles.md).

Cycles' pictures are checked in as means and variances, so this needs no Blender. blender-addon/tests/test_cycles_ladder.py renders some
of them again each day.
"""

import sys
from pathlib import Path

import numpy as np
import pumice
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/cycles_ladder"))
import controls
import reference
import rung as rungs
from share import some_of_today


@pytest.fixture(scope="module")
def rung(request, tmp_path_factory):
    return rungs.Rung(request.param, tmp_path_factory.mktemp("rung"))


def pairs_of(names):
    return [(name, fault) for name in names for fault in rungs.described(name)["controls"]]


# A third of the rungs a day.
@pytest.mark.parametrize("rung", some_of_today(rungs.judged(), 3), indirect=True)
def test_pumice_agrees_with_cycles(rung):
    truth, about = reference.load(rung.name)
    assert about["digest"] == rung.digest, "the rung has changed: make its reference again with make_references.py"
    found = reference.heard(lambda first, seeds: rung.draw(first, seeds), truth, rung.seeds)
    print(found["sentence"])
    assert found["agrees"], found


@pytest.mark.full
@pytest.mark.parametrize(("rung", "fault"), pairs_of(rungs.judged()), indirect=["rung"])
def test_faults_are_convicted(rung, fault):
    truth, _ = reference.load(rung.name)
    found = truth.judge(rung.draw(0, rung.seeds, scene=controls.wrong(rung.scene, fault)))
    print(found["sentence"])
    assert not found["agrees"], found


def test_each_reference_belongs_to_a_rung_and_convicted_itself_seldom():
    assert sorted(p.stem for p in reference.FOLDER.glob("*.npz")) == rungs.judged()
    false_alarms = [reference.load(name)[1]["false_alarms"] for name in rungs.judged()]
    # At most 2 of 100 first verdicts are false alarms, so 4 or more in the 20 sets of a rung occur for 1 rung in 1,000.
    assert max(false_alarms) < 4, false_alarms
    assert sum(path.stat().st_size for path in reference.FOLDER.iterdir()) < 5_000_000


def noise(seed, seeds, offset=0.0):
    """Pictures with exponentially distributed pixels about a gradient, as skewed as those of a path tracer."""
    rng = np.random.default_rng(seed)
    mean = np.linspace(0.1, 1.0, 24)[None, :, None] * np.ones((16, 1, 3))
    return mean * (rng.exponential(size=(seeds, 16, 24, 3)) + offset)


def test_verdicts_convict_as_often_as_they_say():
    truth = pumice.ReferencePicture.of(noise(0, 2000))
    found = [truth.judge(noise(1 + i, 16)) for i in range(200)]
    guilty = sum(not f["agrees"] for f in found)
    # Two tests at 1 % each (the third fails more rarely): 4 failures are expected, and more than 12 occur once in 1,000.
    assert guilty <= 12, guilty
    # A mean that is off by less than a tenth of a pixel's noise is detected.
    assert not any(truth.judge(noise(300 + i, 16, offset=0.08))["agrees"] for i in range(20))


def test_one_wrong_tile_is_enough():
    pictures = noise(5, 16)
    truth = pumice.ReferencePicture.of(noise(0, 2000))
    assert truth.judge(pictures)["agrees"]
    pictures[:, 8:16, 8:16] *= 1.25
    found = truth.judge(pictures)
    assert found["rejected"] >= 1 and not found["agrees"]


def test_a_second_hearing_has_new_seeds():
    truth, asked = pumice.ReferencePicture.of(noise(0, 2000)), []

    def draw(first, seeds):
        asked.append((first, seeds))
        return noise(7 + first, seeds, offset=1.0)

    assert not reference.heard(draw, truth, 8)["agrees"]
    assert asked == [(0, 8), (8, 32)]


def test_merging_follows_rfc_7386():
    assert rungs.merged({"a": {"b": 1, "c": [1]}, "d": 2}, {"a": {"b": None, "c": [2, 3]}, "e": {"f": 1}}) == {
        "a": {"c": [2, 3]},
        "d": 2,
        "e": {"f": 1},
    }
