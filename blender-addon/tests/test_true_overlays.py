# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that viewports that Pumice draws are taken over, and that the artist's settings come back: on Blender's own screens, without a window.

Timers and messages do not run in background mode, so the tests call `sweep`, which they call in a window.
"""

import itertools

import pytest

from test_real_volumes import load


@pytest.fixture
def taking(extension, blender):
    blender.context.scene.render.engine = "PUMICE"
    # An empty file keeps the screens of the test before.
    for screen in blender.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                area.spaces.active.shading.type = "SOLID"
    yield load(extension, "true_overlays")
    load(extension, "true_overlays").sweep(gives_all_back=True)


def view(bpy, place=0):
    """(screen, area, space) of a 3D viewport in the window."""
    screen = bpy.context.window_manager.windows[0].screen
    area = [area for area in screen.areas if area.type == "VIEW_3D"][place]
    return screen, area, area.spaces.active


def flags_of(taking, space):
    return {flag: getattr(space.overlay, flag) for flag in taking.FLAGS}


def wish(taking, space, **flags):
    for flag in taking.FLAGS:
        setattr(space.overlay, flag, flags.get(flag, False))


def test_what_is_decided_for_every_state(taking):
    off = dict.fromkeys(taking.FLAGS, False)
    for values in itertools.product((False, True), repeat=len(taking.FLAGS)):
        mine = dict(zip(taking.FLAGS, values))
        # Taken at first: Blender's are off, the artist's are kept. Then it stays so, and is given back.
        assert taking.decided(mine, None, True) == (off, mine)
        assert taking.decided(off, mine, True) == (off, mine)
        assert taking.decided(off, mine, False) == (mine, None)
        assert taking.decided(mine, None, False) == (mine, None), "what is not taken stays"
        for flag in taking.FLAGS:
            # A click on Blender's own box.
            assert taking.decided({**off, flag: True}, mine, True) == (off, {**mine, flag: not mine[flag]})
        both = {**off, "show_floor": True, "show_axis_z": True}
        assert taking.decided(both, mine, True) == (off, {**mine, "show_floor": True, "show_axis_z": True})


def test_a_viewport_is_taken_in_rendered_shading_alone(taking, blender):
    screen, _, space = view(blender)
    wish(taking, space, show_floor=True, show_axis_y=True, show_outline_selected=True)
    mine = flags_of(taking, space)
    taking.sweep()
    assert flags_of(taking, space) == mine and taking.wishes_of(space) is None
    space.shading.type = "RENDERED"
    taking.sweep()
    assert not any(flags_of(taking, space).values())
    entry = taking.wishes_of(space)
    assert {flag: getattr(entry, flag) for flag in taking.FLAGS} == mine
    taking.sweep()
    assert not any(flags_of(taking, space).values()) and len(screen.pumice_overlays) == 1, "once"
    for leave, back in (
        (lambda: setattr(space.shading, "type", "SOLID"), lambda: setattr(space.shading, "type", "RENDERED")),
        (lambda: setattr(space.shading, "type", "MATERIAL"), lambda: setattr(space.shading, "type", "RENDERED")),
        (
            lambda: setattr(blender.context.scene.render, "engine", "BLENDER_WORKBENCH"),
            lambda: setattr(blender.context.scene.render, "engine", "PUMICE"),
        ),
    ):
        leave()
        taking.sweep()
        assert flags_of(taking, space) == mine and len(screen.pumice_overlays) == 0
        back()
        taking.sweep()
        assert not any(flags_of(taking, space).values())
    entry = taking.wishes_of(space)
    entry.show_floor, entry.show_ortho_grid = False, True
    space.shading.type = "SOLID"
    taking.sweep()
    assert flags_of(taking, space) == {**mine, "show_floor": False, "show_ortho_grid": True}, "what was switched meanwhile counts"


def test_a_click_on_blenders_own_box_changes_the_wish(taking, blender):
    _, _, space = view(blender)
    wish(taking, space, show_floor=True)
    space.shading.type = "RENDERED"
    taking.sweep()
    space.overlay.show_axis_x = True
    taking.sweep()
    assert not space.overlay.show_axis_x and taking.wishes_of(space).show_axis_x
    space.overlay.show_floor = True
    taking.sweep()
    assert not space.overlay.show_floor and not taking.wishes_of(space).show_floor


def test_an_area_that_shows_another_editor_is_given_back(taking, blender):
    _, area, space = view(blender)
    wish(taking, space, show_floor=True)
    space.shading.type = "RENDERED"
    taking.sweep()
    assert not space.overlay.show_floor
    area.type = "IMAGE_EDITOR"
    taking.sweep()
    area.type = "VIEW_3D"
    assert area.spaces.active.overlay.show_floor
    taking.sweep()
    assert not area.spaces.active.overlay.show_floor


def test_a_file_has_the_artists_settings(taking, blender, tmp_path, monkeypatch):
    _, _, space = view(blender)
    wish(taking, space, show_axis_x=True, show_outline_selected=True)
    space.shading.type = "RENDERED"
    taking.sweep()
    seen = []
    blender.app.handlers.save_post.append(lambda *_: seen.append(flags_of(taking, view(blender)[2])))
    # As in a window.
    monkeypatch.setattr(taking, "_after_save", lambda *_: taking.sweep())
    path = str(tmp_path / "mine.blend")
    blender.ops.wm.save_as_mainfile(filepath=path)
    blender.app.handlers.save_post.pop()
    mine = {**dict.fromkeys(taking.FLAGS, False), "show_axis_x": True, "show_outline_selected": True}
    assert seen == [mine], "given back before it is written"
    taking.sweep()
    blender.ops.wm.open_mainfile(filepath=path, load_ui=True)
    screen, _, space = view(blender)
    assert flags_of(taking, space) == mine and len(screen.pumice_overlays) == 0


@pytest.mark.parametrize("keeps", (True, False))
def test_a_file_of_a_crash_is_given_back(taking, blender, tmp_path, monkeypatch, keeps):
    """An autosave calls no handler. Without what the screen keeps, the settings would be lost."""
    _, _, space = view(blender)
    wish(taking, space, show_axis_x=True, show_outline_selected=True)
    mine = flags_of(taking, space)
    space.shading.type = "RENDERED"
    taking.sweep()
    if not keeps:
        for screen in blender.data.screens:
            screen.pumice_overlays.clear()
    path = str(tmp_path / "autosave.blend")
    with monkeypatch.context() as patch:
        patch.setattr(taking, "safely", lambda **_: None)
        blender.ops.wm.save_as_mainfile(filepath=path)
    taking.sweep(gives_all_back=True)
    blender.ops.wm.read_homefile(use_factory_startup=True)
    with monkeypatch.context() as patch:
        patch.setattr(taking, "safely", lambda **_: None)
        blender.ops.wm.open_mainfile(filepath=path, load_ui=True)
        assert not any(flags_of(taking, view(blender)[2]).values()), "the file has what was taken"
    taking._after_load()
    screen, _, space = view(blender)
    assert (flags_of(taking, space) == mine) == keeps and len(screen.pumice_overlays) == 0


def test_loading_another_file_gives_back_first(taking, blender, tmp_path):
    """Blender keeps the screens of the open file where *Load UI* is off."""
    path = str(tmp_path / "other.blend")
    blender.ops.wm.save_as_mainfile(filepath=path)
    _, _, space = view(blender)
    wish(taking, space, show_floor=True)
    mine = flags_of(taking, space)
    space.shading.type = "RENDERED"
    taking.sweep()
    blender.ops.wm.open_mainfile(filepath=path, load_ui=False)
    screen, _, space = view(blender)
    assert flags_of(taking, space) == mine and len(screen.pumice_overlays) == 0


def test_a_copy_of_a_taken_viewport_has_its_wishes(taking, blender):
    screen, area, space = view(blender)
    wish(taking, space, show_floor=True, show_axis_y=True)
    mine = flags_of(taking, space)
    space.shading.type = "RENDERED"
    taking.sweep()
    region = next(region for region in area.regions if region.type == "WINDOW")
    window = blender.context.window_manager.windows[0]
    before = len(screen.areas)
    with blender.context.temp_override(window=window, screen=screen, area=area, region=region):
        blender.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    assert len(screen.areas) == before + 1
    both = [view(blender, place)[2] for place in (0, 1)]
    assert [sum(flags_of(taking, one).values()) for one in both] == [0, 0]
    other = next(one for one in both if one != space)
    other.shading.type = "SOLID"
    taking.sweep()
    assert flags_of(taking, other) == mine and not any(flags_of(taking, space).values())
    # A viewport that has nothing on because its artist wants it so, and looks from elsewhere, is no copy.
    wish(taking, other)
    other.region_3d.view_distance *= 1.5
    taking._known.discard(taking.name_of(other))
    taking.sweep()
    assert not any(flags_of(taking, other).values())


def test_a_copy_of_a_workspace_has_the_artists_settings(taking, blender):
    _, _, space = view(blender)
    wish(taking, space, show_floor=True, show_axis_y=True)
    mine = flags_of(taking, space)
    space.shading.type = "RENDERED"
    taking.sweep()
    window, before = blender.context.window_manager.windows[0], set(blender.data.screens)
    with blender.context.temp_override(window=window):
        blender.ops.workspace.duplicate()
    copies = [screen for screen in blender.data.screens if screen not in before]
    assert copies
    taking.sweep()
    spaces = [area.spaces.active for screen in copies for area in screen.areas if area.type == "VIEW_3D"]
    assert spaces
    for one in spaces:
        one.shading.type = "SOLID"
    taking.sweep()
    assert mine in [flags_of(taking, one) for one in spaces]
    for screen in copies:
        assert len(screen.pumice_overlays) == 0


def test_the_preference_turns_it_off(taking, blender, extension, monkeypatch):
    _, _, space = view(blender)
    wish(taking, space, show_floor=True)
    space.shading.type = "RENDERED"
    monkeypatch.setattr(load(extension, "preferences"), "true_overlays", lambda: False)
    taking.sweep()
    assert space.overlay.show_floor and taking.wishes_of(space) is None
    monkeypatch.undo()
    taking.sweep()
    assert not space.overlay.show_floor
    monkeypatch.setattr(load(extension, "preferences"), "true_overlays", lambda: False)
    taking.sweep()
    assert space.overlay.show_floor and taking.wishes_of(space) is None


def test_the_picture_waits_for_the_takeover(taking, blender, monkeypatch):
    """So that nobody sees it with the proxy's outline and grid; a takeover that fails does not keep it away."""
    import types

    _, _, space = view(blender)
    context = types.SimpleNamespace(space_data=space, scene=blender.context.scene)
    assert not taking.awaited(context), "nothing is taken in background mode"
    asked = []
    app = types.SimpleNamespace(background=False)
    monkeypatch.setattr(taking, "bpy", types.SimpleNamespace(app=app, types=blender.types, data=blender.data, context=blender.context))
    monkeypatch.setattr(taking, "soon", lambda: asked.append(True))
    assert not taking.awaited(context) and not asked, "a solid viewport has nothing to wait for"
    space.shading.type = "RENDERED"
    assert taking.awaited(context) and asked
    taking.sweep()
    assert not taking.awaited(context)
    space.shading.type = "SOLID"
    taking.sweep()
    space.shading.type = "RENDERED"
    with monkeypatch.context() as patch:
        patch.setattr(taking, "sweep", lambda _: 1 / 0)
        patch.setattr(taking, "log", lambda error: None)
        taking.safely()
    assert not taking.awaited(context)
    taking.safely()


def test_a_disabled_extension_gives_back(taking, blender):
    screen, _, space = view(blender)
    wish(taking, space, show_floor=True)
    space.shading.type = "RENDERED"
    taking.sweep()
    taking.unregister()
    try:
        assert space.overlay.show_floor and not hasattr(screen, "pumice_overlays")
    finally:
        taking.register()


def test_a_screen_that_is_not_shown_is_given_back(taking, blender):
    """The viewports of other workspaces."""
    shown = blender.context.window_manager.windows[0].screen
    other = next(
        (screen, area.spaces.active)
        for screen in blender.data.screens
        for area in screen.areas
        if screen != shown and area.type == "VIEW_3D"
    )
    other[1].shading.type = "RENDERED"
    before = flags_of(taking, other[1])
    taking.sweep()
    assert flags_of(taking, other[1]) == before and any(before.values())
