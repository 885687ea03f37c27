"""Tests every rung of the ladder (tests/cycles_ladder) on every Vulkan backend against pictures of the CPU backend, statistically as the
ladder does, and value by value. It uses fewer samples and pixels than the comparison with Cycles, because most of the time goes into
compiling for a device that computes on the CPU. Each rung compiles shaders for just what it needs.

An ordinary run takes a 28th of the pairs of rung and hardware backend, which changes daily; `--full` takes all, and compute shaders too,
which `vulkan-renderer/tests/radiance` compares with the CPU daily. Rungs whose file says that they await something are left out.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np
import pumice
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/cycles_ladder"))
import controls
import rung as rungs

BACKENDS = ["vulkan-rt", "vulkan-query", "vulkan-compute"]
DAILY = BACKENDS[:2]
SEEDS, SPP = 8, 4
# With the same samples, a value counts as differing if it is off by more than this share of itself, or of the picture's mean if that is
# larger. Rounding made at most 8e-6 (in a coat's rough lobe) on Mesa's llvmpipe.
ROUNDING = 1e-4
# Rounding may make a path take another branch, with a probability below 2⁻¹⁴ per choice (vulkan-renderer/tests/radiance). With 4 paths per
# pixel and at most some twenty choices each, that is at worst one value in 200. None was observed.
MOST_APART = 0.005


def todays():
    """Pairs (rung, backend) that PUMICE_TEST_SHARE selects: all for `full`, every Nth from K on for `K/N`."""
    which = os.environ.get("PUMICE_TEST_SHARE") or "0/16"
    names = rungs.judged()
    if which == "full":
        return [(name, backend) for name in names for backend in BACKENDS]
    day, _, days = which.partition("/")
    return turns(names, int(day), int(days))


def turns(names, day, days):
    """Every `days`th pair; pair i belongs to rung i // 2. Each `days` pairs begin with the other backend, so that a day has both."""
    pairs = [(name, DAILY[(side + i // (days // 2)) % 2]) for i, name in enumerate(names) for side in range(2)]
    return pairs[day::days]


def drawn(rung, first, seeds, backend):
    """Renders pictures (seeds, height, width, 3) in one live session, which compiles only once."""
    out = []
    settings = rung.scene["settings"]
    scene = pumice.Scene.from_dict({**rung.scene, "settings": {**settings, "seed": first}})
    with pumice.Session(scene, rung.volumes, meshes=rung.meshes, spp=SPP, backend=backend) as session:
        for seed in range(first, first + seeds):
            revision = 0 if seed == first else session.edit({"edit": "settings", "settings": {**settings, "seed": seed}})
            frame = converged(session, revision)
            picture = np.asarray(frame)[::-1].astype(np.float64)
            alpha = picture[..., 3] if rung.scene["film"].get("transparent") else None
            out.append(rungs.laid_over_white(picture[..., :3], alpha))
        assert session.status.backend == backend and session.status.notices == []
    return np.array(out, dtype=np.float64)


def converged(session, revision):
    # A limit against hangs: compiling takes seconds, on a busy machine several times that.
    end = time.monotonic() + 400
    while time.monotonic() < end:
        frame = session.latest()
        if frame is not None and frame.revision >= revision and frame.converged:
            return frame
        assert session.status.state != "failed", session.status
        time.sleep(0.01)
    raise AssertionError(session.status)


def apart(pictures, expected):
    """(share of values that differ by more than ROUNDING, largest difference)."""
    off = np.abs(pictures - expected) / np.maximum(np.abs(expected), expected.mean())
    return (off > ROUNDING).mean(), off.max()


@pytest.mark.parametrize(("name", "backend"), todays())
def test_a_rung_is_the_processors(name, backend, tmp_path):
    rung = rungs.Rung(name, tmp_path)
    for side in ("width", "height"):
        rung.scene["film"][side] //= 2
    # Live pictures have no passes. Without the shadow-catcher pass, caught shadows are in the picture. (The pass itself is compared in
    # vulkan-renderer/tests/radiance/catchers.rs.)
    rung.scene["film"].pop("passes", None)
    pictures = drawn(rung, 0, SEEDS, backend)

    # Other seeds are compared statistically, as with Cycles.
    truth = pumice.ReferencePicture.of(rung.draw(1000, 8 * SEEDS, spp=SPP))
    found = truth.judge(pictures)
    if not found["agrees"]:
        found = truth.judge(drawn(rung, SEEDS, 4 * SEEDS, backend))
    assert found["agrees"], found

    # The same seeds give the same samples, which are compared value by value.
    share, worst = apart(pictures, rung.draw(0, SEEDS, spp=SPP))
    print(f"{name} on {backend}: {found['sentence']}; {share:.2e} of values apart, worst {worst:.1e}")
    assert share <= MOST_APART, (share, worst)

    # Controls: other samples and each fault of the rung are detected.
    share, _ = apart(pictures, rung.draw(1, SEEDS, spp=SPP))
    assert share > 2 * MOST_APART, share
    for fault in rung.fields["controls"]:
        share, _ = apart(pictures, rung.draw(0, SEEDS, spp=SPP, scene=controls.wrong(rung.scene, fault)))
        print(f"    {fault}: {share:.3f} of values apart")
        assert share > 2 * MOST_APART, (fault, share)


def test_each_day_draws_on_both_and_all_days_draw_all_on_both():
    names = [str(i) for i in range(20)]
    each = [turns(names, day, 16) for day in range(16)]
    assert all({backend for _, backend in day} == set(DAILY) for day in each)
    drawn = [pair for day in each for pair in day]
    assert len(drawn) == len(set(drawn)) == 40
    # The pairs of a day belong to different rungs.
    assert all(len({name for name, _ in day}) == len(day) for day in each)
