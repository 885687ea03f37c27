//! Writes the measurements as CSV, one row per value, and as a Markdown page.

use std::fmt::Write;

use super::plots::ranks;
use super::{FormFigures, PaperTables};

fn side_name(side: Option<u32>) -> String {
    side.map_or("undivided".into(), |s| format!("{s}³"))
}

fn form_name(f: &FormFigures) -> String {
    match (f.name.as_str(), f.with_fields) {
        ("Pumice", _) => f.name.clone(),
        (_, true) => format!("{} with fields", f.name),
        (_, false) => f.name.clone(),
    }
}

/// All measurements as tuples of table, row, column and value.
fn figures(v: &PaperTables) -> Vec<(&'static str, String, String, String)> {
    let mut all = Vec::new();
    let mut put = |table, row: &str, column: &str, figure: String| {
        all.push((table, row.to_owned(), column.to_owned(), figure));
    };
    for (axis, d) in ["x", "y", "z"].into_iter().zip(v.dims) {
        put("1", "volume", axis, d.to_string());
    }
    for (column, figure) in [
        ("solid voxels", v.solid),
        ("raw bytes", v.bytes_raw()),
        ("labels", v.labels as u64),
        ("types", v.types as u64),
    ] {
        put("1", "volume", column, figure.to_string());
    }
    let mut form = |table, row: &str, f: &FormFigures| {
        for (column, figure) in [
            ("boxes", f.boxes as u64),
            ("box bytes", f.box_bytes),
            ("bvh bytes", f.bvh_bytes),
            ("tree bytes", f.tree_bytes),
        ] {
            put(table, row, column, figure.to_string());
        }
        for (detail, rates) in [("voxels", &f.fine), ("boxes", &f.coarse)] {
            for (i, kind) in ["camera", "diffuse"].into_iter().enumerate() {
                put(table, row, &format!("{kind} rays at {detail} M/s"), format!("{:.4}", rates.rays[i]));
                put(table, row, &format!("{kind} hits at {detail}"), rates.hits[i].to_string());
                put(table, row, &format!("{kind} nodes a ray at {detail}"), format!("{:.3}", rates.nodes[i]));
            }
        }
    };
    v.forms.iter().for_each(|f| form("3 4", &form_name(f), f));
    v.sides.iter().for_each(|s| form("5.6 sides", &side_name(s.side), &s.figures));
    for step in &v.steps {
        for (took, fields) in step.took.iter().zip(["", " with fields"]) {
            put("5", step.name, &format!("CPU s{fields}"), format!("{:.4}", took.cpu_seconds));
            put("5", step.name, &format!("wall s{fields}"), format!("{:.4}", took.seconds));
        }
    }
    for h in &v.hiding {
        for (i, who) in ["SVDAG (SHARED) with fields", "Pumice"].into_iter().enumerate() {
            let row = format!("{} % shown, {who}", h.shown);
            put("5.6 hiding", &row, "rebuild CPU ms", format!("{:.3}", h.rebuild_ms[i]));
            put("5.6 hiding", &row, "rebuilt M/s", format!("{:.4}", h.rebuilt[i]));
            put("5.6 hiding", &row, "discarding M/s", format!("{:.4}", h.discarding[i]));
        }
    }
    for (reuse, fields) in v.reuse.iter().zip(["without fields", "with fields"]) {
        for l in &reuse.levels {
            let row = format!("{fields}, {}³", l.side);
            put("figure 6", &row, "nodes", l.nodes.to_string());
            put("figure 6", &row, "references", l.references.to_string());
            put("figure 6", &row, "used once", l.once.to_string());
        }
        for (rank, uses) in ranks(&reuse.ranked) {
            put("figure 6 uses", fields, &format!("{rank:.0}"), format!("{uses:.0}"));
        }
    }
    for g in &v.growth {
        for (i, who) in ["SVOs (AABB)", "SVDAGs (TYPE)", "SVDAG (SHARED)"].into_iter().enumerate() {
            let row = format!("{} types, {} boxes", g.types, g.boxes);
            put("figure 6 growth", &row, who, g.bytes[i].to_string());
        }
    }
    all
}

pub(super) fn csv(volumes: &[PaperTables]) -> String {
    let mut text = String::from("volume,table,row,column,figure\n");
    for v in volumes {
        for (table, row, column, figure) in figures(v) {
            let _ = writeln!(text, "{},{table},\"{row}\",{column},{figure}", v.volume);
        }
    }
    text
}

pub(super) fn markdown(machine: &str, volumes: &[PaperTables]) -> String {
    let mut text = format!(
        "# paper\n\n{machine}\n\nThe tables and the figure of the paper, for its encodings in its layouts and for Pumice's own. Each was \
         decoded and compared with the volume, voxel by voxel. All trace the same rays, on one thread; rates are millions per CPU second.\n"
    );
    for v in volumes {
        let _ = writeln!(text, "\n## {}", v.volume);
        one(&mut text, v);
    }
    text
}

fn one(text: &mut String, v: &PaperTables) {
    let raw = v.bytes_raw() as f64;
    let voxels = raw / 4.0;
    let _ = write!(
        text,
        "\nTable 1: the volume.\n\n| dimensions | voxels, 10⁹ | solid | raw, MB | labels | types |\n| --- | --- | --- | --- | --- | --- |\n\
         | {} | {:.3} | {:.2} % | {:.1} | {} | {} |\n",
        v.dims.map(|d| d.to_string()).join(" × "),
        voxels / 1e9,
        100.0 * v.solid as f64 / voxels,
        raw / 1e6,
        v.labels,
        v.types
    );
    *text += "\nTable 3: bytes.\n\n| form | boxes | boxes, MB | BVH, MB | in them, MB | together, MB | of 4 bytes a voxel |\n| --- | --- | --- | --- | --- | --- | --- |\n";
    for f in &v.forms {
        bytes(text, &form_name(f), f, raw);
    }
    let [camera, diffuse] = v.rays;
    let _ = write!(
        text,
        "\nTable 4: {camera} rays of a camera, {diffuse} diffuse rays from their hits; {} % of the labels shown. In brackets: boxes drawn \
         as solid.\n\n| form | camera, M/s | diffuse, M/s | nodes a ray: camera, diffuse | hits: camera, diffuse |\n| --- | --- | --- | --- | --- |\n",
        v.show
    );
    for f in &v.forms {
        rates(text, &form_name(f), f);
    }
    *text += "\nTable 5: seconds of each step, CPU (wall).\n\n| step | without fields | with fields |\n| --- | --- | --- |\n";
    for step in &v.steps {
        let took: Vec<String> =
            step.took.iter().map(|t| format!("{:.3} ({:.3})", t.cpu_seconds, t.seconds)).collect();
        let second = took.get(1).map_or("the same", String::as_str);
        let _ = writeln!(text, "| {} | {} | {second} |", step.name, took.first().map_or("", String::as_str));
    }
    *text += "\nSection 5.6: other sizes of boxes, one graph with fields.\n\n| boxes of | boxes | boxes, MB | BVH, MB | in them, MB | together, MB | of 4 bytes a voxel |\n| --- | --- | --- | --- | --- | --- | --- |\n";
    for s in &v.sides {
        bytes(text, &side_name(s.side), &s.figures, raw);
    }
    *text += "\n| boxes of | camera, M/s | diffuse, M/s | nodes a ray: camera, diffuse | hits: camera, diffuse |\n| --- | --- | --- | --- | --- |\n";
    for s in &v.sides {
        rates(text, &side_name(s.side), &s.figures);
    }
    *text += "\nSection 5.6: labels hidden by building a BVH of only those shown, or by skipping the boxes of the others. Camera rays, M/s.\n\n| shown | building: theirs, ours, CPU ms | rebuilt: theirs, ours | passed over: theirs, ours |\n| --- | --- | --- | --- |\n";
    for h in &v.hiding {
        let _ = writeln!(
            text,
            "| {} % | {:.1}, {:.1} | {:.3}, {:.3} | {:.3}, {:.3} |",
            h.shown,
            h.rebuild_ms[0],
            h.rebuild_ms[1],
            h.rebuilt[0],
            h.rebuilt[1],
            h.discarding[0],
            h.discarding[1]
        );
    }
    *text += "\nFigure 6: uses of the shared graph's nodes.\n\n| nodes over | nodes | uses | uses a node | used once |\n| --- | --- | --- | --- | --- |\n";
    for (reuse, fields) in v.reuse.iter().zip(["without fields", "with fields"]) {
        for l in &reuse.levels {
            let _ = writeln!(
                text,
                "| {}³, {fields} | {} | {} | {:.2} | {:.1} % |",
                l.side,
                l.nodes,
                l.references,
                l.references as f64 / l.nodes.max(1) as f64,
                100.0 * l.once as f64 / l.nodes.max(1) as f64
            );
        }
    }
    *text += "\nAnd growth, with fields, while types are merged one after another.\n\n| types | boxes | SVOs (AABB), MB | SVDAGs (TYPE), MB | SVDAG (SHARED), MB |\n| --- | --- | --- | --- | --- |\n";
    let step = v.growth.len().div_ceil(8).max(1);
    for g in v.growth.iter().rev().step_by(step).collect::<Vec<_>>().into_iter().rev() {
        let [a, b, c] = g.bytes.map(mb);
        let _ = writeln!(text, "| {} | {} | {a} | {b} | {c} |", g.types, g.boxes);
    }
}

fn mb(bytes: u64) -> String {
    format!("{:.3}", bytes as f64 / 1e6)
}

/// Appends a table row with bytes.
fn bytes(text: &mut String, name: &str, f: &FormFigures, raw: f64) {
    let [boxes, bvh, trees, all] = [f.box_bytes, f.bvh_bytes, f.tree_bytes, f.bytes()].map(mb);
    let share = 100.0 * f.bytes() as f64 / raw;
    let _ = writeln!(text, "| {name} | {} | {boxes} | {bvh} | {trees} | {all} | {share:.3} % |", f.boxes);
}

/// Appends a table row with rates of rays.
fn rates(text: &mut String, name: &str, f: &FormFigures) {
    let both = |i: usize| format!("{:.3} ({:.3})", f.fine.rays[i], f.coarse.rays[i]);
    let nodes = match f.fine.nodes {
        [0.0, 0.0] => "–".to_owned(),
        [a, b] => format!("{a:.1}, {b:.1}"),
    };
    let [a, b] = f.fine.hits;
    let _ = writeln!(text, "| {name} | {} | {} | {nodes} | {a}, {b} |", both(0), both(1));
}
