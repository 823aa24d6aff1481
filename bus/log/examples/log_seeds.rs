//! Writes the seeds of the fuzz targets into `tests/fuzz/seeds`: small logs of every kind.

use std::path::Path;

use elk_bus::{Type, Value};
use elk_log::alog::AlogWriter;
use elk_log::{Compression, LogOptions, LogWriter, Metadata, Record};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz/seeds");
    let (logs, alogs) = (seeds.join("log"), seeds.join("alog"));
    for folder in [&logs, &alogs] {
        let _ = std::fs::remove_dir_all(folder);
        std::fs::create_dir_all(folder)?;
    }
    for (name, compression) in [("none", Compression::None), ("lz4", Compression::Lz4), ("zstd", Compression::Zstd)] {
        let options = LogOptions { compression, ..LogOptions::default() };
        let metadata = Metadata { mission_name: "m.xml".into(), mission: "<Scenario/>".into(), ..Metadata::default() };
        let mut log = LogWriter::create_with(&logs.join(format!("{name}.mcap")), &metadata, options)?;
        for number in 0..6 {
            log.append(&record(number).as_ref())?;
        }
        log.note_dropped(2, 3.0)?;
        log.finish()?;
    }
    let mut alog = AlogWriter::create(&alogs.join("numbers.alog"), 0.0)?;
    for number in [0, 1, 3, 4] {
        alog.append(&record(number).as_ref())?;
    }
    alog.finish()?;
    Ok(())
}

fn record(number: u64) -> Record {
    Record {
        key: ["DEPTH", "NOTE", "BLOB"][number as usize % 3].into(),
        source: "app".into(),
        source_aux: "aux".into(),
        community: "lab".into(),
        time: number as f64,
        sequence: number,
        received: number as f64,
        order: number,
        epoch: 1,
        value: match number % 3 {
            0 => Value::Double(number as f64 / 7.0),
            1 => Value::Text("a \"text\"\nof two lines".into()),
            _ => Value::Binary { type_: Type::undescribed("Blob", 1), bytes: vec![7; 20] },
        },
    }
}
