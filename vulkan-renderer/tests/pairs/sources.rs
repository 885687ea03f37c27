//! Lists the functions of Rust and GLSL files. It reads just enough of both languages, and relies on this repository's formatting: items of
//! a file begin in the first column, methods in the fifth.

/// Names of the functions of a Rust file without its tests; methods as `Type::method`.
pub(crate) fn rust_functions(source: &str) -> Vec<String> {
    let before_tests = source.split("#[cfg(test)]").next().unwrap_or(source);
    let mut owner = String::new();
    let mut found = Vec::new();
    for line in before_tests.lines() {
        if line.starts_with("impl") || line.contains("trait ") && !line.starts_with([' ', '/']) {
            owner = owner_of(line);
        }
        let indent = line.len() - line.trim_start().len();
        let Some(name) = function_of(line.trim_start()) else { continue };
        match indent {
            0 => found.push(name.to_owned()),
            _ => found.push(format!("{owner}::{name}")),
        }
    }
    found
}

/// `impl<T: Bound> Trait for Type<T> {` belongs to Type.
fn owner_of(line: &str) -> String {
    let mut depth = 0i32;
    let without_generics: String = line
        .chars()
        .filter(|&c| {
            depth += i32::from(c == '<') - i32::from(c == '>');
            depth == 0 && c != '>'
        })
        .collect();
    let head = without_generics.trim_end_matches(['{', ' ']).split(" where").next().unwrap_or_default();
    let named = match head.rsplit_once(" for ") {
        Some((_, name)) => name,
        None => head.split_once("trait ").or(head.split_once("impl ")).map_or(head, |(_, name)| name),
    };
    let path = named.split(' ').next().unwrap_or_default().trim_end_matches(':');
    path.rsplit("::").next().unwrap_or_default().to_owned()
}

/// The name in `pub(crate) const fn name<T>(`.
fn function_of(line: &str) -> Option<&str> {
    let words = ["pub ", "pub(crate) ", "pub(super) ", "const ", "unsafe "];
    let mut rest = line;
    while let Some(after) = words.iter().find_map(|w| rest.strip_prefix(w)) {
        rest = after;
    }
    let name = rest.strip_prefix("fn ")?;
    name.split(['(', '<']).next()
}

/// Names of the functions of a shader.
pub(crate) fn shader_functions(source: &str) -> Vec<String> {
    let found = source.lines().filter_map(|line| {
        let before = line.split_once('(')?.0;
        let (kind, name) = before.split_once(' ')?;
        let is_word = |w: &str| !w.is_empty() && w.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        (is_word(kind) && is_word(name)).then(|| name.to_owned())
    });
    found.collect()
}

/// The comment at the head of a shader, joined to one line.
pub(crate) fn head_of(source: &str) -> String {
    let lines = source.lines().map_while(|l| l.strip_prefix("//"));
    lines.map(str::trim).collect::<Vec<_>>().join(" ")
}

/// Names that a Rust function may have in a shader: its own, and for methods the same with the type's name, or one word of it, in front.
pub(crate) fn shader_names(function: &str) -> Vec<String> {
    let Some((owner, method)) = function.split_once("::") else { return vec![function.to_owned()] };
    let mut words: Vec<String> = Vec::new();
    for c in owner.chars() {
        if c.is_uppercase() || words.is_empty() {
            words.push(String::new());
        }
        let last = words.len() - 1;
        words[last].extend(c.to_lowercase());
    }
    let mut names = vec![format!("{}_{method}", words.join("_"))];
    names.extend(words.iter().map(|w| format!("{w}_{method}")));
    names.push(method.to_owned());
    names
}
