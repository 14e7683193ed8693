//! The page around the results.

const STYLE: &str = "
:root { --ink: #1b1f24; --soft: #667; --paper: #fff; --line: #dde1e6; --good: #1a7f4b; --bad: #c2302e;
  --even: #6b7280; --unsure: #b07d00; --rest: #d4d8de; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e8eb; --soft: #9aa; --paper: #16191d; --line: #333a42; --good: #4cc38a; --bad: #ff7b72;
    --even: #9ca3af; --unsure: #e3b341; --rest: #4a525c; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 1240px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; } h2 { margin: 2.4rem 0 .2rem; font-size: 1.2rem; }
.lead, .about { color: var(--soft); margin-top: .2rem; max-width: 75ch; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; width: 100%; }
th, td { padding: .25rem .6rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; color: var(--soft); } .l { text-align: left; } .c { text-align: center; }
.plain td { white-space: normal; } .wide { width: 100%; padding-right: 0; }
small { color: var(--soft); margin-left: .6em; }
.tiles { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1rem 0; }
.tile { border: 1px solid var(--line); border-left: .4rem solid var(--even); border-radius: .3rem;
  padding: .5rem 1rem; max-width: 15rem; color: var(--soft); }
.tile b { display: block; font-size: 1.6rem; color: var(--ink); line-height: 1.2; }
.tile.faster { border-left-color: var(--good); } .tile.slower, .tile.invalid { border-left-color: var(--bad); }
.tile.ambiguous, .tile.busy { border-left-color: var(--unsure); }
.verdict { font-weight: 600; } .faster { color: var(--good); } .slower, .invalid { color: var(--bad); }
.same { color: var(--even); } .ambiguous, .busy { color: var(--unsure); }
svg { display: block; } svg text { fill: var(--soft); font: 12px system-ui, sans-serif; }
rect.faster { fill: var(--good); } rect.slower, rect.invalid { fill: var(--bad); }
rect.same { fill: var(--even); } rect.ambiguous, rect.busy { fill: var(--unsure); }
rect.rest { fill: var(--rest); } .more td { font-size: .9em; color: var(--soft); } .more td.l:first-child { padding-left: 1.6rem; }
.more td.remark { white-space: normal; color: var(--unsure); } .more td.remark.invalid { color: var(--bad); }
.axis { stroke: var(--line); } .one { stroke: var(--ink); stroke-dasharray: 4 3; }
.classic { fill: var(--even); } .key { display: inline-block; margin-right: 1.2rem; }
.key i { display: inline-block; width: .8rem; height: .8rem; margin-right: .4rem; vertical-align: -1px; }
";

/// A page that is being written.
pub struct Html {
    text: String,
    open: bool,
}

impl Html {
    pub fn new(title: &str) -> Self {
        let title = escape(title);
        let text = format!(
            "<!DOCTYPE html>\n<html lang=en>\n<meta charset=utf-8>\n<meta name=viewport \
             content='width=device-width'>\n<title>{title}</title>\n<style>{STYLE}</style>\n\
             <h1>{title}</h1>\n"
        );
        Self { text, open: false }
    }

    pub fn line(&mut self, text: &str) {
        self.text += text;
        self.text.push('\n');
    }

    /// Ends the section before and begins another.
    pub fn section(&mut self, title: &str, about: &str) {
        self.close();
        self.open = true;
        self.line(&format!("<section>\n<h2>{}</h2>", escape(title)));
        if !about.is_empty() {
            self.line(&format!("<p class=about>{}</p>", escape(about)));
        }
    }

    fn close(&mut self) {
        if std::mem::take(&mut self.open) {
            self.line("</section>");
        }
    }

    pub fn finish(mut self) -> String {
        self.close();
        self.line("</html>");
        self.text
    }
}

/// `text` as the content of an element or of an attribute.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}
