//! Writes a stage with the crate openusd, and measures that: `pumice-bench-openusd ARRAYS.json JOB.json`.
//!
//! ```text
//! ARRAYS.json  default_prim, prims: for each its path, type, names of children,
//!              attributes      name, type, interpolation (or null), uniform, and a token, or a file of `int` or `float3` values
//!              relationships   name, targets
//! JOB.json     out: the file to write, .usda or .usdc; report: where {seconds, cpu_seconds, peak_rss_bytes} goes
//! ```
//! Files hold little-endian values without a header, and are named from the folder of ARRAYS.json. They are read into the types of the
//! crate before the clock starts; it stops when the file is synced.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use cpu_time::ProcessTime;
use openusd::gf::vec3f;
use openusd::sdf::{self, ChildrenKey, Data, FieldKey, PathListOp, SpecType, Specifier, Value, Variability};
use openusd::usda::TextWriter;
use openusd::usdc::CrateWriter;
use serde_json::{Value as Json, json};

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [arrays, job] = arguments.as_slice() else { bail!("expected ARRAYS.json JOB.json") };
    let arrays = Path::new(arrays);
    let (described, job) = (json_of(arrays)?, json_of(Path::new(job))?);
    let folder = arrays.parent().unwrap_or(Path::new("."));
    let values = values_of(&described, folder)?;

    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let data = stage(&described, values)?;
    let out = Path::new(text(&job["out"])?);
    if out.extension().is_some_and(|ending| ending == "usda") {
        let mut file = BufWriter::new(File::create(out)?);
        TextWriter::write(&data, &mut file)?;
        file.flush()?;
        file.get_ref().sync_all()?;
    } else {
        // Syncs the file itself.
        CrateWriter::write_to_file(&data, out)?;
    }
    let report = json!({
        "seconds": wall.elapsed().as_secs_f64(),
        "cpu_seconds": cpu.elapsed().as_secs_f64(),
        "peak_rss_bytes": peak_rss_bytes()?,
    });
    Ok(std::fs::write(text(&job["report"])?, report.to_string())?)
}

fn json_of(path: &Path) -> Result<Json> {
    let file = BufReader::new(File::open(path).with_context(|| path.display().to_string())?);
    Ok(serde_json::from_reader(file)?)
}

fn text(json: &Json) -> Result<&str> {
    json.as_str().with_context(|| format!("expected a text, got {json}"))
}

fn list(json: &Json) -> Result<&Vec<Json>> {
    json.as_array().with_context(|| format!("expected a list, got {json}"))
}

/// The values of all attributes, in their order.
fn values_of(described: &Json, folder: &Path) -> Result<Vec<Value>> {
    let mut values = Vec::new();
    for prim in list(&described["prims"])? {
        for attribute in list(&prim["attributes"])? {
            values.push(match (attribute["token"].as_str(), attribute["file"].as_str()) {
                (Some(token), _) => Value::Token(token.into()),
                (None, Some(file)) => array(&folder.join(file), text(&attribute["kind"])?)?,
                (None, None) => bail!("an attribute without a value: {attribute}"),
            });
        }
    }
    Ok(values)
}

fn array(path: &Path, kind: &str) -> Result<Value> {
    let file = File::open(path).with_context(|| path.display().to_string())?;
    let count = file.metadata()?.len() as usize / 4;
    let mut file = BufReader::with_capacity(1 << 16, file);
    let mut four = || {
        let mut bytes = [0; 4];
        file.read_exact(&mut bytes).map(|()| bytes)
    };
    Ok(match kind {
        "int" => {
            let values: std::io::Result<_> = (0..count).map(|_| Ok(i32::from_le_bytes(four()?))).collect();
            Value::IntVec(values?)
        }
        "float3" => {
            let mut float = || Ok::<_, std::io::Error>(f32::from_le_bytes(four()?));
            let mut values = Vec::with_capacity(count / 3);
            for _ in 0..count / 3 {
                values.push(vec3f(float()?, float()?, float()?));
            }
            Value::Vec3fVec(values)
        }
        other => bail!("{}: expected int or float3, got {other}", path.display()),
    })
}

/// The stage with these values.
fn stage(described: &Json, values: Vec<Value>) -> Result<Data> {
    let tokens = |json: &Json| -> Result<Value> {
        let tokens: Result<Vec<_>> = list(json)?.iter().map(|name| Ok(text(name)?.into())).collect();
        Ok(Value::TokenVec(tokens?))
    };
    let mut data = Data::new();
    let mut values = values.into_iter();
    let root = data.create_spec(sdf::Path::abs_root(), SpecType::PseudoRoot);
    root.add(FieldKey::DefaultPrim, Value::Token(text(&described["default_prim"])?.into()));
    root.add(ChildrenKey::PrimChildren, tokens(&json!([described["default_prim"]]))?);
    for prim in list(&described["prims"])? {
        let path = sdf::path(text(&prim["path"])?)?;
        let (attributes, relationships) = (list(&prim["attributes"])?, list(&prim["relationships"])?);
        let properties: Vec<Json> =
            attributes.iter().chain(relationships).map(|property| property["name"].clone()).collect();
        let spec = data.create_spec(path.clone(), SpecType::Prim);
        spec.add(FieldKey::Specifier, Value::Specifier(Specifier::Def));
        spec.add(FieldKey::TypeName, Value::Token(text(&prim["type"])?.into()));
        spec.add(ChildrenKey::PrimChildren, tokens(&prim["children"])?);
        spec.add(ChildrenKey::PropertyChildren, tokens(&Json::Array(properties))?);
        for attribute in attributes {
            let spec = data
                .create_spec(path.clone().append_property(text(&attribute["name"])?)?, SpecType::Attribute);
            spec.add(FieldKey::TypeName, Value::Token(text(&attribute["type"])?.into()));
            spec.add(FieldKey::Default, values.next().context("fewer values than attributes")?);
            if attribute["uniform"] == true {
                spec.add(FieldKey::Variability, Value::Variability(Variability::Uniform));
            }
            if let Some(interpolation) = attribute["interpolation"].as_str() {
                spec.add("interpolation", Value::Token(interpolation.into()));
            }
        }
        for relationship in relationships {
            let targets: Result<Vec<_>> =
                list(&relationship["targets"])?.iter().map(|target| Ok(sdf::path(text(target)?)?)).collect();
            let spec = data.create_spec(
                path.clone().append_property(text(&relationship["name"])?)?,
                SpecType::Relationship,
            );
            spec.add(FieldKey::TargetPaths, Value::PathListOp(PathListOp::explicit(targets?)));
        }
    }
    Ok(data)
}

/// Largest resident set of this process so far, in bytes (Linux: proc_pid_status(5)).
fn peak_rss_bytes() -> Result<u64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).context("no VmHWM")?;
    let kib: u64 = line.trim().trim_end_matches("kB").trim().parse()?;
    Ok(1024 * kib)
}
