# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The legend: a swatch and a name for each group of labels of a volume, or for chosen labels, in a corner of the camera's view.

    ■ axon        names are those of materials or of labels; a label without a name has its id
    ■ glia        colors are those that are drawn: of the label table, or of the material's base color

A group whose labels have several colors has no swatch that would be true, so it is refused by name.
"""

import numpy as np

from . import figure_frame, figure_part, label_table, volume_place
from .reports import Refused
from .sync import materials

# More lines help nobody, and would fill the picture.
MOST_ENTRIES = 32
# Of the size of the text: side of a swatch, its distance to the text, distance between lines.
SWATCH, GAP, LINE = 0.7, 0.5, 1.4


def follow(obj, scene, depsgraph):
    """Makes a legend what camera, picture, volume and table ask for. Returns one line where an entry cannot be true, otherwise None."""
    settings = obj.pumice_figure
    if settings.volume is None or settings.volume.pumice.table is None:
        return f"{obj.name}: its volume is gone; choose another, or delete the legend"
    volume = settings.volume.evaluated_get(depsgraph)
    shown, problems = entries(volume, settings.labels)
    frame, size = figure_frame.Frame(scene, depsgraph), settings.text_mm
    height = (SWATCH + LINE * max(0, len(shown) - 1)) * size
    # The text's width is known only when it is drawn; on the right, swatches stand at the margin and the text before them.
    is_left = settings.corner.endswith("LEFT")
    x, y = frame.corner(settings.corner, settings.margin_mm, SWATCH * size, height)
    distance = frame.distance_of(volume_place.known(volume).translation)
    figure_frame.attach(obj, frame, frame.camera_from_paper(frame.part_distance(distance), x, y))
    top = height - SWATCH * size
    figure_part.set_rectangles(obj.data, [(0.0, top - LINE * size * i, SWATCH * size, SWATCH * size) for i in range(len(shown))])
    figure_part.set_colors(obj.data, obj.name, [color for _, color in shown])
    text = figure_part.text_of(obj)
    if text is not None:
        place = ((SWATCH + GAP) * size if is_left else -GAP * size, top)
        body = "\n".join(name for name, _ in shown)
        figure_part.set_text(text, body, size=size, place=place, align="LEFT" if is_left else "RIGHT", spacing=LINE)
        figure_part.set_colors(text.data, f"{obj.name} Text", [tuple(settings.color)])
    return f"{obj.name}: {'; '.join(problems)}" if problems else None


def entries(volume, labels):
    """([(name, linear color)], what has no true color) of a legend; `labels` are ids with commas, the groups of the volume where it is empty."""
    table = volume.original.pumice.table
    dresses = [materials.read(slot.material)[:2] for slot in volume.material_slots] or [materials.read(None)[:2]]
    slots = label_table.slots(table).clip(max=len(dresses) - 1)
    if labels:
        return _of_labels(table, slots, dresses, labels)
    visible, color = label_table.visible(table), label_table.colors(table)[:, :3]
    shown, problems = [], []
    for slot, (fields, colored) in enumerate(dresses):
        rows = np.flatnonzero((slots == slot) & visible)
        if not len(rows):
            continue
        name = _slot_name(volume, slot)
        if not colored:
            shown.append((name, tuple(fields["base_color"])))
        elif (color[rows] == color[rows[0]]).all():
            shown.append((name, tuple(color[rows[0]].tolist())))
        else:
            problems.append(f"{name}: its labels have several colors; give them one, or choose labels")
    return shown[:MOST_ENTRIES], problems + _beyond(len(shown))


def _of_labels(table, slots, dresses, labels):
    ids, names = label_table.ids(table), label_table.names(table)
    color, shown, problems = label_table.colors(table)[:, :3], [], []
    for word in labels.replace(",", " ").split():
        label = int(word) if word.isdecimal() else -1
        row = int(np.searchsorted(ids, np.uint64(label))) if 0 <= label < 1 << 64 else len(ids)
        if row == len(ids) or int(ids[row]) != label:
            problems.append(f"the volume has no label {word}")
            continue
        fields, colored = dresses[slots[row]]
        own = color[row].tolist() if colored else fields["base_color"]
        shown.append(((names[row] if names else "") or str(label), tuple(own)))
    return shown[:MOST_ENTRIES], problems + _beyond(len(shown))


def selected(table):
    """Ids of the selected labels of a table, as a legend's settings have them; Refused where there are too many."""
    ids = label_table.ids(table)[label_table.selected(table)].tolist()
    if len(ids) > MOST_ENTRIES:
        raise Refused(f"A legend has at most {MOST_ENTRIES} entries, and {len(ids):,} labels are selected")
    return ", ".join(map(str, ids))


def _slot_name(volume, slot):
    if not volume.material_slots:
        return volume.name
    name = volume.material_slots[slot].name or f"group {slot + 1}"
    # The import names materials after the volume and the type.
    return name.removeprefix(f"{volume.name} ") or name


def _beyond(count):
    return [f"{count - MOST_ENTRIES} entries beyond {MOST_ENTRIES} are left out"] if count > MOST_ENTRIES else []
