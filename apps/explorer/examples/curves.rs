//! Two runs of a world drawn over their plans, one with isovolumes and one without: which share of the domain is sealed, and
//! how long the field takes. `cargo run -p elk-explorer --example curves ON OFF > curves.svg` of what
//! `cargo bench -p elk-explorer --bench missions -- WORLD Potential curves solver=multigrid [isovolumes=SHARE]` said.

use std::fmt::Write;

/// Of each plan the share of the blocks that is sealed, and what the field took (ms).
type Curve = Vec<(f64, f64)>;

/// Width and height of a panel, and the space around it.
const PANEL: (f64, f64) = (640.0, 160.0);
const MARGIN: f64 = 48.0;
const ON: &str = "#0b6e99";
const OFF: &str = "#b0641e";

fn read(path: &str) -> std::io::Result<Curve> {
    let numbers = |line: &str| {
        let (share, ms) = line.split_once(',')?;
        Some((share.parse().ok()?, ms.parse().ok()?))
    };
    Ok(std::fs::read_to_string(path)?.lines().filter_map(numbers).collect())
}

/// A panel whose left side begins `top` from above: a frame, what its values are, its largest value, and the lines.
fn panel(svg: &mut String, top: f64, title: &str, (plans, largest): (usize, f64), lines: [(&str, Vec<f64>); 2]) {
    let ((width, height), left) = (PANEL, MARGIN);
    let _ =
        writeln!(svg, r##"<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#999"/>"##);
    let _ = writeln!(svg, r#"<text x="{left}" y="{}">{title}</text>"#, top - 6.0);
    let _ = writeln!(svg, r#"<text x="{}" y="{}" text-anchor="end">{largest:.0}</text>"#, left - 4.0, top + 10.0);
    let _ = writeln!(svg, r#"<text x="{}" y="{}" text-anchor="end">0</text>"#, left - 4.0, top + height);
    for (colour, values) in lines {
        let place = |(n, value): (usize, &f64)| {
            let (x, y) = (n as f64 / plans.max(1) as f64, 1.0 - value / largest);
            format!("{:.1},{:.1}", left + width * x, top + height * y)
        };
        let points: Vec<String> = values.iter().enumerate().map(place).collect();
        let _ = writeln!(svg, r#"<polyline fill="none" stroke="{colour}" points="{}"/>"#, points.join(" "));
    }
}

fn draw(on: &Curve, off: &Curve) -> String {
    let plans = on.len().max(off.len());
    let (width, height) = (PANEL.0 + 2.0 * MARGIN, 2.0 * PANEL.1 + 3.0 * MARGIN);
    let mut svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" font-size="12">"#
    );
    let _ = writeln!(svg, r#"<rect width="{width}" height="{height}" fill="white"/>"#);
    let percent = |curve: &Curve| curve.iter().map(|(share, _)| 100.0 * share).collect();
    let ms = |curve: &Curve| curve.iter().map(|(_, ms)| *ms).collect::<Vec<f64>>();
    let slowest = ms(on).into_iter().chain(ms(off)).fold(1.0, f64::max);
    let title = format!(
        r#"sealed share of the blocks (%), by plan: isovolumes <tspan fill="{ON}">on</tspan>, <tspan fill="{OFF}">off</tspan>"#
    );
    panel(&mut svg, MARGIN, &title, (plans, 100.0), [(OFF, percent(off)), (ON, percent(on))]);
    let top = 2.0 * MARGIN + PANEL.1;
    panel(&mut svg, top, "the field (ms of CPU)", (plans, slowest), [(OFF, ms(off)), (ON, ms(on))]);
    svg + "</svg>\n"
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut paths = std::env::args().skip(1);
    let (Some(on), Some(off)) = (paths.next(), paths.next()) else {
        return Err("name two files: of a run with isovolumes, and of one without".into());
    };
    print!("{}", draw(&read(&on)?, &read(&off)?));
    Ok(())
}
