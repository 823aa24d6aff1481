//! Pictures of an evaluation, as SVG: coverage over way, and ways in plan view.

use std::fmt::Write;

use elk_geometry::Voxel;
use elk_geometry::set::VoxelSet;

use crate::outcome::TracePoint;
use crate::table::escaped;

/// Colours that are told apart by whoever sees fewer of them, too (Okabe and Ito, 2008), and then again.
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"];
const STYLE: &str = "font-family=\"sans-serif\" font-size=\"13\"";
/// Size of a panel, and the margins around what is drawn in it (px).
const PANEL: [f64; 2] = [620.0, 340.0];
const MARGIN: [f64; 4] = [55.0, 40.0, 170.0, 45.0];

/// The colour of a strategy.
fn colour(strategy: usize) -> &'static str {
    COLOURS[strategy % COLOURS.len()]
}

/// A curve of coverage over way, from each start.
pub type Curves = Vec<Vec<TracePoint>>;

/// Coverage over way, a panel a world, a curve a strategy: the mean of its runs, each of which stays where it ended.
pub fn curves(worlds: &[(String, Vec<Curves>)], strategies: &[String]) -> String {
    let [width, height] = PANEL;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{}\" {STYLE}>\n<rect width=\"100%\" \
         height=\"100%\" fill=\"white\"/>\n",
        height * worlds.len() as f64
    );
    for (place, (name, runs)) in worlds.iter().enumerate() {
        let _ = write!(
            svg,
            "<g transform=\"translate(0 {})\">\n{}</g>\n",
            height * place as f64,
            panel(name, runs, strategies)
        );
    }
    svg + "</svg>\n"
}

fn panel(name: &str, runs: &[Curves], strategies: &[String]) -> String {
    let [left, top, right, bottom] = MARGIN;
    let [width, height] = [PANEL[0] - left - right, PANEL[1] - top - bottom];
    let ends = runs.iter().flatten().filter_map(|trace| trace.last()).map(|point| point.mark.way_m);
    let longest = ends.fold(1.0, f64::max);
    let x = |way_m: f64| left + width * way_m / longest;
    let y = |share: f64| top + height * (1.0 - share);
    let mut svg = format!("<text x=\"{left}\" y=\"24\" font-weight=\"bold\">{}</text>\n", escaped(name));
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let (at, percent) = (y(share), 100.0 * share);
        let _ = writeln!(svg, "<line x1=\"{left}\" x2=\"{}\" y1=\"{at}\" y2=\"{at}\" stroke=\"#ddd\"/>", left + width);
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{percent} %</text>", left - 6.0, at + 4.0);
    }
    let step = tick(longest);
    for way_m in (0..).map(|n| f64::from(n) * step).take_while(|way_m| *way_m <= longest) {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{way_m} m</text>",
            x(way_m),
            top + height + 18.0
        );
    }
    for (strategy, traces) in runs.iter().enumerate() {
        let points: String = mean_curve(traces, longest)
            .into_iter()
            .map(|(way_m, share)| format!("{:.1},{:.1} ", x(way_m), y(share)))
            .collect();
        let (colour, at) = (colour(strategy), top + 12.0 + 18.0 * strategy as f64);
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            points.trim()
        );
        svg += &legend(left + width + 14.0, at, colour, &format!("{} ({})", strategies[strategy], traces.len()));
    }
    svg
}

fn legend(x: f64, y: f64, colour: &str, words: &str) -> String {
    format!(
        "<line x1=\"{x}\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\" stroke=\"{colour}\" stroke-width=\"3\"/>\n<text x=\"{}\" \
         y=\"{}\">{}</text>\n",
        x + 16.0,
        x + 22.0,
        y + 4.0,
        escaped(words)
    )
}

/// A round step of an axis.
fn tick(longest: f64) -> f64 {
    let decade = 10_f64.powf((longest / 5.0).log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * decade)
        .into_iter()
        .find(|step| longest / step <= 6.0)
        .unwrap_or(longest)
}

/// The mean of curves at ways from 0 to `longest` (m).
fn mean_curve(traces: &Curves, longest: f64) -> Vec<(f64, f64)> {
    const POINTS: usize = 200;
    if traces.is_empty() {
        return Vec::new();
    }
    let ways = (0..=POINTS).map(|n| longest * n as f64 / POINTS as f64);
    let mean = |way_m: f64| traces.iter().map(|trace| share_at(trace, way_m)).sum::<f64>() / traces.len() as f64;
    ways.map(|way_m| (way_m, mean(way_m))).collect()
}

/// What is known after so much of the way.
fn share_at(trace: &[TracePoint], way_m: f64) -> f64 {
    let after = trace.partition_point(|point| point.mark.way_m <= way_m);
    trace.get(after.wrapping_sub(1)).or(trace.first()).map_or(0.0, |point| point.coverage)
}

/// Ways in plan view, each strategy's from the same start, before the surfaces at the height of that start.
pub fn ways(
    name: &str,
    surface: &VoxelSet,
    resolution: f64,
    ways: &[(usize, Vec<TracePoint>)],
    strategies: &[String],
) -> String {
    let Some([low, high]) = surface.corners() else { return String::new() };
    let level = ways.iter().find_map(|(_, way)| way.first()).map_or(0.0, |point| point.position.z);
    let level = (level / resolution).floor() as i32;
    let [low, high] = [low.to_array(), high.to_array()];
    let cell = 560.0 / f64::from((high[0] - low[0]).max(high[1] - low[1]) + 1);
    let [columns, rows] = [0, 1].map(|axis| f64::from(high[axis] - low[axis] + 1) * cell);
    let (left, top) = (10.0, 40.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" {STYLE}>\n<rect width=\"100%\" height=\"100%\" \
         fill=\"white\"/>\n<text x=\"{left}\" y=\"24\" font-weight=\"bold\">{}</text>\n<g fill=\"#bbb\">\n",
        left + columns + 190.0,
        top + rows.max(18.0 * ways.len() as f64) + 10.0,
        escaped(name)
    );
    for (x, y, length) in runs_of(surface, level, [low, high]) {
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{cell:.1}\"/>",
            left + f64::from(x - low[0]) * cell,
            top + f64::from(high[1] - y) * cell,
            f64::from(length) * cell
        );
    }
    svg += "</g>\n";
    let at = |point: &TracePoint| {
        let [x, y] = [point.position.x, point.position.y].map(|along| along / resolution);
        let [x, y] = [left + (x - f64::from(low[0])) * cell, top + (f64::from(high[1] + 1) - y) * cell];
        format!("{x:.1},{y:.1}")
    };
    for (line, (strategy, way)) in ways.iter().enumerate() {
        let points: Vec<String> = way.iter().map(at).collect();
        let colour = colour(*strategy);
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\" stroke-opacity=\"0.8\"/>",
            points.join(" ")
        );
        let length = way.last().map_or(0.0, |point| point.mark.way_m);
        let words = format!("{}: {length:.1} m", strategies[*strategy]);
        svg += &legend(left + columns + 14.0, top + 12.0 + 18.0 * line as f64, colour, &words);
    }
    svg + "</svg>\n"
}

/// The voxels of a level as rows along x: first x, y, and how many there are.
fn runs_of(surface: &VoxelSet, level: i32, [low, high]: [[i32; 3]; 2]) -> Vec<(i32, i32, i32)> {
    let mut runs: Vec<(i32, i32, i32)> = Vec::new();
    for y in low[1]..=high[1] {
        for x in (low[0]..=high[0]).filter(|x| surface.contains(Voxel::new(*x, y, level))) {
            match runs.last_mut().filter(|(first, row, length)| *row == y && first + *length == x) {
                Some((_, _, length)) => *length += 1,
                None => runs.push((x, y, 1)),
            }
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::outcome::Mark;

    fn trace(points: &[(f64, f64)]) -> Vec<TracePoint> {
        let point = |(way_m, coverage): &(f64, f64)| TracePoint {
            mark: Mark { way_m: *way_m, ..Mark::default() },
            coverage: *coverage,
            surface: 0.0,
            position: Point3::new(*way_m, 0.5, 0.05),
        };
        points.iter().map(point).collect()
    }

    #[test]
    fn a_mean_curve_stays_where_its_runs_ended() {
        let traces = vec![trace(&[(0.0, 0.5), (1.0, 1.0)]), trace(&[(0.0, 0.1), (4.0, 0.9)])];
        let mean = mean_curve(&traces, 4.0);
        assert_eq!((mean[0], mean[199].1, mean[200].1), ((0.0, 0.3), 0.55, 0.95));
        assert_eq!(share_at(&traces[0], 0.99), 0.5);
        assert_eq!(mean_curve(&Vec::new(), 4.0), []);
    }

    #[test]
    fn pictures_hold_each_strategy_by_name_and_nothing_from_outside() {
        let strategies = ["A & B".to_owned(), "C".to_owned()];
        let runs = vec![vec![trace(&[(0.0, 0.5), (3.0, 1.0)])], Vec::new()];
        let wall: VoxelSet = (0..20).map(|x| Voxel::new(x, 3, 0)).collect();
        let drawn = [
            curves(&[("hall".to_owned(), runs.clone())], &strategies),
            ways("hall", &wall, 0.1, &[(0, runs[0][0].clone()), (1, Vec::new())], &strategies),
        ];
        for svg in drawn {
            assert!(svg.contains("A &amp; B") && svg.contains(">C") && svg.contains("hall"), "{svg}");
            assert_eq!(svg.matches("http").count(), 1, "the name of the format alone");
            roxmltree::Document::parse(&svg).unwrap();
        }
        assert_eq!(runs_of(&wall, 0, [[0, 0, 0], [19, 5, 0]]), [(0, 3, 20)]);
        assert_eq!([4.0, 12.0, 400.0].map(tick), [1.0, 2.0, 100.0]);
    }
}
