# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps of `window_drive` that compare the overlays that Pumice draws with the label film, and with those that Blender draws, on the screen.

Each comparison is between screenshots of one finished picture, which differ in an overlay alone, so what changes from one to the other is the
overlay. Screenshots are named overlays_*.
"""

import os
import subprocess
import time

import bpy
import gpu
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from window_pick import COVERED, screen_of

# Levels of 255 by which two screenshots of the same picture may differ.
NOISE = 2


def steps(package, out, window, area, shown, converged, until, shot):
    """Looks at the viewport of `area`; `shown`, `converged`, `until` and `shot` are those of `window_drive`."""
    taking, scene = package.true_overlays, bpy.context.scene
    space = area.spaces.active
    view, region = space.region_3d, next(r for r in area.regions if r.type == "WINDOW")
    preferences = bpy.context.preferences.addons[package.__name__].preferences
    obj = bpy.context.object
    samples, scene.pumice.viewport_samples = scene.pumice.viewport_samples, 4
    # Text moves: Blender names the unit of its own grid.
    space.overlay.show_text = False
    former = (obj.location.copy(), view.view_rotation.copy(), view.view_perspective, view.view_location.copy(), view.view_distance)

    def done():
        """The picture and its film, after a redraw with both."""
        area.tag_redraw()
        yield 0.7
        yield from until(lambda: converged() and shown().labels() is not None, "the label film is there")
        found = shown().labels()
        area.tag_redraw()
        yield 0.7
        return found

    def pixels(name):
        area.tag_redraw()
        yield 0.7
        shot(f"overlays_{name}")
        return screen_of(f"{out}/overlays_{name}.xwd", region, window).astype(int)

    def switch(**flags):
        entry = taking.wishes_of(space)
        for flag in taking.FLAGS:
            setattr(entry, flag, flags.get(flag, False))

    def differ(one, other):
        """Pixels that differ, away from what covers the picture."""
        found = np.abs(one - other).max(axis=-1) > NOISE
        found[: COVERED[1]] = found[-COVERED[1] :] = found[:, : COVERED[0]] = found[:, -COVERED[0] :] = False
        return found

    def own_flags():
        return {flag: getattr(space.overlay, flag) for flag in taking.FLAGS}

    was_selected = obj.select_get()
    obj.select_set(True)
    # A volume through the floor, seen from the side.
    middle = obj.matrix_world @ (sum((Vector(corner) for corner in obj.bound_box), Vector()) / 8.0)
    obj.location -= middle
    size = max(obj.dimensions)
    view.view_perspective, view.view_location, view.view_distance = "PERSP", (0.0, 0.0, 0.0), 2.2 * size
    view.view_rotation = Quaternion((0.0, 0.0, 1.0), 0.5) @ Quaternion((1.0, 0.0, 0.0), 1.1)
    yield from done()
    mine = {flag: flag in ("show_floor", "show_axis_x", "show_axis_y", "show_outline_selected", "show_ortho_grid") for flag in taking.FLAGS}
    assert not any(own_flags().values()), "the viewport is taken over"

    # The outline is where the instances of the film have their edges, and nowhere else.
    film = yield from done()
    switch()
    nothing = yield from pixels("nothing")
    switch(show_outline_selected=True)
    outlined = differ((yield from pixels("outline")), nothing)
    edges = differ_of_instances(film.pixels[..., 0])
    near = grown(edges)
    inside = np.zeros_like(edges)
    inside[COVERED[1] : -COVERED[1], COVERED[0] : -COVERED[0]] = True
    assert edges[inside].sum() > 200, "edges are in the picture"
    seen, beside = (outlined & edges & inside).sum() / (edges & inside).sum(), (outlined & ~near).sum()
    assert seen > 0.97 and beside == 0, f"{seen:.3f} of the edges are outlined, {beside} pixels elsewhere"
    color = np.array(bpy.context.preferences.themes[0].view_3d.object_active) * 255.0
    close = (np.abs((yield from pixels("outline")) - color) <= 24.0).all(axis=-1)
    assert close[edges & inside].mean() > 0.97, "in the color of the active object"
    assert (outlined & ~grown(np.roll(edges, (5, 7), (0, 1)))).any(), "the comparison notices a shift"
    obj.select_set(False)
    assert not differ((yield from pixels("unselected")), nothing).any(), "no outline of an object that is not selected"
    obj.select_set(True)

    # The grid is hidden exactly where the picture is nearer, and is Blender's elsewhere.
    for name, perspective, rotation in (
        ("grid", "PERSP", Quaternion((0.0, 0.0, 1.0), 0.5) @ Quaternion((1.0, 0.0, 0.0), 1.1)),
        ("grid_low", "PERSP", Quaternion((0.0, 0.0, 1.0), -0.7) @ Quaternion((1.0, 0.0, 0.0), 1.45)),
        ("grid_parallel", "ORTHO", Quaternion((0.0, 0.0, 1.0), 0.3) @ Quaternion((1.0, 0.0, 0.0), 0.9)),
        ("grid_top", "ORTHO", Quaternion()),
        ("grid_front", "ORTHO", Quaternion((1.0, 0.0, 0.0), np.pi / 2)),
    ):
        view.view_perspective = perspective
        if name in ("grid_top", "grid_front"):
            with bpy.context.temp_override(window=window, area=area, region=region):
                bpy.ops.view3d.view_axis(type=name.removeprefix("grid_").upper())
            yield 1.0
        else:
            view.view_rotation = rotation
        film = yield from done()
        everything = dict.fromkeys(taking.FLAGS, True) | {"show_outline_selected": False}
        switch()
        nothing = yield from pixels("nothing")
        # The z axis lies on another plane, before or behind other parts of the picture.
        switch(**everything | {"show_axis_z": False})
        masked = yield from pixels(f"{name}_floor")
        # Without the film's depth.
        kept = package.floor_grid.Depth.update
        package.floor_grid.Depth.update = lambda self, film, camera: setattr(self, "size", None)
        package.floor_grid._depths.clear()
        whole = yield from pixels(f"{name}_whole")
        package.floor_grid.Depth.update = kept
        package.floor_grid._depths.clear()
        is_side = view.is_orthographic_side_view and perspective == "ORTHO"
        nearer, margin = nearer_of(film.depth, view, shown().sent.camera, is_side)
        drawn, all_drawn = differ(masked, nothing), differ(whole, nothing)
        hidden = all_drawn & nearer & margin
        assert all_drawn.sum() > 2000, f"{name}: the grid is seen"
        assert hidden.sum() > 50, f"{name}: the picture hides some of it, {hidden.sum()} pixels"
        assert not (drawn & nearer & margin).any(), f"{name}: {(drawn & nearer & margin).sum()} pixels of the grid over what is nearer"
        lost = differ(masked, whole) & ~nearer & margin
        assert not lost.any(), f"{name}: {lost.sum()} pixels of the grid are hidden by nothing"
        # As Blender draws it, where the proxy is not.
        switch(**everything)
        masked = yield from pixels(name)
        preferences.true_overlays = False
        yield 0.5
        for flag, value in everything.items():
            setattr(space.overlay, flag, value)
        yield from done()
        blenders = yield from pixels(f"{name}_blender")
        far = ~grown(film.pixels[..., 0] > 0, 12)
        ours, theirs = differ(masked, nothing) & far, differ(blenders, nothing) & far
        common = [(ours & grown(theirs)).sum() / ours.sum(), (theirs & grown(ours)).sum() / theirs.sum()]
        # Blender 5.2 draws its own grid in tatters with Vulkan in software.
        is_whole = gpu.platform.backend_type_get() == "OPENGL"
        assert min(common) > 0.8 or not is_whole, f"{name}: {common[0]:.3f} of our lines are Blender's, {common[1]:.3f} of Blender's are ours"
        off = np.abs(masked - blenders).max(axis=-1)[far & inside]
        # Since 5.1 Blender draws its lines as lines, thinner and darker.
        if bpy.app.version < (5, 1) and is_whole:
            assert (off > 12).mean() < 0.002, f"{name}: {(off > 12).mean():.4f} of the pixels are not Blender's, by up to {off.max()}"
        figures = {"pixels": int(far[inside].sum()), "largest": int(off.max()), "above 3": float((off > 3).mean()), "common": [float(share) for share in common]}
        print(name, "against Blender's:", figures, "hidden", int(hidden.sum()), flush=True)
        preferences.true_overlays = True
        yield 0.5
        yield from done()

    switch(**dict.fromkeys(taking.FLAGS, True))
    yield from done()
    print("milliseconds of the main thread:", (yield from cost(package, area)), flush=True)

    # The artist's settings come back in Solid, in a file, and for copies; and may be switched meanwhile.
    switch(**mine)
    space.shading.type = "SOLID"
    yield from until(lambda: own_flags() == mine, "the artist's settings are back in Solid")
    space.shading.type = "RENDERED"
    yield from done()
    assert not any(own_flags().values())
    path = f"{out}/overlays.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    yield 0.3
    assert not any(own_flags().values()), "taken again after the file is saved"
    assert saved_flags(path, taking.FLAGS) == mine, saved_flags(path, taking.FLAGS)
    space.overlay.show_axis_z = True
    yield from until(lambda: not space.overlay.show_axis_z and taking.wishes_of(space).show_axis_z, "a click on Blender's box is a wish")
    taking.wishes_of(space).show_axis_z = False

    before = set(window.screen.areas)
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield 1.5
    copy = next(one for one in window.screen.areas if one not in before)
    other = copy.spaces.active
    # Blender makes the copy of a rendered viewport a solid one.
    assert other.shading.type == "SOLID"
    flags_of = lambda one: {flag: getattr(one, flag) for flag in taking.FLAGS}  # noqa: E731
    yield from until(lambda: flags_of(other.overlay) == mine, "a split area has the artist's settings")
    shot("overlays_split_solid")
    other.shading.type = "RENDERED"
    yield from until(lambda: taking.wishes_of(other) is not None, "it is taken too")
    yield 3.0
    assert flags_of(taking.wishes_of(other)) == mine
    assert not any(flags_of(other.overlay).values()) and len(window.screen.pumice_overlays) == 2
    shot("overlays_split")
    with bpy.context.temp_override(window=window, area=copy):
        bpy.ops.screen.area_close()
    yield 1.0
    assert len(window.screen.pumice_overlays) == 1
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.screen.region_quadview()
    yield 4.0
    shot("overlays_quad")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.screen.region_quadview()
    yield 1.0

    # All overlays off hides these too.
    yield from done()
    switch()
    nothing = yield from pixels("nothing")
    switch(**mine)
    space.overlay.show_overlays = False
    hidden = yield from pixels("off")
    space.overlay.show_overlays = True
    switch()
    assert not differ(hidden, nothing).any() or (np.abs(hidden - nothing).max(axis=-1) > NOISE).mean() < 0.02
    switch(**mine)
    obj.location, view.view_rotation, view.view_perspective, view.view_location, view.view_distance = former
    scene.pumice.viewport_samples, space.overlay.show_text = samples, True
    obj.select_set(was_selected)
    yield from done()


def cost(package, area):
    """Milliseconds of Blender's thread for a redraw of the grid, and of the outline, of a finished picture: the largest of some."""
    took = {}

    def timed(owner, name):
        function = getattr(owner, name)

        def run(*arguments):
            begin = time.perf_counter()
            result = function(*arguments)
            took.setdefault(name, []).append(1000.0 * (time.perf_counter() - begin))
            return result

        setattr(owner, name, run)
        return lambda: setattr(owner, name, function)

    back = [timed(package.floor_grid, "draw_grid"), timed(package.object_outline, "draw_outline")]
    for _ in range(20):
        area.tag_redraw()
        yield 0.05
    for undo in back:
        undo()
    return {owner: round(max(values), 2) for owner, values in took.items()}


def differ_of_instances(instance):
    """Pixels that have a neighbor of another instance."""
    edges = np.zeros(instance.shape, dtype=bool)
    for before, after in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])):
        apart = instance[before] != instance[after]
        edges[before] |= apart
        edges[after] |= apart
    return edges


def grown(mask, by=1):
    """A mask with all pixels up to so many beside it."""
    out = mask.copy()
    for _ in range(by):
        wide = out.copy()
        for before, after in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])):
            wide[before] |= out[after]
            wide[after] |= out[before]
        out = wide
    return out


def nearer_of(depth, view, camera, is_side):
    """(where the picture is nearer than the plane of the grid, where that is sure): rows from the top. By the matrices of the view alone."""
    height, width = depth.shape
    x = (2.0 * (np.arange(width) + 0.5) / width - 1.0)[None, :]
    y = (1.0 - 2.0 * (np.arange(height) + 0.5) / height)[:, None]
    world_from_clip = np.array((view.window_matrix @ view.view_matrix).inverted_safe())
    ends = []
    for z in (-0.9, 0.9):
        clip = np.stack(np.broadcast_arrays(x, y, z, 1.0), axis=-1)
        p = clip @ world_from_clip.T
        ends.append(p[..., :3] / p[..., 3:])
    place = np.array(Matrix([[camera["world_from_camera"][3 * c + r] for c in range(4)] for r in range(3)] + [[0, 0, 0, 1]]))
    forward = -place[:3, 2]
    along = [(end - place[:3, 3]) @ forward for end in ends]
    if is_side:
        return np.isfinite(depth), ~grown(differ_of_instances(np.isfinite(depth)))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = ends[0][..., 2] / (ends[0][..., 2] - ends[1][..., 2])
        plane = along[0] + share * (along[1] - along[0])
    plane = np.where(plane > 0.0, plane, np.inf)
    nearer = depth < plane
    # Where both are close the grid fades, over what the plane recedes from pixel to pixel.
    slope = np.zeros_like(plane)
    with np.errstate(invalid="ignore"):
        slope[:-1] += np.abs(np.diff(plane, axis=0))
        slope[:, :-1] += np.abs(np.diff(plane, axis=1))
        close = np.abs(depth - plane) < np.nan_to_num(2.0 * slope, nan=np.inf) + 1e-4 * np.abs(plane)
    return nearer, ~close & ~grown(differ_of_instances(nearer))


def saved_flags(path, flags):
    """The flags of the first 3D viewport of a file, as a Blender without the extension reads them."""
    code = (
        "import bpy\n"
        "screen = bpy.context.window_manager.windows[0].screen\n"
        "space = next(a for a in screen.areas if a.type == 'VIEW_3D').spaces.active\n"
        f"print('FLAGS', [int(getattr(space.overlay, f)) for f in {tuple(flags)!r}], len(screen.get('pumice_overlays', ())) > 0)"
    )
    environment = {**os.environ, "BLENDER_USER_RESOURCES": "/tmp/without"}
    command = ["blender", "-b", "--factory-startup", path, "--python-expr", code]
    told = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    line = next(line for line in told.splitlines() if line.startswith("FLAGS"))
    assert line.endswith("False"), "the file keeps nothing of the extension"
    values = line[line.index("[") + 1 : line.index("]")].split(", ")
    return {flag: value == "1" for flag, value in zip(flags, values)}
