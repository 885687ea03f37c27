# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the images of a comparison with Cycles: their pixels, that the next comparison replaces them, and that an editor shows them. What a
comparison puts into them is tested in test_bridge.py."""

import numpy as np
import pytest


@pytest.fixture
def verify_maps(blender, extension):
    return extension.verify_maps


def arrays(verify_maps, height, width, seed):
    """Arrays as of `pumice.verify_render`, some numbers of which are negative or large."""
    random = np.random.default_rng(seed)
    return {key: (5 * random.normal(size=(height, width, 3))).astype(np.float32) for key, _, _ in verify_maps.MAPS}


def pixels(image):
    width, height = image.size
    values = np.empty(4 * width * height, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)


def test_images_have_the_numbers_and_are_replaced(blender, verify_maps):
    assert not verify_maps.are_kept()
    for height, width, seed in [(5, 9, 1), (5, 9, 2), (6, 4, 3)]:
        maps = arrays(verify_maps, height, width, seed)
        verify_maps.keep(maps)
        assert verify_maps.are_kept() and len(blender.data.images) == len(maps) == 7
        for key, title, _ in verify_maps.MAPS:
            image = blender.data.images[f"Pumice verify: {title}"]
            assert image.is_float and tuple(image.size) == (width, height)
            # Blender's row 0 is at the bottom.
            assert np.array_equal(pixels(image)[::-1, :, :3], maps[key]) and (pixels(image)[..., 3] == 1).all()
    assert blender.data.images["Pumice verify: difference"].colorspace_settings.is_data


def test_images_stay_in_a_saved_file(blender, verify_maps, tmp_path):
    maps = arrays(verify_maps, 5, 9, 4)
    verify_maps.keep(maps)
    difference = blender.data.images["Pumice verify: difference"]
    difference.use_fake_user = True
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    blender.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    difference = blender.data.images["Pumice verify: difference"]
    assert np.array_equal(pixels(difference)[::-1, :, :3], maps["difference"])


def test_an_editor_shows_the_chosen_map(blender, verify_maps):
    with pytest.raises(RuntimeError, match="no such image"):
        blender.ops.pumice.show_verify_map(which="flip_color")
    verify_maps.keep(arrays(verify_maps, 5, 9, 5))
    # Without a window none can be opened, and there is no Image Editor yet.
    with pytest.raises(RuntimeError, match="no Image Editor is open"):
        blender.ops.pumice.show_verify_map(which="flip_color")
    area = blender.context.window_manager.windows[0].screen.areas[0]
    area.ui_type = "UV"
    with pytest.raises(RuntimeError, match="no Image Editor is open"):
        blender.ops.pumice.show_verify_map(which="flip_color")
    area.ui_type = "IMAGE_EDITOR"
    for which, title in [("flip_color", "FLIP"), ("difference_color", "difference in color")]:
        assert blender.ops.pumice.show_verify_map(which=which) == {"FINISHED"}
        assert area.spaces.active.image == blender.data.images[f"Pumice verify: {title}"]
    # The next comparison replaces what the editor shows.
    verify_maps.keep(arrays(verify_maps, 6, 4, 6))
    assert area.spaces.active.image == blender.data.images["Pumice verify: difference in color"]
    assert tuple(area.spaces.active.image.size) == (4, 6)
