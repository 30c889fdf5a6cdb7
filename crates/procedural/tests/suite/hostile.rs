//! Files that are refused, with the name and line of every fault.

use mateval_procedural::ProceduralError;
use mateval_procedural::error::Code;
use mateval_procedural::mtlx::read_text;

use super::graphs::{findings, read, text};

const GREY: &str = r#"<constant name="grey" type="color3" />"#;

/// Asserts that a file is accepted, and refused with exactly this finding once `from` is replaced by `to`.
fn refused(good: &str, from: &str, to: &str, finding: &str) {
    assert_eq!(findings(good), [""; 0], "{good}");
    assert!(good.contains(from), "{from}");
    assert_eq!(findings(&good.replacen(from, to, 1)), [finding], "{to}");
}

#[test]
fn faults_are_named_with_their_element_and_line() {
    let good = text(
        r#"<input name="size" type="float" value="0.1" uimin="0.01" uimax="1" />"#,
        r#"<noise2d name="grain" type="color3"><input name="amplitude" type="float" interfacename="size" /></noise2d>"#,
        "grain",
    );
    let cases = [
        (
            "<noise2d",
            "<noise2d bogus='1'",
            "line 5: noise2d 'grain': the attribute 'bogus' is not supported [attribute]",
        ),
        (
            r#"interfacename="size""#,
            "value='nan'",
            "line 5: input 'amplitude': value: expected a finite number, found 'nan' [value]",
        ),
        (
            r#"interfacename="size""#,
            "interfacename='sise'",
            "line 5: input 'amplitude': the graph has no input 'sise' [connection]",
        ),
        (
            r#"interfacename="size""#,
            "nodename='coarse'",
            "line 5: input 'amplitude': there is no node 'coarse' [connection]",
        ),
        (
            r#"interfacename="size""#,
            "interfacename='size' value='1'",
            "line 5: input 'amplitude': expected one of the attributes 'value', 'nodename' and 'interfacename' [connection]",
        ),
        (
            r#""amplitude" type="float""#,
            r#""amplitude" type="color3""#,
            "line 5: noise2d 'grain': no color3 noise2d has inputs of these types: color3 amplitude [type]",
        ),
        (r#""amplitude""#, r#""size""#, "line 5: input 'size': a color3 noise2d has no input 'size' [unknown_input]"),
        (
            r#"value="0.1""#,
            r#"value="2""#,
            "line 4: input 'size': expected uimin <= value <= uimax, found 0.01, 2, 1 [value]",
        ),
        (
            r#"type="float" value="0.1""#,
            r#"type="boolean" value="0.1""#,
            "line 4: input 'size': expected a type of float, integer, vector2, vector3, color3, found 'boolean' [type]",
        ),
        (
            r#"<output name="metallic" type="float" nodename="half" />"#,
            "",
            "line 3: nodegraph 'NG_test': expected an output 'metallic', found none [output]",
        ),
        (
            r#"<output name="metallic" type="float""#,
            r#"<output name="metallic" type="color3""#,
            "line 9: output 'metallic': expected a connection of type float, found color3 [type]",
        ),
        (
            r#"<constant name="half""#,
            r#"<dot name="grain" type="float" /><constant name="half""#,
            "line 6: dot 'grain': another element within nodegraph 'NG_test' has this name [duplicate_name]",
        ),
        (
            r#"version="1.39""#,
            r#"version="1.38""#,
            "line 2: <materialx>: expected version 1.39 of MaterialX, found '1.38' [attribute]",
        ),
        (
            "lin_rec709",
            "srgb_texture",
            "line 2: <materialx>: expected the colour space lin_rec709, found 'srgb_texture' [attribute]",
        ),
    ];
    for (from, to, finding) in cases {
        refused(&good, from, to, finding);
    }
}

/// The faults of one file are reported together, sorted by line.
#[test]
fn all_faults_are_reported_at_once() {
    let bad = text(
        r#"<input name="size" type="matrix33" value="1" />"#,
        r#"<noise3d name="grain" type="float" />
           <add name="sum" type="color3"><input name="in1" type="color3" value="1, 2" /></add>
           <image name="photo" type="color3" />"#,
        "sum",
    );
    let found = findings(&bad);
    assert_eq!(found.len(), 4, "{found:#?}");
    for (found, expected) in found.iter().zip([
        "line 4: input 'size'",
        "line 5: noise3d 'grain': this node is not supported [unknown_node]",
        "line 6: input 'in1': value: expected 3 numbers",
        "line 7: image 'photo': this node is not supported [unknown_node]",
    ]) {
        assert!(found.starts_with(expected), "{found}");
    }
}

/// Only the nodes of a cycle are named, not those before or after it.
#[test]
fn cycles_are_refused() {
    let nodes = |third: &str| {
        format!(
            r#"<constant name="before" type="color3" />
            <add name="one" type="color3"><input name="in1" type="color3" nodename="before" />
              <input name="in2" type="color3" nodename="{third}" /></add>
            <add name="two" type="color3"><input name="in1" type="color3" nodename="one" /></add>
            <add name="after" type="color3"><input name="in1" type="color3" nodename="two" /></add>"#
        )
    };
    assert_eq!(findings(&text("", &nodes("before"), "after")), [""; 0]);
    let found = findings(&text("", &nodes("two"), "after"));
    let cycle = |line: usize, name: &str| format!("line {line}: add '{name}': this node depends on itself [cycle]");
    assert_eq!(found, [cycle(6, "one"), cycle(8, "two")]);
    assert_eq!(findings(&text("", &nodes("one"), "after")), [cycle(6, "one")]);
}

#[test]
fn selectors_are_whole_numbers_in_range() {
    let octaves = |source: &str| {
        let node = format!(
            r#"<fractal2d name="f" type="color3"><input name="octaves" type="integer" {source} /></fractal2d>"#
        );
        text(r#"<input name="n" type="integer" value="3" uimin="1" uimax="6" />"#, &node, "f")
    };
    assert_eq!(findings(&octaves(r#"interfacename="n""#)), [""; 0]);
    let too_many = octaves(r#"value="1000000000""#);
    assert_eq!(findings(&too_many), ["line 5: fractal2d 'f': octaves: expected 0 to 16, found 1000000000 [value]"]);
    let unbounded = octaves(r#"interfacename="n""#).replace(r#" uimax="6""#, "");
    assert_eq!(findings(&unbounded), ["line 5: fractal2d 'f': octaves: expected 0 to 16, found 1 to inf [value]"]);

    let extract = |index: i32| {
        let nodes = format!(
            r#"<extract name="e" type="float"><input name="in" type="vector2" value="1, 2" />
              <input name="index" type="integer" value="{index}" /></extract>
            <convert name="c" type="color3"><input name="in" type="float" nodename="e" /></convert>"#
        );
        findings(&text("", &nodes, "c"))
    };
    assert_eq!(extract(1), [""; 0]);
    assert_eq!(extract(2), ["line 5: extract 'e': index: expected 0 to 1, found 2 [value]"]);
    assert_eq!(extract(-1).len(), 1);
}

/// Only the first set of texture coordinates is evaluated.
#[test]
fn other_texture_coordinates_are_refused() {
    let good = text(
        "",
        r#"<texcoord name="uv" type="vector2"><input name="index" type="integer" value="0" /></texcoord>
           <convert name="c" type="color3"><input name="in" type="vector2" nodename="uv" /></convert>"#,
        "c",
    );
    refused(&good, r#"value="0""#, r#"value="1""#, "line 5: texcoord 'uv': index: expected 0, found 1 [value]");
}

/// The inputs of a nodedef become parameters of the graph, and are written as such.
#[test]
fn inputs_of_a_nodedef_are_checked() {
    let node = r#"<dot name="d" type="color3"><input name="in" type="color3" interfacename="tint" /></dot>"#;
    let nodedef = concat!(
        r#"<nodedef name="ND_test"><input name="tint" type="color3" value="1, 1, 1" />"#,
        r#"<input name="size" type="float" value="1" /><output name="roughness" type="float" /></nodedef>"#,
        "\n  <nodegraph nodedef='ND_test'"
    );
    let good = text("", node, "d").replace("<nodegraph", nodedef);
    let size = r#"<input name="size""#;
    let names = "expected a name made of letters, digits and underscores [attribute]";
    let cases = [
        (size, "<input", format!("line 3: <input>: {names}")),
        (size, "<input name='a\"b'", format!("line 3: input 'a\"b': {names}")),
        (
            size,
            r#"<input name="tint""#,
            "line 3: input 'tint': another element within nodedef 'ND_test' has this name [duplicate_name]".to_owned(),
        ),
        (
            size,
            r#"<input name="half""#,
            "line 3: input 'half': another element within nodegraph 'NG_test' has this name [duplicate_name]"
                .to_owned(),
        ),
        (
            r#"<dot name="d""#,
            r#"<input name="x" type="float" value="1" /><dot name="d""#,
            "line 6: input 'x': expected the inputs within nodedef 'ND_test' [unknown_element]".to_owned(),
        ),
        (
            "<output",
            r#"<dot name="x" /><output"#,
            "line 3: dot 'x': expected <input> or <output> [unknown_element]".to_owned(),
        ),
    ];
    for (from, to, finding) in cases {
        refused(&good, from, to, &finding);
    }
}

/// The prefix of graphs is cut off names, but not from one that is nothing else.
#[test]
fn no_graph_has_an_empty_name() {
    let graph = read(&text("", GREY, "grey").replace("NG_test", "NG_")).unwrap();
    assert_eq!(graph.name, "NG_");
    assert_eq!(read(&mateval_procedural::mtlx::to_text(&graph)).unwrap(), graph);
    assert_eq!(read(&text("", GREY, "grey")).unwrap().name, "test");
}

/// A shader that would show something else than what is evaluated is refused.
#[test]
fn shaders_may_only_show_the_graphs_outputs() {
    let good = mateval_procedural::mtlx::to_text(&read(&text("", GREY, "grey")).unwrap());
    let extra = r#"<input name="coat" type="float" value="1" /></standard_surface>"#;
    let bad = good.replace("</standard_surface>", extra);
    assert_eq!(findings(&good), [""; 0]);
    let found = findings(&bad);
    assert!(
        found.len() == 2 && found[1].contains("expected base_color, specular_roughness and metalness"),
        "{found:?}"
    );
    let swapped = good.replacen(r#"output="base_color""#, r#"output="roughness""#, 1);
    assert_eq!(findings(&swapped).len(), 1);
}

#[test]
fn bombs_and_broken_xml_are_refused() {
    let bomb = r#"<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><materialx version="1.39">&b;</materialx>"#;
    for text in
        [bomb, "", "<materialx", "<materialx></other>", "<scene version='1.39' />", "<materialx version='1.39' />"]
    {
        assert_eq!(findings(text).len(), 1, "{text}");
    }
    assert!(findings(bomb)[0].contains("without a DTD"));
}

#[test]
fn a_million_nodes_and_great_depth_are_refused_early() {
    let many = text("", &format!("{GREY}{}", "<dot/>".repeat(600_000)), "grey");
    assert_eq!(findings(&many), ["expected XML without a DTD: it has too many elements [xml]"]);
    // Fewer than the XML may have, but more than a graph may.
    let several: String = (0..3000).map(|at| format!(r#"<dot name="n{at}" type="float" />"#)).collect();
    let found = findings(&text("", &format!("{GREY}{several}"), "grey"));
    assert!(
        found.iter().any(|found| found.contains("expected at most 2048 nodes, found 3002 [too_many]")),
        "{found:?}"
    );
    let inputs: String = (0..300).map(|at| format!(r#"<input name="p{at}" type="float" value="0" />"#)).collect();
    let found = findings(&text(&inputs, GREY, "grey"));
    assert_eq!(found, ["line 3: nodegraph 'NG_test': expected at most 256 inputs, found 300 [too_many]"]);

    let deep = format!("{}{}", "<dot>".repeat(60_000), "</dot>".repeat(60_000));
    let found = findings(&text("", &format!("{GREY}{deep}"), "grey"));
    assert_eq!(found, ["line 5: expected elements nested at most 8 deep, found deeper ones [xml]"]);
    let long = format!("<!--{}-->", "x".repeat(5 << 20));
    assert!(findings(&long)[0].contains("expected at most 4194304 bytes"));
}

/// Text on which a parser would take minutes.
#[test]
fn crowds_of_attributes_and_namespaces_are_refused_early() {
    let start = std::time::Instant::now();
    let attributes = |count: usize| (0..count).map(|at| format!(" a{at} =\n'>'")).collect::<String>();
    let crowd = |count: usize| text("", &format!("{GREY}<dot{} />", attributes(count)), "grey");
    let refusal = ["line 5: expected at most 64 attributes of an element, found more [xml]"];
    assert_eq!(findings(&crowd(300_000)), refusal);
    assert_eq!(findings(&crowd(65)), refusal);
    let spaces: String = (0..60_000).map(|at| format!("<a xmlns:b{at}=''>")).collect();
    assert_eq!(
        findings(&text("", &format!("{GREY}{spaces}"), "grey")),
        ["expected at most 16 namespaces, found more [xml]"]
    );
    // Names that are compared with all others.
    let inputs: String = (0..60_000).map(|at| format!("<input name='i{at}'/>")).collect();
    assert!(findings(&text("", &format!("{GREY}<dot name='d' type='float'>{inputs}</dot>"), "grey")).len() > 200);
    let surfaces = "<standard_surface name='s'/>".repeat(30_000);
    let uses = "<input nodename='t'/>".repeat(30_000);
    let shown = format!("{surfaces}<surfacematerial name='m'>{uses}</surfacematerial></materialx>");
    assert!(findings(&text("", GREY, "grey").replace("</materialx>", &shown)).len() > 200);
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    // The twins: 64 attributes are parsed, and equals signs elsewhere are none.
    assert!(
        findings(&crowd(64))
            .iter()
            .all(|found| found.contains("[attribute]") || found.contains("'dot'") || found.contains("<dot>"))
    );
    assert_eq!(findings(&text("", &format!("<!--{}-->{GREY}", "=".repeat(100)), "grey")), [""; 0]);
}

#[test]
fn long_tags_are_cut_in_messages() {
    let tag = "x".repeat(100_000);
    let node = format!("<constant name='grey' type='color3'/><{tag}><input><{tag}/></input></{tag}>");
    let node =
        node + &format!("<dot name='d' type='float'><input name='in' type='float' value='1'><{tag}/></input></dot>");
    let surface = format!("<standard_surface name='SR'><{tag}><{tag}/></{tag}></standard_surface></materialx>");
    let found = findings(&text("", &node, "grey").replace("</materialx>", &surface));
    assert!(found.len() >= 4, "{found:?}");
    assert!(found.iter().all(|found| found.len() < 300), "{found:?}");
}

#[test]
fn long_files_are_refused_whatever_they_hold() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let refusal = |bytes: &[u8]| {
        std::fs::write(file.path(), bytes).unwrap();
        mateval_procedural::mtlx::read_file(file.path()).unwrap_err().to_string()
    };
    // A letter of two bytes is cut at the limit.
    let long = refusal(format!("a{}", "ä".repeat(3 << 20)).as_bytes());
    assert!(long.ends_with("1 finding: expected at most 4194304 bytes, found more [xml]"), "{long}");
    assert!(refusal(b"<materialx a='\xff'>").contains("expected UTF-8 text"));
}

/// More faults than anyone reads are counted.
#[test]
fn findings_are_limited() {
    let many: String = (0..1000).map(|at| format!(r#"<image name="n{at}" type="float" />"#)).collect();
    let Err(ProceduralError::Invalid { findings, .. }) = read_text("x", &text("", &format!("{GREY}{many}"), "grey"))
    else {
        panic!("accepted")
    };
    let last = findings.last().unwrap();
    assert_eq!(
        (findings.len(), last.code, last.message.as_str()),
        (201, Code::TooMany, "800 more findings are not listed")
    );
}
