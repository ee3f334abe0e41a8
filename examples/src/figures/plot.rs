//! Line plots as SVG.

use core::fmt::Write;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 40.0;

/// Lines of at most as many points have a dot at each.
const MOST_DOTS: usize = 16;

/// Digits of powers.
const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// Colours of lines that also those tell apart who see few (Okabe and Ito 2008).
pub(super) const GREY: &str = "#bbbbbb";
pub(super) const BLACK: &str = "#000000";
pub(super) const BLUE: &str = "#0072b2";
pub(super) const PURPLE: &str = "#cc79a7";
pub(super) const ORANGE: &str = "#d55e00";
pub(super) const GREEN: &str = "#009e73";

/// A line.
pub(super) struct Line<'a> {
    pub(super) name: &'a str,
    pub(super) colour: &'a str,
    /// Stroke (pixels).
    pub(super) width: f64,
    /// What is not positive leaves a gap.
    pub(super) points: Vec<[f64; 2]>,
}

/// A plot with a logarithmic upward axis.
pub(super) struct Plot<'a> {
    pub(super) across: &'a str,
    pub(super) upwards: &'a str,
    pub(super) x: [f64; 2],
    pub(super) y: [f64; 2],
    pub(super) lines: Vec<Line<'a>>,
}

impl Plot<'_> {
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let across = (x - self.x[0]) / (self.x[1] - self.x[0]);
        let up = (y / self.y[0]).ln() / (self.y[1] / self.y[0]).ln();
        [LEFT + across * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM)]
    }

    /// The plot as a file's text.
    pub(super) fn svg(&self) -> String {
        let ticks = (0..=10).map(|k| self.x[0] + (self.x[1] - self.x[0]) * f64::from(k) / 10.0);
        self.drawn(ticks.map(|x| (x, ((x * 1e3).round() / 1e3).to_string())).collect())
    }

    /// The plot with a logarithmic axis across, too.
    pub(super) fn svg_over_decades(&self) -> String {
        let logarithms = |points: &[[f64; 2]]| points.iter().map(|[x, y]| [x.log10(), *y]).collect();
        let lines = self.lines.iter().map(|line| Line { points: logarithms(&line.points), ..*line }).collect();
        let x = self.x.map(f64::log10);
        let decades = (x[0].floor() as i32)..=(x[1].ceil() as i32);
        let is_short = x[1] - x[0] < 2.5;
        let steps: &[f64] = if is_short { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let inside = |tick: &f64| (x[0] - 1e-3..=x[1] + 1e-3).contains(tick);
        let powers = decades.flat_map(|power| steps.iter().map(move |step| (power, step)));
        let ticks = powers.map(|(power, step)| {
            if is_short {
                let value = step * 10_f64.powi(power);
                return (value.log10(), ((value * 1e6).round() / 1e6).to_string());
            }
            let digits = power.to_string().replace('-', "⁻");
            let raised = digits.chars().map(|c| c.to_digit(10).map_or(c, |d| SUPERSCRIPTS[d as usize]));
            (f64::from(power), format!("10{}", raised.collect::<String>()))
        });
        Plot { x, lines, ..*self }.drawn(ticks.filter(|(at, _)| inside(at)).collect())
    }

    fn drawn(&self, ticks: Vec<(f64, String)>) -> String {
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" \
             height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>\n"
        );
        self.grid(&mut svg, &ticks);
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        let (w, h) = (right - LEFT, bottom - TOP);
        // Writing to a string cannot fail.
        let _ = write!(
            svg,
            "<clipPath id=\"frame\"><rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{w}\" height=\"{h}\"/></clipPath>\n\
             <g fill=\"none\" stroke-linejoin=\"round\" clip-path=\"url(#frame)\">\n"
        );
        for line in &self.lines {
            let _ = writeln!(
                svg,
                "<path stroke=\"{}\" stroke-width=\"{}\" d=\"{}\"/>",
                line.colour,
                line.width,
                self.path(&line.points)
            );
            for point in line.points.iter().filter(|_| line.points.len() <= MOST_DOTS) {
                let [x, y] = self.place(*point);
                let _ = writeln!(
                    svg,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" stroke=\"none\" fill=\"{}\"/>",
                    line.colour
                );
            }
        }
        let _ = write!(
            svg,
            "</g>\n<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{w}\" height=\"{h}\" fill=\"none\" stroke=\"#444\"/>\n"
        );
        let mut x = LEFT;
        for line in &self.lines {
            let _ = writeln!(
                svg,
                "<path d=\"M{x} 13h20\" stroke=\"{}\" stroke-width=\"2\"/><text x=\"{}\" y=\"17\">{}</text>",
                line.colour,
                x + 25.0,
                line.name
            );
            x += 45.0 + 6.6 * line.name.chars().count() as f64;
        }
        let (middle, centre) = (0.5 * (LEFT + right), 0.5 * (TOP + bottom));
        let _ = write!(
            svg,
            "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(13 {centre}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n</svg>\n",
            HEIGHT - 6.0,
            self.across,
            self.upwards
        );
        svg
    }

    fn grid(&self, svg: &mut String, ticks: &[(f64, String)]) {
        let bottom = HEIGHT - BOTTOM;
        for (x, label) in ticks {
            let [at, _] = self.place([*x, self.y[0]]);
            let _ = writeln!(
                svg,
                "<path d=\"M{at:.1} {TOP}V{bottom}\" stroke=\"#ddd\"/>\
                 <text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
                bottom + 15.0
            );
        }
        let (first, last) = (self.y[0].log10().floor() as i32, self.y[1].log10().ceil() as i32);
        let mantissas: &[f64] = if last - first > 3 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let ticks = (first..=last).flat_map(|power| mantissas.iter().map(move |m| m * 10_f64.powi(power)));
        // A little room for rounding.
        for tick in ticks.filter(|t| (self.y[0] * 0.999..=self.y[1] * 1.001).contains(t)) {
            let [_, at] = self.place([self.x[0], tick]);
            let _ = writeln!(
                svg,
                "<path d=\"M{LEFT} {at:.1}H{}\" stroke=\"#ddd\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - RIGHT,
                LEFT - 5.0,
                at + 4.0,
                (tick * 1e6).round() / 1e6,
            );
        }
    }

    fn path(&self, points: &[[f64; 2]]) -> String {
        let mut path = String::new();
        let mut pen = 'M';
        for point in points {
            let [x, y] = self.place(*point);
            if point[1] > 0.0 && y.is_finite() {
                // Far outside the frame it does not matter how far.
                let _ = write!(path, "{pen}{x:.1} {:.1}", y.clamp(-1e4, 1e4));
                pen = 'L';
            } else {
                pen = 'M';
            }
        }
        path
    }
}
