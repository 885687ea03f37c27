//! Builds one SVDAG for each label type, and merges them into one (§3.2.2, Table 5).

use rayon::prelude::*;

use crate::dag::{Dag, DagBuilder};
use crate::subdivision::Subdivision;
use crate::types::Types;

/// A merged graph, with the new index of each node of the graphs that were merged.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The merged graph.
    pub dag: Dag,
    /// For each source graph: the index in `dag` of each of its nodes.
    pub numbers: Vec<Vec<u32>>,
    /// Number of nodes after each source graph, by [`merge_in_turn`]; empty by [`merge_on_all_cores`].
    pub growth: Vec<usize>,
}

/// Builds a graph for each type, on all cores. Returns the graphs, and for each box the index of its root in its type's graph.
pub(crate) fn graphs_of_types(boxes: &Subdivision, types: &Types, with_fields: bool) -> (Vec<Dag>, Vec<u32>) {
    let mut of_type = vec![Vec::new(); types.count()];
    for (i, b) in boxes.boxes().iter().enumerate() {
        of_type[types.of(b.label)].push(i);
    }
    let built: Vec<(Dag, Vec<u32>)> = of_type
        .par_iter()
        .map(|its| {
            let mut dag = DagBuilder::new(with_fields);
            let roots = its.iter().map(|&i| dag.add(boxes.cells(i), boxes.levels(i), 0)).collect();
            (dag.finish(), roots)
        })
        .collect();
    let mut roots = vec![0; boxes.boxes().len()];
    let mut dags = Vec::with_capacity(built.len());
    for ((dag, its_roots), its) in built.into_iter().zip(&of_type) {
        its.iter().zip(its_roots).for_each(|(&i, root)| roots[i] = root);
        dags.push(dag);
    }
    (dags, roots)
}

/// Merges graphs into one, one after another on one core.
pub fn merge_in_turn(dags: &[Dag], with_fields: bool) -> Merged {
    let mut all = DagBuilder::new(with_fields);
    let (mut numbers, mut growth) = (Vec::with_capacity(dags.len()), Vec::with_capacity(dags.len()));
    for dag in dags {
        numbers.push(all.absorb(dag));
        growth.push(all.len());
    }
    Merged { dag: all.finish(), numbers, growth }
}

/// Merges graphs into one on all cores: recursively merges two halves in parallel, then adds the shorter graph to the longer.
pub fn merge_on_all_cores(dags: &[Dag], with_fields: bool) -> Merged {
    let (all, numbers) = halves(dags, with_fields, rayon::current_num_threads());
    Merged { dag: all.finish(), numbers, growth: Vec::new() }
}

fn halves(dags: &[Dag], with_fields: bool, cores: usize) -> (DagBuilder, Vec<Vec<u32>>) {
    // Stops at as many parts as cores, because each further cut merges more nodes twice.
    if dags.len() < 2 || cores < 2 {
        let mut all = DagBuilder::new(with_fields);
        let numbers = dags.iter().map(|dag| all.absorb(dag)).collect();
        return (all, numbers);
    }
    let middle = middle(dags);
    let (first, second) = rayon::join(
        || halves(&dags[..middle], with_fields, cores.div_ceil(2)),
        || halves(&dags[middle..], with_fields, cores / 2),
    );
    let swap = first.0.len() < second.0.len();
    let ((mut long, mut long_numbers), (short, mut short_numbers)) =
        if swap { (second, first) } else { (first, second) };
    let moved = long.absorb(&short.finish());
    short_numbers.iter_mut().flatten().for_each(|n| *n = moved[*n as usize]);
    let numbers = if swap {
        short_numbers.append(&mut long_numbers);
        short_numbers
    } else {
        long_numbers.append(&mut short_numbers);
        long_numbers
    };
    (long, numbers)
}

/// Where to split the graphs so that both parts have about the same number of nodes and at least one graph each.
fn middle(dags: &[Dag]) -> usize {
    let all: usize = dags.iter().map(|d| d.nodes().len()).sum();
    let mut before = 0;
    let half = dags.iter().position(|d| {
        before += d.nodes().len();
        2 * before >= all
    });
    half.unwrap_or(0).clamp(1, dags.len() - 1)
}
