//! Groups of labels give each label the material that a list of single materials gives it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use pumice_scene::{LabelGroup, LabelGroups, LabelMaterials, LabelStyle, Material};
use pumice_transport::material_table::MaterialTable;

const IDS: [u64; 6] = [2, 3, 5, 8, 13, u64::MAX];
const RED: [f32; 3] = [1.0, 0.0, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

fn table(style: &LabelStyle) -> MaterialTable {
    MaterialTable::new(style, &IDS, [(0, 1), (1, 2)].into_iter(), &[true; 6])
}

fn each(table: &MaterialTable) -> Vec<Material> {
    (0..IDS.len() as u32).map(|label| *table.material(label)).collect()
}

#[test]
fn each_label_has_the_material_of_its_group_in_its_color() {
    let common = Material { roughness: 0.9, ..Material::DEFAULT };
    let ghost = Material { alpha: 0.25, ..Material::DEFAULT };
    let metal = Material { metallic: 1.0, ..Material::DEFAULT };
    let gold = Material { base_color: [1.0, 0.7, 0.1], ..metal };
    let groups = LabelGroups::new(vec![
        LabelGroup::new(ghost, vec![13, 2, 7, u64::MAX], vec![RED, BLUE, RED, RED]).unwrap(),
        LabelGroup::new(gold, vec![8, 3], vec![]).unwrap(),
    ]);
    let mut style = LabelStyle { material: common, groups: groups.unwrap(), ..LabelStyle::default() };
    style.materials = [(3, metal)].into();
    let colored = |base_color| Material { base_color, ..ghost };
    let expected = [colored(BLUE), metal, common, gold, colored(RED), colored(RED)];
    let made = table(&style);
    assert_eq!(each(&made), expected);
    assert!(made.has_transparent());
    // Labels of a group with the same colour share a material: common, blue and red ghosts, gold, and the one of label 3.
    assert_eq!(made.materials().len(), 5);

    let listed: LabelMaterials = IDS.into_iter().zip(expected).collect();
    let listed = LabelStyle { material: common, materials: listed, ..LabelStyle::default() };
    assert_eq!(each(&table(&listed)), expected);
}

#[test]
fn automatic_colors_are_for_labels_without_a_group() {
    let groups = LabelGroups::new(vec![LabelGroup::new(Material::DEFAULT, vec![5], vec![RED]).unwrap()]);
    let automatic = LabelStyle { auto_color: true, ..LabelStyle::default() };
    let grouped = LabelStyle { groups: groups.unwrap(), ..automatic.clone() };
    let (automatic, grouped) = (each(&table(&automatic)), each(&table(&grouped)));
    assert_ne!(automatic[0].base_color, automatic[1].base_color);
    for (label, (a, b)) in automatic.iter().zip(&grouped).enumerate() {
        assert_eq!(b.base_color, if IDS[label] == 5 { RED } else { a.base_color });
    }
}
