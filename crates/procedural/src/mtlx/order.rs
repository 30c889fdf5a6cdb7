//! Nodes in an order in which each follows those that it depends on.

use std::collections::{BTreeMap, BTreeSet};

use super::document::Element;
use crate::finding::{Code, Findings};
use crate::graph::{Node, Source};

/// Sorts the nodes; among those that may come next, the first of the file does. `None`, with findings, where nodes
/// depend on themselves.
pub(super) fn sorted(
    nodes: Vec<Node>,
    outputs: [Source; 3],
    graph: &Element,
    findings: &mut Findings,
) -> Option<(Vec<Node>, [Source; 3])> {
    let needs: Vec<BTreeSet<usize>> = nodes.iter().map(needs).collect();
    let order = peel(&needs);
    if order.len() < nodes.len() {
        report_cycles(&nodes, &needs, &order, graph, findings);
        return None;
    }
    let mut place_of = vec![0; nodes.len()];
    for (place, &node) in order.iter().enumerate() {
        place_of[node] = place;
    }
    let moved = |source: Source| match source {
        Source::Node { node, output } => Source::Node { node: place_of[node], output },
        other => other,
    };
    let mut slots: Vec<Option<Node>> = nodes.into_iter().map(Some).collect();
    let in_order = order.iter().filter_map(|&at| slots[at].take());
    let in_order = in_order.map(|node| Node { inputs: node.inputs.into_iter().map(moved).collect(), ..node }).collect();
    Some((in_order, outputs.map(moved)))
}

fn needs(node: &Node) -> BTreeSet<usize> {
    let of = |source: &Source| match source {
        Source::Node { node, .. } => Some(*node),
        _ => None,
    };
    node.inputs.iter().filter_map(of).collect()
}

/// Nodes whose needs come before them, in order; without those that depend on a cycle.
fn peel(needs: &[BTreeSet<usize>]) -> Vec<usize> {
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); needs.len()];
    for (user, needed) in needs.iter().enumerate() {
        needed.iter().for_each(|&node| users[node].push(user));
    }
    let mut missing: Vec<usize> = needs.iter().map(BTreeSet::len).collect();
    let mut ready: BTreeSet<usize> = (0..needs.len()).filter(|&node| missing[node] == 0).collect();
    let mut order = Vec::with_capacity(needs.len());
    while let Some(node) = ready.pop_first() {
        order.push(node);
        for &user in &users[node] {
            missing[user] -= 1;
            if missing[user] == 0 {
                ready.insert(user);
            }
        }
    }
    order
}

/// Reports the nodes of cycles: what remains after those before and those after all cycles are taken away.
fn report_cycles(
    nodes: &[Node],
    needs: &[BTreeSet<usize>],
    before: &[usize],
    graph: &Element,
    findings: &mut Findings,
) {
    let mut reversed = vec![BTreeSet::new(); nodes.len()];
    for (user, needed) in needs.iter().enumerate() {
        for &node in needed {
            reversed[node].insert(user);
        }
    }
    let outside: BTreeSet<usize> = before.iter().copied().chain(peel(&reversed)).collect();
    // The first element of each name.
    let named: BTreeMap<&str, &Element> = graph.children.iter().rev().map(|child| (child.name(), child)).collect();
    for (_, node) in nodes.iter().enumerate().filter(|(at, _)| !outside.contains(at)) {
        let element = named.get(node.name.as_str()).copied().unwrap_or(graph);
        element.report(findings, Code::Cycle, "this node depends on itself".to_owned());
    }
}
