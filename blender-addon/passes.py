# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of passes, used for what a view layer offers, what is registered with Blender, what a render requests and what it returns.

    ours                the name in `film.passes` of the scene and in `Picture.passes`
    Blender's           the name in Cycles, so that compositor set-ups fit both engines; Blender 5.0 replaced the short names by long ones
    where it is chosen  a property of the view layer: Blender's own, or one of `view_layer.pumice`
"""

import json
from typing import NamedTuple

import bpy
import numpy as np

from .reports import Refused
from .sync import drawn

NOTHING_DEPTH = np.float32(1e10)
LARGEST_EXACT_LABEL = 1 << 24
# The picture before it is denoised, under Cycles' name.
NOISY = "Noisy Image"


class Pass(NamedTuple):
    """One pass: Pumice's name, Blender's, its name before Blender 5.0, its channels, its kind, and where it is chosen."""

    ours: str
    name: str
    short: str
    channels: str
    kind: str
    chosen: str

    @property
    def in_blender(self):
        """Its name in this Blender."""
        return self.name if bpy.app.version >= (5, 0, 0) else self.short

    def owner(self, view_layer):
        """The data block that has the property."""
        return view_layer if self.chosen in view_layer.bl_rna.properties else view_layer.pumice

    def is_wanted(self, view_layer):
        """Whether a view layer asks for the pass."""
        return self.ours in drawn.PASSES and getattr(self.owner(view_layer), self.chosen)

    @property
    def is_matte(self):
        """Whether it is Cryptomatte: numbered layers of two ids with their coverages each."""
        return self.channels == "rgba"

    def names(self, view_layer):
        """Its names in Blender: one, or one for each layer of Cryptomatte."""
        if not self.is_matte:
            return [self.in_blender]
        return [f"{self.in_blender}{number:02}" for number in range(ranks(view_layer) // 2)]

    def pixels(self, picture):
        """The pixels for each of its names, rows from the top; empty if the picture does not have the pass. Raises Refused if a label is
        too large."""
        found = picture.passes.get(self.ours)
        if found is None:
            return []
        if self.is_matte:
            height, width, count, _ = found.shape
            layers = found.reshape(height, width, count // 2, 4)
            return [layers[:, :, number] for number in range(count // 2)]
        return [self._plane(found)]

    def _plane(self, found):
        if self.ours == "depth":
            # As Cycles has it.
            return np.where(np.isfinite(found), found, NOTHING_DEPTH)
        if self.ours == "label" and found.size and int(found.max()) > LARGEST_EXACT_LABEL:
            raise Refused("The volume has more than 16,777,216 labels: the Label pass cannot hold them; switch it off")
        return found


TABLE = (
    Pass("depth", "Depth", "Depth", "Z", "VALUE", "use_pass_z"),
    Pass("position", "Position", "Position", "XYZ", "VECTOR", "use_pass_position"),
    Pass("normal", "Normal", "Normal", "XYZ", "VECTOR", "use_pass_normal"),
    Pass("label", "Label", "Label", "X", "VALUE", "use_pass_label"),
    Pass("diffuse_direct", "Diffuse Direct", "DiffDir", "RGB", "COLOR", "use_pass_diffuse_direct"),
    Pass("diffuse_indirect", "Diffuse Indirect", "DiffInd", "RGB", "COLOR", "use_pass_diffuse_indirect"),
    Pass("diffuse_color", "Diffuse Color", "DiffCol", "RGB", "COLOR", "use_pass_diffuse_color"),
    Pass("glossy_direct", "Glossy Direct", "GlossDir", "RGB", "COLOR", "use_pass_glossy_direct"),
    Pass("glossy_indirect", "Glossy Indirect", "GlossInd", "RGB", "COLOR", "use_pass_glossy_indirect"),
    Pass("glossy_color", "Glossy Color", "GlossCol", "RGB", "COLOR", "use_pass_glossy_color"),
    Pass("transmission_direct", "Transmission Direct", "TransDir", "RGB", "COLOR", "use_pass_transmission_direct"),
    Pass("transmission_indirect", "Transmission Indirect", "TransInd", "RGB", "COLOR", "use_pass_transmission_indirect"),
    Pass("transmission_color", "Transmission Color", "TransCol", "RGB", "COLOR", "use_pass_transmission_color"),
    Pass("emission", "Emission", "Emit", "RGB", "COLOR", "use_pass_emit"),
    Pass("environment", "Environment", "Env", "RGB", "COLOR", "use_pass_environment"),
    Pass("shadow_catcher", "Shadow Catcher", "Shadow Catcher", "RGB", "COLOR", "use_pass_shadow_catcher"),
    Pass("albedo", "Denoising Albedo", "Denoising Albedo", "RGB", "COLOR", "use_pass_denoising"),
    Pass("normal", "Denoising Normal", "Denoising Normal", "XYZ", "VECTOR", "use_pass_denoising"),
    Pass("cryptomatte_label", "CryptoObject", "CryptoObject", "rgba", "COLOR", "use_pass_cryptomatte_object"),
    Pass("cryptomatte_type", "CryptoAsset", "CryptoAsset", "rgba", "COLOR", "use_pass_cryptomatte_asset"),
    Pass("variance", "Variance", "Variance", "RGB", "COLOR", "use_pass_variance"),
    Pass("samples", "Debug Sample Count", "Debug Sample Count", "X", "VALUE", "use_pass_samples"),
)


# Passes of Blender and Cycles that are not drawn.
NOT_DRAWN = (
    ("use_pass_mist", "Mist"),
    ("use_pass_vector", "Vector"),
    ("use_pass_uv", "UV"),
    ("use_pass_object_index", "Object Index"),
    ("use_pass_material_index", "Material Index"),
    ("use_pass_ambient_occlusion", "Ambient Occlusion"),
    ("use_pass_shadow", "Shadow"),
    ("use_pass_cryptomatte_material", "Cryptomatte Material"),
    ("use_pass_subsurface_direct", "Subsurface Direct"),
    ("use_pass_subsurface_indirect", "Subsurface Indirect"),
    ("use_pass_subsurface_color", "Subsurface Color"),
)


def ranks(view_layer):
    """Number of labels per pixel in Cryptomatte: whole layers of two, as in Cycles."""
    return 2 * ((min(16, view_layer.pass_cryptomatte_depth) + 1) // 2)


def metadata(view_layer, picture, hash_of):
    """Metadata of the mattes of a render, by key, for the compositor and for files: Cryptomatte's specification 1.2.0."""
    said = {}
    for one in wanted(view_layer):
        if one.is_matte and one.ours in picture.passes:
            layers = f"{view_layer.name}.{one.in_blender}"
            key = f"cryptomatte/{hash_of(layers):08x}"[: len("cryptomatte/") + 7]
            manifest = {name: f"{number:08x}" for name, number in picture.manifests[one.ours].items()}
            said[f"{key}/name"] = layers
            said[f"{key}/hash"] = "MurmurHash3_32"
            said[f"{key}/conversion"] = "uint32_to_float32"
            said[f"{key}/manifest"] = json.dumps(manifest, ensure_ascii=False, separators=(",", ":"))
    return said


def wanted(view_layer):
    """The passes of a view layer except Combined."""
    return [one for one in TABLE if one.is_wanted(view_layer)]


def left_out_of(view_layer):
    """A line with the passes of Blender's own that a view layer asks for and no picture has."""
    asked = [name for flag, name in NOT_DRAWN if getattr(view_layer, flag, False)]
    return [f"View layer {view_layer.name}: no pass {' or '.join(asked)}"] if asked else []


def registered(view_layer, is_denoised=False):
    """(name, channels, channel names, kind) of each pass that a view layer has, as Blender asks for them."""
    yield "Combined", 4, "RGBA", "COLOR"
    if is_denoised:
        yield NOISY, 4, "RGBA", "COLOR"
    for one in wanted(view_layer):
        for name in one.names(view_layer):
            yield name, len(one.channels), one.channels, one.kind


def asked_for(view_layer):
    """The name for `film.passes`; None if every picture has the pass."""
    return sorted({one.ours for one in wanted(view_layer)}) if drawn.PASSES_ASKED else None
