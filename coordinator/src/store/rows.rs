//! Many rows with few statements, in words that every database of ours understands.

use std::fmt::Write as _;

use sqlx::{AnyConnection, AssertSqlSafe};

/// Rows per INSERT: enough to make the cost of a statement small, and fewer than 32,766 parameters,
/// SQLite's limit.
const ROWS_PER_INSERT: usize = 64;
/// The database that needs no numbers where values belong.
const SQLITE: &str = "SQLite";

/// A value of a row.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Int(Option<i64>),
    Real(Option<f64>),
    Text(Option<String>),
    Flag(bool),
}

impl Value {
    pub(super) fn int(value: i64) -> Self {
        Self::Int(Some(value))
    }

    pub(super) fn real(value: f64) -> Self {
        Self::Real(Some(value))
    }

    pub(super) fn text(value: &str) -> Self {
        Self::Text(Some(value.to_owned()))
    }

    pub(super) fn perhaps(value: Option<&str>) -> Self {
        Self::Text(value.map(str::to_owned))
    }
}

/// Writes rows; those that are there already stay as they are.
pub(super) async fn insert<T>(
    connection: &mut AnyConnection,
    into: &str,
    rows: &[T],
    values: impl Fn(&T) -> Vec<Value>,
) -> Result<(), sqlx::Error> {
    // SQLite takes a number for a name, and looks through all names for each: with a thousand of them
    // that takes longer than the writing.
    let numbered = connection.backend_name() != SQLITE;
    for chunk in rows.chunks(ROWS_PER_INSERT) {
        let chunk: Vec<Vec<Value>> = chunk.iter().map(&values).collect();
        let mut sql = format!("INSERT INTO {into} VALUES ");
        let mut number = 0;
        for (index, row) in chunk.iter().enumerate() {
            sql += if index == 0 { "(" } else { ", (" };
            for place in 0..row.len() {
                number += 1;
                sql += if place == 0 { "" } else { ", " };
                if numbered {
                    write!(sql, "${number}").expect("a text can be written to");
                } else {
                    sql.push('?');
                }
            }
            sql.push(')');
        }
        sql += " ON CONFLICT DO NOTHING";
        // Only whole chunks come again in the same words; the others are not worth keeping a prepared
        // statement for.
        let mut query = sqlx::query(AssertSqlSafe(sql)).persistent(chunk.len() == ROWS_PER_INSERT);
        for value in chunk.into_iter().flatten() {
            query = match value {
                Value::Int(value) => query.bind(value),
                Value::Real(value) => query.bind(value),
                Value::Text(value) => query.bind(value),
                Value::Flag(value) => query.bind(value),
            };
        }
        query.execute(&mut *connection).await?;
    }
    Ok(())
}
