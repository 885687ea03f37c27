//! A table, printed two ways.

/// Named columns, rows of text.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Adds a row; the first one names the columns, and all rows have the same.
    pub(crate) fn push(&mut self, row: Vec<(&str, String)>) {
        let columns: Vec<String> = row.iter().map(|c| c.0.to_owned()).collect();
        if self.rows.is_empty() {
            self.columns = columns;
        } else {
            debug_assert_eq!(self.columns, columns);
        }
        self.rows.push(row.into_iter().map(|c| c.1).collect());
    }

    pub(crate) fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule: Vec<String> = self.columns.iter().map(|_| "---".to_owned()).collect();
        let rows: String = self.rows.iter().map(|r| line(r)).collect();
        line(&self.columns) + &line(&rule) + &rows
    }

    pub(crate) fn csv(&self) -> String {
        let cell = |c: &String| match c.contains([',', '"', '\n']) {
            true => format!("\"{}\"", c.replace('"', "\"\"")),
            false => c.clone(),
        };
        let line = |cells: &Vec<String>| cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\n";
        line(&self.columns) + &self.rows.iter().map(line).collect::<String>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways() {
        let mut table = Table::default();
        table.push(vec![("volume", "a, \"b\"".into()), ("MB", "1.5".into())]);
        assert_eq!(table.markdown(), "| volume | MB |\n| --- | --- |\n| a, \"b\" | 1.5 |\n");
        assert_eq!(table.csv(), "volume,MB\n\"a, \"\"b\"\"\",1.5\n");
    }
}
