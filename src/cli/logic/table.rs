//! Tables of inputs and outputs over time.
//!
//! In:  CSV with `t_ms` and inputs. Out: CSV with `t_ms`, outputs and what is watched, a row for each scan.

use logic::{Logic, Role, Runtime, Value, Variable, duration};
use std::io::{self, Write};

/// Values of inputs over time.
pub(super) struct Table<'t> {
    inputs: Vec<Variable>,
    rows: Vec<(i64, Vec<Option<Value<'t>>>)>,
}

impl<'t> Table<'t> {
    /// Reads a table whose columns are inputs of the program; what is wrong with it begins with its line.
    pub(super) fn read(text: &'t str, logic: &Logic) -> Result<Table<'t>, String> {
        let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
        let mut lines = lines.filter(|(_, line)| !line.is_empty());
        let Some((number, header)) = lines.next() else {
            return Err("1: t_ms and names of inputs are missing".into());
        };
        let mut names = fields(header);
        if names.first().is_none_or(|name| !name.eq_ignore_ascii_case("t_ms")) {
            return Err(format!("{number}: the first column is t_ms"));
        }
        names.remove(0);
        let mut inputs: Vec<Variable> = Vec::new();
        for name in names {
            let known = || {
                logic
                    .inputs()
                    .map(|input| logic.name(input))
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            let is_at = |variable: &&Variable| {
                let address = variable.address.as_deref();
                address.is_some_and(|address| address.eq_ignore_ascii_case(name))
            };
            let named = logic.variable(name).filter(|variable| variable.role == Role::Input);
            let input = named.or_else(|| logic.inputs().find(is_at));
            let Some(input) = input else {
                return Err(format!("{number}: {name} is no input; inputs are {}", known()));
            };
            if inputs.contains(input) {
                return Err(format!("{number}: {name} has two columns"));
            }
            inputs.push(input.clone());
        }
        let mut rows: Vec<(i64, Vec<Option<Value<'t>>>)> = Vec::new();
        for (number, line) in lines {
            let fields = fields(line);
            if fields.len() != inputs.len() + 1 {
                let wanted = inputs.len() + 1;
                return Err(format!("{number}: {wanted} values are expected, not {}", fields.len()));
            }
            let time = duration::of_milliseconds(fields[0]).filter(|time| *time >= 0);
            let Some(time) = time else {
                return Err(format!("{number}: t_ms = {:?} is no time from 0 on", fields[0]));
            };
            if rows.last().is_some_and(|(before, _)| time < *before) {
                return Err(format!("{number}: t_ms = {} is before the row above", fields[0]));
            }
            let mut values = Vec::new();
            for (input, field) in inputs.iter().zip(&fields[1..]) {
                let value = Some(*field).filter(|field| !field.is_empty());
                let value = value.and_then(|field| logic.read(input, field));
                if value.is_none() && !field.is_empty() {
                    let (name, ty, form) = (&input.name, &input.ty, input.form());
                    return Err(format!("{number}: {name} = {field:?} is no {ty}{form}"));
                }
                values.push(value);
            }
            rows.push((time, values));
        }
        match rows.is_empty() {
            true => Err(format!("{number}: there is no row behind the header")),
            false => Ok(Table { inputs, rows }),
        }
    }
}

/// Values between commas; a name with a comma stands between quotes.
fn fields(line: &str) -> Vec<&str> {
    let mut fields = Vec::new();
    let (mut start, mut quoted) = (0, false);
    for (at, letter) in line.char_indices() {
        match letter {
            '"' => quoted = !quoted,
            ',' if !quoted => {
                fields.push(&line[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    fields.push(&line[start..]);
    fields.into_iter().map(|field| field.trim().trim_matches('"')).collect()
}

/// What is printed: all outputs, and what is watched. A structure, array or block has a column for each of its values.
pub(super) fn columns(logic: &Logic, watch: &[String]) -> Result<Vec<Variable>, String> {
    let mut columns: Vec<Variable> = logic.outputs().cloned().collect();
    for name in watch.iter().flat_map(|names| names_of(names)) {
        let found: Vec<Variable> = logic.variables_of(name).into_iter().cloned().collect();
        if found.is_empty() {
            return Err(format!("there is no variable {name} to watch"));
        }
        columns.extend(found);
    }
    Ok(columns)
}

/// Names between commas; those within brackets are indices: `g[1,2],n`.
fn names_of(names: &str) -> Vec<&str> {
    let mut depth = 0;
    let is_between = |letter: char| {
        match letter {
            '[' => depth += 1,
            ']' => depth -= 1,
            _ => {}
        }
        letter == ',' && depth == 0
    };
    names.split(is_between).map(str::trim).collect()
}

/// As a field of CSV.
fn field(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// Runs the program from 0 to the time of the last row, and writes a row behind each scan.
pub(super) fn print(
    table: &Table<'_>,
    columns: &[Variable],
    runtime: &mut Runtime,
    period_ns: i64,
    output: &mut impl Write,
) -> io::Result<()> {
    let names = columns
        .iter()
        .map(|variable| format!(",{}", field(&runtime.logic().name(variable))));
    writeln!(output, "t_ms{}", names.collect::<String>())?;
    let last = table.rows.last().map_or(0, |(time, _)| *time);
    let mut rows = table.rows.iter().peekable();
    let mut now_ns = 0;
    while now_ns <= last {
        while let Some((_, values)) = rows.next_if(|(time, _)| *time <= now_ns) {
            for (input, value) in table.inputs.iter().zip(values) {
                if let Some(value) = value {
                    runtime.set(input, *value);
                }
            }
        }
        runtime.scan(now_ns);
        write!(output, "{}", duration::milliseconds(now_ns))?;
        for variable in columns {
            write!(output, ",{}", field(&runtime.get(variable).to_string()))?;
        }
        writeln!(output)?;
        now_ns += period_ns;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    const TEXT: &str = "PROGRAM p
        VAR_INPUT go : BOOL; level : INT := 3; wait : TIME; END_VAR
        VAR_OUTPUT light : BOOL; rest : TIME; text : STRING; END_VAR
        VAR t : TON; l : ARRAY[1..2] OF INT; END_VAR
        t(IN := go, PT := wait); light := t.Q; rest := wait - t.ET; l[2] := level;
        text := SEL(light, 'off, dark', 'on');
        END_PROGRAM";

    fn shown(table: &str, period_ns: i64, watch: &[&str]) -> Result<String, String> {
        let logic = Arc::new(logic::compile(TEXT).unwrap());
        let watch: Vec<String> = watch.iter().map(|name| (*name).to_owned()).collect();
        let columns = columns(&logic, &watch)?;
        let table = Table::read(table, &logic)?;
        let mut output = Vec::new();
        print(&table, &columns, &mut Runtime::new(logic), period_ns, &mut output).unwrap();
        Ok(String::from_utf8(output).unwrap())
    }

    #[test]
    fn a_row_holds_from_its_time_on_and_every_scan_is_printed() {
        let inputs = "t_ms, GO, wait\n5,1,12.5\n\n25,,\n31,0,10\n";
        let wanted = "t_ms,light,rest,text,level,l[1],l[2]\n\
            0,0,0,\"off, dark\",3,0,3\n10,0,12.5,\"off, dark\",3,0,3\n20,0,2.5,\"off, dark\",3,0,3\n30,1,0,on,3,0,3\n";
        assert_eq!(shown(inputs, 10_000_000, &["level", "l"]).unwrap(), wanted);
        let by_quarters = shown("t_ms\n0.5\n", 250_000, &[]).unwrap();
        let times: Vec<&str> = by_quarters
            .lines()
            .map(|line| line.split(',').next().unwrap())
            .collect();
        assert_eq!(times, ["t_ms", "0", "0.25", "0.5"]);
    }

    #[test]
    fn columns_are_named_by_addresses_and_values_by_numbers_too() {
        let text = "TYPE colour : (red, green := 5); END_TYPE
            PROGRAM p VAR_INPUT c : colour; r : REAL; s : STRING := 'on'; END_VAR VAR key AT %IX0.1 : BOOL; t : STRING; END_VAR
            VAR_OUTPUT o : colour; k : BOOL; said : STRING; END_VAR VAR g : ARRAY[1..2, 1..2] OF INT; END_VAR
            o := c; k := key; g[1,2] := 7; said := s; t := 'off'; END_PROGRAM";
        let logic = Arc::new(logic::compile(text).unwrap());
        let columns = columns(&logic, &["g[1,2],r".to_owned()]).unwrap();
        let table = Table::read("t_ms,%ix0.1,c,r,s\n0,1,5,1.5,\n10,0,red,,off\n", &logic).unwrap();
        let mut output = Vec::new();
        print(
            &table,
            &columns,
            &mut Runtime::new(logic.clone()),
            10_000_000,
            &mut output,
        )
        .unwrap();
        let wanted = "t_ms,o,k,said,\"g[1,2]\",r\n0,green,1,on,7,1.5\n10,red,0,off,7,1.5\n";
        assert_eq!(String::from_utf8(output).unwrap(), wanted);
        let refused = Table::read("t_ms,r\n0,1e39\n", &logic).err().unwrap();
        assert_eq!(refused, "2: r = \"1e39\" is no REAL");
        let refused = Table::read("t_ms,c\n0,1\n", &logic).err().unwrap();
        assert_eq!(refused, "2: c = \"1\" is no colour");
    }

    #[test]
    fn what_is_wrong_with_a_table_is_told_with_its_line() {
        let cases = [
            ("", "1: t_ms and names of inputs are missing"),
            ("go\n1\n", "1: the first column is t_ms"),
            ("t_ms,light\n0,1\n", "1: light is no input; inputs are go, level, wait"),
            ("t_ms,go,go\n0,1,1\n", "1: go has two columns"),
            ("t_ms,go\n", "1: there is no row behind the header"),
            ("t_ms,go\n0\n", "2: 2 values are expected, not 1"),
            ("t_ms,go\n-1,0\n", "2: t_ms = \"-1\" is no time from 0 on"),
            ("t_ms,go\n10,0\n5,1\n", "3: t_ms = 5 is before the row above"),
            ("t_ms,go\n0,yes\n", "2: go = \"yes\" is no BOOL: TRUE or FALSE"),
            ("t_ms,level\n0,40000\n", "2: level = \"40000\" is no INT"),
            (
                "t_ms,wait\n0,1s\n",
                "2: wait = \"1s\" is no TIME: T#1s500ms, or milliseconds",
            ),
        ];
        for (table, rule) in cases {
            assert_eq!(shown(table, 10_000_000, &[]).unwrap_err(), rule, "{table}");
        }
        assert_eq!(
            shown("t_ms\n0\n", 10_000_000, &["lamp"]).unwrap_err(),
            "there is no variable lamp to watch"
        );
    }
}
