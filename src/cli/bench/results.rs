//! Results as they come: standard output and the page after each row.

use super::{
    super::{
        messages,
        output::{Output, write_stdout},
    },
    cases::Case,
};
use crate::{
    bench::{self, Columns, Label},
    error::Result,
};
use serde_json::{Value, json};

/// What standard output gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table to read.
    Table,
    /// JSON with a line for each row.
    Json,
    /// Comma-separated values.
    Csv,
}

/// A run's results so far.
pub struct Results {
    format: Format,
    columns: Columns,
    report: Option<Output>,
    environment: Value,
    settings: Value,
    rows: Vec<Value>,
    skipped: Vec<Value>,
    finished: bool,
}

impl Results {
    /// Writes the text before the first row.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io), as of all that writes here.
    pub fn begin(
        format: Format,
        report: Option<Output>,
        environment: Value,
        settings: Value,
        cases: &[Case],
    ) -> Result<Self> {
        let name = |case: &Case| (case.label.name(), case.label.extent.to_string());
        let names: Vec<_> = cases.iter().map(name).collect();
        let names = names.iter().map(|(name, size)| (name.as_str(), size.as_str()));
        let (rows, skipped, finished) = (Vec::new(), Vec::new(), false);
        let columns = Columns::new(names);
        let results =
            Self { format, columns, report, environment, settings, rows, skipped, finished };
        results.write(&match format {
            Format::Table => results.columns.header(),
            Format::Json => bench::opening(&results.environment, &results.settings),
            Format::Csv => bench::csv_header(),
        })?;
        Ok(results)
    }

    /// A row was measured.
    ///
    /// # Errors
    /// See [`Results::begin`].
    pub fn row(&mut self, row: Value) -> Result<()> {
        self.write(&match self.format {
            Format::Table => self.columns.row(&row),
            Format::Json => bench::line(&row, self.rows.is_empty()),
            Format::Csv => bench::csv_line(&row),
        })?;
        self.rows.push(row);
        self.write_report()
    }

    /// A row cannot be measured.
    ///
    /// # Errors
    /// See [`Results::begin`].
    pub fn skip(&mut self, label: &Label, reason: &str) -> Result<()> {
        let (name, size) = (label.name(), label.extent.to_string());
        self.skipped.push(json!({ "name": name, "size": size, "reason": reason }));
        Ok(())
    }

    /// Writes the text behind the last row. Returns whether the pictures of any row differ.
    ///
    /// # Errors
    /// See [`Results::begin`].
    pub fn finish(&mut self) -> Result<bool> {
        self.finished = true;
        self.end()?;
        Ok(bench::any_invalid(&self.rows))
    }

    /// Writes the end of a run that was interrupted; says so in a sentence.
    ///
    /// # Errors
    /// See [`Results::begin`].
    pub fn interrupted(&mut self) -> Result<String> {
        // A signal that comes while the process ends finds nothing to do.
        if !self.finished {
            self.end()?;
        }
        Ok(format!(
            "interrupted: {} of {} rows were measured, and are written",
            self.rows.len(),
            self.settings["rows"]
        ))
    }

    fn end(&self) -> Result<()> {
        match self.format {
            Format::Table => self.write(&bench::footer(&self.document()))?,
            Format::Json => {
                self.write(&bench::closing(&self.rows, &self.skipped, self.finished))?;
            }
            Format::Csv => {}
        }
        self.write_report()
    }

    fn write(&self, text: &str) -> Result<()> {
        messages::around(|| write_stdout(text.as_bytes()))
    }

    fn write_report(&self) -> Result<()> {
        match &self.report {
            Some(report) => report.write(bench::report(&self.document()).as_bytes()),
            None => Ok(()),
        }
    }

    fn document(&self) -> Value {
        json!({
            "environment": self.environment,
            "settings": self.settings,
            "rows": self.rows,
            "skipped": self.skipped,
            "complete": self.finished,
        })
    }
}
