//! One page that shows it all: `report.html`, whole in one file, without network.
//!
//! The text, tables and charts are in the page as they are; scenes in three dimensions are drawn by `page/page.js` with three.js
//! (`vendor/`) from numbers in the page. Without WebGL the page says so and the rest stays.

use super::{
    compare_charts::ChartError,
    compare_files,
    figure::Figure,
    page_scene::{Scene, encoded},
    palette,
};
use crate::compare::{Comparison, Estimate, Finding};
use serde_json::{Value, json};
use std::{collections::BTreeMap, fmt::Write as _};

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");
const THREE: &str = include_str!("vendor/three.iife.min.js");

/// The file's name in its folder.
pub const PAGE_NAME: &str = "report.html";

/// A picture in the page.
#[derive(Clone, Debug)]
pub struct PagePhoto {
    /// What it shows.
    pub caption: String,
    /// A JPEG file.
    pub jpeg: Vec<u8>,
    /// Its width and height in pixels.
    pub size: [u32; 2],
}

/// What a page shows.
#[derive(Debug)]
pub struct Page<'a> {
    /// Its title.
    pub title: String,
    /// A line below it.
    pub subtitle: String,
    /// The comparison.
    pub comparison: &'a Comparison,
    /// Scenes to turn.
    pub scenes: Vec<Scene>,
    /// Photographs with what was read from them.
    pub photos: Vec<PagePhoto>,
    /// The unit of lengths in the scenes.
    pub unit: String,
    /// Settings and seeds.
    pub settings: Value,
}

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// A chart cannot be drawn.
    #[error(transparent)]
    Chart(#[from] ChartError),
    /// A table cannot be written.
    #[error("a table of the page cannot be written: {0}")]
    Table(#[from] std::io::Error),
    /// The data cannot be written.
    #[error("the page's data cannot be written: {0}")]
    Data(#[from] serde_json::Error),
}

impl Page<'_> {
    /// The page as HTML.
    ///
    /// # Errors
    /// [`PageError`] if a chart or a table cannot be made.
    pub fn html(&self) -> Result<String, PageError> {
        let charts = compare_files::charts(self.comparison)?;
        let tables = self.tables()?;
        let verdict = &self.comparison.verdict;
        let finding = match verdict.finding {
            Finding::Different => "different",
            Finding::NoDifference => "no-difference",
            Finding::TooFewCells => "too-few-cells",
        };
        let scenes: Vec<String> = self.scenes.iter().enumerate().map(|(i, s)| scene_html(i, s)).collect();
        let names: Vec<&String> = tables.keys().collect();
        let parts = [
            ("title", escaped(&self.title)),
            ("subtitle", escaped(&self.subtitle)),
            ("finding", finding.to_owned()),
            ("verdict", escaped(&verdict.sentence)),
            ("scenes", scenes.concat()),
            ("photos", self.photos_html()),
            ("table", self.table_html()),
            ("notes", self.notes_html()),
            ("charts", charts.iter().map(|(name, figure)| chart_html(name, figure)).collect()),
            (
                "downloads",
                names.iter().map(|name| format!(r##"<a href="#" data-table="{name}">{name}</a>"##)).collect(),
            ),
            ("settings", escaped(&serde_json::to_string_pretty(&self.settings)?)),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("css", STYLE.to_owned()),
            ("data", in_script(&serde_json::to_string(&self.data(&tables))?)),
            ("three", in_script(THREE)),
            ("js", in_script(SCRIPT)),
        ];
        Ok(filled(TEMPLATE, &parts))
    }

    /// The tables behind the plots, as CSV.
    fn tables(&self) -> Result<BTreeMap<String, String>, std::io::Error> {
        let tables = compare_files::tables(self.comparison);
        tables.iter().map(|(name, rows)| Ok(((*name).to_owned(), compare_files::csv_text(rows)?))).collect()
    }

    fn data(&self, tables: &BTreeMap<String, String>) -> Value {
        let side_colours: Vec<String> = (0..=9).map(|n| palette::of_sides(n).hex()).collect();
        let ramp: Vec<String> = (0..=10).map(|i| palette::viridis(f64::from(i) / 10.0).hex()).collect();
        json!({
            "unit": self.unit,
            "side_colours": side_colours,
            "ramp": ramp,
            "scenes": self.scenes.iter().map(Scene::data).collect::<Vec<_>>(),
            "tables": tables,
        })
    }

    fn photos_html(&self) -> String {
        if self.photos.is_empty() {
            return String::new();
        }
        let photo = |photo: &PagePhoto| {
            let caption = escaped(&photo.caption);
            format!(
                r#"<figure><img src="data:image/jpeg;base64,{}" width="{}" height="{}" alt="{caption}"><figcaption>{caption}</figcaption></figure>"#,
                encoded(&photo.jpeg),
                photo.size[0],
                photo.size[1]
            )
        };
        let photos: String = self.photos.iter().map(photo).collect();
        format!("<h2>Photographs and what was read from them</h2>\n<div class=\"photos\">{photos}</div>")
    }

    fn table_html(&self) -> String {
        let comparison = self.comparison;
        let mut rows = String::new();
        let mut row = |name: &str, cells: [String; 4]| {
            // Writing to a string does not fail.
            let _ = write!(rows, "<tr><th scope=\"row\">{name}</th>");
            for cell in cells {
                let _ = write!(rows, "<td>{cell}</td>");
            }
            let _ = writeln!(rows, "</tr>");
        };
        let count = |cells: usize| cells.to_string();
        row(
            "complete cells",
            [count(comparison.comb.cells), count(comparison.foam.cells), String::new(), String::new()],
        );
        for class in &comparison.sides.classes {
            let name = format!("{} sides, %", class.sides);
            let [comb, foam] = class.share.map(|share| shown(&share, 100.0, 1));
            row(&name, [comb, foam, shown(&class.difference, 100.0, 1), String::new()]);
        }
        for test in &comparison.figures {
            let [comb, foam] = test.value.map(|value| shown(&value, 1.0, 3));
            let p = format!("{:.4}", test.p_holm);
            row(test.figure.label(), [comb, foam, shown(&test.difference, 1.0, 3), p]);
        }
        format!(
            "<table><thead><tr><th></th><th>comb</th><th>foam</th><th>difference</th><th>p (Holm)</th></tr></thead>\
             <tbody>{rows}</tbody></table>"
        )
    }

    fn notes_html(&self) -> String {
        let left =
            self.comparison.left_out.iter().map(|left| format!("Left out: {}: {}.", left.what, left.why));
        let notes = self.comparison.notes.iter().map(|note| format!("{note}."));
        let first = "In brackets: 95 % intervals from resampled patches.".to_owned();
        std::iter::once(first)
            .chain(left)
            .chain(notes)
            .map(|text| format!("<p class=\"note\">{}</p>", escaped(&text)))
            .collect()
    }
}

fn shown(estimate: &Estimate, scale: f64, digits: usize) -> String {
    let minus = |text: String| text.replace('-', "−");
    let value = minus(format!("{:.digits$}", estimate.value * scale));
    match estimate.interval {
        Some([low, high]) => {
            let ends = format!("{:.digits$}, {:.digits$}", low * scale, high * scale);
            format!("{value} [{}]", minus(ends))
        }
        None => value,
    }
}

/// A chart as it is, with a label for those who do not see it.
fn chart_html(name: &str, figure: &Figure) -> String {
    let svg = figure.svg().replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{name}\" "), 1);
    format!("<figure>{svg}</figure>")
}

fn scene_html(index: usize, scene: &Scene) -> String {
    let mut controls = String::new();
    for layer in &scene.layers {
        let name = escaped(&layer.name);
        let checked = if layer.shown { " checked" } else { "" };
        // Writing to a string does not fail.
        let _ =
            write!(controls, r#"<label><input type="checkbox" data-show="{name}"{checked}> {name}</label>"#);
        if !layer.pairs.is_empty() {
            let _ = write!(
                controls,
                r#"<label><input type="checkbox" data-show="{name} pairs" checked> 5–7 pairs</label>"#
            );
        }
        if let Some(cells) = &layer.cells {
            let options: String =
                cells.figures.keys().map(|key| format!("<option value=\"{key}\">{key}</option>")).collect();
            let _ = write!(
                controls,
                r#"<label>colour by <select data-colour="{name}"><option value="sides">sides</option>{options}</select></label>"#
            );
        }
    }
    let has_cells = scene.layers.iter().any(|layer| layer.cells.is_some());
    let legend = if has_cells { r#"<div class="legend" aria-live="polite"></div>"# } else { "" };
    // Scenes of cells stand side by side, to be compared.
    let wide = if has_cells { "" } else { " wide" };
    format!(
        r#"<figure class="scene{wide}" data-scene="{index}"><canvas tabindex="0" role="img" aria-label="{0}"></canvas>{legend}<div class="controls">{controls}<button type="button" data-turn="0.4" aria-label="turn left">⟲</button><button type="button" data-turn="-0.4" aria-label="turn right">⟳</button><button type="button" data-look="top">from above</button><button type="button" data-look="home">reset</button></div><figcaption>{0}</figcaption></figure>"#,
        escaped(&scene.caption)
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Text that stands in a script: it must not seem to end it.
fn in_script(text: &str) -> String {
    text.replace("</", "<\\/")
}

/// The template with every `{{name}}` replaced; what is put in is not looked at again.
fn filled(template: &str, parts: &[(&str, String)]) -> String {
    let mut html = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        html.push_str(before);
        let Some((name, after)) = after.split_once("}}") else { break };
        let part = parts.iter().find(|(known, _)| *known == name);
        html.push_str(part.map_or("", |(_, text)| text));
        rest = after;
    }
    html.push_str(rest);
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_the_template_has_its_place_and_scripts_stay_whole() {
        let parts = [("a", "1 {{b}}".to_owned()), ("b", "2".to_owned())];
        assert_eq!(filled("x{{a}}y{{b}}z", &parts), "x1 {{b}}y2z");
        assert_eq!(in_script("a</script>b"), "a<\\/script>b");
        assert_eq!(escaped("<a & \"b\">"), "&lt;a &amp; &quot;b&quot;&gt;");
        assert!(!THREE.contains("</script"));
    }
}
