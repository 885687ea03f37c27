// Materials of labels: twin of transport/src/material_table.rs.
#ifndef MATERIAL_TABLE_GLSL
#define MATERIAL_TABLE_GLSL

#include "layout.glsl"
#include "needs.glsl"

// Whether the instance is a shadow catcher.
bool material_table_catches(InstanceRef instance) {
    return NEEDS_CATCHER != 0u && instance.it.lod == LOD_CATCHER;
}

// Material of a dense label.
Material material_of(InstanceRef instance, uint label) {
    uint index = label < instance.it.label_count ? Words(instance.it.material_of_label).at[label] : 0u;
    return Materials(instance.it.materials).at[index];
}

// Cryptomatte ids of a label; 0, which is no id, where there are none.
vec2 material_table_ids_of(InstanceRef instance, uint label) {
    if (instance.it.matte_ids == 0UL) {
        return vec2(0.0);
    }
    uint at = 2u * min(instance.it.last_matte_id, label);
    Floats ids = Floats(instance.it.matte_ids);
    return vec2(ids.at[at], ids.at[at + 1u]);
}

#endif
