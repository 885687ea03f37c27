//! Tables of labels of every format: what is read from sample lines of each program, round trips, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};

use pumice_core::{AnnotationTable, NumericColumn};
use pumice_formats::{LabelTableFile, LabelTableFormat, read_label_table, write_label_table};
use tempfile::TempDir;

/// Writes a file into a fresh folder.
fn file(name: &str, content: impl AsRef<[u8]>) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, content).unwrap();
    (folder, path)
}

fn read(name: &str, content: impl AsRef<[u8]>) -> LabelTableFile {
    let (_folder, path) = file(name, content);
    read_label_table(&path).unwrap()
}

/// The error's line without the file's path.
fn refused(name: &str, content: impl AsRef<[u8]>) -> String {
    let (_folder, path) = file(name, content);
    let error = read_label_table(&path).unwrap_err().to_string();
    assert!(!error.contains('\n'), "{error}");
    error.strip_prefix(&format!("{}: ", path.display())).unwrap_or(&error).to_owned()
}

fn bytes(table: &AnnotationTable) -> Vec<Option<[u8; 3]>> {
    let byte = |c: f32| (c * 255.0).round() as u8;
    table.colors_srgb().iter().map(|color| color.map(|c| c.map(byte))).collect()
}

fn column(name: &str, values: &[f64]) -> NumericColumn {
    NumericColumn { name: name.into(), values: values.to_vec() }
}

/// A table with all kinds of ids, texts and numbers.
fn table() -> AnnotationTable {
    let texts = |texts: [&str; 4]| texts.map(str::to_owned).to_vec();
    AnnotationTable::new(
        vec![3, 17, 9_007_199_254_740_993, u64::MAX],
        texts(["PV, \"basket\"", "Ästroglia", "", "line\nbreak"]),
        texts(["axon", "", "glia", "axon"]),
        vec![Some([1.0, 128.0 / 255.0, 0.0]), None, Some([0.0; 3]), Some([1.0 / 255.0; 3])],
        vec![
            column("depth", &[0.1 + 0.2, f64::NAN, -1e300, 5e-324]),
            column("count", &[0.0, 7.0, 1e15, 3.0]),
        ],
    )
    .unwrap()
}

/// The same with colours for all, and texts and ids that every format can hold.
fn plain() -> AnnotationTable {
    let texts = |texts: [&str; 3]| texts.map(str::to_owned).to_vec();
    let colors = [[255u8, 128, 0], [1, 2, 3], [0, 0, 0]].map(|c| Some(c.map(|b| f32::from(b) / 255.0)));
    AnnotationTable::new(
        vec![1, 5, 60_000],
        texts(["left-lobe", "Ä", "x1"]),
        texts(["", "", ""]),
        colors.to_vec(),
        vec![],
    )
    .unwrap()
}

#[test]
fn csv_and_tsv_keep_everything() {
    for (format, name) in [(LabelTableFormat::Csv, "t.csv"), (LabelTableFormat::Tsv, "t.tsv")] {
        let (_folder, path) = file(name, "");
        assert_eq!(write_label_table(&path, format, &table()).unwrap(), Vec::<String>::new());
        let back = read_label_table(&path).unwrap();
        assert_eq!((&back.table, back.format), (&table(), format), "{}", fs::read_to_string(&path).unwrap());
        assert!(back.notes.is_empty());
    }
}

#[test]
fn formats_of_lines_keep_ids_names_and_colours() {
    for format in [LabelTableFormat::ItkSnap, LabelTableFormat::FreeSurfer, LabelTableFormat::Slicer] {
        let (_folder, path) = file("t", "");
        assert_eq!(write_label_table(&path, format, &plain()).unwrap(), Vec::<String>::new());
        let back = read_label_table(&path).unwrap();
        assert_eq!(back.format, format);
        assert!(back.notes.is_empty(), "{:?}", back.notes);
        // These formats begin with the background.
        assert_eq!(back.table.ids(), [0, 1, 5, 60_000]);
        assert_eq!(back.table.names()[1..], *plain().names());
        assert_eq!(bytes(&back.table)[1..], *bytes(&plain()));

        // They say what they do not hold, and refuse labels without a colour.
        let error = write_label_table(&path, format, &table()).unwrap_err().to_string();
        assert!(error.contains("label 17 has no colour"), "{error}");
        assert_eq!(read_label_table(&path).unwrap().table, back.table, "the file is as before");
        let colors = vec![Some([0.5; 3]); 4];
        let all = table();
        let (ids, names, types) = (all.ids().to_vec(), all.names().to_vec(), all.types().to_vec());
        let colored = AnnotationTable::new(ids, names, types, colors, all.columns().to_vec()).unwrap();
        let notes = write_label_table(&path, format, &colored).unwrap().join("; ");
        for what in ["types of 3 labels", "columns depth, count", "1 labels have no name"] {
            assert!(notes.contains(what), "{notes}");
        }
        assert_eq!(read_label_table(&path).unwrap().table.ids()[1..], *all.ids());
    }
}

/// A comma or a quote in the first name made a table of FreeSurfer look like CSV (found by fuzzing).
#[test]
fn the_first_name_does_not_change_the_format() {
    for name in ["a,b", "a;b", "\"a\"", "#a"] {
        let names = vec![name.to_owned()];
        let table =
            AnnotationTable::new(vec![0], names.clone(), vec![String::new()], vec![Some([0.0; 3])], vec![])
                .unwrap();
        for format in [LabelTableFormat::ItkSnap, LabelTableFormat::FreeSurfer, LabelTableFormat::Slicer] {
            let (_folder, path) = file("t", "");
            write_label_table(&path, format, &table).unwrap();
            let back = read_label_table(&path).unwrap();
            assert_eq!((back.format, back.table.names()), (format, &names[..]), "{name}");
        }
    }
}

#[test]
fn neuroglancer_keeps_ids_names_types_and_numbers() {
    let texts = |texts: [&str; 3]| texts.map(str::to_owned).to_vec();
    let written = AnnotationTable::new(
        vec![3, 17, u64::MAX],
        texts(["PV, \"basket\"", "", "line\nbreak"]),
        texts(["axon", "", "initial segment"]),
        vec![None, Some([1.0; 3]), None],
        vec![
            column("small", &[0.0, 255.0, 7.0]),
            column("signed", &[-1.0, 0.0, 40_000.0]),
            column("exact", &[0.5, -2.0, 1024.25]),
            column("rounded", &[0.1, 0.0, 0.0]),
            column("missing", &[1.0, f64::NAN, 0.0]),
            column("huge", &[1e300, 0.0, 0.0]),
        ],
    )
    .unwrap();
    let (folder, path) = file("info", "");
    let notes = write_label_table(&path, LabelTableFormat::Neuroglancer, &written).unwrap().join("; ");
    for what in [
        "spaces in the types of 1 labels",
        "1 numbers of the column rounded",
        "column missing, which has no number for 1 labels",
        "column huge, which has 1e300",
        "colours of 1 labels",
    ] {
        assert!(notes.contains(what), "{notes}");
    }
    // The folder stands for its file `info`.
    let back = read_label_table(folder.path()).unwrap();
    assert_eq!((back.table.ids(), back.table.names()), (written.ids(), written.names()));
    assert_eq!(back.table.types(), ["axon", "", "initial_segment"]);
    assert_eq!(back.table.columns(), &written.columns()[..4]);
    // Numbers have the type that holds them.
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let types: Vec<&str> = json["inline"]["properties"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|p| p["data_type"].as_str())
        .collect();
    assert_eq!(types, ["uint8", "int32", "float32", "float32"]);
}

#[test]
fn sample_lines_of_each_program_are_read() {
    let snap = read(
        "labels.txt",
        "################################################\n# ITK-SnAP Label Description File\n# IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL\n\
         ################################################\n    0     0    0    0        0  0  0    \"Clear Label\"\n    \
         1   255    0    0        1  1  1    \"Inner \"ERC\"/CS\"\n  200   186  194  212      0.5  1  0    \"Deep_R\"\n",
    );
    assert_eq!((snap.format, snap.table.ids()), (LabelTableFormat::ItkSnap, &[0, 1, 200][..]));
    assert_eq!(snap.table.names(), ["Clear Label", "Inner \"ERC\"/CS", "Deep_R"]);
    assert_eq!(bytes(&snap.table)[2], Some([186, 194, 212]));
    assert_eq!(snap.notes, ["left out: opacity and visibility, which are not 1 for 1 labels"]);

    let free = read(
        "FreeSurferColorLUT.txt",
        "#$Id: FreeSurferColorLUT.txt,v 1.70 $\n\n#No. Label Name:                            R   G   B   A\n\n\
         0   Unknown                                 0   0   0   0\n2   Left-Cerebral-White-Matter              245 245 245 0\n\
         1002  ctx-lh-caudalanteriorcingulate        125 100 160 0\n",
    );
    assert_eq!((free.format, free.table.ids()), (LabelTableFormat::FreeSurfer, &[0, 2, 1002][..]));
    assert_eq!(free.table.names()[1], "Left-Cerebral-White-Matter");
    assert_eq!(bytes(&free.table)[2], Some([125, 100, 160]));
    assert!(free.notes.is_empty());

    let slicer = read(
        "x.txt",
        "# Color table file C:/Users/a/Segmentation-label_ColorTable.ctbl\n# 4 values\n0 Background 0 0 0 0\n1 artery 216 101 79 255\n\
         2 bone 241 214 145 255 whatever after the opacity\n3 connective_tissue 111 184 210 128\n",
    );
    assert_eq!((slicer.format, slicer.table.ids()), (LabelTableFormat::Slicer, &[0, 1, 2, 3][..]));
    assert_eq!(slicer.table.names()[3], "connective tissue");
    assert_eq!(bytes(&slicer.table)[1], Some([216, 101, 79]));
    assert_eq!(slicer.notes, ["left out: opacity, which is not 255 for 1 labels"]);
    // Before version 4.3, colours were from 0 to 1. The ending alone says what it is.
    let old = read("old.ctbl", "# Comments\n0 air 0 0 0 0\n1 bone 1 1 1 1 whatever\n2 tumor 1 0.5 0 1\n");
    assert_eq!(bytes(&old.table), [Some([0; 3]), Some([255; 3]), Some([255, 128, 0])]);
    // Slicer's newer tables are CSV.
    let new = read(
        "s.csv",
        "LabelValue,Name,Color_R,Color_G,Color_B,Color_A,Type_CodeMeaning\n10,liver,221,130,101,255,Liver\n",
    );
    assert_eq!((new.table.ids(), new.table.names()), (&[10][..], &["liver".to_owned()][..]));
    assert_eq!(bytes(&new.table), [Some([221, 130, 101])]);
    assert_eq!(new.table.columns(), []);
    assert_eq!(
        new.notes,
        [
            "left out: the column Color_A, which is opacity",
            "left out: the column Type_CodeMeaning, because line 2 has `Liver`, which is no number"
        ]
    );

    // BIDS (dseg.tsv): index, name, abbreviation, color, mapping.
    let bids =
        read("dseg.tsv", "index\tname\tabbreviation\tcolor\tmapping\n3\tGray matter\tGM\t#ff53bb\t1\n");
    assert_eq!((bids.format, bids.table.ids()), (LabelTableFormat::Tsv, &[3][..]));
    assert_eq!(bytes(&bids.table), [Some([255, 83, 187])]);
    assert_eq!(bids.table.columns(), [column("mapping", &[1.0])]);

    let google = read(
        "info",
        r#"{"@type": "neuroglancer_segment_properties", "inline": {"ids": ["18446744073709551615", "3"], "properties": [
            {"id": "name", "type": "label", "values": ["far", "near"]}, {"id": "about", "type": "description", "values": ["", "x"]},
            {"id": "tags", "type": "tags", "tags": ["axon", "left"], "values": [[], [0, 1]]},
            {"id": "depth", "type": "number", "data_type": "float32", "values": [1.5, 2]}]}}"#,
    );
    assert_eq!(
        (google.table.ids(), google.table.types()),
        (&[3, u64::MAX][..], &["axon left".to_owned(), String::new()][..])
    );
    assert_eq!(google.table.columns(), [column("depth", &[2.0, 1.5])]);
    assert_eq!(google.notes, ["left out: the description about"]);
}

#[test]
fn delimiters_and_headers_are_found() {
    for (text, name, kind, color) in [
        ("id;name;type\n5;a,b;axon\n", "a,b", "axon", None),
        ("\u{FEFF}#ID, Name\r\n5, a \r\n", "a", "", None),
        ("label\tr\tg\tb\n5\t0\t0.5\t1\n", "", "", Some([0, 128, 255])),
        ("Label ,Red,Green,Blue\n5,0,1,2\n", "", "", Some([0, 1, 2])),
        ("index,label,colour\n5,a,8000FF\n", "a", "", Some([128, 0, 255])),
        ("5\n", "", "", None),
        ("5,a\n", "a", "", None),
        ("5,a,axon,#0a0b0c\n", "a", "axon", Some([10, 11, 12])),
        ("5,a,10,11,12,255\n", "a", "", Some([10, 11, 12])),
        ("id,name\n5,\"a\nb\"\n\n", "a\nb", "", None),
    ] {
        let read = read("t.txt", text);
        let got = (read.table.ids()[0], read.table.names()[0].as_str(), read.table.types()[0].as_str());
        assert_eq!((got, bytes(&read.table)[0]), ((5, name, kind), color), "{text:?}");
    }
}

#[test]
fn columns_that_are_no_numbers_are_left_out_by_name() {
    let read =
        read("t.csv", "id,seg,root,depth,,flag\n1,12,864691135494786390,1.5,,\n2,12b,1,,,\n3,x,2,-2e3,z,\n");
    assert_eq!(read.table.columns()[0], column("depth", &[1.5, f64::NAN, -2000.0]));
    assert_eq!(read.table.columns()[1], column("flag", &[f64::NAN; 3]));
    assert_eq!(
        read.notes,
        [
            "left out: the column seg, because line 3 has `12b`, which is no number",
            "left out: the column root, because line 2 has `864691135494786390`, which would be rounded (numbers are exact up to 2^53)",
            "left out: column 5, which has no name",
        ]
    );
}

#[test]
fn bad_tables_are_refused_with_line_and_column() {
    for (text, what) in [
        // Windows line breaks, an empty line, and a cell of two lines.
        ("id,name\r\n1,a\r\n\r\n2,\"b\r\nc\"\r\n-2,b\r\n", "line 6, column 1: expected an id"),
        ("id,name\n1,a\n-2,b\n", "line 3, column 1: expected an id, a whole number of 0 or more, got `-2`"),
        ("name,id\na,1.5\n", "line 2, column 2: expected an id, a whole number of 0 or more, got `1.5`"),
        ("id\n1\nnan\n", "line 3, column 1: expected an id, a whole number of 0 or more, got `nan`"),
        ("id\n18446744073709551616\n", "line 2, column 1: expected an id up to 18446744073709551615"),
        ("id,name\n,a\n", "line 2, column 1: expected an id, got an empty cell"),
        ("id,name\n7,a\n8,b\n7,c\n", "line 4, column 1: expected each id once, got 7 as in line 2"),
        ("id,name\n7,a\n8\n", "line 3, column 2: expected 2 fields as in the first line, got 1"),
        ("id,name\n7,a,b\n", "line 2, column 3: expected 2 fields as in the first line, got 3"),
        ("id,name\n7,\"a\n8,b\n", "line 2, column 2: expected a closing quote, got the end of the file"),
        (
            "id,depth\n7,1\n8,inf\n",
            "line 3, column 2: expected a finite number or an empty cell in depth, got `inf`",
        ),
        (
            "id,depth\n7,NaN\n",
            "line 2, column 2: expected a finite number or an empty cell in depth, got `NaN`",
        ),
        ("id,color\n7,#12345\n", "line 2, column 2: expected a colour #rrggbb, got `#12345`"),
        (
            "id,r,g,b\n7,1,2,256\n",
            "line 2, column 4: expected a colour from 0 to 1 or from 0 to 255, got `256`",
        ),
        ("id,r,g,b\n7,1,,3\n", "line 2, column 2: expected red, green and blue or none of them"),
        ("id,a,a\n7,1,2\n", "line 1, column 3: expected each column once, got `a` twice"),
        (
            "name,depth\na,1\n",
            "line 1, column 1: expected a column id, label or index in the header, got `name`, `depth`",
        ),
        ("7,a,1,2\n", "line 1, column 3: expected a header line that names the columns"),
        ("id,name\n", "expected a row a label behind the header, got none"),
        ("", "expected a table of labels, got an empty file"),
        ("# Color procedural file x\n0 0 0 0\n", "a continuous colour scale of 3D Slicer has no labels"),
        (
            "# Color table file\n1 a 1 2 3\n",
            "line 2, column 6: expected an id, a name, three colours and an opacity, got 5",
        ),
        (
            "# Color table file\n1 a 1 2 300 255\n",
            "line 2, column 5: expected a colour from 0 to 255, got 300",
        ),
        (
            "# Color table file\n1 a 1 2 3 255\n1 b 1 2 3 255\n",
            "line 3, column 1: expected each id once, got 1 as in line 2",
        ),
        ("1 a 1 2 3 0\n2 b c 1 2 3\n", "line 2, column 3: expected a colour from 0 to 255, got `c`"),
        (
            "1 a 1 2 3 0\n2 b 1 2\n",
            "line 2, column 5: expected an id, a name without spaces and three colours, got 4",
        ),
        (
            "1 255 0 0 1 1 1 \"a\"\n2 0 0 1 1 1 \"b\"\n",
            "line 2, column 7: expected 7 numbers before the name, got 6",
        ),
        (
            "1 255 0 0 1 1 1 \"a\"\n2 0 0 0 1 1 1 \"b\n",
            "line 2, column 8: expected a name in quotes, got `\"b`",
        ),
        ("{\"@type\": \"neuroglancer_segment_properties\", ", "line 1, column 45: JSON: EOF while parsing"),
        ("{\"@type\": \"x\"}", "@type: expected `neuroglancer_segment_properties`, got `x`"),
        ("{\"@type\": \"neuroglancer_segment_properties\"}", "inline: expected ids and properties, got none"),
    ] {
        let error = refused("t.txt", text);
        assert!(error.contains(what), "{text:?}\n  got {error}\n  not {what}");
    }
    let info = |ids: &str, property: &str| {
        format!(
            "{{\"@type\":\"neuroglancer_segment_properties\",\"inline\":{{\"ids\":{ids},\"properties\":[{property}]}}}}"
        )
    };
    for (text, what) in [
        (info("[\"1\",\"-1\"]", ""), "inline.ids[1]: expected an id"),
        (info("[\"1\",\"2\",\"1\"]", ""), "inline.ids[2]: expected each id once, got 1 as in ids[0]"),
        (info("[1]", ""), "JSON: invalid type: integer `1`, expected a string"),
        (
            info("[\"1\"]", r#"{"id":"a","type":"label","values":[]}"#),
            "inline.properties[0]: expected 1 values",
        ),
        (
            info("[\"1\"]", r#"{"id":"a","type":"label","values":[3]}"#),
            "expected a text for each id, as type label",
        ),
        (
            info("[\"1\",\"2\"]", r#"{"id":"a","type":"number","values":[3,null]}"#),
            "values[1]: expected a number, got `null`",
        ),
        (
            info("[\"1\"]", r#"{"id":"a","type":"tags","tags":["x"],"values":[[1]]}"#),
            "values[0]: expected places below 1 in tags, got 1",
        ),
        (
            info("[\"1\"]", r#"{"id":"a","type":"color","values":["x"]}"#),
            "type: expected label, description, string, tags or number",
        ),
    ] {
        let error = refused("info", &text);
        assert!(error.contains(what), "{text}\n  got {error}\n  not {what}");
    }
    let utf16: Vec<u8> = "\u{FEFF}id,name\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(refused("t.csv", utf16).contains("expected text in UTF-8, got UTF-16"));
    assert!(
        refused("t.csv", b"id,name\n1,a\n2,\xE4\n")
            .contains("line 3, column 3: expected text in UTF-8, got byte e4")
    );
    assert!(refused("t.csv", b"id\0\0\0\n").contains("got a binary file"));
    // What errors quote cannot break the line or steer a terminal.
    assert!(refused("t.csv", "id\n\u{1b}[2J\n").contains("got `\\u{1b}[2J`"));
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(
        read_label_table(Path::new("/dev/zero"))
            .unwrap_err()
            .to_string()
            .contains("expected an ordinary file, got a device")
    );
    let error = read_label_table(folder.path()).unwrap_err().to_string();
    assert!(error.contains("info"), "{error}");
    // A file of a terabyte, none of which is on disk.
    let path = folder.path().join("t.csv");
    fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    assert!(
        read_label_table(&path)
            .unwrap_err()
            .to_string()
            .contains("expected a file of at most 1073741824 bytes, got 1099511627776")
    );
    assert!(LabelTableFormat::of_file_name(Path::new("t.xls")).is_err());
}

#[test]
fn damaged_tables_never_panic() {
    /// SplitMix64 (Steele, Lea, Flood 2014): reproducible, without a dependency.
    struct Random(u64);
    impl Random {
        fn below(&mut self, n: usize) -> usize {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) % n as u64) as usize
        }
    }
    let (_folder, path) = file("t", "");
    let mut random = Random(1);
    let (mut refused, mut read) = (0, 0);
    for format in LabelTableFormat::ALL {
        write_label_table(&path, format, &plain()).unwrap();
        let whole = fs::read(&path).unwrap();
        for round in 0..100 {
            let mut damaged = whole.clone();
            if round % 3 == 0 {
                damaged.truncate(random.below(whole.len()));
            } else {
                for _ in 0..1 + random.below(3) {
                    let at = random.below(damaged.len());
                    damaged[at] =
                        [damaged[at] ^ 1 << random.below(8), b'"', b',', b'\n', 0xFF][random.below(5)];
                }
            }
            fs::write(&path, &damaged).unwrap();
            match read_label_table(&path) {
                Ok(_) => read += 1,
                Err(error) => {
                    assert!(!error.to_string().contains('\n'), "{error}");
                    refused += 1;
                }
            }
        }
    }
    // Both happen: a damaged name is a name, and a damaged id is mostly none.
    assert!(refused > 150 && read > 30, "{refused} refused, {read} read");
}

#[test]
fn a_colour_table_of_slicer_with_commas_is_read_by_its_content() {
    let rows = "LabelValue,Name,Color_R,Color_G,Color_B,Color_A\n1,liver left,221,130,101,255\n2,x,1,2,3,\n";
    let new = read("t.ctbl", rows);
    assert_eq!((new.table.ids(), new.format), (&[1, 2][..], LabelTableFormat::Csv));
    assert_eq!(new.table.names(), ["liver left", "x"]);
    assert_eq!(bytes(&new.table), [Some([221, 130, 101]), Some([1, 2, 3])]);
    assert_eq!((new.table.columns(), new.notes.len()), (&[][..], 1), "{:?}", new.notes);
    // Control: names of the older kind may have commas, and a line with too few fields is still one of that kind.
    assert_eq!(read("t.ctbl", "1 liver,left 221 130 101 255\n").format, LabelTableFormat::Slicer);
    assert!(refused("t.ctbl", "1 liver 221 130 101\n").contains("an opacity, got 5 fields"));
    // Beside a colour in one column, and without three of its own kind, such a column is one of numbers.
    assert_eq!(read("t.csv", "id,color,alpha\n1,#ff0000,7\n").table.columns(), [column("alpha", &[7.0])]);
}
