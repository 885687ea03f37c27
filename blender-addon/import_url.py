# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > Label Volume from URL: asks for the URL of a store on a server, and opens the dialog of the import for it.

    URL                     ──► headers (a thread, ESC) ──► the dialog of `import_dialog`, as for a file
    link to Neuroglancer    ──► the dialog of `import_state`

A script has no dialog: for it, the operators are `pumice.import_volume` and `pumice.import_state` with a URL in place of the file.
"""

import bpy
from bpy.props import StringProperty

from . import import_dialog, import_state, native, online_access
from .background import InBackground, Work
from .reports import Refused

DIALOG_PIXELS = 640


class PUMICE_OT_import_url(InBackground, bpy.types.Operator):
    """Import a label volume from a server, by the URL of its Zarr, N5 or Neuroglancer folder. Reads all that Region and Level leave
    over the network, and keeps it compressed"""

    bl_idname = "pumice.import_url"
    bl_label = "Import Label Volume from URL"

    url: StringProperty(
        name="URL",
        description=(
            "Folder of a Zarr, N5 or Neuroglancer volume on a server: https://, gs:// or s3://, also with precomputed://, zarr:// or n5:// before it; or a link "
            "to Neuroglancer"
        ),
        default="",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, _event):
        self._interactive = True
        manager = context.window_manager
        copied = manager.clipboard.strip()
        if not self.url and native.is_on_server(copied):
            self.url = copied
        try:
            # Before anybody types.
            online_access.check([self.url or "https://"])
        except Exception as error:
            return self.refused(error)
        return manager.invoke_props_dialog(self, width=DIALOG_PIXELS, confirm_text="Next")

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "url")
        layout.label(text="A dialog follows with what the server says")

    def begin(self, _context):
        url = self.url.strip()
        if import_state.is_link(url):
            return Work("Reading the link", lambda job: native.require().state_layers(url))
        if not native.is_on_server(url):
            raise Refused(f"{url or 'URL'}: expected the URL of a store: https://, gs:// or s3://")
        online_access.check([url])
        return Work(f"Asking {url.split('://')[-1].split('/')[0]}", lambda job: native.require().probe(url, job=job), asks_server=True)

    def finish(self, context, _said):
        url = self.url.strip()
        operator = bpy.ops.pumice.import_state if import_state.is_link(url) else bpy.ops.pumice.import_volume
        # What the server said is known for some seconds, so the dialog does not wait for it again.
        if self._interactive:
            import_dialog.open_later(context, operator, filepath=url)
        else:
            operator(filepath=url)


def _menu_entry(self, _context):
    self.layout.operator(PUMICE_OT_import_url.bl_idname, text="Label Volume from URL (Pumice)")


def register():
    bpy.utils.register_class(PUMICE_OT_import_url)
    bpy.types.TOPBAR_MT_file_import.append(_menu_entry)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu_entry)
    bpy.utils.unregister_class(PUMICE_OT_import_url)
