//! Files that are read and written.

use mateval_procedural::ProceduralError;
use mateval_procedural::library::LIBRARY;
use mateval_procedural::mtlx::to_text;

use super::graphs::{findings, read, text};

const GREY: &str = r#"    <constant name="grey" type="color3" />"#;

#[test]
fn what_is_written_reads_back_as_the_same_graph() {
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        let written = to_text(&graph);
        let again = read(&written).unwrap();
        assert_eq!(again, graph, "{}", entry.name);
        assert_eq!(to_text(&again), written);
        // The twin: another value is another graph.
        let changed = written.replacen("value=\"0", "value=\"0.001", 1);
        assert_ne!(read(&changed).ok(), Some(graph), "{}", entry.name);
    }
}

#[test]
fn text_in_attributes_is_escaped() {
    let mut graph = read(&text("", GREY, "grey")).unwrap();
    graph.doc = Some("a < b & \"c\"\n\t".to_owned());
    assert_eq!(read(&to_text(&graph)).unwrap(), graph);
}

/// A graph that implements a nodedef has the nodedef's inputs as parameters.
#[test]
fn parameters_may_stand_in_a_nodedef() {
    let plain = text(
        r#"<input name="tint" type="color3" value="0.1, 0.2, 0.3" uimin="0, 0, 0" uimax="1, 1, 1" />"#,
        r#"<dot name="tinted" type="color3"><input name="in" type="color3" interfacename="tint" /></dot>"#,
        "tinted",
    );
    let input = plain.lines().find(|line| line.contains("<input name=\"tint\"")).unwrap();
    let nodedef = format!(r#"<nodedef name="ND_test" node="test">{input}</nodedef><nodegraph nodedef="ND_test""#);
    let moved = plain.replace(input, "").replace("<nodegraph", &nodedef);
    assert_eq!(read(&moved).unwrap(), read(&plain).unwrap());
    let unknown = moved.replace(r#"nodedef="ND_test""#, r#"nodedef="ND_other""#);
    assert!(findings(&unknown).iter().any(|found| found.contains("there is no <nodedef> 'ND_other'")));
}

/// Order does not matter, as in MaterialX.
#[test]
fn nodes_may_stand_before_those_that_they_need() {
    let late = r#"
        <multiply name="twice" type="color3">
          <input name="in1" type="color3" nodename="once" /><input name="in2" type="float" value="2" />
        </multiply>
        <constant name="once" type="color3"><input name="value" type="color3" value="0.1, 0.2, 0.3" /></constant>"#;
    let graph = read(&text("", late, "twice")).unwrap();
    let names: Vec<&str> = graph.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["once", "twice", "half"]);
}

#[test]
fn a_file_that_does_not_exist_is_an_io_error() {
    let error = mateval_procedural::mtlx::read_file("no/such.mtlx".as_ref(), &Default::default()).unwrap_err();
    assert!(matches!(error, ProceduralError::Io { .. }), "{error}");
}
