//! Results as one page that needs nothing else: no script, no network.
//!
//! It is made from the same JSON that `--json` prints, so that a page can show nothing that a program could
//! not read. Rows stand in the order in which they were measured, winning or losing; the bar of a ratio is
//! as long for one half as for two.

mod page;
mod plot;

use super::{
    rows::Means,
    statistics::FLOOR,
    table::{how, interval, number, remarks, text, unfinished},
};
use page::{Html, escape};
use serde_json::Value;

/// The page of `document`.
pub fn report(document: &Value) -> String {
    let rows = document["rows"].as_array().map_or(&[][..], Vec::as_slice);
    let mut html = Html::new("tilewright bench: compute against classic");
    summary(&mut html, document, rows);
    results(&mut html, rows);
    skipped(&mut html, &document["skipped"]);
    stages(&mut html, rows);
    crossover(&mut html, rows);
    cost(&mut html, rows);
    limits(&mut html, document, rows);
    environment(&mut html, &document["environment"]);
    method(&mut html, &document["settings"]);
    html.finish()
}

/// The class of a row's colour.
fn class(row: &Value) -> String {
    text(&row["verdict"]).to_lowercase()
}

fn label(row: &Value) -> String {
    format!("{}<small>{}</small>", escape(&text(&row["name"])), escape(&text(&row["size"])))
}

fn summary(html: &mut Html, document: &Value, rows: &[Value]) {
    let environment = &document["environment"];
    let device = &environment["device"];
    html.line(&format!(
        "<p class=lead>{} on {}, {} cores. {}{}</p>",
        escape(&text(&device["driver"])),
        escape(&processor(environment)),
        text(&environment["cores"]),
        environment["date"].as_str().map_or(String::new(), |date| format!("{}. ", escape(date))),
        environment["commit"]
            .as_str()
            .map_or(String::new(), |commit| format!("Commit {}.", escape(commit))),
    ));
    if document["complete"] == false {
        html.line(&format!("<p class=ambiguous>{}</p>", escape(&unfinished(document))));
    }
    html.line("<div class=tiles>");
    let means = Means::new(rows);
    if let Some(mean) = means.all {
        html.line(&format!(
            "<div class=tile><b>{mean:.2}</b>geometric mean of classic time / compute time</div>"
        ));
    }
    if let (Some(best), Some(mean)) = (means.best, means.without_best) {
        html.line(&format!(
            "<div class=tile><b>{mean:.2}</b>the same without the best scene, {}</div>",
            escape(&best)
        ));
    }
    for verdict in ["FASTER", "SAME", "AMBIGUOUS", "SLOWER", "BUSY", "INVALID"] {
        let count = rows.iter().filter(|row| row["verdict"] == verdict).count();
        if count > 0 || matches!(verdict, "FASTER" | "SLOWER") {
            html.line(&format!(
                "<div class='tile {}'><b>{count}</b>{verdict}</div>",
                verdict.to_lowercase()
            ));
        }
    }
    html.line("</div>");
}

/// The processor with what its name does not say.
fn processor(environment: &Value) -> String {
    let name = text(&environment["cpu"]);
    let part = |key: &str| environment["processor"][key].as_str();
    match (part("family"), part("model"), part("stepping")) {
        (Some(family), Some(model), Some(stepping)) => {
            format!("{name} (family {family}, model {model}, stepping {stepping})")
        }
        _ => name,
    }
}

fn results(html: &mut Html, rows: &[Value]) {
    html.section("Results", "Whole frames, in milliseconds. The bar is the ratio on a logarithmic scale: right of the middle compute is faster, left of it classic is. Winners are pixels that show another triangle; colour is the largest difference of a channel, of 255. The second line of a scene is a frame in which everything changes: compute prepares and executes it, classic uploads and records it anew.");
    html.line("<table><tr><th class=l>scene<th>triangles<th>compute ms<th>classic ms<th>ratio<th>95 % interval<th class=c>1/16 &middot; 1 &middot; 16<th>rounds<th>winners<th>colour<th class=l>verdict");
    for row in rows {
        let difference = &row["difference"];
        html.line(&format!(
            "<tr><td class=l>{}<td>{}{}<td>{}<td>{}{}",
            label(row),
            text(&row["counts"]["triangles"]),
            times(row),
            text(&difference["winner_differing"]),
            text(&difference["colour_max"]),
            verdict(row),
        ));
        if row["changing"].is_object() {
            let changing = &row["changing"];
            html.line(&format!(
                "<tr class=more><td class=l>everything changes<td>{}<td><td>{}",
                times(changing),
                verdict(changing),
            ));
        }
        for remark in remarks(row) {
            html.line(&format!(
                "<tr class=more><td class='l remark {}' colspan=11>{}",
                class(row),
                escape(&remark)
            ));
        }
    }
    html.line("</table>");
}

/// The cells from the times to the rounds.
fn times(row: &Value) -> String {
    format!(
        "<td>{}<td>{}<td><b>{}</b><td>{}<td>{}<td>{}",
        number(&row["compute"]["frame_ms"], 2),
        number(&row["classic"]["frame_ms"], 2),
        number(&row["ratio"], 2),
        interval(&row["ratio_interval"]),
        plot::ratio_bar(row["ratio"].as_f64(), &class(row)),
        text(&row["rounds"]),
    )
}

fn verdict(row: &Value) -> String {
    format!("<td class='l verdict {}'>{}", class(row), text(&row["verdict"]))
}

fn skipped(html: &mut Html, skipped: &Value) {
    for row in skipped.as_array().into_iter().flatten() {
        let reason = escape(&text(&row["reason"]));
        html.line(&format!("<p class=ambiguous>{}: not measured: {reason}</p>", label(row)));
    }
}

fn stages(html: &mut Html, rows: &[Value]) {
    html.section("Stages", "The upper bar is the frame of compute, the lower one that of classic: the times of the table above, on one scale in each row. Compute's frame is shared out among its stages and a remainder, which is submitting, waiting and the gaps between dispatches. Stages were timed in frames of their own, since timestamps cost barriers, and their times scaled to the measured frame. Classic's frame is shared out between the device's own time and the remainder.");
    html.line(&plot::stage_legend(rows));
    html.line("<table class=bars>");
    for row in rows {
        html.line(&format!("<tr><td class=l>{}<td class=wide>{}", label(row), plot::stages(row)));
    }
    html.line("</table>");
}

fn crossover(html: &mut Html, rows: &[Value]) {
    html.section("Crossover", "Where compute and classic change places, by the area of a triangle and the number of layers. From rows that vary the axis area. Where the whole picture would take more than four million triangles, the layers cover less of it.");
    let plots = plot::crossovers(rows);
    if plots.is_empty() {
        html.line("<p>No row of this run varies the area: <code>tilewright bench --report</code> without scenes does, as does <code>--axis area=…</code></p>");
    }
    plots.iter().for_each(|plot| html.line(plot));
}

fn cost(html: &mut Html, rows: &[Value]) {
    html.section("First frames, processor, memory", "The first frame with empty caches and that of a second run, all from the making of the renderer to its end; processor time of a warm frame, all threads together; the most memory the process ever held, scene included.");
    html.line("<table><tr><th class=l>scene<th colspan=2>first frame, ms<th colspan=2>second run, ms<th colspan=2>processor, ms<th colspan=2>memory, MiB<tr><th class=l>");
    html.line(&"<th>compute<th>classic".repeat(4));
    for row in rows {
        let mut cells = String::new();
        for key in ["first_frame_ms", "second_run_first_frame_ms", "cpu_ms"] {
            for side in ["compute", "classic"] {
                cells += &format!("<td>{}", number(&row[side][key], 1));
            }
        }
        for side in ["compute", "classic"] {
            let bytes = row[side]["peak_bytes"].as_u64();
            let mib = bytes.map_or("-".into(), |bytes| format!("{}", bytes >> 20));
            cells += &format!("<td>{mib}");
        }
        html.line(&format!("<tr><td class=l>{}{cells}", label(row)));
    }
    html.line("</table>");
}

fn limits(html: &mut Html, document: &Value, rows: &[Value]) {
    let rates = &document["environment"]["rates"];
    let copy = rates["copy_bytes_per_second"].as_f64();
    let atomics = rates["atomics_per_second"].as_f64();
    html.section("Limits", "How close each stage comes to the limits of the device: the time in which the device could copy and count the stage's least work, as part of the time that the stage takes. The least work is the data that goes in and out by the stage's contract. Stages whose work depends on the picture are left out. A stage can have more than 100 % if its data stayed in caches; the data of the measured copies does not.");
    html.line(&format!(
        "<p>Measured here: copying {} GB a second, reads and writes together; {} million scattered atomic additions a second.</p>",
        copy.map_or("-".into(), |rate| format!("{:.1}", rate / 1e9)),
        atomics.map_or("-".into(), |rate| format!("{:.0}", rate / 1e6)),
    ));
    let counted = |name: &String| {
        let stages = rows.iter().filter_map(|row| row["compute"]["stages"].as_array()).flatten();
        let mut of_it = stages.filter(|stage| stage["stage"] == name.as_str());
        of_it.any(|stage| stage["least_bytes"].is_number())
    };
    let names: Vec<_> = plot::stage_names(rows).into_iter().filter(counted).collect();
    html.line("<table><tr><th class=l>scene");
    names.iter().for_each(|name| html.line(&format!("<th>{}", escape(name))));
    for row in rows {
        html.line(&format!("<tr><td class=l>{}", label(row)));
        let stages = row["compute"]["stages"].as_array().map_or(&[][..], Vec::as_slice);
        for name in &names {
            let stage = stages.iter().find(|stage| stage["stage"] == name.as_str());
            let part = stage.and_then(|stage| {
                let bytes = stage["least_bytes"].as_f64()? / copy?;
                let counted = stage["least_atomics"].as_f64()? / atomics?;
                let ms = stage["timed_ms"].as_f64().filter(|ms| *ms > 0.0)?;
                Some((bytes + counted) * 1e3 / ms)
            });
            html.line(&part.map_or("<td>-".into(), |part| format!("<td>{:.0} %", part * 100.0)));
        }
    }
    html.line("</table>");
}

fn environment(html: &mut Html, environment: &Value) {
    html.section("Environment", "");
    html.line("<table class=plain>");
    let mut add = |key: &str, value: &Value| {
        html.line(&format!("<tr><th class=l>{}<td class=l>{}", escape(key), escape(&text(value))));
    };
    for (key, value) in environment.as_object().into_iter().flatten() {
        match value.as_object() {
            Some(inner) => inner.iter().for_each(|(k, v)| add(&format!("{key}: {k}"), v)),
            None => add(key, value),
        }
    }
    html.line("</table>");
}

fn method(html: &mut Html, settings: &Value) {
    html.section("How it was measured", "");
    if let Some(how) = how(settings) {
        html.line(&format!("<p>{}.</p>", escape(&how)));
    }
    html.line(&format!(
        "<p>Both executors draw the same pass on the same device. Their pictures are compared first, on \
         16-bit float targets, with the limits of <code>tilewright parity</code>. Then both draw in rounds, \
         a frame each, in one process, and take turns in who begins. A frame lasts from its submission until \
         it has ended. Bringing the picture to the host is part of neither. Intervals are \
         distribution-free, made of order statistics. FASTER and SLOWER mean that the whole interval of the \
         ratio is on one side of 1 and the ratio is off by more than {0} %, SAME that the interval is within \
         {0} % of 1, BUSY that the machine was not quiet meanwhile, INVALID that the pictures differ, \
         AMBIGUOUS anything else.</p>",
        FLOOR * 100.0
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn row(name: &str, area: Value, depth: u32, ratio: f64, verdict: &str) -> Value {
        json!({
            "name": name, "size": "64x48", "axes": { "area": area, "depth": depth },
            "images_equal": verdict != "INVALID", "verdict": verdict, "ratio": ratio,
            "ratio_interval": [ratio * 0.9, ratio * 1.1],
            "compute": { "frame_ms": 2.0, "remainder_ms": 0.5, "stages": [
                { "stage": "clear", "ms": 0.5, "timed_ms": 0.6, "least_bytes": 1000, "least_atomics": 0 },
                { "stage": "a<b", "ms": 1.0, "timed_ms": 1.2, "least_bytes": null, "least_atomics": null },
            ] },
            "classic": { "frame_ms": 2.0 * ratio, "device_ms": 1.9 * ratio }, "counts": { "triangles": 9 },
            "rounds": 21, "difference": { "winner_differing": 3, "colour_max": 1 },
            "changing": { "ratio": 0.5, "verdict": verdict, "compute": { "frame_ms": 5.5 } },
            "quiet": { "is_quiet": true, "reasons": [] },
        })
    }

    fn document() -> Value {
        json!({
            "environment": { "device": { "driver": "A & <B>" }, "cpu": "C", "cores": 2,
                "processor": { "family": "25", "model": "1", "stepping": "0" }, "commit": "abc",
                "rates": { "copy_bytes_per_second": 1e9, "atomics_per_second": 1e8 } },
            "rows": [
                row("x <script>", json!(1.0), 1, 2.0, "FASTER"),
                row("y", json!("full"), 1, 0.25, "SLOWER"),
                row("z", json!(4.0), 4, 1.0, "INVALID"),
            ],
            "skipped": [{ "name": "never", "size": "1x1", "reason": "no & time" }],
        })
    }

    #[test]
    fn a_page_is_whole_and_asks_for_nothing() {
        let page = report(&document());
        assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
        for outside in ["http:", "https:", "src=", "href=", "@import", "url(", "<script"] {
            assert!(!page.contains(outside), "{outside}");
        }
        for tag in ["svg", "table", "div", "section", "h2", "p", "g", "text", "small", "b"] {
            let opened = page.matches(&format!("<{tag}>")).count()
                + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
        assert!(page.contains("A &amp; &lt;B&gt;") && page.contains("a&lt;b"));
    }

    #[test]
    fn losing_and_invalid_rows_are_on_the_page() {
        let page = report(&document());
        for shown in [
            "SLOWER",
            "INVALID",
            "0.25",
            "the pictures differ",
            "no &amp; time",
            "everything changes",
            "5.50",
            "family 25, model 1, stepping 0",
            "Commit abc",
        ] {
            assert!(page.contains(shown), "{shown}");
        }
        // A row whose pictures differ is no part of the mean: the root of 2 times a quarter.
        assert!(page.contains("<b>0.71</b>geometric mean"));
        assert!(page.contains("<b>0.25</b>the same without the best scene, x &lt;script&gt;"));
    }

    #[test]
    fn a_bar_is_as_long_as_the_frame_it_stands_for() {
        let mut slower = row("y", json!(1.0), 1, 0.5, "SLOWER");
        // Stages that take little of the frame: the remainder fills the bar.
        slower["compute"] = json!({ "frame_ms": 2.0, "remainder_ms": 1.5, "stages": [
            { "stage": "clear", "ms": 0.5, "timed_ms": 0.4 } ] });
        let bars = plot::stages(&slower);
        let widths: Vec<f64> = bars
            .match_indices("width='")
            .filter_map(|(at, found)| bars[at + found.len()..].split('\'').next()?.parse().ok())
            .collect();
        // Compute: the stage and the remainder; classic: the device's time and the remainder.
        let [stage, rest, device, other] = widths[..] else { panic!("{widths:?}: {bars}") };
        assert!(((stage + rest) / (device + other) - 2.0).abs() < 0.01, "{widths:?}");
        assert!((rest / stage - 3.0).abs() < 0.01, "{widths:?}");
    }
}
